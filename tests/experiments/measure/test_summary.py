import io
import math

import numpy as np
import pytest
from rich.console import Console
from steerclear.experiments.measure.summary import metrics_of, summarise
from steerclear.experiments.report.markdown import bars_table as bars_lines
from steerclear.experiments.report.parts import bars_table as bars_html
from steerclear.experiments.report.tables import bars_table, interval_text, measured_text, number_text, pairing_table


def row(game, shielded, **columns):
    base = {
        "pairing": "medium vs easy",
        "game": game,
        "shielded": shielded,
        "policy_failures": 0,
        "captures": 2,
        "captures_against": 1,
        "grabs": 3,
        "tags": 1,
        "tags_against": 0,
        "breaches_teammate_2.5m": 0,
        "breaches_teammate_4.0m": 1,
        "breaches_opponent_2.5m": 0,
        "breaches_opponent_4.0m": 0,
        "closest_m": 3.0,
        "covered_steps": 300 if shielded else 0,
        "changed_steps": 30 if shielded else 0,
        "mean_heading_change_deg": 12.0 if shielded else None,
        "mean_speed_change_mps": 0.25 if shielded else None,
        "decision_p50_us": 80.0 if shielded else None,
        "decision_p99_us": 200.0 if shielded else None,
        "reversals_per_boat_minute": 4.0,
        "deadlocks": 1 if shielded else 0,
        "primary": 0.5,
        "secondary": 2.0,
        "reason_PASSED": 270 if shielded else 0,
    }
    return {**base, **columns}


@pytest.fixture
def summary():
    off = [row(0, False, **{"breaches_opponent_2.5m": 4, "closest_m": 1.0}), row(1, False, closest_m=2.0)]
    on = [row(1, True, captures=3), row(0, True, closest_m=2.75)]
    return summarise(off + on, (2.5, 4.0))


def figure(summary, name, column):
    return summary["metrics"][name][column]


def test_counts_are_means_per_game_with_poisson_limits(summary):
    assert figure(summary, "breaches_opponent_2.5m", "off")["value"] == pytest.approx(2.0)
    on = figure(summary, "breaches_opponent_2.5m", "on")
    assert on["value"] == 0.0
    assert on["high"] == pytest.approx(-math.log(0.05) / 2)


def test_differences_are_paired_by_game_not_by_order(summary):
    assert figure(summary, "closest_m", "difference")["value"] == pytest.approx(((2.75 - 1.0) + (3.0 - 2.0)) / 2)
    assert figure(summary, "captures", "difference")["value"] == pytest.approx(0.5)


def test_what_describes_the_shield_has_no_figure_without_it(summary):
    assert "off" not in summary["metrics"]["changed_share"]
    assert figure(summary, "changed_share", "on")["value"] == pytest.approx(10.0)
    assert figure(summary, "mean_heading_change_deg", "on")["value"] == pytest.approx(12.0)
    assert summary["reasons"] == {"PASSED": 540}


def test_extremes_and_shares(summary):
    assert figure(summary, "closest_of_all_m", "off")["value"] == 1.0
    assert math.isnan(figure(summary, "closest_of_all_m", "off")["low"])
    assert figure(summary, "clean_games", "off")["value"] == pytest.approx(0.5)
    assert figure(summary, "clean_games", "on")["value"] == 1.0


def test_a_pairing_with_games_of_one_kind_only_has_no_difference():
    only_off = summarise([row(0, False), row(1, False)], (2.5, 4.0))
    assert only_off["games_on"] == 0
    assert all("difference" not in figures and "on" not in figures for figures in only_off["metrics"].values())


def test_missing_distances_are_left_out():
    alone = summarise([row(0, False, closest_m=None), row(0, True, closest_m=None)], (2.5, 4.0))
    assert math.isnan(figure(alone, "closest_m", "off")["value"])


def printed(table, width):
    stream = io.StringIO()
    Console(file=stream, width=width, no_color=True).print(table)
    return stream.getvalue()


