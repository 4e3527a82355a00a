import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError

ANGLES = st.floats(-360.0, 360.0)


@given(st.floats(-60, 60), st.floats(-180, 180), ANGLES, st.floats(-500, 500), st.floats(-500, 500))
def test_places_round_trip_to_a_tenth_of_a_millimetre(latitude, longitude, axis, x, y):
    frame = FieldFrame(latitude, longitude, axis)
    assert frame.to_field_m(*frame.to_geodetic_deg(x, y)) == pytest.approx((x, y), abs=1e-4)


@given(ANGLES, st.floats(0.0, 2 * math.pi, exclude_max=True))
def test_headings_round_trip_and_agree_with_vectors(axis, heading):
    frame = FieldFrame(42.0, -71.0, axis)
    there = frame.heading_to_true_rad(heading)
    assert math.cos(frame.heading_to_field_rad(there) - heading) == pytest.approx(1.0, abs=1e-12)
    x, y = frame.turn_to_field(math.sin(there), math.cos(there))
    assert (x, y) == pytest.approx((math.sin(heading), math.cos(heading)), abs=1e-12)


@pytest.mark.parametrize("place", [(90.0, 0.0, 0.0), (math.nan, 0.0, 0.0), (0.0, 181.0, 0.0), (0.0, 0.0, math.inf)])
def test_impossible_places_are_refused(place):
    with pytest.raises(ConfigError, match="give"):
        FieldFrame(*place)
