"""Games off and on from the same seeds: what is played, how it is summed up, judged, kept and shown."""

import io
import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from json_keys import KEYS, undocumented
from rich.console import Console
from steerclear.experiments.ablation import (
    AblationSettings,
    failure_warnings,
    held_games,
    most_instructive,
    pairings_of,
    replay_of,
    results_of,
    spec_of,
    write_results,
)
from steerclear.experiments.docs import write_pages
from steerclear.experiments.markdown import goals_table as goals_lines
from steerclear.experiments.metrics import check, game_goals, game_metrics_of
from steerclear.experiments.play.spec import MatchSpec
from steerclear.experiments.report import goal_rows
from steerclear.experiments.runner import execute
from steerclear.experiments.tables import (
    covered_table,
    goals_table,
    interval_text,
    measured_text,
    number_text,
    pairing_table,
    verdict_of,
)
from steerclear.shield.exceptions import ConfigError

SETTINGS = AblationSettings(opponents=("easy", "hold"), games=2, rules={"max_time_s": 3.0})


@pytest.fixture(scope="module")
def played(tmp_path_factory):
    return execute(SETTINGS.experiment("ablate"), tmp_path_factory.mktemp("played"))


def test_every_pairing_is_played_off_and_on_from_the_same_seeds():
    specs = SETTINGS.specs()
    assert len(specs) == 8
    for off, on in zip(specs[::2], specs[1::2], strict=True):
        assert (off.shield, on.shield) == (None, {})
        assert (off.pairing, off.game, off.seed, off.side) == (on.pairing, on.game, on.seed, on.side)
    assert [spec.side for spec in specs] == ["blue"] * 4 + ["red"] * 4
    assert {spec.seed for spec in specs} == {0, 1}
    assert [MatchSpec.of_job(json.loads(json.dumps(spec.as_job()))) for spec in specs] == specs


THREE = AblationSettings(opponents=("easy",), games=1, rules={"max_time_s": 3.0}, shield_autopilot=False, covered=True)


def test_each_game_is_also_played_covering_boats_that_the_game_drives():
    off, on, covered = THREE.specs()
    assert (off.shield, on.shield, covered.shield) == (None, {}, {})
    assert [spec.covered for spec in (off, on, covered)] == [False, False, True]
    assert len({(spec.pairing, spec.game, spec.seed, spec.side) for spec in (off, on, covered)}) == 1
    assert [spec.covered for spec in replace(THREE, covered=False).specs()] == [False, False]
    with pytest.raises(ConfigError, match="give shield_autopilot=False with it"):
        replace(THREE, shield_autopilot=True)


def test_both_figures_are_in_results_tables_and_pages_and_goals_are_of_the_first(tmp_path):
    run = execute(THREE.experiment("ablate"), tmp_path)
    first, goals_before = THREE.off_and_on(run.table), results_of(run, THREE)["goals"]
    assert list(first["covered"]) == [False, False]
    run.__dict__.pop("table", None)
    run.rows = [
        {**row, "violations_opponent_2.5m": 7, "violations_teammate_2.5m": 9, "violations_driven_2.5m": 16}
        if row["covered"] else row for row in run.rows
    ]  # fmt: skip
    results = results_of(run, THREE)
    assert str(results["goals"]) == str(goals_before), "what is covered decides none"
    assert most_instructive(THREE.off_and_on(run.table), 2.5)[1]["covered"] is False
    (summary,) = results["pairings"]
    assert (summary["games_off"], summary["games_on"], summary["games_covered"]) == (1, 1, 1)
    hits = summary["metrics"]["violations_opponent_2.5m"]
    assert (hits["covered"]["value"], hits["on"]["value"]) == (7.0, first["violations_opponent_2.5m"].iloc[1])
    assert hits["difference_covered"]["value"] == 7.0 - hits["off"]["value"]
    assert sum(summary["reasons"].values()) == run.rows[1]["covered_steps"]
    assert summary["verdicts"]["covered"]["games"] == 1
    text = printed(covered_table(summary), 80)
    assert "covered - off, paired" in text
    assert "game-controlled 2.5 m" in text
    write_results(run, results)
    content = json.loads((run.folder / "results.json").read_text())
    assert undocumented(content, KEYS["ablate"]) == []
    report = (run.folder / "report.html").read_text()
    assert all(
        words in report for words in ("covered − off, paired", "shield on, left to the game", "shield on, covered")
    )
    (page,) = (path for path in write_pages([content], tmp_path / "docs") if path.name == "ablation_aamas2024.md")
    assert (
        "| shield off | on, left to the game | on - off, paired | on, covered | covered - off, paired |"
        in page.read_text()
    )


