"""Damaged input gives one clear error that names the remedy."""

import numpy as np
import pytest
from oracle_runs import first_breach, straight_track
from steerclear.experiments.oracle import Boat, Motion, OracleError, Settings, judge, judge_breach
from steerclear.experiments.oracle.boat_model import rows_of
from steerclear.experiments.oracle.verdict import Level
from steerclear.shield.platforms import get_platform

HERON = get_platform("heron").pack()
LEVEL = Level(5, (1.0,) * 5, (0.0,), ((0.5,),))


@pytest.fixture
def run():
    """Two boats on rails that meet; the parameters and the step of their violation."""
    states = np.stack([straight_track((0, 0), (0, 2.0), 90), straight_track((0, 12.0), (0, 0), 90)], axis=1)
    return states, np.array([HERON] * 2), first_breach(states, 2.5)


@pytest.mark.parametrize("place", [(3, 0, 0), (3, 1, 1), (90, 1, 2)])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_states_that_are_not_finite(run, place, value):
    states, rows, step = run
    states[place] = value
    with pytest.raises(OracleError, match=rf"boat {place[1]} at step {place[0]} is not finite; check the recorder"):
        judge(states, rows, 0, step, 2.5)


def test_a_controller_that_has_not_run_is_fine_but_not_infinite(run):
    states, rows, step = run
    states[:, :, [6, 8]] = np.nan
    judge(states, rows, 0, step, 2.5)
    states[4, 1, 6] = np.inf
    with pytest.raises(OracleError, match="boat 1 at step 4"):
        judge(states, rows, 0, step, 2.5)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"states": np.zeros((5, 2, 2))}, r"shape \(steps \+ 1, boats, 11\)"),
        ({"states": np.zeros((1, 2, 11))}, "at least one step"),
        ({"states": np.zeros((5, 1, 11))}, "two boats"),
        ({"states": [[["x"] * 11] * 2] * 3}, "must be numbers"),
        ({"radius_m": 0.0}, "radius_m is 0.0; give a positive"),
        ({"radius_m": np.nan}, "radius_m is nan; give a positive"),
        ({"dt_s": -0.1}, "dt_s is -0.1; give a positive"),
        ({"own": 2}, r"no boat 2; the record's boats are 0..1"),
        ({"other": 7}, "no boat 7"),
        ({"other": 0}, "no breach"),
        ({"step": 0}, r"no step 0 to judge; the record's steps are 1..90"),
        ({"step": 91}, "no step 91"),
        ({"step": 10}, "no breach of 2.5 m; give the first step inside"),
        ({"step": 60}, "give the first step inside"),
        ({"boats": np.array([HERON])}, "hold 2 boats but 1 parameter sets"),
        ({"motion": Motion(delay_steps=(5,))}, "one per boat"),
    ],
)
def test_questions_that_make_no_sense(run, changes, words):
    states, rows, step = run
    asked = {"states": states, "boats": rows, "own": 0, "step": step, "radius_m": 2.5, **changes}
    with pytest.raises(OracleError, match=words):
        judge(**asked)


@pytest.mark.parametrize("driven", [np.zeros((90, 3), bool), np.zeros((90, 2))])
def test_marks_of_who_drove_that_do_not_fit(run, driven):
    states, rows, step = run
    with pytest.raises(OracleError, match="one row per step"):
        judge_breach(states, rows, (0, 1), step, 2.5, driven=driven)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Settings(look_back_s=0.0), "look_back_s must be a number of seconds, at least 0.1"),
        (lambda: Settings(settle_s=np.nan), "settle_s must be a number of seconds"),
        (lambda: Settings(quick=LEVEL._replace(width=0)), "search level needs"),
        (lambda: Settings(full=LEVEL._replace(rudders=(2.0,))), "search level needs"),
        (lambda: Settings(quick=LEVEL._replace(schedules=((0.0,),))), "search level needs"),
        (lambda: Motion((np.nan, 0.0)), "two finite speeds"),
        (lambda: Motion(delay_steps=(0.5, 1)), "whole number"),
        (lambda: rows_of(np.zeros((2, 37))), "give one row per boat"),
        (lambda: rows_of(np.full((1, 38), np.nan)), "not finite"),
        (lambda: Boat("ship", 2.0), "choose one of"),
        (lambda: Boat("usv", np.nan), "not finite"),
        (lambda: Boat("usv", 2.0, thrust_map=((0.0, 0.0), (0.0, 1.0))), "rising thrust"),
    ],
)
def test_settings_and_boats_that_cannot_be(make, words):
    with pytest.raises(OracleError, match=words):
        make()
