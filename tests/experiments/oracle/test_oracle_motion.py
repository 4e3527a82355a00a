"""Records in which a current carried the boats or commands came late: forgetting either would turn the verdict."""

import numpy as np
from oracle_runs import DT_S, driven_track, first_breach
from steerclear.experiments.oracle import Boat, Motion, Outcome, Responsible, judge, judge_breach
from steerclear.shield.platforms import fresh_state, get_platform

RADIUS_M = 2.5
HERON = get_platform("heron")
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
    step = first_breach(states, RADIUS_M)
    told = judge(states, boats, 0, step, RADIUS_M, motion=Motion(CURRENT))
    assert told.outcome is Outcome.AVOIDABLE
    forgotten = judge(states, boats, 0, step, RADIUS_M)
    assert forgotten.outcome is Outcome.UNAVOIDABLE  # it cannot outrun a boat that seems to come at 0.5 m/s


def head_on(gap_m, steps):
    """Two herons at full speed towards each other."""
    south, north = fresh_state(0.0, 0.0, 0.0, 2.0), fresh_state(0.0, gap_m, 180.0, 2.0)
    south[4] = north[4] = 100.0
    rows = [driven_track(HERON.pack(), boat, [(2.0, 0.0)] * steps) for boat in (south, north)]
    return np.stack(rows, axis=1), np.array([HERON.pack()] * 2)


def test_no_command_arrived_in_time():
    states, rows = head_on(12.0, 80)
    step = first_breach(states, RADIUS_M)
    told = judge(states, rows, 0, step, RADIUS_M, motion=Motion(delay_steps=(20, 0)))
    assert (told.outcome, told.last_preventable_s, told.exhausted) == (Outcome.UNAVOIDABLE, None, True)
    forgotten = judge(states, rows, 0, step, RADIUS_M)
    assert forgotten.outcome is Outcome.AVOIDABLE
    assert step - forgotten.last_step < 20 < step  # commands of the first moments come too late


def test_who_had_the_last_chance_is_a_matter_of_when_commands_were_given():
    states, rows = head_on(30.0, 120)
    step = first_breach(states, RADIUS_M)
    at_once = judge_breach(states, rows, (0, 1), step, RADIUS_M)
    late = judge_breach(states, rows, (0, 1), step, RADIUS_M, motion=Motion(delay_steps=(5, 0)))
    assert (at_once.responsible, late.responsible) == (Responsible.BOTH, Responsible.SECOND)
    assert late.first.last_step == at_once.first.last_step - 5
    assert late.first.plan.begin_step == at_once.first.plan.begin_step
    assert late.second.last_step == at_once.second.last_step