def hits(row, off, on):
    return {**row, "violations_opponent_2.5m": on if row["shielded"] else off}


def test_the_most_instructive_game_has_the_most_violations_without_shield(played):
    rows = [hits(row, 5 if row["opponent"] == "hold" else 1, 9) for row in played.rows]
    off, on = most_instructive(pd.DataFrame(rows), 2.5)
    assert (off["game"], off["opponent"], off["side"]) == (0, "hold", "blue"), "of those alike the one in blue"
    rows = [{**row, "side": "red"} for row in rows if (row["game"], row["opponent"]) != (0, "hold")]
    off, on = most_instructive(pd.DataFrame(rows), 2.5)
    assert (off["game"], off["opponent"], off["shielded"], on["shielded"]) == (1, "hold", False, True)
    assert spec_of(off, SETTINGS.specs()).shield is None
    assert most_instructive(pd.DataFrame([row for row in rows if row["shielded"]]), 2.5) is None


def goals(rows):
    return check(game_goals(2.5), pd.DataFrame(rows))


def test_goals_judge_pairs_of_all_pairings(played):
    rows = [{**hits(row, 10, 1), "captures": 4, "violations_teammate_2.5m": 0} for row in played.rows]
    found = goals(rows)
    assert [goal["met"] for goal in found] == [True, True, True, True, True]
    assert found[1]["value"] == pytest.approx(0.1)
    worse = [
        {**hits(row, 10, 2), "captures": 3 if row["shielded"] else 4, "violations_teammate_2.5m": 1} for row in rows
    ]
    assert [goal["met"] for goal in goals(worse)] == [False, False, False, True, True]
    assert goals(worse)[0]["value"] == 4
    stuck = [{**row, "deadlocks": 1 if row["shielded"] else 0} for row in rows]
    assert [goal["met"] for goal in goals(stuck)] == [True, True, True, False, True]
    judged = [{**row, "avoidable": 1 if row["shielded"] else None} for row in rows]
    assert [goal["met"] for goal in goals(judged)] == [True, True, True, True, False]
    unjudged = [{**row, "avoidable": None} for row in rows]
    assert len(goals(unjudged)) == 4
    assert goals([{**row, "captures": 0} for row in rows])[2]["met"] is None


def test_hits_of_boats_that_the_game_drives_stand_beside_the_goals_and_miss_none(played):
    """Nothing on board can prevent them: tagged boats and those out of bounds obey the game."""
    rows = [
        {
            **hits(row, 10, 3),
            "violations_teammate_2.5m": 2 if row["shielded"] else 0,
            "violations_driven_teammate_2.5m": 2 if row["shielded"] else 0,
            "violations_driven_opponent_2.5m": 2 if row["shielded"] else 0,
        }
        for row in played.rows
    ]
    mates, opponents = goals(rows)[:2]
    assert (mates["value"], mates["met"], mates["note"]) == (0.0, True, "beside 8 of boats that the game drives")
    assert (opponents["value"], opponents["met"]) == (pytest.approx(0.1), True)
    assert "of boats the team commands" in mates["name"]
    shown = " ".join(printed(goals_table([mates]), 100).split())
    assert "(beside 8 of boats that the game drives)" in shown
    assert "8 of boats that the game drives" in goals_lines([mates])[2]
    assert "8 of boats that the game drives" in goal_rows([mates])[0]["name"]
    judged = [{**row, "avoidable": 3 if row["shielded"] else None, "avoidable_driven": 3} for row in rows]
    (told,) = (goal for goal in goals(judged) if goal["name"].startswith("avoidable"))
    assert (told["value"], told["met"], told["note"]) == (0.0, True, "beside 12 of boats that the game drives")
    judged[1]["avoidable_driven"] = 2
    (told,) = (goal for goal in goals(judged) if goal["name"].startswith("avoidable"))
    assert (told["value"], told["met"]) == (0.25, False)
    one_more = [{**row, "violations_teammate_2.5m": row["violations_teammate_2.5m"] + row["shielded"]} for row in rows]
    assert (goals(one_more)[0]["value"], goals(one_more)[0]["met"]) == (4.0, False)
    assert not any("drives" in goal.get("note", "") for goal in goals(played.rows)), "none is driven in three seconds"


