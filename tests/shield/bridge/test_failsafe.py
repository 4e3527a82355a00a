"""Every limit of the file, just kept and just broken, and what is declared for it; what the operator may switch off."""

import logging
import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from bridge_fakes import fleet_of
from steerclear.shield import Commands
from steerclear.shield.bridge.failsafe import Failsafe, Seen
from steerclear.shield.bridge.failsafe_table import CONDITIONS, DISABLES, response_page, response_table
from steerclear.shield.bridge.messages import Alarm, Answer, BoatReading
from steerclear.shield.bridge.operator import LONGEST_OVERRIDE_S, Operator, Override
from steerclear.shield.bridge.tracker import Track, Tracker
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import fresh_state

MORE = """
limits:
  navigation: {max_age_s: 0.5, then: slow, lost_after_s: 2.0}
  contact: {max_age_s: 1.0, then: slow, lost_after_s: 5.0, lost_then: stop}
  policy: {max_age_s: 0.5, then: hold_course, give_up_after_s: 3.0, give_up_then: hold_station}
  link: {max_age_s: 1.0, then: stop}
  game: {max_age_s: 2.0, then: hold_station}
  log: {then: slow}
"""


def verdict_of(navigation_s=0.0, contact_s=0.0, known_s=None, where=(0.0, 0.0), faults=None, reading=None, **seen):
    fleet = fleet_of(blue=1, red=1, more=MORE)
    roster = SimpleNamespace(
        commanded=("blue_1",),
        faults=faults or {},
        navigation_age_s=lambda name: navigation_s,
        known_age_s=lambda name: navigation_s if known_s is None else known_s,
        contact_age_s=lambda name: contact_s,
        track=lambda name: Track(fresh_state(*where, 0.0), 0.0, navigation_s, 0.0),
    )
    values = {"ready": True, "why_not": "", "heartbeat_age_s": 0.0} | (reading or {})
    usable, age_s = seen.pop("usable", True), seen.pop("policy_age_s", 0.1)
    failsafe = Failsafe(fleet, roster)
    boats = {"blue_1": BoatReading("blue_1", 0.0, **values)}
    good, bad = (Commands.absolute_rad(np.full((2, 2), value)) for value in (0.0, math.nan))
    if age_s is not None:  # the last answer that could be used, then the one of now
        failsafe.judge(Seen(100.0, boats, Answer(good, age_s)))
    answer = Answer(good if usable else bad, 0.0 if age_s is None else age_s, seen.pop("policy_fault", ""))
    return failsafe.judge(Seen(100.0, boats, answer, **seen))


@pytest.mark.parametrize(
    ("situation", "response", "said"),
    [
        ({"navigation_s": 0.6}, "slow", "own navigation 0.6 s old"),
        ({"navigation_s": 2.1}, "stop", "position unknown"),
        ({"navigation_s": math.inf}, "stop", "never heard"),
        ({"navigation_s": 0.6, "faults": {"blue_1": "jumped"}}, "slow", "(jumped)"),
        ({"navigation_s": 9.0, "known_s": 0.3}, "slow", "known from the feed"),
        ({"reading": {"heartbeat_age_s": 2.1}}, "stop", "no longer reached"),
        ({"contact_s": 1.1}, "slow", "contact red_1 old"),
        ({"contact_s": 5.1}, "stop", "contact red_1 lost"),
        ({"policy_age_s": 0.6}, "hold_course", "no usable command"),
        ({"policy_age_s": 3.1}, "hold_station", "3.1 s old"),
        ({"usable": False}, "hold_course", "no usable command"),
        ({"usable": False, "policy_age_s": None}, "hold_station", "blue_1: no answer of the policy yet"),
        ({"usable": False, "policy_age_s": None, "policy_fault": "it died"}, "hold_station", "it died"),
        ({"game_age_s": 2.1}, "hold_station", "state of the game"),
        ({"game_expected": True}, "hold_station", "never heard"),
        ({"game_over": True, "game_age_s": 0.1}, "hold_station", "over"),
        ({"log_fault": "disk full"}, "slow", "disk full"),
        ({"reading": {"faults": {"second_commander": 1}}}, "stop", "somebody else commands it too; end that program"),
        (
            {"reading": {"faults": {"second_commander": 1}, "commander": "(system 252, component 190) sends SET_MODE"}},
            "stop",
            "somebody else commands it too (system 252, component 190 sends SET_MODE); end that program",
        ),
        ({"where": (0.0, 99.0)}, "return", "blue_1 is 39.0 m outside the geofence, for 0 s"),
        ({"reading": {"heartbeat_age_s": 1.1}}, "stop", "link silent"),
    ],
)
def test_each_limit_has_its_declared_response(situation, response, said):
    verdict = verdict_of(**situation)
    assert verdict.responses == {"blue_1": response}
    assert any(said in action.text for action in verdict.actions)


