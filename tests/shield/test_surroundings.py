"""Static constraints are checked when they are given."""

import math

import numpy as np
import pytest
from steerclear.shield import Shield, ShieldConfig, Surroundings
from steerclear.shield.exceptions import ConfigError

TRIANGLE = [(0.0, 0.0), (4.0, 0.0), (2.0, 3.0)]
HARBOUR = Surroundings((0, 0, 40, 20), [(1, 2, 3)], [TRIANGLE], [(5, 5, 2)], [(7, 7, 3)])


@pytest.mark.parametrize(
    ("things", "text"),
    [
        ({"field": (0, 0, 10)}, r"field holds .*\(xmin, ymin, xmax, ymax\)"),
        ({"field": "wide"}, "field holds"),
        ({"field": (0, 0, math.nan, 10)}, "field holds a value that is not finite"),
        ({"field": (0, 0, math.inf, 10)}, "field holds a value that is not finite"),
        ({"field": (0, 0, 1e10, 10)}, r"field holds a value that is .* beyond 1e\+09 m"),
        ({"field": (10, 0, 0, 10)}, "field .* is empty"),
        ({"field": (0, 5, 10, 5)}, "field .* is empty"),
        ({"circles": [(0, 0)]}, r"circles holds .*\(x, y, radius\)"),
        ({"circles": [(0, 0, math.nan)]}, "circles holds a value that is not finite"),
        ({"circles": [3.0]}, "circles holds"),
        ({"circles": {"x": 1}}, "circles holds .*no list .*give a list of"),
        *(({name: [(0, 0, -0.1)]}, f"{name} holds a negative radius") for name in ("circles", "keep_out", "stops")),
        ({"stops": [(0, 0)]}, "stops holds"),
        ({"keep_out": [(0, math.inf, 1)]}, "keep_out holds a value that is not finite"),
        ({"polygons": [TRIANGLE[:2]]}, "fewer than three corners"),
        ({"polygons": [[*TRIANGLE[:2], (math.nan, 0.0)]]}, "polygons holds a value that is not finite"),
        ({"polygons": [[*TRIANGLE[:2], (1.0, 2.0, 3.0)]]}, r"polygons holds .*\(x, y\)"),
        ({"polygons": [[*TRIANGLE[:2], ("a", "b")]]}, "polygons holds"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words_that_help(things, text):
    with pytest.raises(ConfigError, match=text):
        Surroundings(**things)


def test_lists_and_arrays_will_do():
    given = Surroundings(
        field=[0, 0, 40.0, 20], circles=np.array([[1.0, 2.0, 3.0]]), polygons=[np.array(TRIANGLE)], keep_out=[[5, 5, 2]]
    )
    tuples = Surroundings((0.0, 0.0, 40.0, 20.0), ((1.0, 2.0, 3.0),), (tuple(TRIANGLE),), ((5.0, 5.0, 2.0),))
    assert given == tuples
    assert hash(given) == hash(tuples)
    Shield(surroundings=given)


def test_packing_widens_by_the_distances_of_the_settings_and_by_what_positions_may_be_off():
    exact, off = (
        HARBOUR.pack(ShieldConfig(edge_m=0.5, obstacle_clearance_m=1.5, position_error_m=error_m))
        for error_m in (0.0, 0.25)
    )
    assert exact.field.tolist() == [0.5, 0.5, 39.5, 19.5]
    assert exact.circles.tolist() == [[1.0, 2.0, 4.5], [7.0, 7.0, 3.0]]  # a circle that stops boats has no hull
    assert exact.keep_out.tolist() == [[5.0, 5.0, 2.0]]
    assert exact.segment_m == 1.5
    starts, ends = ({tuple(row) for row in rows} for rows in (exact.segments[:, :2], exact.segments[:, 2:]))
    assert starts == ends == set(TRIANGLE), "walls of a polygon close"
    np.testing.assert_allclose(off.field - exact.field, [0.25, 0.25, -0.25, -0.25])
    np.testing.assert_allclose(off.circles[:, 2] - exact.circles[:, 2], 0.25)
    np.testing.assert_allclose(off.keep_out[:, 2] - exact.keep_out[:, 2], 0.25)
    assert off.segment_m - exact.segment_m == 0.25
    np.testing.assert_array_equal(off.segments, exact.segments)
    assert np.isinf(HARBOUR.pack(ShieldConfig(edge_m=None)).field).all()


def test_a_field_of_which_nothing_is_left_is_refused_when_the_shield_is_built():
    small = Surroundings(field=(0.0, 0.0, 40.0, 3.0))
    Shield(ShieldConfig(edge_m=0.5, position_error_m=0.9), small)
    with pytest.raises(ConfigError, match=r"too small to keep 1\.6 m inside its edge; give a larger field"):
        Shield(ShieldConfig(edge_m=0.5, position_error_m=1.1), small)
    Shield(ShieldConfig(edge_m=None, position_error_m=1.1), small)
