"""Every limit of the file, just kept and just broken, and what is declared for it."""

import math
from types import SimpleNamespace

import pytest
from bridge_fakes import fleet_of
from steerclear.shield.bridge.freshness import Seen, judge, words
from steerclear.shield.bridge.link import BoatReading
from steerclear.shield.bridge.operator import Override
from steerclear.shield.bridge.roster import Track
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
    given = {"usable": {"blue_1"}, "policy_age_s": {"blue_1": 0.1}} | seen
    return judge(fleet, roster, Seen(readings={"blue_1": BoatReading("blue_1", 0.0, **values)}, **given))


def test_nothing_is_due_while_all_is_well():
    verdict = verdict_of()
    assert (verdict.actions, verdict.responses) == ([], {})
    assert not verdict.unknown | verdict.idle | verdict.dropped


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
        ({"policy_age_s": {"blue_1": 0.6}}, "hold_course", "no usable command"),
        ({"policy_age_s": {"blue_1": 3.1}}, "hold_station", "3.1 s old"),
        ({"usable": ()}, "hold_course", "no usable command"),
        ({"usable": (), "policy_age_s": {}}, "hold_station", "blue_1: no answer of the policy yet"),
        ({"usable": (), "policy_age_s": {}, "policy_fault": "it died"}, "hold_station", "it died"),
        ({"game_age_s": 2.1}, "hold_station", "state of the game"),
        ({"game_expected": True}, "hold_station", "never heard"),
        ({"game_over": True, "game_age_s": 0.1}, "hold_station", "over"),
        ({"log_fault": "disk full"}, "slow", "disk full"),
        ({"rivals": {"blue_1"}}, "stop", "somebody else"),
        ({"where": (0.0, 99.0)}, "return", "outside the geofence"),
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
        {"navigation_s": 0.5},
        {"contact_s": 1.0},
        {"policy_age_s": {"blue_1": 0.5}},
        {"game_age_s": 2.0},
        {"game_age_s": math.inf},
        {"reading": {"heartbeat_age_s": 1.0}},
        {"reading": {"heartbeat_age_s": 9.0, "position_age_s": 0.2}},
        {"where": (0.0, 59.9)},
    ],
)
def test_within_a_limit_nothing_is_due(situation):
    assert verdict_of(**situation).responses == {}


def test_the_strongest_of_several_counts_and_all_are_told():
    verdict = verdict_of(contact_s=1.1, navigation_s=0.7, usable=(), where=(0.0, 99.0))
    assert verdict.responses == {"blue_1": "return"}
    assert len(verdict.actions) == 4


def test_a_boat_that_is_unknown_or_obeys_somebody_else_is_named():
    assert verdict_of(navigation_s=3.0).unknown == {"blue_1"}
    verdict = verdict_of(reading={"ready": False, "why_not": "in MANUAL"})
    assert verdict.idle == {"blue_1"}
    assert "in MANUAL" in verdict.actions[0].text
    assert verdict.responses == {}


@pytest.mark.parametrize("silent_s", [0.0, 2.0, 30.0])
def test_a_boat_somebody_took_is_told_nothing_however_long_it_is_silent(silent_s):
    taken = {"ready": False, "released": True, "why_not": "taken from us", "heartbeat_age_s": silent_s}
    verdict = verdict_of(navigation_s=silent_s, reading=taken)
    assert verdict.idle == {"blue_1"}
    assert verdict.unknown == set()
    assert verdict.responses == {}
    assert "taken from us" in verdict.actions[0].text


@pytest.mark.parametrize(
    ("situation", "condition"),
    [
        ({"game_age_s": 9.0}, "game"),
        ({"log_fault": "x"}, "log"),
        ({"rivals": {"blue_1"}}, "commander"),
        ({"where": (0.0, 99.0)}, "geofence"),
        ({"contact_s": 9.0}, "contact"),
    ],
)
def test_an_override_switches_off_its_own_response_only(situation, condition):
    made = Override(condition, "", 1.0, "test")
    assert verdict_of(**situation, overrides=(made,)).responses == {}
    other = Override("policy", "", 1.0, "test")
    assert verdict_of(**situation, overrides=(other,)).responses != {}


def test_no_override_lets_a_boat_go_on_without_a_command():
    made = Override("policy", "blue_1", 1.0, "test")
    assert verdict_of(usable=(), overrides=(made,)).responses == {"blue_1": "stop"}


def test_an_override_of_a_lost_contact_drops_it_and_of_an_old_one_does_not():
    made = Override("contact", "red_1", 1.0, "test")
    assert verdict_of(contact_s=9.0, overrides=(made,)).dropped == {"red_1"}
    assert verdict_of(contact_s=2.0, overrides=(made,)).dropped == set()


def test_ages_in_words():
    assert [words(age) for age in (0.25, 120.4, math.inf)] == ["0.2 s old", "120 s old", "never heard"]