@pytest.mark.parametrize(
    "situation",
    [
        {},
        {"navigation_s": 0.5},
        {"contact_s": 1.0},
        {"policy_age_s": 0.5},
        {"game_age_s": 2.0},
        {"game_age_s": math.inf},
        {"reading": {"heartbeat_age_s": 1.0}},
        {"reading": {"heartbeat_age_s": 9.0, "position_age_s": 0.2}},
        {"where": (0.0, 59.9)},
    ],
)
def test_within_a_limit_nothing_is_due(situation):
    verdict = verdict_of(**situation)
    assert (verdict.actions, verdict.responses) == ([], {})
    assert not verdict.unknown | verdict.idle | verdict.dropped


def test_the_strongest_of_several_counts_and_all_are_told():
    verdict = verdict_of(contact_s=1.1, navigation_s=0.7, usable=False, where=(0.0, 99.0))
    assert verdict.responses == {"blue_1": "return"}
    assert len(verdict.actions) == 4


@pytest.mark.parametrize(("released", "silent_s"), [(False, 0.0), (True, 0.0), (True, 2.0), (True, 30.0)])
def test_a_boat_that_obeys_somebody_else_is_told_nothing_and_one_that_was_taken_however_long_it_is_silent(
    released, silent_s
):
    taken = {"ready": False, "released": released, "why_not": "in MANUAL", "heartbeat_age_s": silent_s}
    verdict = verdict_of(navigation_s=silent_s, reading=taken)
    assert (verdict.idle, verdict.unknown, verdict.responses) == ({"blue_1"}, set(), {})
    assert "in MANUAL" in verdict.actions[0].text
    assert verdict_of(navigation_s=3.0).unknown == {"blue_1"}


@pytest.mark.parametrize(
    ("situation", "condition"),
    [
        ({"game_age_s": 9.0}, "game"),
        ({"log_fault": "x"}, "log"),
        ({"reading": {"faults": {"second_commander": 1}}}, "commander"),
        ({"where": (0.0, 99.0)}, "geofence"),
        ({"contact_s": 9.0}, "contact"),
    ],
)
def test_an_override_switches_off_its_own_response_only(situation, condition):
    made = Override(condition, "", 1.0, "test")
    assert verdict_of(**situation, overrides=(made,)).responses == {}
    other = Override("policy", "", 1.0, "test")
    assert verdict_of(**situation, overrides=(other,)).responses != {}


def test_no_override_lets_a_boat_go_on_without_a_command_and_one_of_a_lost_contact_drops_it():
    made = Override("policy", "blue_1", 1.0, "test")
    assert verdict_of(usable=False, overrides=(made,)).responses == {"blue_1": "stop"}
    made = Override("contact", "red_1", 1.0, "test")
    assert verdict_of(contact_s=9.0, overrides=(made,)).dropped == {"red_1"}
    assert verdict_of(contact_s=2.0, overrides=(made,)).dropped == set()


@pytest.mark.parametrize(
    ("fault", "said"),
    [
        (Answer(None, math.inf), "no answer of the policy yet"),
        (Answer(Commands(np.zeros((2, 2)), relative=True), 0.0), "relative to headings"),
        (Answer(Commands.absolute_rad(np.zeros((3, 2))), 0.0), "3 boats of 2"),
        (Answer(Commands.absolute_rad(np.full((2, 2), 1e9)), 0.0), "no command for blue_1"),
        (Answer(Commands.absolute_rad(np.zeros((2, 2))), math.nan), "no answer of the policy yet"),
    ],
)
def test_answers_that_are_none_are_told(fault, said):
    fleet = fleet_of(blue=1, red=1)
    tracker = Tracker(fleet, ("blue_1",))
    verdict = Failsafe(fleet, tracker).judge(Seen(100.0, {"blue_1": BoatReading("blue_1", 100.0)}, fault))
    assert any(said in action.text for action in verdict.actions if action.condition == "policy")


