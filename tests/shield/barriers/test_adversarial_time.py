"""An opponent is feared for as long as told, and against a slow boat for as much longer as that takes to get going."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.barriers.value_function import UNDER_WAY, adversarial_for
from steerclear.shield.platforms import layout as L

AT = stages_of(ShieldConfig(), np.zeros((2, L.N_STATE)), ("surveyor", "surveyor"), (0, 1))
TOP_MPS, FROM_REST_S = 3.0, 40.0
"""Of a surveyor: top speed, and the time to it at 0.075 m/s^2."""


def feared(speed_mps, fear_s):
    AT.fear_s[:] = fear_s
    return adversarial_for(0, 1, speed_mps, AT.scene)


def test_at_rest_it_is_the_time_to_a_third_of_top_speed_longer():
    assert feared(0.0, 10.0) == pytest.approx(10.0 + FROM_REST_S / 3.0)
    assert feared(0.5, 10.0) == pytest.approx(10.0 + (TOP_MPS / 3.0 - 0.5) / 0.075)


@given(st.floats(UNDER_WAY * TOP_MPS, 4.0), st.floats(0.0, 90.0))
def test_under_way_it_is_what_was_told(speed_mps, fear_s):
    assert feared(speed_mps, fear_s) == fear_s


@given(st.floats(-1.0, 4.0), st.floats(-1.0, 4.0), st.floats(0.1, 90.0))
def test_the_slower_the_longer(one_mps, other_mps, fear_s):
    slow, fast = sorted((one_mps, other_mps))
    assert feared(slow, fear_s) >= feared(fast, fear_s) >= fear_s


def test_who_holds_its_course_is_not_feared_and_who_hunts_for_ever_is():
    assert feared(0.0, 0.0) == 0.0
    assert math.isinf(feared(0.0, math.inf))
