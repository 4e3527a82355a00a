"""A boat as a unicycle: its limits, and commands to inputs and back."""

import numpy as np
import pytest
from steerclear.experiments.baselines.textbook.inputs import command_of_inputs, input_limits, inputs_of_command
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import cruise


@pytest.mark.parametrize(("name", "way_m"), [("heron", 9.8), ("surveyor", 36.0)])
def test_braking_is_what_stops_the_boat_in_its_real_distance(name, way_m):
    limits = input_limits(get_platform(name), 0.1)
    assert 0.5 * limits.top_speed_mps**2 / limits.brake_mps2 == pytest.approx(way_m, rel=0.03)
    assert 0.0 < limits.gain_mps2 <= limits.top_speed_mps


def test_limits_of_the_double_integrator_are_its_own():
    limits = input_limits(get_platform("di"), 0.1)
    assert limits.brake_mps2 == pytest.approx(1.0, rel=1e-3)
    assert limits.gain_mps2 == pytest.approx(1.0, rel=1e-3)


def read(platform, state, speed, relative):
    z, box = np.zeros(2), np.zeros((2, 2))
    limits = np.array(input_limits(platform, 0.1))
    most = inputs_of_command(platform.pack(), limits, state, np.array([speed, relative]), 0.1, z, box)
    return z, box, most


def write(platform, state, z, most):
    return command_of_inputs(platform.pack(), np.array(input_limits(platform, 0.1)), state, np.array(z), most, 0.1)


@pytest.mark.parametrize("name", ["heron", "surveyor", "si"])
@pytest.mark.parametrize("share", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_turn_asked_for_is_the_turn_made(name, share):
    platform = get_platform(name)
    params, state = cruise(platform)
    most = read(platform, state, platform.max_speed_mps, 0.0)[2]
    speed, relative = write(platform, state, [0.0, share], most)
    assert speed == pytest.approx(state[L.SPEED])
    z, _, again = read(platform, state, speed, relative)
    assert z[1] * again == pytest.approx(share * most, abs=1e-6)
    assert z[0] == pytest.approx(0.0, abs=1e-9)
    before = state[L.HEADING]
    step_boat(params, state, speed, relative, 0.1)
    turned_deg = (state[L.HEADING] - before + 180.0) % 360.0 - 180.0
    assert np.radians(turned_deg) / 0.1 == pytest.approx(z[1] * again)


def test_speed_commands_span_their_range():
    platform = get_platform("surveyor")
    state = cruise(platform)[1]
    assert write(platform, state, [-1.0, 0.0], 1.0)[0] == pytest.approx(0.0, abs=1e-9)
    assert read(platform, state, 0.0, 0.0)[0][0] == pytest.approx(-1.0)
    z, box, _ = read(platform, state, 99.0, 0.0)
    assert z[0] == pytest.approx(0.0, abs=1e-9)
    assert box.tolist() == [[-1.0, z[0]], [-1.0, 1.0]]


def test_no_boat_reverses_or_tops_its_top_speed():
    platform = get_platform("heron")
    state = cruise(platform)[1]
    state[L.SPEED] = 0.05 * input_limits(platform, 0.1).brake_mps2
    z, box, _ = read(platform, state, 0.0, 0.0)
    assert box[0, 0] == pytest.approx(-0.5)
    assert z[0] >= box[0, 0]
