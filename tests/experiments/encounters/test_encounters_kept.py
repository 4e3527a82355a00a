"""Closed loops that were lost once: crowds, two rammers on the quarters, a livelock of teammates."""

import dataclasses

import numpy as np
import pytest
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.experiments.encounters.outcomes import never_arrived
from steerclear.shield import Reason
from steerclear.shield.platforms import layout as L

USUAL, NEVER, OWN = Conditions(), np.nan, 20
QUARTERS = (173, 189, 253, 397, 403, 437, 480, 498, 503, 627)
"""Encounters of a heron and two rammers, one on each quarter, that who takes them to hold their course loses."""


def crowd_of(number):
    return play(draw("crowd_40", "heron", "heron", USUAL, 0, number, 1), "shield", USUAL)


def gaps_of(film):
    """Distances of every own boat from every boat, (T+1, 20, 40) m, from itself inf."""
    place = film.state[:, 0][:, :, [L.X, L.Y]]
    gaps = np.linalg.norm(place[:, :OWN, None] - place[:, None], axis=-1)
    gaps[:, range(OWN), range(OWN)] = np.inf
    return gaps


@pytest.mark.parametrize("number", [961, 962])
def test_mates_that_passed_make_room_for_the_escape_another_has_held(number):
    assert gaps_of(crowd_of(number))[..., :OWN].min() >= 2.5


@pytest.mark.parametrize("number", [546, 572, 873])
def test_a_boat_is_not_let_off_by_what_a_team_mate_far_away_cannot_keep(number):
    """Three encounters with a hit by an opponent of a boat that had 2 m to spare a few seconds before."""
    film = crowd_of(number)
    assert gaps_of(film).min() >= 2.5
    reason, told_m = film.reason[:, 0, :OWN], film.safety_margin_m[:, 0, :OWN]
    both = (reason == Reason.BEST_EFFORT).any(axis=1, keepdims=True) & (reason == Reason.BACKUP)
    assert both.any()  # some keep everything by their backup where others cannot
    assert (told_m[both] >= 0.0).all()


def closest_m(guard):
    scenes = draw("rammer_2", "heron", "heron", USUAL, 0, 0, max(QUARTERS) + 1).take(QUARTERS)
    place = play(scenes, guard, USUAL).state[..., [L.X, L.Y]]
    return np.linalg.norm(place[:, :, :1] - place[:, :, 1:], axis=-1).min(axis=(0, 2))


def test_two_that_close_in_from_both_quarters_are_seen_coming():
    assert (closest_m("shield") >= 2.5).all()


def test_who_takes_them_to_hold_their_course_loses_them():
    assert (closest_m("shield:profile=constant_velocity") < 2.5).mean() >= 0.3


@pytest.fixture(scope="module")
def short_film():
    """Two games of three own boats and three others, one step long: who arrived when is written into it."""
    scenes = dataclasses.replace(draw("crowd_6", "heron", "heron", USUAL, 0, 0, 2), length_s=0.1)
    return play(scenes, "none", USUAL)


@pytest.mark.parametrize(
    ("guarded", "bare", "share"),
    [
        ((9.0, 8.0, 7.0), (5.0, 5.0, 5.0), 0.0),
        ((NEVER, 8.0, NEVER), (5.0, 5.0, 5.0), 2.0 / 3.0),
        ((NEVER, NEVER, 7.0), (NEVER, 5.0, 5.0), 1.0 / 3.0),
        ((9.0, 8.0, 7.0), (NEVER, NEVER, NEVER), 0.0),
    ],
)
def test_own_boats_count_that_would_arrive_without_a_guard(short_film, guarded, bare, share):
    def arriving(first_goal_s):
        others = (NEVER, 5.0, NEVER)
        return dataclasses.replace(short_film, first_goal_s=np.array([(5.0,) * 6, (*first_goal_s, *others)]))

    np.testing.assert_allclose(never_arrived(arriving(guarded), arriving(bare)), [0.0, share])


def circling(guard):
    return measure("circle_3", guard, "surveyor", "surveyor", n=6, seed=0, judge=False)


def test_a_livelock_among_team_mates_is_seen_though_nobody_stands_still():
    livelock = circling("shield:deadlock_timeout_s=inf")
    lost = livelock.columns["never_arrived"]
    assert (lost > 0.0).any()
    assert (lost < 0.7).all(), "two sail on side by side, the third gets across"
    assert livelock.summary["never_arrived_percent"] == pytest.approx(100.0 * lost.mean())
    assert livelock.summary["deadlocked"] == livelock.summary["breached"] == 0
    assert livelock.summary["unshielded_breached"] == 6
    resolved = circling("shield").summary
    assert resolved["never_arrived_percent"] == resolved["breached"] == 0
    assert resolved["reached_percent"] == 100.0


def test_without_a_guard_boats_cross_in_the_middle_and_all_arrive():
    outcome = measure("circle_6", "none", n=6, seed=0, judge=False)
    assert outcome.summary["breached"] == 6
    assert outcome.summary["reached_percent"] == 100.0
    assert not outcome.columns["never_arrived"].any()
