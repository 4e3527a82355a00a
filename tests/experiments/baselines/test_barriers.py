"""Barriers of the literature: values known by hand, gradients against differences, symmetry."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from steerclear.experiments.baselines.barriers import collision_cone, exponential_cbf, parabolic, velocity_cbf

RADIUS_M = 2.5
A1_PER_S, K_LAMBDA_PER_M, K_MU_PER_S = 0.7, 0.2, 0.15
UNIT = math.sqrt(1.05**2 - 1.0) / RADIUS_M
GAINS = {
    velocity_cbf: (),
    exponential_cbf: (A1_PER_S,),
    collision_cone: (),
    parabolic: (K_LAMBDA_PER_M / UNIT, K_MU_PER_S / UNIT),
}
ALL = pytest.mark.parametrize("barrier", list(GAINS), ids=lambda barrier: barrier.__name__)
metres = st.floats(-30.0, 30.0)
speeds = st.floats(-5.0, 5.0)


def jet(barrier, point):
    h, h_p, h_v = barrier(np.array(point[:2]), np.array(point[2:]), RADIUS_M, *GAINS[barrier])
    return np.array([h, *h_p, *h_v])


@ALL
@settings(max_examples=150, deadline=None)
@given(px=metres, py=metres, vx=speeds, vy=speeds)
def test_gradients_are_those_of_h(barrier, px, py, vx, vy):
    assume(abs(math.hypot(px, py) - RADIUS_M) > 0.1)
    assume(math.hypot(px, py) > 0.3 and math.hypot(vx, vy) > 0.1)
    point, step = np.array([px, py, vx, vy]), 1e-6
    differences = [
        (jet(barrier, point + step * axis)[0] - jet(barrier, point - step * axis)[0]) / (2 * step) for axis in np.eye(4)
    ]
    if barrier is velocity_cbf:  # there the inputs act on p itself
        differences[2:] = differences[:2]
    np.testing.assert_allclose(jet(barrier, point)[1:], differences, rtol=2e-5, atol=2e-5)


@pytest.mark.parametrize(("miss_m", "safe"), [(2.4, False), (2.6, True)])
def test_collision_cone_tells_a_miss_from_a_hit(miss_m, safe):
    """A straight course that passes at a distance below the radius is unsafe however far off, one above is safe."""
    for away in (5.0, 50.0):
        assert (jet(collision_cone, (away, miss_m, -2.0, 0.0))[0] > 0.0) == safe


@ALL
@pytest.mark.parametrize("point", [(0.0, 0.0, 1.0, 0.0), (1.0, 0.0, 0.0, 0.0), (RADIUS_M, 0.0, 0.0, 0.0)])
def test_singular_places_give_numbers(barrier, point):
    assert np.isfinite(jet(barrier, point)).all()
