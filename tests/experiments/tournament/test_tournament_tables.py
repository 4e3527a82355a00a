"""Standings, agreement, alpha-rank and prices against cases worked out by hand."""

import numpy as np
import pytest
from steerclear.experiments.tournament.agreement import agreement, rho, tau_b
from steerclear.experiments.tournament.paper import PAPER
from steerclear.experiments.tournament.price import keeps, prices
from steerclear.experiments.tournament.standings import Totals, column, score_of, standings
from steerclear.experiments.tournament.tables import _kept, agreement_tables
from steerclear.experiments.tournament.winning import alpha_rank, cycles, win_matrix

PLAIN = {"captures": 0, "grabs": 0, "tags": 0, "collisions": 0, "hits_teammate": 0, "hits_opponent": 0}


def game(blue, red, repetition=0, state="off", **changed):
    row = {"blue": blue, "red": red, "repetition": repetition, "state": state}
    for side in ("blue", "red"):
        row |= {f"{side}_{name}": value for name, value in PLAIN.items()}
        row |= {f"{side}_avoidable_teammate": None, f"{side}_avoidable_opponent": None}
    return row | changed


def test_a_double_round_robin_adds_up():
    rows = [
        game("a", "b", blue_captures=2, red_captures=1, red_collisions=4),
        game("b", "a", blue_captures=1, red_collisions=2),
    ]
    table = standings(Totals.of(rows, ["a", "b"]), 0.25, 0)
    assert [line["team"] for line in table] == ["a", "b"]
    by_name = {line["team"]: line for line in table}
    assert by_name["a"]["score"] == 2 - 1 - 1 - 0.25 * 2
    assert by_name["b"]["score"] == 1 + 1 - 2 - 0.25 * 4
    assert by_name["a"]["score_0.025"] == pytest.approx(-0.05)
    assert by_name["a"]["rank_free"] == by_name["b"]["rank_free"] == 1  # equal scores share the best rank
    assert table[0]["rank_low"] is None  # one repetition gives no interval


def test_repetitions_count_once_and_only_those_all_pairs_have():
    rows = [game(b, r, k, blue_captures=k) for b, r in (("a", "b"), ("b", "a")) for k in range(3)]
    totals = Totals.of([*rows, game("a", "b", 3, blue_captures=100)], ["a", "b"])
    assert totals.repetitions == 3
    np.testing.assert_allclose(totals.sums()[:, column("captures")], [1.0, 1.0])


def test_intervals_hold_within_a_stratum_only():
    """Strata that differ wildly but are constant inside have an interval without width."""
    rows = [game("a", "b", k, blue_captures=9) for k in range(4)] + [game("b", "a", k) for k in range(4)]
    line = next(line for line in standings(Totals.of(rows, ["a", "b"]), 0.25, 1) if line["team"] == "a")
    assert line["net_captures_low"] == line["net_captures_high"] == 9.0
    rows[0]["blue_captures"] = 1
    line = next(line for line in standings(Totals.of(rows, ["a", "b"]), 0.25, 1) if line["team"] == "a")
    assert line["net_captures_low"] < line["net_captures"] < line["net_captures_high"]


def test_the_papers_own_scores_agree_with_its_ranks():
    """Games in which every team makes the paper's net score against a stand-in that gives and takes nothing."""
    known = [row for row in PAPER if row.rank <= 4]
    rows = [
        game(row.entrant, "x", blue_collisions=row.collisions if row.entrant != "chao" else 27) for row in known
    ] + [game("x", row.entrant) for row in known]
    found = agreement(Totals.of(rows, [*(row.entrant for row in known), "x"]), 0.25, False, 0)
    assert found["kendall"]["value"] == found["spearman"]["value"] == pytest.approx(1.0)
    assert found["disagree"] == []


def test_pairs_the_other_way_round_are_named():
    rows = [
        game("lucas", "x", blue_collisions=9),
        game("ohto", "x", blue_collisions=1),
        game("meo", "x", blue_collisions=2),
    ]
    found = agreement(Totals.of(rows, ["lucas", "ohto", "meo", "x"]), 0.25, False, 0)
    assert found["disagree"] == ["ohto before lucas", "meo before lucas"]
    assert found["kendall"]["value"] == pytest.approx(-1 / 3)
    assert agreement(Totals.of(rows[:1], ["lucas", "x"]), 0.25, False, 0) is None  # one team of the paper