def test_a_goal_says_what_its_ratio_rests_on_and_whether_its_interval_tells(played):
    rows = [{**hits(row, 10, 3), "captures": 1 if row["game"] == 0 else 0} for row in played.rows]
    opponents, captures = goals(rows)[1:3]
    assert captures["note"] == "2 off, 2 on in 4 games each"
    assert opponents["note"] == "40 off, 12 on in 4 games each"
    few = {**captures, "value": 1.0, "low": 0.01, "high": 78.0, "met": True}
    assert "(2 off, 2 on in 4 games each) 1.00 [0.01, 78] >= 0.90 met (too few to tell)" in " ".join(
        printed(goals_table([few]), 100).split()
    )
    assert goals_lines([few])[2].endswith("| met (too few to tell) |")
    assert goal_rows([few])[0]["verdict"] == "met (too few to tell)"
    assert verdict_of({**few, "met": False, "low": 0.5}) == ("not met (too few to tell)", "yellow")
    assert verdict_of({**few, "low": 0.9}) == verdict_of({**few, "low": None}) == ("met", "green")
    assert verdict_of({**few, "met": None}) == ("no data", "yellow")


def test_results_are_written_whole_and_documented(played, tmp_path):
    results = results_of(played, SETTINGS)
    entry, records = replay_of(played.table, SETTINGS.specs(), 2.5, 1)
    results["replay"] = entry
    write_results(played, results, records)
    content = json.loads((played.folder / "results.json").read_text())
    assert undocumented(content, KEYS["ablate"]) == []
    assert (content["complete"], content["replay"]["same_as_played"]) == (True, True)
    assert content["settings"]["opponents"] == ["easy", "hold"]
    assert content["seeds"] == [0, 1]
    for name in content["files"].values():
        assert (played.folder / name).stat().st_size > 0
    assert [(s["pairing"], s["games_off"], s["games_on"]) for s in content["pairings"]] == [
        ("medium vs easy", 2, 2),
        ("medium vs hold", 2, 2),
    ]
    assert all("covered" not in figures for figures in content["pairings"][0]["metrics"].values())
    assert set(content["pairings"][0]["verdicts"]) == {"off", "on"}
    assert covered_table(content["pairings"][0]) is None
    (page,) = (path for path in write_pages([content], tmp_path) if path.name == "ablation_aamas2024.md")
    text = page.read_text()
    assert f"| tags | {interval_text(content['pairings'][0]['metrics']['tags']['off'])} |" in text
    assert "| hits with opponents at 2.5 m, of boats the team commands, on / off (" in text
    assert (tmp_path / "ablation_aamas2024.png").read_bytes()[1:4] == b"PNG"


def row(game, shielded, **columns):
    names = ("captures", "grabs", "tags", "violations_opponent_2.5m", "violations_opponent_4.0m", "tags_against")
    base = {
        "pairing": "medium vs easy", "game": game, "shielded": shielded, "policy_failures": 0,
        **dict.fromkeys(names, 0), "captures_against": 1, "net_captures": 1, "violations_teammate_2.5m": 0,
        "violations_teammate_4.0m": 1, "clean_games": True, "closest_m": 3.0, "collisions": 0,
        "covered_steps": 300 if shielded else 0, "changed_steps": 30 if shielded else 0,
        "mean_heading_change_deg": 12.0 if shielded else None, "mean_speed_change_mps": 0.25 if shielded else None,
        "decision_p50_us": 80.0 if shielded else None, "decision_p99_us": 200.0 if shielded else None,
        "violations_driven_2.5m": 0, "violations_driven_4.0m": 0,
        "reversals_per_boat_minute": 4.0, "deadlocks": 0, "primary": 0.5, "secondary": 2.0,
        "reason_PASSED": 270 if shielded else 0, "reason_QP_RELAXED": 0,
    }  # fmt: skip
    return {**base, **columns}


