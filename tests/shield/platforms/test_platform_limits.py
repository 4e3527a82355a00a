"""What the boats can do, against measurements of the reference simulator."""

import math

import numpy as np
import pytest
from steerclear.shield.platforms import PLATFORMS, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import cruise, limits_of

NAMES = sorted(PLATFORMS)


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