def test_the_scripted_are_compared_on_all_games_and_on_those_among_them():
    """Alamer loses to a learned team alone: among the scripted it stands where the paper has it."""
    rows = [game(a, b, k) for k in range(4) for a in ("lucas", "alamer", "meo", "jin") for b in ("x",)]
    rows += [game("lucas", "meo", k, red_collisions=3) for k in range(4)]
    rows += [game("lucas", "alamer", k, red_collisions=1) for k in range(4)]
    rows += [game("alamer", "jin", k, red_captures=2 + k % 2) for k in range(4)]
    found = agreement(Totals.of(rows, ["lucas", "alamer", "meo", "jin", "x"]), 0.25, False, 0)
    among, over_all = found["scripted"]["among"], found["scripted"]["all_games"]
    assert among["teams"] == over_all["teams"] == ["lucas", "alamer", "meo"]
    assert among["kendall"] == {"value": pytest.approx(1.0), "low": pytest.approx(1.0), "high": pytest.approx(1.0)}
    assert over_all["spearman"]["value"] == pytest.approx(0.5)
    assert (over_all["disagree"], over_all["sure"]) == (["meo before alamer"], [1.0])
    assert "jin" in found["teams"]
    state = {"state": "off", "table_3": found, "table_4": None}
    (_, _, rows), (_, heads, turned) = agreement_tables({"states": [state]})
    assert [row[1] for row in rows] == [
        "all 4",
        "the 3 scripted",
        "the 3 scripted, games among them",
    ]
    assert [row[-1] for row in rows] == [f"{len(found['disagree'])}", "1", "0"]
    assert heads == ["ours", "Table 3, no shields"]
    assert ["meo before alamer", "100 %"] in turned


def test_rank_measures_know_ties():
    assert tau_b(np.array([1, 2, 2, 4]), np.array([1, 2, 2, 4])) == pytest.approx(1.0)
    assert np.isnan(rho(np.ones(4), np.arange(4)))


def test_alpha_rank_shares_a_cycle_and_gives_all_to_who_beats_all():
    cycle = np.array([[np.nan, 1.0, 0.0], [0.0, np.nan, 1.0], [1.0, 0.0, np.nan]])
    np.testing.assert_allclose(alpha_rank(cycle, 1.0), 1 / 3, atol=1e-9)
    assert cycles(cycle, ["rock", "scissors", "paper"]) == ["rock beats scissors beats paper beats rock"]
    order = np.array([[np.nan, 1.0, 1.0], [0.0, np.nan, 1.0], [0.0, 0.0, np.nan]])
    assert alpha_rank(order, 10.0)[0] > 0.99
    assert cycles(order, ["a", "b", "c"]) == []
    np.testing.assert_allclose(alpha_rank(order, 0.0), 1 / 3, atol=1e-9)


def test_wins_count_draws_half_and_look_at_the_penalty():
    rows = [game("a", "b", blue_captures=1, blue_collisions=8), game("b", "a")]
    totals = Totals.of(rows, ["a", "b"])
    assert win_matrix(totals, 0.25)[0, 1] == 0.25  # one loss, one draw
    assert win_matrix(totals, 0.0)[0, 1] == 0.75
    assert np.isnan(win_matrix(totals, 0.0)[0, 0])


def test_prices_pair_games_of_the_same_seed():
    rows = [game("a", "b", k, "off", blue_captures=2, blue_hits_opponent=3) for k in range(3)]
    rows += [game("a", "b", k, "all", blue_captures=1, red_avoidable_teammate=0) for k in range(3)]
    line = prices(rows, ["a"], "off", "all", 0)[0]
    assert (line["games"], line["net_captures"]["value"], line["hits"]["value"]) == (3, -1.0, -3.0)
    assert line["captures_kept"]["value"] == 0.5
    assert line["kept"] is False
    assert line["avoidable"] is None  # nobody judged
    assert line["margin"]["value"] == pytest.approx(-0.9)  # of 2 it is to keep 1.9


@pytest.mark.parametrize(
    ("off", "on", "kept"), [(100, 95, True), (100, 94, False), (-100, -105, True), (-100, -106, False), (0, 0, True)]
)
def test_a_team_keeps_its_net_captures(off, on, kept):
    assert keeps(np.array([[off, on]])) is kept
    assert score_of(np.zeros(9), 0.25) == 0.0


def test_where_nobody_captures_nothing_is_kept():
    rows = [game("a", "b", 0, state) for state in ("off", "all")]
    line = prices(rows, ["a"], "off", "all", 0)[0]
    assert (line["kept"], _kept(line)) == (None, "-")


def test_a_loss_that_may_be_chance_is_called_unsure():
    rows = [game("a", "b", k, "off") for k in range(6)] + [
        game("a", "b", k, "all", red_captures=k % 2) for k in range(6)
    ]
    assert _kept(prices(rows, ["a"], "off", "all", 0)[0]) == "no"
    rows[6]["blue_captures"] = 3
    line = prices(rows, ["a"], "off", "all", 0)[0]
    assert (line["kept"], _kept(line)) == (True, "yes")
    rows[6]["blue_captures"] = 2
    rows[7]["red_captures"] = 2
    line = prices(rows, ["a"], "off", "all", 0)[0]
    assert (line["kept"], _kept(line)) == (False, "unsure")
