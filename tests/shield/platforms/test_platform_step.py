"""Models of boats against the boats written down a second time and measurements; their inverse."""

import csv
import math
from pathlib import Path

import numpy as np
import pytest
from boat_oracle import oracle
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.shield import Fleet, Shield, ShieldConfig
from steerclear.shield.commands import Commands
from steerclear.shield.platforms import PLATFORMS, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import FARTHEST_DEG, actuate, command_for_turn, largest_turn
from steerclear.shield.platforms.limits import cruise, limits_of
from steerclear.shield.platforms.rate import error_for_rate, rate_for_error
from steerclear.shield.platforms.usv import wrap_degrees

NAMES = sorted(PLATFORMS)

COMMANDS = st.lists(
    st.tuples(st.floats(-2.0, 14.0), st.one_of(st.floats(-180.0, 180.0), st.floats(-1e4, 1e4))), min_size=1, max_size=40
)


def apart_deg(a, b):
    return abs(math.remainder(a - b, 360.0))


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data(), commands=COMMANDS, dt=st.sampled_from([0.05, 0.1, 0.25]))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_steps_follow_the_published_model(name, data, commands, dt):
    top = get_platform(name).max_speed_mps
    x, y = data.draw(st.floats(-200.0, 200.0)), data.draw(st.floats(-200.0, 200.0))
    heading, speed = data.draw(st.floats(-180.0, 180.0)), data.draw(st.floats(0.0, top))
    params, row = get_platform(name).pack(), fresh_state(x, y, heading, speed)
    boat = oracle(name, x, y, heading, speed)
    for wanted, error in commands:
        step_boat(params, row, wanted, error, dt)
        boat.step(wanted, error, dt)
        assert row[[L.X, L.Y, L.SPEED]] == pytest.approx([boat.x, boat.y, boat.speed], rel=0, abs=1e-8)
        assert apart_deg(row[L.HEADING], boat.heading) < 1e-8
        assert -180.0 <= row[L.HEADING] <= 180.0


@given(st.floats(-720.0, 720.0))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_wrapping_keeps_the_direction(angle):
    wrapped = wrap_degrees(angle)
    assert -180.0 <= wrapped <= 180.0
    assert apart_deg(wrapped, angle) < 1e-9


def test_any_angle_comes_back_in_range_at_once_and_none_stays_none():
    for angle in (1e300, -1e300, 541.0, -541.0, 1e16):
        assert -180.0 <= wrap_degrees(angle) <= 180.0
    for angle in (math.inf, -math.inf, math.nan):
        assert math.isnan(wrap_degrees(angle))


@st.composite
def situations(draw, name):
    """A boat some steps into a random run, so that its controllers' memory is one it can have."""
    platform = get_platform(name)
    row = fresh_state(0.0, 0.0, draw(st.floats(-180.0, 180.0)), draw(st.floats(0.0, platform.max_speed_mps)))
    if name not in ("si", "di"):
        row[L.THRUST] = draw(st.floats(0.0, platform.max_thrust))
    params = platform.pack()
    for _ in range(draw(st.integers(0, 6))):
        step_boat(params, row, draw(st.floats(0.0, platform.max_speed_mps)), draw(st.floats(-180.0, 180.0)), 0.1)
    return params, row, draw(st.floats(0.0, platform.max_speed_mps)), draw(st.floats(-1.0, 1.0))


def turn_made(params, row, speed, error, dt=0.1):
    after = row.copy()
    step_boat(params, after, speed, error, dt)
    return (after[L.HEADING] - row[L.HEADING] + 180.0) % 360.0 - 180.0


