import math

import numpy as np
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.env.motion import BUFFER_M, entry_point, keep_out
from steerclear.shield.platforms import fresh_state, layout

CENTRE = np.array([10.0, 20.0])
RADIUS = 4.25
examples = settings(derandomize=True, deadline=None, max_examples=200)


@examples
@given(st.floats(0.1, 4.0), st.floats(-180.0, 180.0), st.floats(0.05, 1.0), st.floats(-180.0, 180.0))
def test_the_entry_point_lies_on_the_circle_ahead_on_the_ray(depth, angle, length, course):
    inside = CENTRE + depth * np.array([math.sin(math.radians(angle)), math.cos(math.radians(angle))])
    before = inside + length * np.array([math.sin(math.radians(course)), math.cos(math.radians(course))])
    assume(abs(before[0] - inside[0]) > 1e-3)
    place = np.array(entry_point(inside, before, CENTRE, RADIUS))
    assert abs(np.linalg.norm(place - CENTRE) - RADIUS) < 1e-6
    ray, way = before - inside, place - inside
    assert abs(ray[0] * way[1] - ray[1] * way[0]) < 1e-6
    assert ray @ way > 0.0


def test_rays_along_the_axes_and_no_ray_at_all():
    inside = np.array([11.0, 20.0])
    np.testing.assert_allclose(entry_point(inside, np.array([12.0, 20.0]), CENTRE, 5.0), (15.0, 20.0))
    np.testing.assert_allclose(entry_point(inside, np.array([9.0, 20.0]), CENTRE, 5.0), (5.0, 20.0))
    np.testing.assert_allclose(entry_point(np.array([13.0, 20.0]), np.array([13.0, 25.0]), CENTRE, 5.0), (13.0, 24.0))
    np.testing.assert_allclose(entry_point(inside, inside, CENTRE, 5.0), (15.0, 20.0))
    assert np.isfinite(entry_point(CENTRE, CENTRE, CENTRE, 5.0)).all()


@examples
@given(st.floats(0.0, 3.0), st.floats(-180.0, 180.0))
def test_a_boat_put_back_keeps_only_the_speed_along_the_circle(speed, heading):
    state = fresh_state(10.0, 16.0, heading, speed)
    keep_out(state, np.array([10.0, 15.0]), CENTRE, RADIUS)
    x, y = state[layout.X], state[layout.Y]
    assert abs(math.hypot(x - CENTRE[0], y - CENTRE[1]) - RADIUS - BUFFER_M) < 1e-9
    # due south of the flag the circle runs east-west
    assert abs(state[layout.SPEED] - abs(speed * math.sin(math.radians(heading)))) < 1e-6
    if state[layout.SPEED] > 1e-3:
        assert abs(abs(state[layout.HEADING]) - 90.0) < 1e-6
