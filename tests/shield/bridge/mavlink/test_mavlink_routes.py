"""Ways to command: what the message says is what was asked, and the traps are not used."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
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
headings = st.floats(-20.0, 20.0)
speeds = st.floats(0.0, 2.0)


def on_the_wire(encoded):
    """The message as the boat decodes it."""
    mav = mavlink.MAVLink(None, srcSystem=255, srcComponent=191)
    return mav.decode(bytearray(encoded.message.pack(mav)))


def apart(a, b):
    return abs((a - b + math.pi) % (2 * math.pi) - math.pi)


@settings(deadline=None)
@given(headings, st.floats(-3.0, 3.0))
def test_attitude_says_the_heading_and_a_share_of_the_top_speed(heading, speed):
    encoded = AttitudeRoute(2.0).encode(TARGET, 5, heading, speed)
    got = on_the_wire(encoded)
    assert (got.target_system, got.target_component, got.type_mask) == (3, 1, 7)
    assert got.q[1] == got.q[2] == 0.0
    assert apart(2 * math.atan2(got.q[3], got.q[0]), heading) < 1e-6
    assert got.thrust * 2.0 == encoded.speed_mps == pytest.approx(max(-2.0, min(2.0, speed)), abs=1e-6)
    assert apart(encoded.heading_rad, heading) < 1e-6
    assert 0.0 <= encoded.heading_rad <= 2 * math.pi


@settings(deadline=None)
@given(headings, speeds)
def test_velocity_says_heading_and_speed_and_nothing_else(heading, speed):
    encoded = VelocityRoute(1.5).encode(TARGET, 5, heading, speed)
    got = on_the_wire(encoded)
    assert (got.coordinate_frame, got.type_mask) == (1, 3527)
    assert apart(math.atan2(got.vy, got.vx), heading) < 1e-4, "also at rest: a stop must not turn the boat north"
    assert math.hypot(got.vx, got.vy) == pytest.approx(max(1e-3, min(1.5, speed)), abs=1e-6)
    assert got.yaw == got.yaw_rate == 0.0
    assert encoded.speed_mps == pytest.approx(math.hypot(got.vx, got.vy))


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