def reachable_turn(params, row, speed, share):
    """A share of the turns, deg, the boat can make in this step, found by asking for far too much both ways."""
    ends = []
    for ask in (-1e3, 1e3):
        after = row.copy()
        actuate(params, after, speed, ask, 0.1)
        ends.append((after[L.HEADING] - row[L.HEADING] + 180.0) % 360.0 - 180.0)
    return ends[0] + 0.5 * (share + 1.0) * (ends[1] - ends[0])


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
@settings(max_examples=120, deadline=None, derandomize=True)
def test_the_autopilot_makes_exactly_the_turn_asked_for(name, data):
    params, row, speed, share = data.draw(situations(name))
    turn = reachable_turn(params, row, speed, share)
    before = row.copy()
    error = command_for_turn(params, row, speed, turn, 0.1)
    assert row.tobytes() == before.tobytes(), "the inverse must not advance the controllers"
    assert -FARTHEST_DEG <= error <= FARTHEST_DEG
    assume(abs(error) < FARTHEST_DEG)
    assert turn_made(params, row, speed, error) == pytest.approx(turn, rel=0, abs=1e-9)


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data(), turn=st.floats(-400.0, 400.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_beyond_the_limits_the_nearest_turn_is_made(name, data, turn):
    params, row, speed, _ = data.draw(situations(name))
    error = command_for_turn(params, row, speed, turn, 0.1)
    assert -FARTHEST_DEG <= error <= FARTHEST_DEG
    made = turn_made(params, row, speed, error)
    for other in np.linspace(-FARTHEST_DEG, FARTHEST_DEG, 25):
        assert abs(made - turn) <= abs(turn_made(params, row, speed, other) - turn) + 1e-9


@pytest.mark.parametrize("name", ["heron", "surveyor", "large_usv", "mctf2024_sim"])
def test_without_thrust_there_is_nothing_to_command(name):
    params, row = get_platform(name).pack(), fresh_state(0.0, 0.0, 0.0, 1.0)
    assert command_for_turn(params, row, 0.0, 5.0, 0.1) == 0.0
    assert largest_turn(params, row, 0.1) == 0.0


@pytest.mark.parametrize(("name", "seconds", "metres"), [("heron", 19.0, 9.8), ("surveyor", 24.0, 36.0)])
def test_commanded_stop_takes_as_long_as_measured(name, seconds, metres):
    params, row = cruise(get_platform(name))
    steps = 0
    while row[L.SPEED] > 0.02:
        step_boat(params, row, 0.0, 0.0, 0.1)
        steps += 1
    assert steps * 0.1 == pytest.approx(seconds, abs=0.5)
    assert row[L.Y] == pytest.approx(metres, rel=0.02)


@pytest.mark.parametrize(("name", "seconds"), [("heron", 4.5), ("surveyor", 19.0)])
def test_a_right_angle_by_command_takes_as_long_as_measured(name, seconds):
    params, row = cruise(get_platform(name))
    steps = 0
    while abs(90.0 - row[L.HEADING]) > 5.0:
        step_boat(params, row, params[L.MAX_SPEED], 90.0 - row[L.HEADING], 0.1)
        steps += 1
    assert steps * 0.1 == pytest.approx(seconds, abs=0.4)


@pytest.mark.parametrize(
    ("name", "speed", "rate"),
    [
        ("heron", 2.0, 120.0),
        ("heron", 1.5, 84.0),
        ("heron", 1.0, 48.0),
        ("surveyor", 3.0, 20.0),
        ("surveyor", 2.0, 12.0),
        ("surveyor", 1.5, 8.0),
        ("surveyor", 1.0, 4.0),
        ("si", 5.0, 90.0),
    ],
)
def test_best_turn_rates(name, speed, rate):
    assert get_platform(name).max_turn_rate_at(speed) == pytest.approx(rate)


def seconds_to_thrust(platform, state):
    params, step = platform.pack(), 0
    while state[L.THRUST] < 0.9 * limits_of(platform).thrust:
        step_boat(params, state, platform.max_speed_mps, 0.0, 0.1)
        step += 1
    return 0.1 * step


@pytest.mark.parametrize(("name", "about_s"), [("heron", 13.2), ("surveyor", 15.0)])
def test_thrust_is_back_in_time_from_rest_and_out_of_any_stop(name, about_s):
    platform = get_platform(name)
    longest = limits_of(platform).thrust_s
    assert longest == pytest.approx(about_s, abs=2.0)
    assert seconds_to_thrust(platform, fresh_state(0.0, 0.0, 0.0)) <= longest + 1e-9
    params, slowing = cruise(platform)
    worst = 0.0
    for _ in range(250):
        step_boat(params, slowing, 0.0, 0.0, 0.1)
        worst = max(worst, seconds_to_thrust(platform, slowing.copy()))
    assert worst <= longest + 0.2


@pytest.mark.parametrize("name", NAMES)
def test_no_run_of_commands_turns_faster_than_the_limits_say(name):
    """Opponents are granted the limit: a boat that turns faster would not be covered."""
    platform = get_platform(name)
    params, row = cruise(platform)
    fastest = 0.0
    for step in range(300):
        before = row[L.HEADING]
        error = 179.0 if (step // 60) % 2 == 0 else -179.0
        step_boat(params, row, params[L.MAX_SPEED], error, 0.1)
        fastest = max(fastest, abs(math.remainder(row[L.HEADING] - before, 360.0)) / 0.1)
    assert fastest <= limits_of(platform).turn_rate_dps * (1.0 + 1e-9)


@pytest.mark.parametrize("name", NAMES)
def test_no_run_of_commands_gains_speed_faster_than_the_limits_say(name):
    platform = get_platform(name)
    params, row = cruise(platform)
    random = np.random.default_rng(4)
    speeds = []
    for _ in range(60):
        speed, error = random.uniform(0.0, params[L.MAX_SPEED]), random.uniform(-180.0, 180.0)
        for _ in range(random.integers(1, 40)):
            step_boat(params, row, speed if random.random() < 0.5 else params[L.MAX_SPEED], error, 0.1)
            speeds.append(float(row[L.SPEED]))
    gains = np.subtract(speeds[5:], speeds[:-5]) / 0.5
    assert gains.max() <= limits_of(platform).acceleration_mps2 * 1.02


STEPS = Path(__file__).parents[2] / "data" / "boat_steps"

RATE_BOATS = ("ardurover_boat", "blueboat", "otter")


@pytest.mark.parametrize("name", RATE_BOATS)
@given(rate=st.floats(-120.0, 120.0))
@settings(max_examples=60, deadline=None, derandomize=True)
def test_the_error_that_asks_for_a_rate_asks_for_that_rate(name, rate):
    params = get_platform(name).pack()
    assert rate_for_error(params, error_for_rate(params, rate)) == pytest.approx(rate, abs=1e-9)


def test_an_otter_stops_and_turns_as_published():
    params, row = cruise(get_platform("otter"))
    assert row[L.SPEED] == pytest.approx(3.2, abs=0.01)
    while row[L.SPEED] > 0.05 * 3.2:
        step_boat(params, row, 0.0, 0.0, 0.1)
    assert math.hypot(row[L.X], row[L.Y]) == pytest.approx(4.0, abs=0.1)
    params, row = cruise(get_platform("otter"))
    steps = 0
    while abs(90.0 - row[L.HEADING]) > 5.0:
        step_boat(params, row, params[L.MAX_SPEED], 90.0 - row[L.HEADING], 0.1)
        steps += 1
    assert steps * 0.1 == pytest.approx(15.4, abs=0.2)


def test_the_shipped_rover_turns_as_the_recorded_one():
    """A right angle at 2 m/s: the heading stays within 6 deg of the record, a delay of 0.1 s allowed for."""
    with (STEPS / "ardurover_stock_heading90R_v2.csv").open() as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    times = np.array([row["t_s"] for row in rows])
    headings = np.array([row["yaw_deg_unwrapped"] for row in rows])
    params, boat = get_platform("ardurover_boat").pack(), fresh_state(0.0, 0.0, 0.0, 2.0)
    for k in range(80):
        seen = float(np.interp(0.1 * k, times, headings))
        assert boat[L.HEADING] == pytest.approx(seen, abs=6.0)
        step_boat(params, boat, 2.0, (90.0 if k >= 1 else 0.0) - boat[L.HEADING], 0.1)


def closest_m(name, seed, shielded=True):
    """Two boats meet head on, one of them ours: how near they come."""
    platform = get_platform(name)
    params, top = platform.pack(), platform.max_speed_mps
    random = np.random.default_rng(seed)
    states = np.array([fresh_state(0.0, 0.0, 0.0, top), fresh_state(random.uniform(-2, 2), 60.0, 180.0, top)])
    shield, nearest = Shield(ShieldConfig(dt_s=0.1)), math.inf
    for _ in range(200):
        error = [math.degrees(0.0) - states[0, L.HEADING], 180.0 - states[1, L.HEADING]]
        wanted = np.array([[top, math.remainder(e, 360.0)] for e in error])
        fleet = Fleet(states.copy(), np.array([0, 1]), (name, name), np.array([True, False]), ("ours", "theirs"))
        sent = shield.decide(fleet, Commands.relative_deg(wanted)).filtered.values if shielded else np.radians(wanted)
        for i in range(2):
            command = sent[i] if i == 0 and shielded else wanted[i]
            step_boat(params, states[i], command[0], command[1], 0.1)
        nearest = min(nearest, float(np.hypot(*(states[0, :2] - states[1, :2]))))
    return nearest


@pytest.mark.parametrize("name", RATE_BOATS)
def test_the_shield_keeps_them_apart_head_on(name):
    assert closest_m(name, 3, shielded=False) < 2.5
    assert closest_m(name, 3) >= 2.5
