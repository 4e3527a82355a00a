"""Static constraints are checked when they are given."""

import math

import numpy as np
import pytest
from steerclear.shield import Shield, ShieldConfig, Surroundings
from steerclear.shield.exceptions import ConfigError

TRIANGLE = [(0.0, 0.0), (4.0, 0.0), (2.0, 3.0)]


@pytest.mark.parametrize(
    ("things", "text"),
    [
        ({"field": (0, 0, 10)}, r"field holds .*\(xmin, ymin, xmax, ymax\)"),
        ({"field": "wide"}, "field holds"),
        ({"field": (0, 0, math.nan, 10)}, "field holds a value that is not finite"),
        ({"field": (0, 0, math.inf, 10)}, "field holds a value that is not finite"),
        ({"field": (10, 0, 0, 10)}, "field .* is empty"),
        ({"field": (0, 5, 10, 5)}, "field .* is empty"),
        ({"circles": [(0, 0)]}, r"circles holds .*\(x, y, radius\)"),
        ({"circles": [(0, 0, -1)]}, "negative radius"),
        ({"circles": [(0, 0, math.nan)]}, "circles holds a value that is not finite"),
        ({"circles": [3.0]}, "circles holds"),
        ({"keep_out": [(0, 0, -0.1)]}, "negative radius"),
        ({"stops": [(0, 0)]}, "stops holds"),
        ({"stops": [(0, 0, -0.1)]}, "negative radius"),
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


def test_packing_widens_by_the_distances_of_the_settings():
    static = Surroundings((0, 0, 40, 20), [(1, 2, 3)], [TRIANGLE], [(5, 5, 2)], [(7, 7, 3)]).pack(
        ShieldConfig(edge_m=0.5, obstacle_clearance_m=1.5)
    )
    assert static.field.tolist() == [0.5, 0.5, 39.5, 19.5]
    assert static.circles.tolist() == [[1.0, 2.0, 4.5], [7.0, 7.0, 3.0]]  # a circle that stops boats has no hull
    assert static.keep_out.tolist() == [[5.0, 5.0, 2.0]]
    assert static.segments.shape == (3, 4)
    assert static.segment_m == 1.5


def test_without_an_edge_distance_the_edge_is_not_kept():
    static = Surroundings((0, 0, 40, 20)).pack(ShieldConfig(edge_m=None))
    assert np.isinf(static.field).all()


def test_walls_of_a_polygon_close():
    ends = Surroundings(polygons=[TRIANGLE]).pack(ShieldConfig()).segments
    starts, stops = {tuple(row[:2]) for row in ends}, {tuple(row[2:]) for row in ends}
    assert starts == stops == set(TRIANGLE)


def test_everything_fixed_is_kept_at_a_distance_for_what_positions_may_be_off():
    around = Surroundings(
        field=(0.0, 0.0, 80.0, 40.0),
        circles=((20.0, 20.0, 2.0),),
        polygons=(((30.0, 10.0), (34.0, 10.0), (32.0, 14.0)),),
        keep_out=((50.0, 20.0, 3.0),),
        stops=((70.0, 20.0, 4.0),),
    )
    exact, off = (around.pack(ShieldConfig(position_error_m=error_m)) for error_m in (0.0, 0.5))
    np.testing.assert_allclose(off.field - exact.field, [0.5, 0.5, -0.5, -0.5])
    np.testing.assert_allclose(off.circles[:, 2] - exact.circles[:, 2], 0.5)
    np.testing.assert_allclose(off.keep_out[:, 2] - exact.keep_out[:, 2], 0.5)
    assert off.segment_m - exact.segment_m == 0.5
    np.testing.assert_array_equal(off.segments, exact.segments)


def test_a_field_of_which_nothing_is_left_is_refused_when_the_shield_is_built():
    small = Surroundings(field=(0.0, 0.0, 40.0, 3.0))
    Shield(ShieldConfig(edge_m=0.5, position_error_m=0.9), small)
    with pytest.raises(ConfigError, match=r"too small to keep 1\.6 m inside its edge; give a larger field"):
        Shield(ShieldConfig(edge_m=0.5, position_error_m=1.1), small)
    Shield(ShieldConfig(edge_m=None, position_error_m=1.1), small)
