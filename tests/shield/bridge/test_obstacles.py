"""What does not move around the boats: shores of a FLEET.yaml in the field's metres, and the own flag's circle."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from bridge_fakes import FakeGame, World, fleet_of, fleet_text, game_of, straight
from steerclear.shield import Surroundings
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet
from steerclear.shield.bridge.static_obstacles import StaticObstacles
from steerclear.shield.exceptions import FleetFileError

CORNERS = [(-20.0, 10.0), (-30.0, 10.0), (-30.0, 40.0)]


def text_of(obstacles):
    return fleet_text(more=f"obstacles: {json.dumps(obstacles)}\n")


def places(corners):
    """Latitude and longitude of corners of the field."""
    frame = parse_fleet(fleet_text()).frame
    return [list(frame.to_geodetic_deg(x, y)) for x, y in corners]


def geojson(folder, content):
    (folder / "shore.geojson").write_text(content if isinstance(content, str) else json.dumps(content))
    (folder / "FLEET.yaml").write_text(text_of([{"geojson": "shore.geojson"}]))
    return load_fleet(folder / "FLEET.yaml").surroundings.polygons


def test_metres_and_places_are_the_same_water_and_a_circle_is_a_circle():
    by_metres = parse_fleet(text_of([{"polygon_m": CORNERS, "name": "pier"}])).surroundings
    by_places = parse_fleet(text_of([{"polygon_deg": places(CORNERS)}])).surroundings
    assert by_metres.polygons == (tuple(CORNERS),)
    assert np.allclose(by_places.polygons, by_metres.polygons, atol=1e-3)
    assert by_metres.field == parse_fleet(fleet_text()).geofence.box
    assert parse_fleet(text_of([{"circle_m": [5.0, 60.0, 3.0]}])).surroundings.circles == ((5.0, 60.0, 3.0),)


@pytest.mark.parametrize("kind", ["Polygon", "MultiPolygon", "FeatureCollection", "GeometryCollection"])
def test_rings_of_a_geojson_file_are_polygons(kind, tmp_path):
    ring = [[longitude, latitude, 3.0] for latitude, longitude in places([*CORNERS, CORNERS[0]])]
    polygon = {"type": "Polygon", "coordinates": [ring]}
    point = {"type": "Point", "coordinates": [0.0, 0.0]}
    features = [{"type": "Feature", "geometry": each} for each in (point, None, polygon)]
    content = {
        "Polygon": polygon,
        "MultiPolygon": {"type": "MultiPolygon", "coordinates": [[ring]]},
        "FeatureCollection": {"type": "FeatureCollection", "features": features},
        "GeometryCollection": {"type": "GeometryCollection", "geometries": [polygon]},
    }[kind]
    assert np.allclose(geojson(tmp_path, content), [CORNERS], atol=1e-3)


@pytest.mark.parametrize("count", [2, 3])
def test_a_line_is_a_wall_from_both_sides(count, tmp_path):
    line = [[longitude, latitude] for latitude, longitude in places(CORNERS[:count])]
    (polygon,) = geojson(tmp_path, {"type": "LineString", "coordinates": line})
    way = sum(math.dist(polygon[k - 1], polygon[k]) for k in range(len(polygon)))
    there = sum(math.dist(a, b) for a, b in pairwise(CORNERS[:count]))
    assert len(polygon) >= 3
    assert way == pytest.approx(2.0 * there, rel=1e-4)


BAD = {
    "two forms": ([{"polygon_m": CORNERS, "circle_m": [0, 0, 1]}], "polygon_m and circle_m; give one of"),
    "no form": ([{"name": "pier"}], "no form; give one of polygon_m"),
    "two corners": ([{"polygon_m": CORNERS[:2]}], "at least three"),
    "another water": ([{"polygon_deg": [[lon, lat] for lat, lon in places(CORNERS)]}], "km from the geofence; give"),
    "too many edges": ([{"polygon_m": [[k, 90.0 + k % 2] for k in range(401)]}], "401 edges, more than 400"),
    "an unknown key": ([{"polygon": CORNERS}], "did you mean"),
    "no file": (
        [{"geojson": "none"}],
        r"obstacles\[0\]\.geojson: cannot read none \(No such file [^(]*\); give",
    ),
    "a line that crosses itself": (
        [{"name": "bow", "polygon_m": [[0, 0], [10, 10], [10, 0], [0, 10]]}],
        r"obstacles\[0\] \(bow\): its line crosses itself; give its corners in order",
    ),
    "all of the field": (
        [{"name": "lake", "polygon_m": [[-1, -1], [90, -1], [90, 50], [-1, 50]]}],
        r"\(lake\) covers the whole field or geofence; correct it; a shore around your water is a GeoJSON LineString",
    ),
    "a circle over the geofence": ([{"circle_m": [40, 20, 90]}], r"obstacles\[0\] covers the whole field"),
    "a named one": ([{"name": "pier", "geojson": "none"}], r"obstacles\[0\] \(pier\)\.geojson: cannot read none"),
}


@pytest.mark.parametrize("case", sorted(BAD))
def test_what_bounds_no_water_is_refused(case):
    obstacles, words = BAD[case]
    with pytest.raises(FleetFileError, match=rf"^[^\n]*{words}[^\n]*$"):
        parse_fleet(text_of(obstacles))


@pytest.mark.parametrize(
    "obstacles",
    [
        [{"polygon_m": [[-1, -1], [79, -1], [79, 50], [-1, 50]]}],  # a strip of the field is left
        [{"polygon_m": [[-9, -9], [90, -9], [90, 50], [50, 50], [50, 9], [45, 9], [45, 50], [-9, 50]]}],  # a basin
        [{"circle_m": [40, 20, 40]}],
    ],
)
def test_an_obstacle_that_leaves_water_is_taken(obstacles):
    assert parse_fleet(text_of(obstacles)).obstacles


def ring_of(corners):
    return [[longitude, latitude] for latitude, longitude in places([*corners, corners[0]])]


def test_land_with_a_hole_leaves_the_hole_and_a_closed_line_has_no_inside(tmp_path):
    around = [(-25.0, -25.0), (105.0, -25.0), (105.0, 65.0), (-25.0, 65.0)]
    hole = [(-10.0, -10.0), (90.0, -10.0), (90.0, 50.0), (-10.0, 50.0)]
    water = (40.0, 20.0)
    for content, insides in (
        ({"type": "Polygon", "coordinates": [ring_of(around), ring_of(hole)]}, [False]),
        ({"type": "LineString", "coordinates": ring_of(hole)}, [False]),
        ({"type": "MultiLineString", "coordinates": [ring_of(hole), ring_of(CORNERS)]}, [False, False]),
    ):
        geojson(tmp_path, content)
        found = StaticObstacles(load_fleet(tmp_path / "FLEET.yaml")).areas
        assert [area.holds(*water) for area in found] == insides
        assert found[0].distance_m(*water) == pytest.approx(30.0, abs=0.1)
    with pytest.raises(FleetFileError, match="covers the whole field"):
        geojson(tmp_path, {"type": "Polygon", "coordinates": [ring_of(around)]})


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", r"is no GeoJSON: no JSON \(.*; give one of polygons or lines"),
        ("[]", r"is no GeoJSON \(an object has no type, such as FeatureCollection\)"),
        ('{"a": 1}', r"is no GeoJSON \(an object has no type"),
        ('{"type": "Circle"}', "unknown type 'Circle'"),
        ('{"type": "Point", "coordinates": [0, 0]}', "holds no polygon or line"),
        ('{"type": "LineString", "coordinates": [[42.0, -710.0], [1, 2]]}', r"not \[longitude, latitude\]"),
        ('{"type": "LineString", "coordinates": [[NaN, 1], [1, 2]]}', r"not \[longitude, latitude\]"),
        ('{"type": "LineString", "coordinates": [[1, 2]]}', "fewer than two positions"),
    ],
)
def test_a_file_that_is_no_geojson_is_refused(content, words, tmp_path):
    with pytest.raises(FleetFileError, match=words):
        geojson(tmp_path, content)


def test_the_hard_line_is_ten_metres_out_unless_the_file_says_otherwise_without_contradicting_itself():
    fence, config = parse_fleet(fleet_text()).geofence, parse_fleet(fleet_text()).shield_config
    assert (fence.beyond_m, fence.then) == (config.beyond_m, config.beyond_then) == (10.0, "stop")
    assert parse_fleet(fleet_text(more="shield: {beyond_m: 25.0}")).shield_config.beyond_m == 25.0


@pytest.mark.parametrize(
    ("key", "more", "words"),
    [
        ("beyond_m: -1", "", "give metres outside the geofence, 0 to 1000"),
        ("then: go", "", "stop or flee"),
        (
            "beyond_m: 3.0",
            "shield: {beyond_m: 25.0}",
            "shield.beyond_m is 25.0 and geofence.beyond_m 3.0; leave",
        ),
    ],
)
def test_a_hard_line_that_is_none_is_refused(key, more, words):
    with pytest.raises(FleetFileError, match=words):
        parse_fleet(fleet_text(more=more).replace("geofence: {", f"geofence: {{{key}, "))


CIRCLE = (10.0, 20.0, 4.35)
ROCK = (40.0, 10.0, 2.0)
PIER = ((50.0, 0.0), (52.0, 0.0), (51.0, 5.0))
GROUNDS = Surroundings((0.0, 0.0, 80.0, 40.0), circles=[ROCK], polygons=[PIER], stops=[CIRCLE])


@pytest.mark.parametrize(
    ("game", "age_s", "is_there"),
    [
        (game_of(), 0.0, True),
        (game_of(), 2.0, True),
        (game_of(), 2.001, False),
        (game_of(), math.nan, False),
        (game_of(blue_taken=True), 0.0, True),
        (game_of(red_taken=True), 0.0, True),
        (game_of(over=True), 0.0, False),
        (None, math.inf, False),
    ],
    ids=["home", "just fresh", "silent", "no age", "taken", "the other taken", "over", "no referee"],
)
def test_the_own_flags_circle_is_there_while_a_referee_keeps_the_game_and_the_geofence_is_the_edge(
    game, age_s, is_there
):
    file = fleet_of(blue=2, red=0)
    around = StaticObstacles(file, GROUNDS).around(game, age_s)
    assert around.stops == ((CIRCLE,) if is_there else ())
    assert (around.field, around.circles, around.polygons) == (file.geofence.box, (ROCK,), (PIER,))


def test_a_boat_told_to_cross_its_own_flag_stays_out_of_the_circle_whether_the_flag_is_home_or_not():
    """It may come home at any time. Without a referee the boat goes through; the tick holds what it was given."""

    def nearest_m(game, seconds):
        world = World(fleet_of(blue=1, red=0), [(10.0, -5.0, 0.0, 2.0)], straight(0.0), game=game, surroundings=GROUNDS)
        path = []
        world.run(seconds, lambda world: path.append(world.links["blue_1"].row[:2] - CIRCLE[:2]))
        return world, float(np.hypot(*np.array(path).T).min())

    world, nearest = nearest_m(FakeGame(lambda number: game_of(blue_taken=number >= 120)), 30.0)
    assert CIRCLE[2] - 0.02 <= nearest < CIRCLE[2] + 3.0  # paths are looked at from sample to sample
    assert {tick.game["flags"][0]["taken"] for tick in world.sink.ticks} == {False, True}
    assert {tick.surroundings.stops for tick in world.sink.ticks} == {(CIRCLE,)}
    assert nearest_m(None, 12.0)[1] < 2.0, "without a referee nothing is in the way"


def test_a_referee_who_falls_silent_lifts_the_circle_and_the_next_word_sets_it_again():
    game = FakeGame(lambda number: game_of())
    world = World(
        fleet_of(blue=1, red=0), [(40.0, 30.0, 0.0, 0.0)], straight(0.0, 0.0), game=game, surroundings=GROUNDS
    )
    seen = []
    for age_s in (0.0, 3.0, 0.1):
        game.age_s = age_s
        world.run(0.2)
        seen.append(world.last.surroundings.stops)
    assert seen == [(CIRCLE,), (), (CIRCLE,)]
