import json
from dataclasses import replace

import numpy as np
import pytest
from json_keys import KEYS, undocumented
from steerclear.experiments.ablation import AblationSettings, results_of, write_results
from steerclear.experiments.docs import write_pages
from steerclear.experiments.oracle import Outcome, Verdict
from steerclear.experiments.play.match import play_match
from steerclear.experiments.play.spec import MatchSpec
from steerclear.experiments.runner import execute
from steerclear.experiments.verdicts import (
    NOT_JUDGED,
    StateLog,
    all_violations,
    helpless,
    judge_game,
    verdict_columns,
    verdict_rows,
)
from steerclear.shield.platforms import get_platform

RULES = {"max_time_s": 60.0}


def spec_of(**settings):
    return MatchSpec("aamas2024", "medium", "medium", **{"rules": RULES, "judge": "all", "seed": 1, **settings})


@pytest.fixture(scope="module")
def judged():
    """A game of wild boats without a shield, every violation judged."""
    return play_match(spec_of(radii_m=(2.5, 4.0)))


def test_every_violation_of_the_own_team_has_a_verdict(judged):
    row, record = judged.row, judged.record
    own = [violation for violation in record["violations"] if min(violation[1:3]) < 3]
    assert len(row["violations"]) == len(own) > 0
    for entry, violation in zip(row["violations"], own, strict=True):
        assert (entry["step"], entry["closest_m"]) == (violation[0], violation[3])
        assert entry["boats"] == [f"agent_{int(boat)}" for boat in violation[1:3]]
        assert entry["kind"] == ("teammate" if max(violation[1:3]) < 3 else "opponent")
        assert entry["verdict"] in ("avoidable", "unavoidable", "started_inside")
        assert (entry["last_preventable_s"] is None) == (entry["verdict"] != "avoidable")
        assert set(entry["responsible_boats"]) <= set(entry["boats"])
    assert undocumented(row, KEYS["rows of ablate"]) == []
    for kind in ("teammate", "opponent"):
        verdicts = ("avoidable", "unavoidable", "started_inside", NOT_JUDGED)
        assert sum(row[f"{verdict}_{kind}_2.5m"] for verdict in verdicts) == row[f"violations_{kind}_2.5m"]
    plain = play_match(spec_of(judge="none"))
    np.testing.assert_array_equal(plain.record["position"], record["position"], "judging changes nothing in the game")


@pytest.mark.parametrize(
    ("judge", "shield", "expected"),
    [("none", {}, None), ("shielded", None, None), ("shielded", {}, []), ("all", None, []), ("none", None, None)],
)
def test_whose_violations_are_judged(judge, shield, expected):
    row = play_match(spec_of(judge=judge, shield=shield, rules={"max_time_s": 1.0}, fixed_start=True)).row
    assert row["violations"] == expected
    assert row["avoidable_opponent_2.5m"] == (None if expected is None else 0)


class FakeCore:
    """One moment of a game."""

    def __init__(self, state, driven):
        self.state, self.driven, self.is_disabled = state[None], driven[None], np.zeros_like(driven)[None]


def head_on(game_meta, driven=False):
    """Boats 0 and 2 meet head-on at full speed; boats 1 and 3 lie far away."""
    state = np.zeros((4, 11))
    state[:, :2] = [[0, 0], [50, 50], [0, 30], [50, 90]]
    state[2, 2] = 180.0
    state[[0, 2], 3:5] = 2.0, 100.0
    log, position = StateLog(), []
    for k in range(90):
        moved = state.copy()
        moved[0, 1], moved[2, 1] = 0.2 * k, 30.0 - 0.2 * k
        core = FakeCore(moved, np.full(4, driven))
        log.step(core) if k else log.start(core)
        position.append(moved[:, :2])
    first = int(np.flatnonzero(np.abs(30.0 - 0.4 * np.arange(90)) <= 2.5)[0])
    meta = {**game_meta, "separation_m": 2.5, "team": [0, 0, 1, 1], "dt_s": 0.1}
    record = {"meta": np.array(json.dumps(meta)), "violations": np.array([[first, 0.0, 2.0, 0.0]])}
    return log, np.array([get_platform("heron").pack()] * 4), record


def test_a_made_up_meeting_is_judged_as_seen_by_the_team(game_meta):
    log, params, record = head_on(game_meta)
    entry = judge_game(log, params, record, side=0)[0]
    assert (entry["verdict"], entry["kind"], entry["responsible"]) == ("avoidable", "opponent", "both")
    assert entry["last_preventable_s"] == pytest.approx(entry["other_last_preventable_s"], abs=0.11)
    assert entry["responsible_boats"] == entry["boats"] == ["agent_0", "agent_2"]


