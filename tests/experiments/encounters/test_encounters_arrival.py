"""Boats that never get to their goal: counted against the same boat without a guard; a livelock is told of."""

import dataclasses

import numpy as np
import pytest
from steerclear.experiments.encounters import Conditions, draw, measure, play
from steerclear.experiments.encounters.outcomes import never_arrived

USUAL = Conditions()
NEVER = np.nan


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
    livelock = circling("shield:give_way_after_s=inf")
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
