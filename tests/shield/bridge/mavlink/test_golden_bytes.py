"""The bytes on the wire are the ones of 0.8.0: ten messages of each kind, both ways, by bytes alone."""

import json
import math
import time
from pathlib import Path

import pytest
from fake_boat import FakeBoat
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.autopilot_parameters import ASKED
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink
from waiting import until

GOLDEN = Path(__file__).parents[1] / "data" / "golden_wire.json"
COMMANDS = [
    *((0.0, 0.0), (0.5, 1.0), (1.5, 2.0), (3.1, 0.3), (3.2, -0.5)),
    *((4.7, 1.9), (6.2, 1.23456), (2.0, 9.0), (5.5, -9.0), (6.28318, 1e-4)),
]
SAID = [
    *("Radio Failsafe", "EKF failsafe cleared", "x" * 50, "tab\tand\x07bell", "PreArm: Compass"),
    *("a", "ü", "Crash: 1", "", "ok"),
]
MODES = [
    *((15, True), (4, True), (15, False), (0, True), (5, True)),
    *((10, True), (11, False), (1, True), (99, True), (15, True)),
]
_STAMPED = {"SET_ATTITUDE_TARGET": 4, "SET_POSITION_TARGET_LOCAL_NED": 4, "TIMESYNC": 16}
"""Bytes of the payload that are a time of day."""


def made(route="auto"):
    clock = MonotonicClock(4.0)
    endpoint = Endpoint("udpin:127.0.0.1:0", clock)
    endpoint.open()
    link = MavlinkLink("blue_1", endpoint, 1, FieldFrame(42.0, -71.0, 30.0), clock, rate_hz=10.0, route=route)
    return link, endpoint, FakeBoat(endpoint.port, speed=4.0)


def plain(message):
    """Sender, kind and payload of a frame, its times of day left out; trailing zeros are MAVLink's to cut."""
    frame = bytes(message.get_msgbuf())
    kind = mavlink.mavlink_map[int.from_bytes(frame[7:10], "little")].msgname
    return [frame[5], frame[6], kind, frame[10 + _STAMPED.get(kind, 0) : 10 + frame[1]].rstrip(b"\0").hex()]


def sent_by(route):
    """Frames of one connection from nothing to HOLD, and those of ten commands."""
    link, _, boat = made(route)
    commands, asked = [], {}
    with boat:
        link.connect(20.0)
        link.prepare(20.0)
        for heading, speed in COMMANDS:
            boat.targets.clear()
            sent = link.send(heading, speed)
            assert until(lambda: boat.targets)
            found = plain(boat.targets[0])
            commands.append([found, round(sent.heading_rad, 12), round(sent.speed_mps, 12), sent.limit_mps])
        said = link.close()
        for *_, kind, payload in map(plain, boat.heard):
            if not kind.startswith("SET_"):
                asked.setdefault(kind, set()).add(payload)
    return {"commands": commands, "asked": {kind: sorted(found) for kind, found in asked.items()}, "left": said}


def read_of():
    """Readings after each of ten positions, attitudes, heartbeats and texts of a boat."""
    link, endpoint, boat = made()
    found = {"position": [], "attitude": [], "heartbeat": [], "text": []}
    with boat:
        link.connect(20.0)
        link.prepare(20.0)
        boat.rates_given = False
        time.sleep(0.3)
        for k in range(10):
            course = (0.3 * k - math.radians(30.0)) % (2.0 * math.pi)

            def told(k=k, course=course):
                """Say it, again until it is heard: the boat's own thread may have moved it meanwhile."""
                boat.obeys = False
                boat.latitude, boat.longitude = 42.0001 + 1e-6 * k, -70.9999 - 1e-6 * k
                boat.speed, boat.yaw = 0.1 * k, 0.3 * k
                place = boat.latitude, boat.longitude
                boat.send_attitude()
                boat.send_position(lat=round(place[0] * 1e7), lon=round(place[1] * 1e7))
                time.sleep(0.02)
                said = link.read()
                return abs(said.heading_rad - course) < 0.002 and abs(said.speed_mps - 0.1 * k) < 0.006

            assert until(told)
            seen = link.read()
            course_rad = None if math.isnan(seen.course_rad) else round(seen.course_rad, 2)
            found["position"].append([round(v, 3) for v in (*seen.position_m, seen.speed_mps)])
            found["attitude"].append([round(seen.heading_rad, 3), course_rad])
        for mode, armed in MODES:
            boat.mode, boat.armed = mode, armed
            time.sleep(0.12)
            seen = link.read()
            found["heartbeat"].append([seen.mode, seen.ready, seen.released])
        link.read()
        for text in SAID:
            boat.say(text)
            time.sleep(0.05)
            found["text"].append([t for t in link.read().texts if "switched" not in t and "disarmed" not in t])
        link.release()
    endpoint.close()
    return found


@pytest.mark.parametrize("route", ["SET_ATTITUDE_TARGET", "SET_POSITION_TARGET_LOCAL_NED"])
def test_what_is_sent_from_nothing_to_hold_is_byte_for_byte_what_it_was(route):
    found, golden = sent_by(route), json.loads(GOLDEN.read_text())[route]
    asked = found["asked"].pop("PARAM_REQUEST_READ")
    golden["asked"].pop("PARAM_REQUEST_READ")
    assert found == golden
    names = ("WP_SPEED", *ASKED)  # which are asked is preflight's; how, is the wire's
    assert set(asked) == {b"\xff\xff\x01\x01".hex() + name.encode().hex() for name in names}


def test_what_a_boat_says_is_read_as_it_was():
    golden = json.loads(GOLDEN.read_text())["read"]
    golden["heartbeat"] = [before[:3] for before in golden["heartbeat"]]
    assert read_of() == golden
