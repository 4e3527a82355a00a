"""Boats whose rudder needs way, as uSimMarineV22's: model, inverse and limits against a hull in plain Python."""

import csv
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from boat_oracle import BOATS, ThrustBoat
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn, full_turn, largest_turn
from steerclear.shield.platforms.files import parse_platform
from steerclear.shield.platforms.limits import cruise, limits_of
from steerclear.shield.platforms.proving import reference_models
from steerclear.shield.platforms.rudder import hardest_rudder, rudder_for_turn, turn_in_step

HERON, DT_S = get_platform("heron"), 0.1
NEEDS_WAY = get_platform("heron_v22")


@st.composite
def boats(draw):
    """Any boat that needs way: its platform, and the same boat in plain Python."""
    full, loss = draw(st.floats(0.3, 8.0)), draw(st.one_of(st.just(0.0), st.floats(0.05, 1.0)))
    acc, dec, gain = draw(st.floats(0.0, 2.0)), draw(st.floats(0.0, 2.0)), draw(st.floats(5.0, 100.0))
    acc, dec = (0.0 if value < 0.1 else value for value in (acc, dec))
    with reference_models():
        platform = replace(
            HERON, name="any", full_turn_speed_mps=full, turn_loss=loss, max_acc=acc, max_dec=dec, turn_gain=gain
        )
    changes = {"full_turn_speed": full, "turn_loss": loss, "max_acc": acc, "max_dec": dec, "turn_rate": gain}
    return platform, {**BOATS["heron"], **changes}


def apart_deg(a, b):
    return abs(math.remainder(a - b, 360.0))


