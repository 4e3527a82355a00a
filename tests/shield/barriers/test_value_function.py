"""Value tables as the certificate uses them, and opponents without a table."""

import math
from dataclasses import replace

import numpy as np
import pytest
from shield_scenes import fleet_of, relative
from steerclear.shield import Shield
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import actuate, largest_turn
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.tables.files import load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, table_value

SURVEYOR = get_platform("surveyor")


def at_thrust(fleet, percent):
    state = fleet.state.copy()
    state[:, L.THRUST] = percent
    return replace(fleet, state=state)


def apart(x, y, heading, own_mps=3.0, other_mps=3.0, kind="surveyor", percent=100.0):
    """A boat of ours at the origin heading north, and an opponent, both at that thrust."""
    return at_thrust(fleet_of([(0, 0, 0, own_mps), (x, y, heading, other_mps)], [0, 1], kind), percent)


def answers(fleet, **settings):
    decisions = Shield(**{"profile": "ramming", **settings}).decide(fleet, relative((3.0, 0.0), (3.0, 0.0)))
    return decisions.filtered.values.tolist(), decisions.reason.tolist(), decisions.safety_margin_m.tolist()


def looked_up_by_hand(fleet):
    """Least value over an opponent that goes straight on or turns hard, one step after the own boat went straight."""
    params, tables = SURVEYOR.pack(), stack_tables([load_table("surveyor", "surveyor")])
    own = fleet.state[0].copy()
    step_boat(params, own, 3.0, 0.0, 0.1)
    least = math.inf
    for turn in (0.0, 1.0, -1.0):
        other = fleet.state[1].copy()
        speed = 3.0 if turn else other[L.SPEED]
        actuate(params, other, speed, turn * 2.0 * largest_turn(params, other, 0.1), 0.1)
        there = other[L.X] - own[L.X], other[L.Y] - own[L.Y]
        headings = math.radians(own[L.HEADING]), math.radians(other[L.HEADING])
        least = min(least, table_value(tables, 0, WHOLE_S, *there, *headings, own[L.SPEED], other[L.SPEED]))
    return least


def test_where_the_worst_opponent_counts_the_certificate_is_that_value():
    met = 0
    for k in range(20):
        fleet = apart(9.0, 18.0 + k, 180.0)
        _, reason, certificate = answers(fleet, buffer_m=0.05, table_margin_m=0.4)
        if reason[0] == 0 and certificate[0] < 1.9:
            assert certificate[0] == pytest.approx(looked_up_by_hand(fleet) - 2.95, abs=1e-9)
            met += 1
    assert met > 2


def test_a_gap_between_two_that_lie_still_is_seen_as_one():
    """Tables are about one boat at a time: each of the two can be passed, both together cannot."""
    rows = [(0, 0, 0, 3), (-2.4, 25.0, 90, 0), (2.4, 25.0, 90, 0)]
    fleet = at_thrust(fleet_of(rows, [0, 1, 1], "surveyor"), 100.0)
    shield, state = Shield(profile="ramming"), fleet.state.copy()
    least = math.inf
    for _ in range(250):
        decisions = shield.decide(replace(fleet, state=state.copy()), relative((3.0, 0.0), (0.0, 0.0), (0.0, 0.0)))
        step_boat(SURVEYOR.pack(), state[0], *decisions.filtered.values[0], 0.1)
        least = min(least, np.hypot(*(state[1:, :2] - state[0, :2]).T).min())
    assert least > 2.5


@pytest.mark.parametrize(
    ("fleet", "settings"),
    [
        (apart(1.0, 9.0, 180.0, 2.0, 2.0, "heron"), {}),
        (apart(1.0, 24.0, 180.0), {"position_error_m": 1.5}),
    ],
    ids=["nimble boats", "a radius beyond the table"],
)
def test_where_no_table_answers_opponents_are_run_through(fleet, settings):
    same = {"table_cbf_rate_per_s": 1.0, **settings}  # the rate is the boat's, whoever answers
    assert answers(fleet, **same) == answers(fleet, opponent_model="turning_circle", **same)


def test_boats_that_lack_the_thrust_the_table_is_for_are_run_through():
    """The run lasts a little longer than without a table: until thrust is what the table needs."""
    fleet = apart(1.0, 24.0, 180.0, percent=40.0)
    sent, reason, certificate = answers(fleet, table_cbf_rate_per_s=1.0)
    same = answers(fleet, table_cbf_rate_per_s=1.0, opponent_model="turning_circle")
    assert (sent, reason) == same[:2]
    assert certificate == pytest.approx(same[2], abs=0.05)
    assert certificate[0] < 0.0


def test_a_boat_without_a_table_is_run_through_and_the_log_says_so(caplog):
    stranger = replace(SURVEYOR, name="surveyor_lighter", max_acc=0.16)
    fleet = replace(apart(1.0, 24.0, 180.0), platforms=(stranger, stranger))
    same = {"table_cbf_rate_per_s": 1.0}
    assert answers(fleet, **same) == answers(fleet, opponent_model="turning_circle", **same)
    assert "steerclear reach solve --own surveyor_lighter" in caplog.text


def test_decisions_name_the_opponents_without_a_table():
    stranger = replace(SURVEYOR, name="surveyor_slower", max_acc=0.15)
    rows = [(0.0, 0.0, 0.0, 3.0), (60.0, 0.0, 0.0, 3.0), (0.0, 90.0, 180.0, 3.0), (60.0, 90.0, 180.0, 3.0)]
    fleet = fleet_of(rows, [0, 0, 1, 1])
    fleet = replace(fleet, platforms=("surveyor", "heron", "surveyor", stranger))
    wanted = relative(*[(2.0, 0.0)] * 4)
    told = {
        certificate: Shield(opponent_model=certificate).decide(fleet, wanted) for certificate in ("auto", "value_table")
    }
    assert [d.no_table for d in told["auto"]] == [("boat_3",), (), (), ()]  # herons are not looked up, opponents never
    assert [d.no_table for d in told["value_table"]] == [("boat_3",), ("boat_3",), (), ()]
    tame = Shield(profile="constant_velocity").decide(fleet, wanted)  # no table is wanted
    assert [d.no_table for d in tame] == [()] * 4
