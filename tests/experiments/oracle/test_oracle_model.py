"""The oracle's boat against the package's boat and against the recorded simulator."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.trace import load_trace
from steerclear.experiments.oracle.boat_model import DOWN, HOLD, UP, command_of, rows_of, step
from steerclear.shield.platforms import PLATFORMS, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L

TRACES = Path(__file__).parents[2] / "data" / "traces"
PLAIN = ("heron_captures", "heron_game_hard", "surveyor_captures", "surveyor_game_medium", "large_usv_random",
         "double_integrator_random", "single_integrator_random", "mixed_fleet_random")  # fmt: skip


@pytest.mark.parametrize("name", sorted(PLATFORMS))
def test_same_steps_as_the_package(name):
    dt_s = 0.05 if name == "heron" else 0.1
    random = np.random.default_rng(5)
    params = get_platform(name).pack()
    numbers = rows_of([params])[0]
    ours = fresh_state(3.0, -2.0, 170.0, 0.5)
    theirs = ours.copy()
    top = params[L.MAX_SPEED]
    speed_mps, error_deg = 0.0, 0.0
    for k in range(1000):
        if k % int(random.integers(1, 40)) == 0:
            speed_mps, error_deg = random.uniform(-0.2 * top, 1.2 * top), random.uniform(-180, 180)
        step(numbers, ours, speed_mps, error_deg, dt_s)
        step_boat(params, theirs, speed_mps, error_deg, dt_s)
        turned = abs((ours[L.HEADING] - theirs[L.HEADING] + 180.0) % 360.0 - 180.0)
        assert turned < 1e-7
        ours[L.HEADING] = theirs[L.HEADING]
        np.testing.assert_allclose(ours, theirs, atol=1e-7)
    assert np.ptp([ours[L.X], ours[L.Y], 3.0]) > 1.0


@pytest.mark.parametrize("stem", PLAIN)
def test_same_steps_as_the_recorded_simulator(stem):
    trace = load_trace(TRACES / f"{stem}.npz")
    arrays, names = trace.arrays, trace.meta["dynamics"]
    names = [names] * arrays["position"].shape[1] if isinstance(names, str) else names
    compared = 0
    for boat, name in enumerate(names):
        free = ~(arrays["oob"] | arrays["is_tagged"])[:, boat].astype(bool)
        steps = int(np.argmin(free)) - 1 if not free.all() else trace.steps
        steps = min(steps, 400)
        compared += _follow(arrays, boat, get_platform(name).pack(), steps, trace.meta["dt"])
    assert compared > 100


def _follow(arrays, boat, params, steps, dt_s):
    """Drive a boat from the record's start by its actions; returns how many steps the record could be followed."""
    numbers = rows_of([params])[0]
    state = fresh_state(*arrays["position"][0, boat], arrays["heading"][0, boat], arrays["speed"][0, boat])
    for k in range(steps):
        speed_mps, error_deg = arrays["action"][k, boat]
        if np.isnan(error_deg):
            return 0
        moved = np.linalg.norm(arrays["position"][k + 1, boat] - arrays["position"][k, boat])
        if moved > 1.5 * max(params[L.MAX_SPEED], 0.1) * dt_s or _near_flag(arrays, k, boat):
            return k
        step(numbers, state, np.float64(np.float32(speed_mps)), np.float64(np.float32(error_deg)), dt_s)
        np.testing.assert_allclose(state[:2], arrays["position"][k + 1, boat], atol=2e-5)
    return max(steps, 0)


def _near_flag(arrays, k, boat):
    gaps = np.linalg.norm(arrays["flag_position"][k + 1] - arrays["position"][k + 1, boat], axis=-1)
    return gaps.min() < 6.0


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(["heron", "surveyor"]),
    rudder=st.floats(-1, 1),
    choice=st.sampled_from([DOWN, HOLD, UP]),
    thrust=st.floats(10, 90),
    last=st.one_of(st.just(np.nan), st.floats(-120, 120)),
)
def test_command_gives_the_rudder_asked_for(name, rudder, choice, thrust, last):
    numbers = rows_of([get_platform(name).pack()])[0]
    state = fresh_state(0.0, 0.0, 0.0, 1.0)
    state[[L.THRUST, L.HEADING_ERROR, L.SPEED_ERROR]] = thrust, last, 0.0
    speed_mps, error_deg = command_of(numbers, state, choice, rudder, 0.1)
    before = state[L.THRUST]
    step(numbers, state, speed_mps, error_deg, 0.1)
    assert abs(error_deg) <= 180.0
    assert 0.0 <= speed_mps <= numbers[1]
    assert state[L.RUDDER] == pytest.approx(100.0 * rudder, abs=1e-6)
    assert np.sign(round(state[L.THRUST] - before, 9)) == {DOWN: -1, HOLD: 0, UP: 1}[choice]