@pytest.mark.parametrize("width", [80, 100])
def test_tables_fit_the_terminal_without_wrapping_or_cutting(width):
    rng = np.random.default_rng(0)
    names = ("primary", "secondary", "closest_m")
    games = [
        row(game, shielded, **{name: int(rng.integers(-300, 300)) / 100 for name in names})
        for game in range(20)
        for shielded in (False, True)
    ]
    text = printed(pairing_table(summarise(games, (2.5, 4.0))), width)
    lines = text.rstrip().splitlines()
    assert max(len(line) for line in lines) <= width
    assert "…" not in text
    assert len([line for line in lines if line.strip()]) == 3 + len(metrics_of((2.5, 4.0)))  # title, head, rule


def test_numbers_are_short_and_missing_ones_are_dashes():
    assert [number_text(x) for x in (0.0, 0.123, 9.996, 12.34, 123.4, -0.5, None, float("nan"), 250000.0)] == [
        "0.00", "0.12", "10.0", "12.3", "123", "-0.50", "-", "-", "250,000",
    ]  # fmt: skip
    assert interval_text(None) == interval_text({"value": None, "low": None, "high": None}) == "-"
    assert interval_text({"value": 1.0, "low": float("nan"), "high": 2.0}) == "1.00"
    assert interval_text({"value": 1.0, "low": 0.5, "high": 20.0}) == "1.00 [0.50, 20.0]"


def test_bars_say_whether_they_are_met():
    bars = [
        {"name": "hits", "value": 0.0, "sense": "<=", "limit": 0.0, "met": True},
        {"name": "steps", "value": 100.0, "sense": ">=", "limit": 250000.0, "met": False},
    ]
    text = printed(bars_table(bars), 80)
    lines = [line.split() for line in text.splitlines() if line.strip()]
    assert [line[-1] for line in lines if line[0] in ("hits", "steps")] == ["met", "met"]
    assert [line[-2] for line in lines if line[0] in ("hits", "steps")] == ["0.00", "not"]
    assert ">= 250,000" in text


def test_a_bar_just_missed_does_not_look_as_if_it_were_met():
    def text(value, limit):
        return measured_text({"value": value, "limit": limit})

    assert [text(1 / 300, 0.0), text(0.0, 0.0), text(0.9496, 0.95), text(250_000.4, 250_000.0), text(None, 0.0)] == [
        "0.0033", "0.00", "0.9496", "250000.4", "-",
    ]  # fmt: skip
    missed = {"name": "hits", "value": 1 / 300, "sense": "<=", "limit": 0.0, "met": False}
    assert "0.0033 <= 0.00 not met" in " ".join(printed(bars_table([missed]), 80).split())
    assert "| hits | 0.0033 | <= 0.00 | **not met** |" in bars_lines([missed])
    assert "0.0033 [0.00, 0.02]<" in bars_html([missed | {"low": 8e-5, "high": 0.0186}])


def test_a_long_name_of_a_bar_takes_nothing_from_its_figures():
    bar = {"name": "shield:certificate=value_table: " + "many words " * 6, "sense": "<=", "limit": 0.0}
    shown = printed(bars_table([bar | {"value": 1234.0, "met": met} for met in (False, None)]), 80)
    for words in ("measured", "1,234 <= 0.00 not met", "1,234 <= 0.00 no data"):
        assert words in shown
    assert shown.split().count("words") == 12


def test_a_column_that_rows_of_an_older_version_lack_counts_over_the_others():
    rows = [row(0, True), row(1, True)]
    del rows[1]["deadlocks"]
    assert summarise(rows, (2.5, 4.0))["metrics"]["deadlocks"]["on"]["value"] == pytest.approx(1.0)
    del rows[0]["deadlocks"]
    assert math.isnan(summarise(rows, (2.5, 4.0))["metrics"]["deadlocks"]["on"]["value"])
