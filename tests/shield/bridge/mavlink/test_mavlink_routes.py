"""Ways to command: what the message says is what was asked, and the traps are not used."""

import math

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.mavlink.commands import (
    ROUTES,
    Abilities,
    AttitudeRoute,
    VelocityRoute,
    check_route,
    choose_route,
)
from steerclear.shield.exceptions import LinkError, LinkRefused

TARGET = (3, 1)
ALL = 64 | 128


def test_the_stop_without_a_heading_asks_for_no_turn_and_no_thrust():
    mav = mavlink.MAVLink(None)
    got = mav.decode(bytearray(AttitudeRoute(2.0).straight_stop(TARGET, 0).pack(mav)))
    assert not got.type_mask & 4
    assert not got.type_mask & 64
    assert got.body_yaw_rate == got.thrust == 0.0


def chosen(route="auto", **abilities):
    found = {"version": (4, 6, 0), "capabilities": ALL, "top_mps": 2.0} | abilities
    return choose_route("blue_1", route, Abilities(**found))


@pytest.mark.parametrize(
    ("settings", "route"),
    [
        ({}, AttitudeRoute(2.0)),
        ({"version": None}, AttitudeRoute(2.0)),
        ({"top_mps": None}, VelocityRoute(None)),
        ({"capabilities": 128}, VelocityRoute(2.0)),
        ({"route": ROUTES[1]}, VelocityRoute(2.0)),
    ],
)
def test_the_first_route_the_boat_can_is_chosen(settings, route):
    assert chosen(**settings) == route


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"version": (3, 5, 2)}, "firmware 3.5.2 is too old; install"),
        ({"top_mps": 0.0}, "WP_SPEED is 0, so it would not move; set it"),
        ({"top_mps": math.nan}, "WP_SPEED is nan"),
        ({"top_mps": -1.0}, "WP_SPEED is -1"),
        ({"capabilities": 0}, "did not answer what it can do"),
        ({"capabilities": 64, "top_mps": None}, "cannot do SET_POSITION"),
        ({"route": ROUTES[0], "top_mps": None}, "its WP_SPEED cannot be read"),  # not replaced by another
    ],
)
def test_a_boat_that_cannot_be_commanded_is_refused_with_the_reason(changes, words):
    with pytest.raises(LinkRefused, match=words):
        chosen(**changes)


def test_a_route_that_is_none_is_refused_with_those_there_are():
    with pytest.raises(LinkError, match="there is no route 'attitude'; give auto, SET_ATTITUDE_TARGET or"):
        check_route("attitude")