@pytest.mark.parametrize("after", ["wait", "retake"])
def test_what_its_own_failsafe_took_is_offered_or_taken_back_only_once_that_is_over(after):
    fleet = fleet_of(blue=1, red=1, more=f"limits: {{after_failsafe: {after}}}")
    failsafe = Failsafe(fleet, Tracker(fleet, ("blue_1",)))
    fresh = {"position_age_s": 0.1, "heading_age_s": 0.1, "velocity_age_s": 0.1, "why_not": "it is in HOLD"}

    def judged(by, over, **changes):
        taken = {"released": True, "released_by": by, "failsafe_over": over, **fresh, **changes}
        verdict = failsafe.judge(Seen(100.0, {"blue_1": BoatReading("blue_1", 100.0, **taken)}, Answer()))
        return verdict, next(action.text for action in verdict.actions if action.condition == "mode")

    for by, over in (("pilot", True), ("failsafe", False)):
        verdict, text = judged(by, over)
        assert (verdict.retake, verdict.idle) == (set(), {"blue_1"})
        assert "it is in HOLD" in text
        assert ("t takes it back, when its pilot agrees" if by == "pilot" else "once that is over") in text
    verdict, text = judged("failsafe", True)
    assert verdict.retake == ({"blue_1"} if after == "retake" else set())
    assert ("t takes it back" in text) == (after == "wait")
    assert judged("failsafe", True, position_age_s=1.0)[0].retake == set(), "not while nobody knows where it is"


def test_a_boat_that_the_file_does_not_have_slows_all_boats_until_overridden():
    fleet = fleet_of(blue=2, red=0)
    failsafe = Failsafe(fleet, Tracker(fleet, ("blue_1", "blue_2")))
    readings = {name: BoatReading(name, 100.0, heartbeat_age_s=0.0, released=True) for name in fleet.names}

    def judged(*overrides):
        alarms = (Alarm.of_unlisted("ferry"),)
        verdict = failsafe.judge(Seen(100.0, readings, Answer(), alarms=alarms, overrides=overrides))
        return [(a.subject, a.response, a.text) for a in verdict.actions if a.condition == "contact"]

    ((subject, response, text),) = judged()
    assert (subject, response) == ("ferry", "slow")
    assert "nobody keeps clear of 'ferry'" in text
    assert judged(Override("contact", "", 130.0, "key")) == []


def test_a_boat_handed_over_is_stopped_by_its_link_until_somebody_takes_it():
    fleet = fleet_of(blue=1, red=1)
    failsafe = Failsafe(fleet, Tracker(fleet, ("blue_1",)))
    failsafe.handed_over.add("blue_1")
    ready = {"ready": True, "heartbeat_age_s": 0.0}
    verdict = failsafe.judge(Seen(100.0, {"blue_1": BoatReading("blue_1", 100.0, **ready)}, Answer()))
    assert "blue_1" in verdict.unknown
    assert any(a.condition == "hard_line" and "take it back" in a.text for a in verdict.actions)
    failsafe.judge(Seen(100.1, {"blue_1": BoatReading("blue_1", 100.1, released=True)}, Answer()))
    assert failsafe.handed_over == set()


def test_the_table_names_only_settings_that_there_are_and_only_what_can_be_overridden():
    rows = response_table()
    assert len(rows) == len(CONDITIONS)
    assert all("`" not in cell.replace("(`", "").replace("`)", "") for row in rows for cell in row)
    assert any("0.5 s (`navigation.max_age_s`)" in row[2] for row in rows)
    assert set(DISABLES) == {"commander", "contact", "game", "geofence", "log", "model", "policy"}


def test_the_page_shows_the_table_that_the_loop_acts_by():
    page = (Path(__file__).parents[3] / "docs" / "boat_reference.md").read_text()
    assert f"<!-- responses -->\n{response_page()}\n<!-- /responses -->" in page


def test_an_override_says_what_it_disables_and_ends(caplog):
    operator = Operator()
    with caplog.at_level(logging.WARNING):
        for seconds, subject in ((9.0, "red_1"), (9.0, ""), (30.0, "red_1")):
            operator.override("contact", subject, seconds, now_s=100.0, by="key")
        assert [(entry.subject, entry.until_s) for entry in operator.active(100.0)] == [("", 109.0), ("red_1", 130.0)]
        (action,) = operator.actions(110.0)
        assert "20 s more" in action.text
        assert DISABLES["contact"] in action.text
        assert operator.active(129.9)
        assert operator.active(130.0) == ()
    assert "disables" in caplog.text
    assert "ended" in caplog.text


@pytest.mark.parametrize(
    ("condition", "seconds", "words"),
    [
        *(("game", seconds, "at most") for seconds in (0.0, -1.0, LONGEST_OVERRIDE_S + 1.0, math.nan, math.inf)),
        *((condition, 10.0, "cannot be overridden") for condition in ("shield", "navigation", "link", "")),
    ],
)
def test_no_override_without_an_end_nor_of_the_shield_or_own_navigation(condition, seconds, words):
    with pytest.raises(ConfigError, match=words):
        Operator().override(condition, "", seconds, 0.0)
