"""Own boats followed by their model: bit for bit while telemetry agrees, corrected where it does not."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.bridge.estimator import Estimator
from steerclear.shield.bridge.messages import BoatReading
from steerclear.shield.config import ShieldConfig
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracks import steps_of_delay

DT_S = 0.1


def reading(row, now_s, age_s=0.0, **changed):
    values = {
        "position_m": (float(row[L.X]), float(row[L.Y])),
        "position_age_s": age_s,
        "heading_rad": math.radians(row[L.HEADING]) % (2 * math.pi),
        "heading_age_s": age_s,
        "speed_mps": float(row[L.SPEED]),
        "velocity_age_s": age_s,
    }
    return BoatReading("blue_1", now_s, **{**values, **changed})


def sail(platform, commands, delay_steps=0, noise=None, heading_deg=90.0, wind_mps=0.0):
    """Simulated boat and its estimate, step by step; commands (speed, absolute heading deg)."""
    params, row = get_platform(platform).pack(), fresh_state(3.0, 4.0, heading_deg, 0.0)
    estimator = Estimator(get_platform(platform), DT_S, delay_steps * DT_S)
    queue = [None] * delay_steps
    random = np.random.default_rng(0)
    pairs = []
    for k, (speed, heading) in enumerate(commands):
        now = 50.0 + k * DT_S
        seen = row.copy()
        if noise is not None:
            seen[[L.X, L.Y, L.HEADING, L.SPEED]] += random.normal(size=4) * noise
        estimator.advance(now)
        estimator.correct(reading(seen, now))
        estimate = estimator.estimate(now)
        pairs.append((row.copy(), estimate.row))
        estimator.sent(now, math.radians(heading), speed)
        queue.append((speed, float(np.degrees(math.radians(heading)))))
        command = queue.pop(0)
        if command is not None:
            error = (command[1] - row[L.HEADING] + 180.0) % 360.0 - 180.0
            step_boat(params, row, command[0], error, DT_S)
        row[L.X] += wind_mps * DT_S
    return pairs


COMMANDS = st.lists(st.tuples(st.floats(0.0, 2.0), st.integers(-180, 180)), min_size=2, max_size=5)


@settings(deadline=None, max_examples=15, derandomize=True)
@given(COMMANDS, st.integers(0, 3), st.sampled_from(["heron", "surveyor"]))
def test_a_boat_that_obeys_its_model_is_the_simulators_bit_for_bit(commands, delay, platform):
    held = [command for command in commands for _ in range(12)]
    for truth, believed in sail(platform, held, delay):
        if delay and not truth[L.SPEED]:
            continue  # before its first command works
        np.testing.assert_array_equal(believed, truth)


@pytest.mark.parametrize(("delay_s", "steps"), [(0.04, 1), (0.1, 1), (0.14, 2), (0.3, 3), (0.31, 4)])
def test_a_delay_between_steps_is_counted_up_as_the_shield_counts_it(delay_s, steps):
    """Else the boat would have carried out a command that the shield has on its way yet, and carries out again."""
    assert steps == steps_of_delay(ShieldConfig(delay_s=delay_s, dt_s=DT_S))
    estimator = Estimator(get_platform("heron"), DT_S, delay_s)
    estimator.correct(reading(fresh_state(0.0, 0.0, 0.0, 1.0), 50.0))
    turned = []
    for k in range(6):
        estimator.sent(50.0 + k * DT_S, math.radians(90.0), 2.0)
        estimator.advance(50.0 + (k + 1) * DT_S)
        turned.append(estimator.estimate(50.0 + (k + 1) * DT_S).row[L.HEADING] != 0.0)
    assert turned == [k >= steps for k in range(6)]


def test_noise_is_smoothed_and_memory_stays_the_boats():
    noise = np.array([0.06, 0.06, 1.0, 0.04])
    commands = [(2.0, 90.0)] * 60 + [(2.0, 30.0)] * 60 + [(1.0, -60.0)] * 60
    pairs = sail("heron", commands, 1, noise)[20:]
    error = np.array([believed - truth for truth, believed in pairs])
    error[:, L.HEADING] = (error[:, L.HEADING] + 180.0) % 360.0 - 180.0
    spread = np.sqrt((error[:, [L.X, L.Y, L.HEADING, L.SPEED]] ** 2).mean(axis=0))
    assert (spread < 0.9 * noise).all()
    thrust = np.abs([believed[L.THRUST] - truth[L.THRUST] for truth, believed in pairs])
    assert np.median(thrust) < 5.0


def test_a_surprise_starts_afresh_where_the_boat_is():
    estimator = Estimator(get_platform("heron"), DT_S, 0.0)
    estimator.correct(reading(fresh_state(0.0, 0.0, 0.0, 0.0), 0.0))
    estimator.advance(DT_S)
    estimator.correct(reading(fresh_state(2.5, 0.0, 70.0, 1.0), DT_S))
    row = estimator.estimate(DT_S).row
    assert row[[L.X, L.SPEED]] == pytest.approx([2.5, 1.0])
    assert row[L.THRUST] == pytest.approx(40.0)
    assert math.isnan(row[L.HEADING_ERROR])


def test_a_standstill_of_the_loop_is_made_up_in_bounds():
    estimator = Estimator(get_platform("heron"), DT_S, 0.0)
    estimator.correct(reading(fresh_state(0.0, 0.0, 0.0, 2.0), 0.0))
    estimator.sent(0.0, 0.0, 2.0)
    estimator.advance(1e6)
    assert np.isfinite(estimator.estimate(1e6).row[:4]).all()
    assert estimator.estimate(1e6).row[L.Y] < 2.0 * 5.1
