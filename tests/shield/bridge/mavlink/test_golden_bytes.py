"""The bytes on the wire are the ones of 0.8.0: ten messages of each kind, both ways."""

import pytest
from steerclear.shield.bridge.autopilot_parameters import ASKED
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from wire_bytes import kept, read_of, sent_by


def made(route):
    clock = MonotonicClock(4.0)
    endpoint = Endpoint("udpin:127.0.0.1:0", clock)
    endpoint.open()
    link = MavlinkLink("blue_1", endpoint, 1, FieldFrame(42.0, -71.0, 30.0), clock, rate_hz=10.0, route=route)
    return link, endpoint, clock


@pytest.mark.parametrize("route", ["SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED"])
def test_what_is_sent_from_nothing_to_hold_is_byte_for_byte_what_it_was(route):
    found, golden = sent_by(made, route), kept()[route]
    asked = found["asked"].pop("PARAM_REQUEST_READ")
    golden["asked"].pop("PARAM_REQUEST_READ")
    assert found == golden
    names = ("WP_SPEED", *ASKED)  # which are asked is preflight's; how, is the wire's
    assert set(asked) == {b"\xff\xff\x01\x01".hex() + name.encode().hex() for name in names}


def test_what_a_boat_says_is_read_as_it_was():
    found, golden = read_of(made), kept()["read"]
    for kind in ("position", "attitude", "text"):
        assert found[kind] == golden[kind], kind
    for now, before in zip(found["heartbeat"], golden["heartbeat"], strict=True):
        assert now[:3] == before[:3]
