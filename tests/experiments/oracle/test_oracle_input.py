"""Damaged input gives one clear error that names the remedy."""

import numpy as np
import pytest
from oracle_runs import first_breach, straight_track
from steerclear.experiments.oracle import OracleError, Settings, judge, judge_breach
from steerclear.experiments.oracle.settings import Level
from steerclear.shield.platforms import get_platform

HERON = get_platform("heron").pack()


@pytest.fixture
def run():
    """Two boats on rails that meet; the parameters and the step of their breach."""
    states = np.stack([straight_track((0, 0), (0, 2.0), 90), straight_track((0, 12.0), (0, 0), 90)], axis=1)
    return states, np.array([HERON] * 2), first_breach(states, 2.5)


@pytest.mark.parametrize("place", [(3, 0, 0), (3, 1, 1), (0, 0, 3), (90, 1, 2), (5, 0, 4)])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_states_that_are_not_finite(run, place, value):
    states, rows, step = run
    states[place] = value
    with pytest.raises(OracleError, match=rf"boat {place[1]} at step {place[0]} is not finite; check the recorder"):
        judge(states, rows, 0, step, 2.5)


@pytest.mark.parametrize("column", [6, 8])
def test_a_controller_that_has_not_run_is_fine_but_not_infinite(run, column):
    states, rows, step = run
    states[:, :, column] = np.nan
    judge(states, rows, 0, step, 2.5)
    states[4, 1, column] = np.inf
    with pytest.raises(OracleError, match="boat 1 at step 4"):
        judge(states, rows, 0, step, 2.5)


@pytest.mark.parametrize(
    ("states", "words"),
    [
        (np.zeros((5, 2, 2)), r"shape \(steps \+ 1, boats, 11\)"),
        (np.zeros((5, 11)), r"shape \(steps \+ 1, boats, 11\)"),
        (np.zeros((1, 2, 11)), "at least one step"),
        (np.zeros((5, 1, 11)), "two boats"),
        ([[["x"] * 11] * 2] * 3, "must be numbers"),
        ([[[0.0] * 11], [[0.0] * 10]], "must be numbers"),
    ],
)
def test_states_of_another_shape(states, words):
    with pytest.raises(OracleError, match=words):
        judge(states, np.array([HERON] * 2), 0, 1, 2.5)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"radius_m": 0.0}, "radius_m is 0.0; give a positive"),
        ({"radius_m": np.nan}, "radius_m is nan; give a positive"),
        ({"dt_s": -0.1}, "dt_s is -0.1; give a positive"),
        ({"own": 2}, r"no boat 2; the record's boats are 0..1"),
        ({"own": -1}, "no boat -1"),
        ({"other": 7}, "no boat 7"),
        ({"other": 0}, "no breach"),
        ({"step": 0}, r"no step 0 to judge; the record's steps are 1..90"),
        ({"step": 91}, "no step 91"),
        ({"step": 10}, "no breach of 2.5 m; give the first step inside"),
        ({"step": 60}, "inside already before step 60"),
    ],
)
def test_questions_that_make_no_sense(run, changes, words):
    states, rows, step = run
    asked = {"own": 0, "step": step, "radius_m": 2.5, **changes}
    with pytest.raises(OracleError, match=words):
        judge(states, rows, **asked)


def test_parameters_for_other_boats(run):
    states, rows, step = run
    with pytest.raises(OracleError, match="hold 2 boats but 1 parameter sets"):
        judge(states, rows[:1], 0, step, 2.5)
    rows[0, 3] = np.nan
    with pytest.raises(OracleError, match="not finite"):
        judge(states, rows, 0, step, 2.5)


@pytest.mark.parametrize("driven", [np.zeros((90, 3), bool), np.zeros((91, 2), bool), np.zeros((90, 2))])
def test_marks_of_who_drove_that_do_not_fit(run, driven):
    states, rows, step = run
    with pytest.raises(OracleError, match="one row per step"):
        judge_breach(states, rows, (0, 1), step, 2.5, driven=driven)


@pytest.mark.parametrize("name", ["look_back_s", "settle_s", "longest_s"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_times_that_are_none(name, value):
    with pytest.raises(OracleError, match=f"{name} must be a number of seconds"):
        Settings(**{name: value})


def test_too_little_to_look_back_at():
    with pytest.raises(OracleError, match=r"look_back_s must be a number of seconds, at least 0.1"):
        Settings(look_back_s=0.0)


@pytest.mark.parametrize(
    "change",
    [
        {"width": 0},
        {"thrust": -1.0},
        {"rudders": (2.0,)},
        {"rudders": ()},
        {"schedules": ()},
        {"schedules": ((),)},
        {"schedules": ((0.0,),)},
    ],
)
def test_levels_that_cannot_search(change):
    level = {"width": 5, "position_m": 1.0, "heading_deg": 1.0, "speed_mps": 1.0, "thrust": 1.0, "rudders": (0.0,)}
    with pytest.raises(OracleError, match="search level needs"):
        Settings(quick=Level(**{**level, "schedules": ((0.5,),), **change}))