def summary_of(rows):
    return pairings_of(pd.DataFrame(rows), (2.5, 4.0))[0]


def printed(table, width):
    stream = io.StringIO()
    Console(file=stream, width=width, no_color=True).print(table)
    return stream.getvalue()


def test_tables_fit_the_terminal_without_wrapping_or_cutting():
    rng, names = np.random.default_rng(0), ("primary", "secondary", "closest_m")
    games = [
        row(game, shielded, **{name: int(rng.integers(-300, 300)) / 100 for name in names})
        for game in range(20)
        for shielded in (False, True)
    ]
    lines = printed(pairing_table(summary_of(games)), 80).rstrip().splitlines()
    assert max(len(line) for line in lines) <= 80
    assert not any("…" in line for line in lines)
    assert len([line for line in lines if line.strip()]) == 3 + len(game_metrics_of())  # title, head, rule


def test_numbers_are_short_and_missing_ones_are_dashes():
    assert [number_text(x) for x in (0.0, 0.123, 9.996, 12.34, 123.4, -0.5, None, float("nan"), 250000.0)] == [
        "0.00", "0.12", "10.0", "12.3", "123", "-0.50", "-", "-", "250,000",
    ]  # fmt: skip
    assert interval_text(None) == interval_text({"value": None, "low": None, "high": None}) == "-"
    assert interval_text({"value": 1.0, "low": float("nan"), "high": 2.0}) == "1.00"
    assert interval_text({"value": 1.0, "low": 0.5, "high": 20.0}) == "1.00 [0.50, 20.0]"


def test_a_goal_just_missed_does_not_look_as_if_it_were_met():
    def text(value, limit):
        return measured_text({"value": value, "limit": limit})

    assert [text(1 / 300, 0.0), text(0.0, 0.0), text(0.9496, 0.95), text(250_000.4, 250_000.0), text(None, 0.0)] == [
        "0.0033", "0.00", "0.9496", "250000.4", "-",
    ]  # fmt: skip
    missed = {"name": "hits", "value": 1 / 300, "sense": "<=", "limit": 0.0, "met": False, "low": 8e-5, "high": 0.0186}
    assert "0.0033 [0.00, 0.02] <= 0.00 not met" in " ".join(printed(goals_table([missed]), 80).split())
    assert "| hits | 0.0033 | <= 0.00 | **not met** |" in goals_lines([missed])
    assert goal_rows([missed])[0]["measured"] == "0.0033 [0.00, 0.02]"


def failing(own=0, other=0, text=None, usable=(7, 7), steps=10):
    counts = dict(zip(("policy_usable_steps", "opponent_policy_usable_steps"), usable, strict=True))
    failures = {"policy_failures": own, "opponent_policy_failures": other}
    return {"steps": steps, **failures, "first_failure": text, **counts}


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([failing(), failing(1200, 0, "own: 'a'")], "own policy failed 1,200 times, in 1 of 2 games"),
        ([failing(0, 3, "opponent: no"), failing(0, 4)], "opponents' policy failed 7 times, in 2 of 2 games"),
        ([failing(1, 0, "own: no")], "own policy failed 1 time, in 1 of 1 game"),
    ],
)
def test_failures_are_counted_and_the_first_is_quoted(rows, words):
    (text,) = failure_warnings(rows)
    assert words in text
    first = next(row["first_failure"] for row in rows if row["first_failure"])
    assert text.endswith(f"First failure: {first.partition(': ')[2]}")


def test_policies_that_did_not_play_are_named_and_others_not():
    held = [failing(30, 0, "own: raised", usable=(0, 7)), failing(9)]
    assert "the own policy gave no usable answer throughout 1 of 2 games" in held_games(held)[0]
    assert "(raised)" in held_games(held)[0]
    assert held_games([failing(29, 10, usable=(1, 10)), failing(usable=(0, 0), steps=0)]) == []
    assert failure_warnings([failing(), failing()]) == failure_warnings([]) == []
    own, opponents = failure_warnings([failing(2, 3, "own: lost")])
    assert own.endswith("First failure: lost")
    assert "lost" not in opponents
