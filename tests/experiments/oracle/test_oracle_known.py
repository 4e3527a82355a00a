"""Verdicts against limits known in closed form."""

import math

import numpy as np
import pytest
from oracle_runs import DT_S, driven_track, first_violation, straight_track
from steerclear.experiments import oracle
from steerclear.experiments.oracle import Outcome, judge
from steerclear.shield.platforms import Platform, fresh_state
from steerclear.shield.platforms.proving import reference_models

RADIUS_M = 2.5


def test_earlier_names_warn_in_the_words_of_all_others():
    with pytest.warns(DeprecationWarning, match="'judge_breach' is now 'judge_violation'; the old name goes with"):
        assert oracle.judge_breach is oracle.judge_violation
    with pytest.raises(AttributeError, match="has no attribute 'judge_brech'"):
        oracle.judge_brech  # noqa: B018


def model(*settings, **more):
    """A platform with a known answer, which need not be a boat."""
    with reference_models():
        return Platform(*settings, **more)


def straight_boat(top_mps, **changes):
    """A double integrator without a rudder: it can only brake."""
    return model("rail", "double_integrator", top_mps, **changes)


def meeting(platform, start_m, speed_mps, other, steps=150):
    """States of a boat going straight north beside another boat's rows; the boats' parameters."""
    own = fresh_state(*start_m, 0.0, speed_mps)
    rows = driven_track(platform.pack(), own, [(speed_mps, 0.0)] * steps)
    return np.stack([rows, other], axis=1), np.array([platform.pack()] * 2)


@pytest.mark.parametrize(("speed_mps", "max_acc"), [(1.0, 0.5), (2.0, 1.0), (5.0, 1.0), (3.0, 0.5)])
def test_last_stop_before_a_stopped_boat(speed_mps, max_acc):
    # braking v -> 0 with trapezoid steps takes exactly v^2 / 2a when v is a whole number of steps
    platform = straight_boat(10.0, max_acc=max_acc)
    states, rows = meeting(platform, (0.0, 0.0), speed_mps, straight_track((0.0, 40.0), (0.0, 0.0), 400), steps=400)
    step = first_violation(states, RADIUS_M)
    verdict = judge(states, rows, 0, step, RADIUS_M)
    gap_m = 40.0 - states[:step, 0, 1]
    last = int(np.flatnonzero(gap_m - speed_mps**2 / (2 * max_acc) > RADIUS_M + 1e-8)[-1])
    assert verdict.outcome is Outcome.AVOIDABLE
    assert verdict.last_step == last
    assert verdict.last_preventable_s == pytest.approx((step - last) * DT_S)


def dubins(speed_mps, turn_dps):
    """A boat of constant speed whose turn rate obeys at once within its bound."""
    return model(
        "dubins", "double_integrator", speed_mps, max_turn_rate_dps=turn_dps, max_angular_acc_dps2=1e6, max_acc=0.0
    )


@pytest.mark.parametrize(("speed_mps", "turn_dps"), [(2.0, 30.0), (3.0, 20.0), (1.0, 10.0)])
@pytest.mark.parametrize("offset_m", [0.0, 2.0])
def test_turning_circle_past_a_stopped_boat(speed_mps, turn_dps, offset_m):
    # the turning circle (radius R, centre R to the side) must stay outside the disc: d^2 + (R + b)^2 >= (R + r)^2
    circle_m = speed_mps / math.radians(turn_dps)
    other = straight_track((-offset_m, 25.0), (0.0, 0.0), 350)
    states, rows = meeting(dubins(speed_mps, turn_dps), (0.0, 0.0), speed_mps, other, steps=350)
    step = first_violation(states, RADIUS_M)
    verdict = judge(states, rows, 0, step, RADIUS_M)
    needed_m = math.sqrt((circle_m + RADIUS_M) ** 2 - (circle_m + offset_m) ** 2)
    left_m = 25.0 - states[verdict.last_step, 0, 1]
    assert verdict.exhausted
    assert needed_m - 0.05 * speed_mps <= left_m <= needed_m + 1.2 * speed_mps * DT_S


@pytest.mark.parametrize("mover_mps", [(0.0, -2.0), (1.5, 0.0)])
def test_constant_speed_evader_against_a_straight_mover(mover_mps):
    # the extremals of this game turn hard one way and then run straight: the best over all lengths of the turn
    speed_mps, turn_dps = 2.0, 30.0
    meet_m = np.array([0.0, 20.0])
    start = meet_m - np.array(mover_mps) * 10.0
    other = straight_track(start, mover_mps, 200)
    states, rows = meeting(dubins(speed_mps, turn_dps), (0.0, 0.0), speed_mps, other, steps=200)
    step = first_violation(states, RADIUS_M)
    verdict = judge(states, rows, 0, step, RADIUS_M)
    clear = [
        turn_then_straight(states[k, 0], other[k : verdict.end_step + 1, :2], speed_mps, turn_dps) for k in range(step)
    ]
    last = int(np.flatnonzero(np.array(clear) > RADIUS_M)[-1])
    assert verdict.outcome is Outcome.AVOIDABLE
    assert last <= verdict.last_step <= last + 1


def turn_then_straight(row, track, speed_mps, turn_dps):
    """Largest closest distance over all turns one way followed by straight running, in exact arcs."""
    time_s = np.arange(len(track)) * DT_S
    best = 0.0
    for side in (-1.0, 1.0):
        rate = math.radians(side * turn_dps)
        for turning_s in np.arange(0.0, 9.0, 0.05):
            angle = math.radians(row[2]) + rate * np.minimum(time_s, turning_s)
            arc = np.minimum(time_s, turning_s)
            east = speed_mps / rate * (np.cos(math.radians(row[2])) - np.cos(math.radians(row[2]) + rate * arc))
            north = speed_mps / rate * (np.sin(math.radians(row[2]) + rate * arc) - np.sin(math.radians(row[2])))
            run = speed_mps * np.maximum(0.0, time_s - turning_s)
            path = row[:2] + np.stack([east + run * np.sin(angle), north + run * np.cos(angle)], axis=1)
            best = max(best, float(np.hypot(*(path - track).T)[1:].min()))
    return best
