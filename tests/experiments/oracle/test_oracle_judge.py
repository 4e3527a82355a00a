"""What a verdict means: where the search may begin and end, third boats, both sides, currents and late commands.

What is judged shares no code with what judges it, and damaged input is one error that names the remedy.
"""

import ast
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracle_runs import DT_S, driven_track, first_violation, straight_track
from steerclear.experiments import oracle
from steerclear.experiments.oracle import (
    Boat,
    Motion,
    OracleError,
    Outcome,
    Responsible,
    Settings,
    judge,
    judge_violation,
)
from steerclear.experiments.oracle.boat_model import rows_of
from steerclear.experiments.oracle.verdict import Level
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
    step = first_violation(states, RADIUS_M)
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
    step = first_violation(states, RADIUS_M)
    last = judge(states, rows, 0, step, RADIUS_M).last_step
    for begin in (0, last - 20, last - 1, last):
        cut = judge(states[begin:], rows, 0, step - begin, RADIUS_M)
        assert cut.last_step == last - begin
    gone = judge(states[last + 1 :], rows, 0, step - last - 1, RADIUS_M)
    assert gone.outcome is Outcome.UNAVOIDABLE


def test_a_third_boat_in_the_way_counts():
    # walls of stopped boats left and right leave only the brake
    wall = [straight_track((side * 2.6, 2.6 * k + 10.0), (0, 0), 200) for side in (-1, 1) for k in range(7)]
    ahead = straight_track((0.0, 25.0), (0.0, 0.0), 200)
    alone, rows = heron_towards([ahead])
    walled, many = heron_towards([ahead, *wall])
    step = first_violation(alone, RADIUS_M)
    free = judge(alone, rows, 0, step, RADIUS_M)
    held = judge(walled, many, 0, step, RADIUS_M, other=1)
    assert held.last_preventable_s is None or held.last_preventable_s > free.last_preventable_s + 1.0


def test_a_contact_under_way_with_a_third_boat_is_another_violation():
    # boat 2 rides inside the radius all along: boat 1 must still be judged
    ahead, rider = straight_track((0.0, 25.0), (0.0, 0.0), 120), straight_track((1.0, 0.0), (0.0, 2.0), 120)
    states, rows = heron_towards([ahead, rider], steps=120)
    step = first_violation(states, RADIUS_M)
    verdict = judge(states, rows, 0, step, RADIUS_M, other=1)
    assert verdict.outcome is Outcome.AVOIDABLE
    assert np.hypot(*(verdict.plan.path_m - [0.0, 25.0]).T).min() > RADIUS_M


def test_started_inside():
    states, rows = heron_towards([straight_track((0.0, 1.0), (0.0, 0.0), 60)], steps=60)
    both = judge_violation(states, rows, (0, 1), 1, RADIUS_M)
    assert both.first.outcome is both.second.outcome is Outcome.STARTED_INSIDE
    assert both.responsible is Responsible.START
    assert both.responsible_boats() == ()


@pytest.mark.parametrize(
    ("first", "second", "expected"),
    [
        (20, 20, Responsible.BOTH),
        (20, 21, Responsible.BOTH),
        (20, 22, Responsible.SECOND),
        (22, 20, Responsible.FIRST),
        (None, 0, Responsible.SECOND),
        (0, None, Responsible.FIRST),
        (None, None, Responsible.NEITHER),
    ],
)
def test_who_had_the_later_last_chance_is_responsible_with_a_step_to_spare(first, second, expected):
    states, rows = heron_towards([straight_track((0.5, 25.0), (0.0, 0.0), 200)])
    one = judge(states, rows, 0, first_violation(states, RADIUS_M), RADIUS_M)
    one, other = replace(one, last_step=first), replace(one, own=1, other=0, last_step=second)
    assert Responsible.of(one, other, np.zeros((200, 2), dtype=bool)) is expected


