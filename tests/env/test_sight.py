import math

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.env.angles import heading_to, wrap_bearing
from steerclear.env.observation_layout import pack_lines, sight_of_line, sight_of_point
from steerclear.env.obstacles import closest_on_segment

examples = settings(derandomize=True, deadline=None, max_examples=200)
coordinate = st.floats(-200.0, 200.0)
heading = st.floats(-180.0, 180.0)
point = st.tuples(coordinate, coordinate)


def turned(a, b):
    """Angle between two directions, deg."""
    return abs((a - b + 180.0) % 360.0 - 180.0)


@examples
@given(st.floats(-539.0, 539.0))
def test_wrapped_bearings_keep_their_direction_and_astern_is_plus_180(angle):
    wrapped = wrap_bearing(angle)
    assert -180.0 < wrapped <= 180.0
    assert turned(wrapped, angle) < 1e-9


def test_headings_of_the_four_winds():
    assert [heading_to(*v) for v in ((0, 1), (1, 0), (0, -1), (-1, 0))] == [0.0, 90.0, 180.0, -90.0]
    assert heading_to(0.0, 0.0) == 90.0


@examples
@given(point, heading, point)
def test_sailing_the_bearing_and_distance_of_a_point_leads_to_it(here, course, there):
    bearing, distance = sight_of_point(*here, course, *there)
    way = math.radians(course + bearing)
    arrived = (here[0] + distance * math.sin(way), here[1] + distance * math.cos(way))
    np.testing.assert_allclose(arrived, there, atol=1e-9)


@examples
@given(point, heading, point, st.tuples(st.floats(1.0, 99.0), st.floats(-99.0, 99.0)))
def test_a_line_is_seen_at_its_closest_point(here, course, start, along):
    segment = np.array([start, (start[0] + along[0], start[1] + along[1])])
    bearing, distance = sight_of_line(*here, course, pack_lines(segment[np.newaxis]), 0)
    foot = closest_on_segment(segment, *here)
    want_bearing, want_distance = sight_of_point(*here, course, *foot)
    assert abs(distance - want_distance) < 1e-9
    if want_distance > 1e-6:
        assert turned(bearing, want_bearing) < 1e-4


def test_walls_are_seen_exactly_abreast():
    lines = pack_lines(np.array([[[80.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [0.0, 40.0]]]))
    assert sight_of_line(33.3, 7.7, 0.0, lines, 0) == (180.0, 7.7)
    assert sight_of_line(33.3, 7.7, 90.0, lines, 1) == (180.0, 33.3)
    assert sight_of_line(33.3, 0.0, 90.0, lines, 0) == (0.0, 0.0)
