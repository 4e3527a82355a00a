"""Barriers of the literature: values known by hand, gradients against differences, symmetry."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.experiments.textbook.barriers import COLLISION_CONE, EXPONENTIAL, PARABOLIC, barrier

RADIUS_M = 2.5
GAINS = np.array([0.7, 1.3, 0.2, 0.15])
KINDS = [EXPONENTIAL, COLLISION_CONE, PARABOLIC]
metres = st.floats(-30.0, 30.0)
speeds = st.floats(-5.0, 5.0)


def jet(kind, point):
    return np.array(barrier(kind, GAINS, *point, RADIUS_M))


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=150, deadline=None)
@given(px=metres, py=metres, vx=speeds, vy=speeds)
def test_gradients_are_those_of_h(kind, px, py, vx, vy):
    assume(abs(math.hypot(px, py) - RADIUS_M) > 0.1)
    assume(math.hypot(px, py) > 0.3 and math.hypot(vx, vy) > 0.1)
    point, step = np.array([px, py, vx, vy]), 1e-6
    differences = [
        (jet(kind, point + step * axis)[0] - jet(kind, point - step * axis)[0]) / (2 * step) for axis in np.eye(4)
    ]
    np.testing.assert_allclose(jet(kind, point)[1:], differences, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=50, deadline=None)
@given(px=metres, py=metres, vx=speeds, vy=speeds, turn=st.floats(-math.pi, math.pi))
def test_h_does_not_hang_on_the_frame(kind, px, py, vx, vy, turn):
    c, s = math.cos(turn), math.sin(turn)
    turned = (c * px - s * py, s * px + c * py, c * vx - s * vy, s * vx + c * vy)
    mirrored = (-px, py, -vx, vy)
    h = jet(kind, (px, py, vx, vy))[0]
    assert jet(kind, turned)[0] == pytest.approx(h, abs=1e-7, rel=1e-7)
    assert jet(kind, mirrored)[0] == pytest.approx(h, abs=1e-9, rel=1e-9)


def test_exponential_is_rate_of_distance_plus_distance():
    assert jet(EXPONENTIAL, (3.0, 4.0, -1.0, 0.5))[0] == pytest.approx(2 * (-3 + 2) + 0.7 * (25 - 6.25))


@pytest.mark.parametrize(("miss_m", "safe"), [(2.4, False), (2.6, True)])
def test_collision_cone_tells_a_miss_from_a_hit(miss_m, safe):
    """A straight course that passes at a distance below the radius is unsafe however far off, one above is safe."""
    for away in (5.0, 50.0):
        assert (jet(COLLISION_CONE, (away, miss_m, -2.0, 0.0))[0] > 0.0) == safe


def test_collision_cone_is_the_formula_with_the_angle():
    p, v = np.array([8.0, 3.0]), np.array([-2.0, 0.4])
    angle = math.asin(RADIUS_M / np.linalg.norm(p))
    want = p @ v + np.linalg.norm(p) * np.linalg.norm(v) * math.cos(angle)
    assert jet(COLLISION_CONE, (*p, *v))[0] == pytest.approx(want, rel=1e-6)


def test_parabolic_is_the_formula_in_the_frame_of_the_line_of_sight():
    s = math.sqrt(100.0 - RADIUS_M**2)
    along, across = -1.5, 0.8
    want = along + 0.2 * s / math.hypot(along, across) * across**2 + 0.15 * s
    assert jet(PARABOLIC, (10.0, 0.0, along, across))[0] == pytest.approx(want, rel=1e-9)
    assert jet(PARABOLIC, (0.0, 10.0, -across, along))[0] == pytest.approx(want, rel=1e-9)


@pytest.mark.parametrize("kind", [COLLISION_CONE, PARABOLIC])
@pytest.mark.parametrize("point", [(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (RADIUS_M, 0.0, 0.0, 0.0)])
def test_singular_places_give_numbers(kind, point):
    assert np.isfinite(jet(kind, point)).all()