def test_who_cannot_turn_or_brake_has_no_chance():
    """A point on a rail."""
    states, rows = heron_towards([straight_track((0.0, 40.0), (0.0, -2.0), 150)], steps=150)
    step = first_violation(states, RADIUS_M)
    rail = get_platform("di").pack()
    rail[[1, 7, 19]] = 2.0, 0.0, 0.0
    states[:, 1, 2:4] = 180.0, 2.0
    for pair, responsible in (((0, 1), Responsible.FIRST), ((1, 0), Responsible.SECOND)):
        both = judge_violation(states, np.array([rows[0], rail]), pair, step, RADIUS_M)
        assert both.of(1).outcome is Outcome.UNAVOIDABLE
        assert (both.responsible, both.responsible_boats()) == (responsible, (0,))


def head_on(gap_m, steps):
    """Two herons at full speed towards each other."""
    south, north = fresh_state(0.0, 0.0, 0.0, 2.0), fresh_state(0.0, gap_m, 180.0, 2.0)
    south[4] = north[4] = 100.0
    rows = [driven_track(HERON.pack(), boat, [(2.0, 0.0)] * steps) for boat in (south, north)]
    return np.stack(rows, axis=1), np.array([HERON.pack()] * 2)


def test_both_of_a_symmetric_meeting_unless_driven():
    states, rows = head_on(40.0, 150)
    step, driven = first_violation(states, RADIUS_M), np.zeros((150, 2), dtype=bool)
    for boats, responsible in (([], Responsible.BOTH), ([1], Responsible.FIRST), ([0, 1], Responsible.GAME)):
        driven[:, boats] = True
        both = judge_violation(states, rows, (0, 1), step, RADIUS_M, driven=driven)
        assert both.responsible is responsible
    assert both.responsible_boats() == ()


CURRENT = (0.5, 0.0)


def slow_boat_upstream(steps=120):
    """A boat of 0.2 m/s makes for a drifting one 4 m west of it; the water goes east at 0.5 m/s."""
    rows = np.zeros((steps + 1, 2, 11))
    ran_s = DT_S * np.arange(steps + 1)
    rows[:, 0, 0] = 4.0 + (CURRENT[0] - 0.2) * ran_s
    rows[:, 0, 2], rows[:, 0, 3] = -90.0, 0.2
    rows[:, 1, 0] = CURRENT[0] * ran_s
    boat = Boat("single_integrator", 0.2, max_turn_dps=90.0)
    return rows, [boat, boat]


def test_a_boat_that_could_have_stayed_where_the_water_took_it():
    states, boats = slow_boat_upstream()
    step = first_violation(states, RADIUS_M)
    told = judge(states, boats, 0, step, RADIUS_M, motion=Motion(CURRENT))
    assert told.outcome is Outcome.AVOIDABLE
    forgotten = judge(states, boats, 0, step, RADIUS_M)
    assert forgotten.outcome is Outcome.UNAVOIDABLE  # it cannot outrun a boat that seems to come at 0.5 m/s


def test_no_command_arrived_in_time():
    states, rows = head_on(12.0, 80)
    step = first_violation(states, RADIUS_M)
    told = judge(states, rows, 0, step, RADIUS_M, motion=Motion(delay_steps=(20, 0)))
    assert (told.outcome, told.last_preventable_s, told.exhausted) == (Outcome.UNAVOIDABLE, None, True)
    forgotten = judge(states, rows, 0, step, RADIUS_M)
    assert forgotten.outcome is Outcome.AVOIDABLE
    assert step - forgotten.last_step < 20 < step  # commands of the first moments come too late


def test_who_had_the_last_chance_is_a_matter_of_when_commands_were_given():
    states, rows = head_on(30.0, 120)
    step = first_violation(states, RADIUS_M)
    at_once = judge_violation(states, rows, (0, 1), step, RADIUS_M)
    late = judge_violation(states, rows, (0, 1), step, RADIUS_M, motion=Motion(delay_steps=(5, 0)))
    assert (at_once.responsible, late.responsible) == (Responsible.BOTH, Responsible.SECOND)
    assert late.first.last_step == at_once.first.last_step - 5
    assert late.first.plan.begin_step == at_once.first.plan.begin_step
    assert late.second.last_step == at_once.second.last_step


FILES = sorted(Path(oracle.__file__).parent.glob("*.py"))
ALLOWED = {"__future__", "contextlib", "numpy", "numba", "math", "dataclasses", "enum", "typing", "collections",
           "functools", "hashlib", "itertools", "logging", "pathlib", "warnings"}  # fmt: skip
