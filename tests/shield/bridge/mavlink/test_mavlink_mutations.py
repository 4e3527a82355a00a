"""Bent packets by the hundred thousand: nothing breaks, nothing impossible is read, and the next good one is heard."""

import math
import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.autopilot import Autopilot
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink

PEER = ("127.0.0.1", 5000)
PACKETS = 10_000


class Bench:
    """A link whose wire is never opened: bytes go straight to where the wire's thread takes them."""

    def __init__(self, datagrams=True):
        self.clock = ManualClock(100.0)
        self.endpoint = Endpoint("udpin:127.0.0.1:0" if datagrams else "tcpin:127.0.0.1:0", self.clock)
        self.link = MavlinkLink("blue_1", self.endpoint, 1, FieldFrame(42.0, -71.0), self.clock)
        self.endpoint._receivers = {1: self.link.autopilot}
        self.boot_ms = 10_000

    def take(self, data):
        self.clock.sleep_until(self.clock.now_s() + 0.001)
        self.endpoint.take(data, PEER, self.clock.now_s())

    def good(self):
        """A position a little north of the corner, well formed."""
        self.boot_ms += 1
        return mavlink.MAVLink_global_position_int_message(self.boot_ms, 420_001_000, -710_000_000, 0, 0, 0, 0, 0, 9000)


def seeds():
    """One frame of every kind the link looks into, and of those it should not care about."""
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    messages = [
        mavlink.MAVLink_heartbeat_message(11, 3, 129, 15, 4, 3),
        mavlink.MAVLink_global_position_int_message(10_000, 420_001_000, -710_000_000, 0, 0, 100, -50, 0, 9000),
        mavlink.MAVLink_attitude_message(10_000, 0.0, 0.0, 1.0, 0.0, 0.0, 0.1),
        mavlink.MAVLink_gps_raw_int_message(10_000_000, 3, 420_001_000, -710_000_000, 0, 80, 120, 100, 0, 14),
        mavlink.MAVLink_system_time_message(1_704_067_200_000_000, 10_000),
        mavlink.MAVLink_timesync_message(10_000_000_000, 12345),
        mavlink.MAVLink_command_ack_message(176, 0, 0, 0, 255, 191),
        mavlink.MAVLink_param_value_message(b"WP_SPEED", 2.0, 9, 100, 1),
        mavlink.MAVLink_statustext_message(4, b"PreArm: something", 3, 1),
        mavlink.MAVLink_autopilot_version_message(64 | 128, 4 << 24, 0, 0, 0, [0] * 8, [0] * 8, [0] * 8, 0, 0, 0),
        mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, 15, 0, 0, 0, 0, 0),
        mavlink.MAVLink_sys_status_message(0, 0, 0, 100, 12_600, 500, 90, 0, 0, 0, 0, 0, 0),
    ]
    return [bytes(message.pack(mav, force_mavlink1=first)) for message in messages for first in (False, True)]


def bend(frame, draw):
    """A frame with one to four changes: bytes changed, cut out, doubled, or the end lost."""
    data = bytearray(frame)
    for _ in range(draw.randint(1, 4)):
        at = draw.randrange(len(data))
        kind = draw.randrange(6)
        if kind <= 2:
            data[at] = draw.randrange(256)
        elif kind == 3 and len(data) > 2:
            del data[at]
        elif kind == 4:
            data[at:at] = data[at : at + draw.randrange(1, 8)]
        else:
            data = data[: max(1, at)]
    return bytes(data)


def mend(frame):
    """The same with a right checksum, so that what is inside reaches the handlers."""
    if len(frame) < 12 or frame[0] != 0xFD or frame[2]:
        return frame
    kind = mavlink.mavlink_map.get(int.from_bytes(frame[7:10], "little"))
    body = frame[: 10 + frame[1]]
    if kind is None or len(body) < 10 + frame[1]:
        return frame
    checksum = mavlink.x25crc(body[1:])
    checksum.accumulate(bytes([kind.crc_extra]))
    return body + checksum.crc.to_bytes(2, "little")


def check(bench):
    """What is read is finite with a finite age, or was never received."""
    reading = bench.link.read()
    for value, age in (
        (reading.position_m[0], reading.position_age_s),
        (reading.position_m[1], reading.position_age_s),
        (reading.heading_rad, reading.heading_age_s),
        (reading.turn_rate_rads, reading.turn_rate_age_s),
    ):
        assert math.isfinite(value) == math.isfinite(age)
    assert not reading.ready
    for text in reading.texts:
        assert text.isprintable()


@pytest.mark.parametrize("packets", [PACKETS, pytest.param(10 * PACKETS, marks=pytest.mark.study)])
def test_bent_packets_by_the_thousand(packets):
    bench, draw, frames = Bench(), random.Random(20240731), seeds()
    for i in range(packets):
        data = bend(frames[i % len(frames)], draw)
        bench.take(mend(data) if i % 2 else data)
        if i % 1000 == 0:
            check(bench)
    check(bench)
    assert bench.endpoint.faults["bad_checksum"] > packets // 10
    assert "undecodable" not in bench.endpoint.faults


def test_after_all_that_a_good_boat_is_heard():
    bench, draw, frames = Bench(), random.Random(7), seeds()
    for i in range(2000):
        bench.take(mend(bend(frames[i % len(frames)], draw)))
    now_s = bench.clock.now_s()
    bench.link.autopilot.telemetry.clock.sync(bench.boot_ms * 1e-3, now_s - 0.001, now_s)
    mav = mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    for _ in range(3000):
        bench.take(bytes(bench.good().pack(mav)))
        mav.seq = (mav.seq + 1) % 256
    assert bench.link.read().position_age_s < 0.1


@settings(deadline=None)
@given(st.lists(st.binary(max_size=300), max_size=20), st.booleans())
def test_any_bytes_at_all(pieces, datagrams):
    bench = Bench(datagrams)
    for piece in pieces:
        bench.take(piece)
    check(bench)


@pytest.mark.parametrize("datagrams", [True, False])
def test_the_next_good_frame_is_heard_whatever_came_before(datagrams):
    draw, frames = random.Random(11), seeds()
    good = bytes(mavlink.MAVLink_heartbeat_message(11, 3, 1, 4, 4, 3).pack(mavlink.MAVLink(None, 1, 1)))
    for i in range(500):
        bench = Bench(datagrams)
        bench.take(bend(frames[i % len(frames)], draw))
        for _ in range(30):
            bench.take(good)
        heard: Autopilot = bench.link.autopilot
        assert heard.heartbeat is not None
        assert heard.mode == "HOLD"
