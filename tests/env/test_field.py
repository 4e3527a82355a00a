import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.field import field_geometry, field_points, line_through_field
from steerclear.env.trace import load_trace
from steerclear.shield.exceptions import ConfigError


def test_geometry_is_that_of_the_recorded_games(traces):
    for path in traces.values():
        trace = load_trace(path)
        field = field_geometry(trace.config)
        np.testing.assert_allclose(field.flag_home, trace.meta["flag_home"])
        np.testing.assert_allclose(field.scrimmage, trace.meta["scrimmage"])
        np.testing.assert_allclose(field.walls, [trace.meta["walls"]["0"], trace.meta["walls"]["1"]])


def test_flags_one_above_the_other_turn_the_walls_with_them():
    config = GameConfig.preset("aamas2024", blue_flag_home_m=(40.0, 5.0), red_flag_home_m=(40.0, 35.0))
    field = field_geometry(config)
    np.testing.assert_allclose(sorted(field.scrimmage[:, 0]), [0.0, 80.0])
    np.testing.assert_allclose(field.scrimmage[:, 1], 20.0)
    assert (field.walls[0, 1, :, 1] == 0.0).all()
    assert (field.walls[1, 1, :, 1] == 40.0).all()


def test_a_slanting_line_is_drawn_out_to_the_edges():
    field = field_geometry(GameConfig.preset("aamas2024", scrimmage_m=((39.0, 19.0), (41.0, 21.0))))
    np.testing.assert_allclose(field.scrimmage, [[20.0, 0.0], [60.0, 40.0]])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"blue_flag_home_m": (0.0, 5.0), "red_flag_home_m": (40.0, 35.0)}, "lies outside the field"),
        ({"blue_flag_home_m": (9.0, 5.0), "red_flag_home_m": (9.0, 5.0)}, "same home"),
        ({"scrimmage_m": ((75.0, 0.0), (75.0, 40.0))}, "does not part the two flag homes"),
        ({"scrimmage_m": ((-5.0, 0.0), (-5.0, 40.0))}, "does not cross the field"),
    ],
)
def test_impossible_fields_are_refused(settings, message):
    with pytest.raises(ConfigError, match=message):
        field_geometry(GameConfig.preset("aamas2024", **settings))


def test_line_through_field_starts_along_the_direction():
    ends = line_through_field(np.array([10.0, 4.0]), np.array([5.0, 1.0]), np.array([0.0, -2.0]))
    np.testing.assert_allclose(ends, [[5.0, 0.0], [5.0, 4.0]])


def test_field_points_form_the_named_grid():
    points = field_points(np.array([160.0, 80.0]))
    assert len(points) == 45
    for name, place in {"SC": (80, 20), "CC": (80, 40), "PBX": (160, 60), "SSB": (0, 0), "PPFX": (140, 80)}.items():
        np.testing.assert_allclose(points[name], place)
