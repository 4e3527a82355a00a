"""Shores and keep-out areas of a FLEET.yaml reach the shield in the field's metres, or are refused in words."""

import json
import math
from itertools import pairwise

import numpy as np
import pytest
from bridge_fakes import fleet_text
from steerclear.shield.bridge.fleet_file import load_fleet, parse_fleet
from steerclear.shield.exceptions import FleetFileError

CORNERS = [(-20.0, 10.0), (-30.0, 10.0), (-30.0, 40.0)]


def text_of(obstacles):
    return fleet_text(more=f"obstacles: {json.dumps(obstacles)}\n")


def places(corners):
    """Latitude and longitude of corners of the field."""
    frame = parse_fleet(fleet_text()).frame
    return [list(frame.to_geodetic_deg(x, y)) for x, y in corners]


def geojson(folder, geometry):
    (folder / "shore.geojson").write_text(json.dumps(geometry))
    (folder / "FLEET.yaml").write_text(text_of([{"geojson": "shore.geojson"}]))
    return load_fleet(folder / "FLEET.yaml").surroundings.polygons


def test_metres_and_places_are_the_same_water():
    by_metres = parse_fleet(text_of([{"polygon_m": CORNERS, "name": "pier"}])).surroundings
    by_places = parse_fleet(text_of([{"polygon_deg": places(CORNERS)}])).surroundings
    assert by_metres.polygons == (tuple(CORNERS),)
    assert np.allclose(by_places.polygons, by_metres.polygons, atol=1e-3)
    assert by_metres.field == parse_fleet(fleet_text()).geofence.box


def test_a_circle_is_a_circle():
    assert parse_fleet(text_of([{"circle_m": [5.0, 60.0, 3.0]}])).surroundings.circles == ((5.0, 60.0, 3.0),)


def ring(corners):
    positions = [[longitude, latitude, 3.0] for latitude, longitude in places(corners)]
    return [*positions, positions[0]]


@pytest.mark.parametrize("kind", ["Polygon", "MultiPolygon", "FeatureCollection", "GeometryCollection"])
def test_rings_of_a_geojson_file_are_polygons(kind, tmp_path):
    polygon = {"type": "Polygon", "coordinates": [ring(CORNERS)]}
    point = {"type": "Point", "coordinates": [0.0, 0.0]}
    content = {
        "Polygon": polygon,
        "MultiPolygon": {"type": "MultiPolygon", "coordinates": [[ring(CORNERS)]]},
        "FeatureCollection": {
            "type": "FeatureCollection",
            "features": [{"type": "Feature", "geometry": each} for each in (point, None, polygon)],
        },
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
    "no file": ([{"geojson": "there.is.none"}], "cannot read .*there.is.none"),
}


@pytest.mark.parametrize("case", sorted(BAD))
def test_what_bounds_no_water_is_refused(case):
    obstacles, words = BAD[case]
    with pytest.raises(FleetFileError, match=words) as error:
        parse_fleet(text_of(obstacles))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ("{", "cannot read"),
        ("[]", "is no GeoJSON"),
        ('{"type": "Circle"}', "unknown type 'Circle'"),
        ('{"type": "Point", "coordinates": [0, 0]}', "holds no polygon or line"),
        ('{"type": "LineString", "coordinates": [[42.0, -710.0], [1, 2]]}', r"not \[longitude, latitude\]"),
        ('{"type": "LineString", "coordinates": [[NaN, 1], [1, 2]]}', r"not \[longitude, latitude\]"),
        ('{"type": "LineString", "coordinates": [[1, 2]]}', "fewer than two positions"),
    ],
)
def test_a_file_that_is_no_geojson_is_refused(content, words, tmp_path):
    (tmp_path / "shore.geojson").write_text(content)
    (tmp_path / "FLEET.yaml").write_text(text_of([{"geojson": "shore.geojson"}]))
    with pytest.raises(FleetFileError, match=words):
        load_fleet(tmp_path / "FLEET.yaml")


def test_the_hard_line_of_a_boat_is_ten_metres_out_unless_said():
    fence = parse_fleet(fleet_text()).geofence
    assert (fence.beyond_m, fence.then) == (10.0, "stop")
    with pytest.raises(FleetFileError, match="give metres outside the geofence, 0 to 1000"):
        parse_fleet(fleet_text().replace("geofence: {", "geofence: {beyond_m: -1, "))
    with pytest.raises(FleetFileError, match="stop or flee"):
        parse_fleet(fleet_text().replace("geofence: {", "geofence: {then: go, "))


def test_the_hard_line_is_the_shields_unless_the_file_contradicts_itself():
    config = parse_fleet(fleet_text()).shield_config
    assert (config.beyond_m, config.beyond_then) == (10.0, "stop")
    wider = parse_fleet(fleet_text(more="shield: {beyond_m: 25.0}")).shield_config
    assert wider.beyond_m == 25.0
    with pytest.raises(
        FleetFileError, match=r"shield.beyond_m is 25.0 and geofence.beyond_m 3.0; leave shield.beyond_m"
    ):
        parse_fleet(fleet_text(more="shield: {beyond_m: 25.0}").replace("geofence: {", "geofence: {beyond_m: 3.0, "))
