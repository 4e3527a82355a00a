"""The compiled step against the boats written down a second time."""

import math

import pytest
from boat_oracle import oracle
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.platforms import PLATFORMS, fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
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
