"""Checks of where boats are before the start."""

import math

import pytest
from bridge_fakes import fleet_of
from steerclear.shield.bridge.messages import BoatReading, Contact
from steerclear.shield.bridge.preflight_checks import SITUATION, check_situation
from steerclear.shield.bridge.tracker import Tracker


def at(**places):
    """A roster of two own boats and one other at (x, y, heading rad, speed); None: never seen."""
    fleet = fleet_of(blue=2, red=1)
    roster = Tracker(fleet, ["blue_1", "blue_2"])
    readings, contacts = {}, []
    for name in ("blue_1", "blue_2", "red_1"):
        place = places.get(name, {"blue_1": (0, 0), "blue_2": (20, 0), "red_1": (40, 0)}[name])
        if place is None:
            continue
        x, y, heading, speed = (*place, 0.0, 0.0)[:4]
        if name == "red_1":
            contacts.append(Contact(name, (x, y), heading, speed, 10.0, 0.0, "test"))
        else:
            readings[name] = BoatReading(name, 10.0, (x, y), 0.0, heading, 0.0, speed, math.nan, 0.0)
    roster.update(10.0, readings, contacts)
    return fleet, roster


def results(**places):
    fleet, roster = at(**places)
    return {name: check_situation(name, fleet, roster) for name in SITUATION}


def test_all_pass_when_boats_are_known_inside_and_apart():
    found = results()
    assert all(result.passed for result in found.values())
    assert found["geofence"].figures["least_inside_m"] == pytest.approx(20.0)


def test_a_boat_nobody_sees_is_named():
    assert "red_1 never heard" in results(red_1=None)["known"].text
    assert "blue_2 never heard" in results(blue_2=None)["known"].text
    nobody = results(red_1=None, blue_1=None, blue_2=None)
    assert not any(result.passed for result in nobody.values())


@pytest.mark.parametrize("name", ["blue_1", "red_1"])
def test_a_boat_outside_the_geofence_is_named(name):
    result = results(**{name: (0.0, 75.0)})["geofence"]
    assert not result.passed
    assert f"{name} (0, 75) m" in result.text


def test_boats_too_near_or_too_fast_to_part_are_named():
    near = results(blue_2=(2.0, 0.0))["backup"]
    assert not near.passed
    assert "move it away" in near.text
    fast = results(blue_1=(0.0, 0.0, math.pi / 2, 2.0), blue_2=(3.5, 0.0, 1.5 * math.pi, 2.0))["backup"]
    assert not fast.passed
