"""What a verdict means: where the search may begin and end, third boats, and both sides."""

from dataclasses import replace

import numpy as np
import pytest
from oracle_runs import DT_S, driven_track, first_breach, straight_track
from steerclear.experiments.oracle import Outcome, Responsible, judge, judge_breach
from steerclear.shield.platforms import fresh_state, get_platform

RADIUS_M = 2.5
HERON = get_platform("heron")


def heron_towards(other, steps=200, start_m=(0.0, 0.0), speed_mps=2.0):
    """A heron going straight north at full speed beside other rows; states and parameters."""
    own = fresh_state(*start_m, 0.0, speed_mps)
    own[4] = 100.0
    rows = driven_track(HERON.pack(), own, [(speed_mps, 0.0)] * steps)
    return np.stack([rows, *other], axis=1), np.array([HERON.pack()] * (1 + len(other)))


def test_facts_of_a_verdict():
    states, rows = heron_towards([straight_track((0.5, 25.0), (0.0, 0.0), 200)])
    step = first_breach(states, RADIUS_M)
    verdict = judge(states, rows, 0, step, RADIUS_M)
    assert (verdict.own, verdict.other, verdict.step, verdict.radius_m) == (0, 1, step, RADIUS_M)
    assert verdict.looked_back_s == pytest.approx(step * DT_S)
    assert verdict.last_preventable_s == pytest.approx((step - verdict.last_step) * DT_S)
    assert verdict.plan.begin_step == verdict.last_step
    assert verdict.plan.closest_m > RADIUS_M
    gap_m = np.hypot(*(states[:, 0, :2] - states[:, 1, :2]).T)
    assert verdict.end_step == step + int(np.argmax(gap_m[step:] > RADIUS_M)) + 50
    assert 0 < verdict.searches < 80


def test_avoidable_from_every_earlier_step():
    states, rows = heron_towards([straight_track((0.5, 25.0), (0.0, 0.0), 200)])
    step = first_breach(states, RADIUS_M)
    last = judge(states, rows, 0, step, RADIUS_M).last_step
    for begin in (0, last - 20, last - 1, last):
        cut = judge(states[begin:], rows, 0, step - begin, RADIUS_M)
        assert cut.last_step == last - begin
    gone = judge(states[last + 1 :], rows, 0, step - last - 1, RADIUS_M)
    assert gone.outcome is Outcome.UNAVOIDABLE


def test_a_third_boat_in_the_way_counts():
    # walls of stopped boats left and right leave only the brake
    wall = [straight_track((side * 2.6, 2.6 * k - 3.0), (0, 0), 200) for side in (-1, 1) for k in range(12)]
    ahead = straight_track((0.0, 25.0), (0.0, 0.0), 200)
    alone, rows = heron_towards([ahead])
    walled, many = heron_towards([ahead, *wall])
    step = first_breach(alone, RADIUS_M)
    free = judge(alone, rows, 0, step, RADIUS_M)
    held = judge(walled, many, 0, step, RADIUS_M, other=1)
    assert held.last_preventable_s is None or held.last_preventable_s > free.last_preventable_s + 1.0


def test_a_contact_under_way_with_a_third_boat_is_another_breach():
    # boat 2 rides inside the radius all along: boat 1 must still be judged
    ahead, rider = straight_track((0.0, 25.0), (0.0, 0.0), 120), straight_track((1.0, 0.0), (0.0, 2.0), 120)
    states, rows = heron_towards([ahead, rider], steps=120)
    step = first_breach(states, RADIUS_M)
    verdict = judge(states, rows, 0, step, RADIUS_M, other=1)
    assert verdict.outcome is Outcome.AVOIDABLE
    assert np.hypot(*(verdict.plan.path_m - [0.0, 25.0]).T).min() > RADIUS_M