BLOCKED = """
import sys
class Wall:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[:2] in (["steerclear", "shield"], ["steerclear", "env"], ["steerclear", "policies"]):
            raise ImportError("blocked: " + name)
sys.meta_path.insert(0, Wall())
import numpy as np
from steerclear.experiments.oracle import Boat, judge
rows = np.zeros((60, 2, 11))
rows[:, 0, 1] = np.arange(60) * 0.3
rows[:, 0, 3] = 3.0
rows[:, 1, 1] = 10.0
own = Boat("single_integrator", 10.0, max_turn_dps=90.0)
print(judge(rows, [own, own], 0, 25, 2.5).outcome, *(n for n in sys.modules if n.startswith("steerclear.shield")))
"""


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_imports_nothing_of_ours_from_outside(file):
    for node in ast.walk(ast.parse(file.read_text())):
        names = [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
        if isinstance(node, ast.ImportFrom):
            assert node.level <= 1, f"line {node.lineno} reaches out of the folder"
            names = [] if node.level else [node.module or ""]
        assert {name.split(".")[0] for name in names} <= ALLOWED


def test_judges_where_the_shield_cannot_be_imported():
    done = subprocess.run([sys.executable, "-c", BLOCKED], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split() == ["avoidable"]


LEVEL = Level(5, (1.0,) * 5, (0.0,), ((0.5,),))


@pytest.fixture
def run():
    """Two boats on rails that meet; the parameters and the step of their violation."""
    states = np.stack([straight_track((0, 0), (0, 2.0), 90), straight_track((0, 12.0), (0, 0), 90)], axis=1)
    return states, np.array([HERON.pack()] * 2), first_violation(states, 2.5)


@pytest.mark.parametrize("place", [(3, 0, 0), (90, 1, 2)])
@pytest.mark.parametrize("value", [np.nan, np.inf])
def test_states_that_are_not_finite_but_for_a_controller_that_has_not_run(run, place, value):
    states, rows, step = run
    states[:, :, [6, 8]] = np.nan
    judge(states, rows, 0, step, 2.5)
    states[place] = value
    with pytest.raises(OracleError, match=rf"boat {place[1]} at step {place[0]} is not finite; check the recorder"):
        judge(states, rows, 0, step, 2.5)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"states": np.zeros((5, 2, 2))}, r"shape \(steps \+ 1, boats, 11\)"),
        ({"states": [[["x"] * 11] * 2] * 3}, "must be numbers"),
        ({"states": np.zeros((1, 2, 11))}, "two boats and at least one step"),
        ({"radius_m": 0.0}, "radius_m is 0.0; give a positive"),
        ({"dt_s": -0.1}, "dt_s is -0.1; give a positive"),
        ({"own": 2}, r"no boat 2; the record's boats are 0..1"),
        ({"other": 0}, "no violation"),
        ({"step": 0}, r"no step 0 to judge; the record's steps are 1..90"),
        ({"step": 10}, "no violation of 2.5 m; give the first step inside"),
        ({"boats": np.array([HERON.pack()])}, "hold 2 boats but 1 parameter sets"),
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
        judge_violation(states, rows, (0, 1), step, 2.5, driven=driven)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Settings(look_back_s=0.0), "look_back_s must be a number of seconds, at least 0.1"),
        (lambda: Settings(quick=LEVEL._replace(width=0)), "search level needs"),
        (lambda: Motion((np.nan, 0.0)), "two finite speeds"),
        (lambda: Motion(delay_steps=(0.5, 1)), "whole number"),
        (lambda: rows_of(np.zeros((2, 37))), "give one row per boat"),
        (lambda: rows_of(np.full((1, 38), np.nan)), "not finite"),
        (lambda: Boat("ship", 2.0), "choose one of"),
        (lambda: Boat("usv", 2.0, thrust_map=((0.0, 0.0), (0.0, 1.0))), "rising thrust"),
    ],
)
def test_settings_and_boats_that_cannot_be(make, words):
    with pytest.raises(OracleError, match=words):
        make()
