"""A boat as a unicycle: its limits, and commands to inputs and back."""

import numpy as np
import pytest
from steerclear.experiments.textbook.inputs import command_of_inputs, input_limits, inputs_of_command
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


@pytest.mark.parametrize("name", ["heron", "surveyor", "si"])
@pytest.mark.parametrize("share", [-1.0, -0.3, 0.0, 0.5, 1.0])
def test_a_turn_asked_for_is_the_turn_made(name, share):
    platform = get_platform(name)
    params, state = cruise(platform)
    limits = input_limits(platform, 0.1).pack()
    most = inputs_of_command(params, limits, state, limits[0], 0.0, 0.1)[2]
    speed, relative = command_of_inputs(params, limits, state, 0.0, share * most, 0.1)
    assert speed == pytest.approx(state[L.SPEED])
    gain, turn, _ = inputs_of_command(params, limits, state, speed, relative, 0.1)
    assert turn == pytest.approx(share * most, abs=1e-6)
    assert gain == pytest.approx(0.0, abs=1e-9)
    before = state[L.HEADING]
    step_boat(params, state, speed, relative, 0.1)
    assert np.radians((state[L.HEADING] - before + 180.0) % 360.0 - 180.0) / 0.1 == pytest.approx(turn)


def test_speed_commands_span_their_range():
    platform = get_platform("surveyor")
    params, state = cruise(platform)
    limits = input_limits(platform, 0.1).pack()
    assert command_of_inputs(params, limits, state, -limits[2], 0.0, 0.1)[0] == pytest.approx(0.0, abs=1e-9)
    assert inputs_of_command(params, limits, state, 0.0, 0.0, 0.1)[0] == pytest.approx(-limits[2])
    assert inputs_of_command(params, limits, state, 99.0, 0.0, 0.1)[0] == pytest.approx(0.0, abs=1e-9)