def test_started_inside():
    states, rows = heron_towards([straight_track((0.0, 1.0), (0.0, 0.0), 60)], steps=60)
    both = judge_breach(states, rows, (0, 1), 1, RADIUS_M)
    assert both.first.outcome is both.second.outcome is Outcome.STARTED_INSIDE
    assert both.responsible is Responsible.START
    assert both.responsible_boats() == ()


class TestSides:
    """Who is responsible."""

    @pytest.mark.parametrize(
        ("first", "second", "expected"),
        [
            (20, 20, Responsible.BOTH),
            (20, 21, Responsible.BOTH),
            (20, 22, Responsible.SECOND),
            (21, 20, Responsible.BOTH),
            (22, 20, Responsible.FIRST),
            (None, 0, Responsible.SECOND),
            (0, None, Responsible.FIRST),
            (None, None, Responsible.NEITHER),
        ],
    )
    def test_the_later_last_chance_with_a_step_to_spare(self, first, second, expected):
        states, rows = heron_towards([straight_track((0.5, 25.0), (0.0, 0.0), 200)])
        step = first_breach(states, RADIUS_M)
        one = judge(states, rows, 0, step, RADIUS_M)
        one, other = replace(one, last_step=first), replace(one, own=1, other=0, last_step=second)
        assert Responsible.of(one, other, np.zeros((200, 2), dtype=bool)) is expected

    def test_the_one_with_the_last_chance(self):
        # the other cannot turn or brake: a point on a rail, so its last chance is none
        states, rows = heron_towards([straight_track((0.0, 40.0), (0.0, -2.0), 150)], steps=150)
        step = first_breach(states, RADIUS_M)
        rail = get_platform("di").pack()
        rail[[1, 7, 19]] = 2.0, 0.0, 0.0
        states[:, 1, 2:4] = 180.0, 2.0
        both = judge_breach(states, np.array([rows[0], rail]), (0, 1), step, RADIUS_M)
        assert both.second.outcome is Outcome.UNAVOIDABLE
        assert both.responsible is Responsible.FIRST
        assert both.responsible_boats() == (0,)
        assert both.of(1) is both.second
        mirrored = judge_breach(states, np.array([rows[0], rail]), (1, 0), step, RADIUS_M)
        assert mirrored.responsible is Responsible.SECOND
        assert mirrored.responsible_boats() == (0,)

    def test_both_of_a_symmetric_meeting_unless_driven(self):
        steps = 150
        first = fresh_state(0.0, 0.0, 0.0, 2.0)
        second = fresh_state(0.0, 40.0, 180.0, 2.0)
        first[4] = second[4] = 100.0
        tracks = [driven_track(HERON.pack(), state, [(2.0, 0.0)] * steps) for state in (first, second)]
        states, rows = np.stack(tracks, axis=1), np.array([HERON.pack()] * 2)
        step = first_breach(states, RADIUS_M)
        assert judge_breach(states, rows, (0, 1), step, RADIUS_M).responsible is Responsible.BOTH
        driven = np.zeros((steps, 2), dtype=bool)
        driven[:, 1] = True
        assert judge_breach(states, rows, (0, 1), step, RADIUS_M, driven=driven).responsible is Responsible.FIRST
        driven[:, 0] = True
        both = judge_breach(states, rows, (0, 1), step, RADIUS_M, driven=driven)
        assert (both.responsible, both.responsible_boats()) == (Responsible.GAME, ())

    def test_neither(self):
        rail = get_platform("di").pack()
        rail[[1, 7, 19]] = 2.0, 0.0, 0.0
        tracks = [straight_track((0, 0), (0, 2.0), 90), straight_track((0, 12.0), (0, -2.0), 90)]
        states = np.stack(tracks, axis=1)
        states[:, :, 3], states[:, 1, 2] = 2.0, 180.0
        both = judge_breach(states, np.array([rail, rail]), (0, 1), first_breach(states, RADIUS_M), RADIUS_M)
        assert both.responsible is Responsible.NEITHER