def test_what_the_game_drove_is_the_games(game_meta):
    log, params, record = head_on(game_meta, driven=True)
    (entry,) = judge_game(log, params, record, side=1)
    assert (entry["responsible"], entry["driven"]) == ("game", True)
    assert judge_game(*head_on(game_meta), side=1)[0]["driven"] is False
    assert verdict_columns([{**entry, "verdict": "avoidable"}], 2.5)["avoidable_driven"] == 1


def test_beyond_the_most_violations_nothing_is_judged(game_meta, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.verdicts.MOST_JUDGED", 0)
    log, params, record = head_on(game_meta)
    entry = judge_game(log, params, record, side=0)[0]
    assert (entry["verdict"], entry["responsible"], entry["last_preventable_s"]) == (NOT_JUDGED, None, None)
    assert entry["closest_m"] == 0.0


@pytest.fixture(scope="module")
def stored(tmp_path_factory):
    """A small ablation."""
    settings = AblationSettings(opponents=("easy",), games=1, rules={"max_time_s": 3.0}, judge="all")
    folder = tmp_path_factory.mktemp("judged")
    return settings, execute(settings.experiment("ablate"), folder)


def with_verdicts(rows, count):
    """Give every game so many avoidable violations."""
    entry = {
        "kind": "opponent", "verdict": "avoidable", "responsible": "own",
        "step": 9, "time_s": 0.9, "boats": ["agent_0", "agent_3"], "radius_m": 2.5,
        "closest_m": 1.5, "last_preventable_s": 1.25, "other_last_preventable_s": None, "exhausted": True,
        "responsible_boats": ["agent_0"],
    }  # fmt: skip
    return [{**row, "violations": [entry] * count, "avoidable": count} for row in rows]


def test_verdicts_reach_results_tables_and_report(stored, tmp_path, monkeypatch):
    monkeypatch.setattr("steerclear.experiments.report.MOST_VIOLATIONS", 1)
    settings, played = stored
    run = replace(played, rows=with_verdicts(played.rows, 2), folder=tmp_path)
    write_results(run, results_of(run, settings))
    content = json.loads((tmp_path / "results.json").read_text())
    assert undocumented(content, KEYS["ablate"]) == []
    part = content["pairings"][0]["verdicts"]["on"]
    assert (part["games_judged"], part["opponent"]["avoidable"], part["teammate"]["avoidable"]) == (1, 2, 0)
    assert part["opponent"]["responsible"]["own"] == 2
    assert len(content["violations"]) == 4
    assert [goal["met"] for goal in content["goals"] if "avoidable" in goal["name"]] == [False]
    page = (tmp_path / "report.html").read_text()
    assert "agent_0, agent_3" in page
    assert "own (agent_0)" in page
    assert "3 more in results.json" in page
    write_pages([content], tmp_path / "docs")
    text = (tmp_path / "docs/ablation_aamas2024.md").read_text()
    driven = sum(
        bool(one.get("driven")) for one in content["violations"] if (one["state"], one["kind"]) == ("on", "opponent")
    )
    assert part["opponent"]["game_controlled"] == driven
    assert f"| opponent, on | 2 | {driven} | 2 | 0 | 0 | 0 | 2.00 [0.24, 7.22] |" in text


def test_games_that_nobody_judged_tell_no_verdicts(stored, tmp_path):
    settings, played = stored
    run = replace(played, rows=[{**row, "violations": None, "avoidable": None} for row in played.rows], folder=tmp_path)
    results = results_of(run, settings)
    assert verdict_rows(results["pairings"][0]["verdicts"], str) == []
    assert all("avoidable" not in goal["name"] for goal in results["goals"])
    assert all_violations(run.rows) == []
    write_results(run, results)
    assert "Not judged" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(
    ("begins", "expected"), [(0, True), (5, True), (6, False), (None, False)], ids=["all", "in time", "late", "untold"]
)
def test_a_boat_that_was_disabled_when_it_had_to_act_could_not(begins, expected):
    facts = {"own": 1, "other": 0, "step": 9, "radius_m": 4.0, "looked_back_s": 0.9, "end_step": 9}
    facts |= {"plan": None, "exhausted": True, "searches": 1, "last_preventable_s": 0.4}
    verdict = Verdict(**facts, outcome=Outcome.AVOIDABLE, last_step=5)
    disabled = None
    if begins is not None:
        disabled = np.zeros((12, 2), np.bool_)
        disabled[begins:, 1] = True
    assert helpless(verdict, disabled) is expected