@given(boat=boats(), seed=st.integers(0, 2**32 - 1), dt=st.sampled_from([0.05, 0.1, 0.2]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_a_minute_of_any_commands_is_sailed_as_by_the_plain_hull(boat, seed, dt):
    platform, numbers = boat
    random, params = np.random.default_rng(seed), platform.pack()
    row = fresh_state(3.0, -7.0, 170.0, random.uniform(0.0, 2.0))
    plain = ThrustBoat(numbers, 3.0, -7.0, 170.0, row[L.SPEED])
    for k in range(round(60.0 / dt)):
        if k % 20 == 0:
            speed, course = random.uniform(-0.5, 2.5), random.uniform(-180.0, 180.0)
        error = math.remainder(course - plain.heading, 360.0)
        step_boat(params, row, speed, error, dt)
        plain.step(speed, error, dt)
        assert row[[L.X, L.Y, L.SPEED]] == pytest.approx([plain.x, plain.y, plain.speed], rel=0, abs=1e-9)
        assert apart_deg(row[L.HEADING], plain.heading) < 1e-9


SITUATION = {
    "speed": st.floats(0.0, 2.0),
    "thrust": st.floats(0.0, 100.0),
    "limit": st.sampled_from([100.0, 60.0]),
    "dt": st.sampled_from([0.1, 0.2]),
}


@given(boat=boats(), share=st.floats(-1.3, 1.3), **SITUATION)
@settings(max_examples=400, deadline=None, derandomize=True)
def test_the_smallest_rudder_for_a_turn_is_found_or_that_of_the_nearest_turn(boat, share, speed, thrust, limit, dt):
    params = boat[0].pack()
    rudders = np.linspace(0.0, limit, 2001)
    turns = np.array([turn_in_step(params, speed, thrust, rudder, dt) for rudder in rudders])
    hardest = hardest_rudder(params, speed, thrust, limit, dt)
    most = turn_in_step(params, speed, thrust, hardest, dt)
    assert 0.0 <= hardest <= limit
    assert most >= turns.max() - 1e-9
    turn = share * most
    rudder = rudder_for_turn(params, speed, thrust, turn, limit, dt)
    made = turn_in_step(params, speed, thrust, rudder, dt)
    assert made == pytest.approx(math.copysign(min(abs(turn), most), turn), rel=0, abs=1e-9)
    if abs(share) <= 1.0 and most > 1e-6:
        before = turns[rudders < abs(rudder) - 1e-6]
        assert before.max(initial=0.0) <= abs(turn) + 1e-9, "a smaller one makes it, too"


@given(boat=boats(), share=st.floats(-1.0, 1.0), speed=st.floats(0.0, 2.0), thrust=st.floats(0.0, 100.0))
@settings(max_examples=100, deadline=None, derandomize=True)
def test_turns_up_to_the_full_one_are_made_exactly(boat, share, speed, thrust):
    params, row = boat[0].pack(), fresh_state(0.0, 0.0, 40.0, speed)
    row[L.THRUST] = thrust
    turn = share * full_turn(params, row, 1.5, DT_S)
    after = row.copy()
    step_boat(params, after, 1.5, command_for_turn(params, row, 1.5, turn, DT_S), DT_S)
    assert math.remainder(after[L.HEADING] - row[L.HEADING], 360.0) == pytest.approx(turn, rel=0, abs=1e-9)


@given(boat=boats(), share=st.floats(-1.0, 1.0), speed=st.floats(0.3, 2.0), thrust=st.floats(5.0, 100.0))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_turns_of_a_step_of_several_moves_are_made_exactly(boat, share, speed, thrust):
    params, row = np.append(boat[0].pack(), DT_S), fresh_state(0.0, 0.0, 40.0, speed)
    row[L.THRUST] = thrust
    turn = share * full_turn(params, row, 1.5, 0.5)
    after = row.copy()
    step_boat(params, after, 1.5, command_for_turn(params, row, 1.5, turn, 0.5), 0.5)
    assert math.remainder(after[L.HEADING] - row[L.HEADING], 360.0) == pytest.approx(turn, rel=0, abs=1e-7)


@given(boat=boats(), seed=st.integers(0, 2**32 - 1))
@settings(max_examples=25, deadline=None, derandomize=True)
def test_no_commands_turn_a_boat_faster_than_its_limit(boat, seed):
    platform, random = boat[0], np.random.default_rng(seed)
    params, row = cruise(platform)
    most = limits_of(platform).turn_rate_dps
    for k in range(600):
        if k % 7 == 0:
            speed, error = random.choice([0.0, 1.0, 2.0]), random.choice([-179.0, -20.0, 0.0, 20.0, 179.0])
        before = row[L.HEADING]
        assert largest_turn(params, row, DT_S) / DT_S <= most * (1.0 + 1e-9)
        step_boat(params, row, speed, error, DT_S)
        assert apart_deg(row[L.HEADING], before) / DT_S <= most * (1.0 + 1e-9)


@pytest.mark.parametrize("drift_dps", [-10.0, 10.0])
@pytest.mark.parametrize("boat", [HERON, replace(NEEDS_WAY, full_turn_speed_mps=2.0)])
def test_the_turn_that_is_always_there_adds_to_the_limit_on_either_side(boat, drift_dps):
    platform = replace(boat, rotate_speed_dps=drift_dps)
    assert limits_of(platform).turn_rate_dps == pytest.approx(limits_of(boat).turn_rate_dps + 10.0)
    params, row = cruise(platform)
    before = row[L.HEADING]
    step_boat(params, row, 2.0, math.copysign(179.0, drift_dps), DT_S)
    assert apart_deg(row[L.HEADING], before) / DT_S <= limits_of(platform).turn_rate_dps * (1.0 + 1e-9)


def test_the_limits_are_what_the_boat_does():
    params, row = cruise(NEEDS_WAY)
    limits, turned, steps = limits_of(NEEDS_WAY), 0.0, 0
    step_boat(params, row.copy(), 2.0, 179.0, DT_S)
    first = row.copy()
    step_boat(params, first, 2.0, command_for_turn(params, row, 2.0, 90.0, DT_S), DT_S)
    assert limits.turn_rate_dps == pytest.approx(48.0)
    assert apart_deg(first[L.HEADING], row[L.HEADING]) / DT_S == pytest.approx(48.0, rel=0.03)
    while turned < 180.0:
        before = row[L.HEADING]
        step_boat(params, row, 2.0, command_for_turn(params, row, 2.0, 90.0, DT_S), DT_S)
        turned, steps = turned + math.remainder(row[L.HEADING] - before, 360.0), steps + 1
    assert steps * DT_S == pytest.approx(limits.half_turn_s, abs=1e-9)
    assert limits.half_turn_s > 3.0 * limits_of(HERON).half_turn_s
    assert NEEDS_WAY.max_turn_rate_at(1.0) == pytest.approx(0.2 * HERON.max_turn_rate_at(1.0))


def test_a_boat_at_rest_is_not_believed_to_turn():
    params, row = NEEDS_WAY.pack(), fresh_state(0.0, 0.0, 0.0)
    for thrust in (0.0, 50.0, 100.0):
        row[L.THRUST] = thrust
        assert turn_in_step(params, 0.0, 0.0, 100.0, DT_S) == 0.0
    row[L.THRUST] = 0.0
    assert largest_turn(params, row, DT_S) == 0.0
    assert full_turn(params, row, 0.0, DT_S) == 0.0
    assert full_turn(params, row, 2.0, DT_S) < 0.01
    assert command_for_turn(params, row, 0.0, 5.0, DT_S) == 0.0


def test_the_recorded_simulator_turns_so():
    """uSimMarineV22, turn_rate 70: turns by rudder, thrust and speed within 3 %; taken as uSimMarine less than half."""
    path = Path(__file__).parents[2] / "data" / "moos_steps" / "v22_turn_at_2_mps.csv"
    with path.open() as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    params = replace(HERON, turn_gain=70.0, full_turn_speed_mps=5.0).pack()
    plain = replace(HERON, turn_gain=70.0).pack()
    shares, wrong = [], []
    for one, two, three in zip(rows, rows[1:], rows[2:], strict=False):
        if abs(one["des_rudder"]) < 2.0:
            continue
        made = math.remainder(two["nav_heading"] - one["nav_heading"], 360.0)
        step = two["t"] - one["t"], two["des_thrust"], three["des_rudder"]
        for found, row in ((shares, params), (wrong, plain)):
            state = (row, two["nav_speed"], step[1], step[2], step[0])
            found.append(made / turn_at(*state))
    assert np.median(shares) == pytest.approx(1.0, abs=0.03)
    assert np.subtract(*np.percentile(shares, [90, 10])) < 0.1
    assert np.median(wrong) < 0.5


def turn_at(params, speed, thrust, rudder, dt):
    """The turn at a speed that is held."""
    held = params.copy()
    held[[L.MAX_ACC, L.MAX_DEC]] = 1e-9
    return turn_in_step(held, speed, thrust, rudder, dt)


def test_only_boats_with_a_rudder_take_the_entry():
    with pytest.raises(PlatformError, match=r"full_turn_speed_mps is for boats of kind .?usv"):
        replace(get_platform("blueboat"), name="tub", full_turn_speed_mps=1.0)
    with pytest.raises(PlatformError, match="full_turn_speed_mps is -1"):
        replace(HERON, name="tub", full_turn_speed_mps=-1.0)
    with pytest.raises(PlatformError, match=r"commanded to turn.*give its full_turn_speed_mps"):
        replace(HERON, name="tub", full_turn_speed_mps=5000.0)
    text = "name: tub\nkind: usv\nmax_speed_mps: 2\nthrust_map: [[0, 0], [100, 2]]\nturn_gain: 60\nspeed_factor: 50\n"
    text += "max_dec: 0.5\nheading_pid: {kp: 0.9}\nfull_turn_speed_mps: 5\n"
    assert parse_platform(text).platform.pack()[L.FULL_TURN_SPEED] == 5.0
    assert HERON.pack()[L.FULL_TURN_SPEED] == 0.0
