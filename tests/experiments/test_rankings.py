"""Standings and prices against cases worked out by hand."""

import numpy as np
import pytest
from steerclear.experiments.rankings import Totals, keeps, kept_words, prices, score_of, seats, standings

PLAIN = {"captures": 0, "grabs": 0, "tags": 0, "collisions": 0, "hits_teammate": 0, "hits_opponent": 0}


def game(blue, red, repetition=0, state="off", **changed):
    row = {"blue": blue, "red": red, "repetition": repetition, "state": state}
    for side in ("blue", "red"):
        row |= {f"{side}_{name}": value for name, value in PLAIN.items()}
        row |= {f"{side}_avoidable_teammate": None, f"{side}_avoidable_opponent": None}
    return row | changed


def table_of(rows, penalty=0.25, seed=0):
    lines = standings(Totals.of(seats(rows), ["a", "b"]), penalty, seed)
    return {line["team"]: line for line in lines}


def test_a_double_round_robin_adds_up():
    rows = [
        game("a", "b", blue_captures=2, red_captures=1, red_collisions=4),
        game("b", "a", blue_captures=1, red_collisions=2),
    ]
    table = table_of(rows)
    assert list(table) == ["a", "b"]
    assert table["a"]["score"] == 2 - 1 - 1 - 0.25 * 2
    assert table["b"]["score"] == 1 + 1 - 2 - 0.25 * 4
    assert table["a"]["rank_free"] == table["b"]["rank_free"] == 1  # equal scores share the best rank
    assert table["a"]["rank_low"] is None  # one repetition gives no interval


def test_intervals_hold_within_a_stratum_only():
    """Strata that differ wildly but are constant inside have an interval without width."""
    rows = [game("a", "b", k, blue_captures=9) for k in range(4)] + [game("b", "a", k) for k in range(4)]
    line = table_of(rows, seed=1)["a"]
    assert line["net_captures_low"] == line["net_captures_high"] == 9.0
    rows[0]["blue_captures"] = 1
    line = table_of(rows, seed=1)["a"]
    assert line["net_captures_low"] < line["net_captures"] < line["net_captures_high"]


def price(rows):
    return prices(seats(rows), ["a"], "off", "all", 0)[0]


def test_prices_pair_games_of_the_same_seed():
    rows = [game("a", "b", k, "off", blue_captures=2, blue_hits_opponent=3) for k in range(3)]
    line = price([*rows, *(game("a", "b", k, "all", blue_captures=1, red_avoidable_teammate=0) for k in range(3))])
    assert (line["games"], line["net_captures"]["value"], line["hits"]["value"]) == (3, -1.0, -3.0)
    assert (line["net_captures_off"], line["net_captures_on"], line["hits_off"], line["hits_on"]) == (
        2.0,
        1.0,
        3.0,
        0.0,
    )
    assert line["kept"] is False
    assert line["avoidable"] is None  # nobody judged
    assert line["margin"]["value"] == pytest.approx(-0.9)  # of 2 it is to keep 1.9
    judged = {"blue_avoidable_teammate": 0, "blue_avoidable_opponent": 1, "blue_hits_opponent": 2}
    line = price([*rows, *(game("a", "b", k, "all", **judged) for k in range(3))])
    assert (line["judged"], line["avoidable"]) == (3, 3)


@pytest.mark.parametrize(
    ("off", "on", "kept"), [(100, 95, True), (100, 94, False), (-100, -105, True), (-100, -106, False), (0, 0, True)]
)
def test_a_team_keeps_its_net_captures(off, on, kept):
    assert keeps(np.array([[off, on]])) is kept
    assert score_of(np.zeros(9), 0.25) == 0.0


def test_a_loss_that_may_be_chance_is_called_unsure():
    rows = [game("a", "b", k, "off") for k in range(6)]
    rows += [game("a", "b", k, "all", red_captures=k % 2) for k in range(6)]
    assert kept_words(price(rows)) == "no"
    rows[6]["blue_captures"] = 3
    assert (price(rows)["kept"], kept_words(price(rows))) == (True, "yes")
    rows[6]["blue_captures"] = 2
    rows[7]["red_captures"] = 2
    assert (price(rows)["kept"], kept_words(price(rows))) == (False, "unsure")
