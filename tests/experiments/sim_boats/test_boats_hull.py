import itertools
import math

import numpy as np
import pytest
from boat_bench import Bench, attitude
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.experiments.sim_boats import Water
from steerclear.experiments.sim_boats.hull import Hull, Keep, Steer, Weather
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.commands import Commands
from steerclear.shield.platforms import PLATFORMS, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

ANGLES = st.floats(-10.0, 10.0)
SPEEDS = st.floats(0.0, 4.0)


def hull(platform="heron", speed_mps=0.0, heading_deg=0.0, brake_mps2=1.2):
    made = Hull(get_platform(platform), 0.0, 0.0, heading_deg, brake_mps2)
    made.state[L.SPEED] = speed_mps
    return made


@pytest.mark.parametrize("platform", sorted(PLATFORMS))
@given(commands=st.lists(st.tuples(ANGLES, SPEEDS), min_size=1, max_size=40))
@settings(max_examples=15, deadline=None)
def test_a_step_ahead_in_still_water_is_the_simulators_bit_for_bit(platform, commands):
    boat = hull(platform, heading_deg=33.0)
    state, params = fresh_state(0.0, 0.0, 33.0), get_platform(platform).pack()
    for heading_rad, speed_mps in commands:
        boat.obey(Steer(heading_rad, speed_mps))
        wanted = Commands.absolute_rad([[speed_mps, heading_rad]]).as_relative_deg(np.array([state[L.HEADING]]))
        step_boat(params, state, *wanted[0], 0.1)
        assert np.array_equal(boat.state, state, equal_nan=True)


def test_goes_astern_only_through_rest_and_stern_first():
    boat = hull(speed_mps=1.0)
    speeds = []
    for _ in range(150):
        boat.obey(Steer(0.0, -1.0))
        speeds.append(boat.speed_mps)
    assert all(abs(b - a) < 0.3 for a, b in itertools.pairwise(speeds))
    assert speeds[-1] == pytest.approx(-1.0, abs=0.05)
    assert boat.state[L.Y] < 0.0
    assert boat.heading_rad == pytest.approx(0.0, abs=0.02)  # the bow still points north
    assert boat.velocity_mps[1] == pytest.approx(-1.0, abs=0.05)
    for _ in range(150):
        boat.obey(Steer(0.0, 1.0))
    assert boat.speed_mps == pytest.approx(1.0, abs=0.05)


def test_a_stop_of_the_autopilot_is_hard_or_the_platforms():
    hard, own = hull(speed_mps=2.0), hull(speed_mps=2.0, brake_mps2=None)
    for boat in (hard, own):
        for _ in range(40):
            boat.obey(Keep())
    assert hard.speed_mps == 0.0
    assert hard.state[L.Y] == pytest.approx(2.0**2 / 2.4, abs=0.1)
    assert own.state[L.Y] > 1.5 * hard.state[L.Y]


def test_backs_up_and_stays():
    boat = hull(speed_mps=1.0)
    places = []
    for _ in range(400):
        boat.obey(Keep(back_up_m=2.0))
        places.append(boat.state[L.Y])
    assert max(places) - places[-1] == pytest.approx(2.0, abs=0.15)
    assert places[-1] == places[-50]
    fastest = max(a - b for a, b in itertools.pairwise(places)) / 0.1
    assert fastest == pytest.approx(0.34, abs=0.02)


def test_returns_when_the_current_sets_it_off():
    boat = hull()
    boat.drift_mps = (0.3, 0.0)
    far = 0.0
    for _ in range(1500):
        boat.obey(Keep())
        far = max(far, math.hypot(*boat.state[:2]))
    assert 2.9 < far < 6.0


@pytest.mark.parametrize(("drift", "heading_rad"), [((0.0, 0.4), 0.0), ((0.0, -0.4), 0.0), ((0.3, 0.0), math.pi / 4)])
def test_speed_is_kept_over_ground(drift, heading_rad):
    boat = hull()
    boat.drift_mps = drift
    for _ in range(400):
        boat.obey(Steer(heading_rad, 1.0))
    vx, vy = boat.velocity_mps
    assert vx * math.sin(heading_rad) + vy * math.cos(heading_rad) == pytest.approx(1.0, abs=0.03)
    assert boat.heading_rad == pytest.approx(heading_rad, abs=0.02)


def test_wind_and_current_drift_along_the_field():
    frame = FieldFrame(42.0, -71.0, 90.0)  # the field's y axis points east
    weather = Weather(Water(current_mps=0.5, current_to_deg=90.0), frame, np.random.default_rng(0))
    assert weather.drift_mps() == pytest.approx((0.0, 0.5))
    windy = Weather(Water(wind_mps=10.0, wind_from_deg=270.0), frame, np.random.default_rng(0))
    drifts = np.array([windy.drift_mps() for _ in range(20_000)])
    assert drifts.mean(axis=0) == pytest.approx((0.0, 0.3), abs=0.02)
    assert drifts[:, 1].std() == pytest.approx(0.09, abs=0.02)


def test_noise_is_as_measured():
    errors = []
    for speed in (0.0, 1.0):
        bench = Bench(noise=1.0).guided()
        places, headings, velocities = [], [], []
        for _ in range(1500):
            bench.run(0.1, attitude(0.0, speed / 2.0))
            seen, hull_now = bench.boat.seen, bench.hull
            places.append((seen.x_m - hull_now.state[L.X], seen.y_m - hull_now.state[L.Y]))
            headings.append(math.degrees(seen.heading_rad - hull_now.heading_rad))
            velocities.append(seen.speed_mps - hull_now.speed_mps)
        errors.append([np.sqrt(np.mean(np.square(values))) for values in (places, headings, velocities)])
    (place, at_rest, velocity), (_, running, _) = errors
    assert 0.02 <= place <= 0.10
    assert 0.02 <= velocity <= 0.05
    assert 1.0 <= at_rest <= 2.5
    assert 0.15 <= running <= 0.6
