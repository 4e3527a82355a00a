"""The command that makes the autopilot turn the boat by just so much, and the hull driven without it."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.shield.platforms import PLATFORMS, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import FARTHEST_DEG, actuate, command_for_turn, largest_turn

NAMES = sorted(PLATFORMS)


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


@pytest.mark.parametrize("name", NAMES)
@given(data=st.data())
@settings(max_examples=60, deadline=None, derandomize=True)
def test_driving_the_hull_and_driving_the_autopilot_go_to_the_same_place(name, data):
    params, row, speed, share = data.draw(situations(name))
    turn = reachable_turn(params, row, speed, share)
    error = command_for_turn(params, row, speed, turn, 0.1)
    assume(abs(error) < FARTHEST_DEG)
    piloted, driven = row.copy(), row.copy()
    step_boat(params, piloted, speed, error, 0.1)
    actuate(params, driven, speed, turn, 0.1)
    seen = [L.X, L.Y, L.HEADING, L.SPEED, L.THRUST, L.TURN_RATE]
    assert driven[seen] == pytest.approx(piloted[seen], rel=0, abs=1e-9)


@pytest.mark.parametrize("name", ["heron", "surveyor", "large_usv", "mctf2024_sim"])
def test_without_thrust_there_is_nothing_to_command(name):
    params, row = get_platform(name).pack(), fresh_state(0.0, 0.0, 0.0, 1.0)
    assert command_for_turn(params, row, 0.0, 5.0, 0.1) == 0.0
    assert largest_turn(params, row, 0.1) == 0.0
