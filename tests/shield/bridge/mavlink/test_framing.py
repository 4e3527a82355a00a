"""Frames out of bytes: chopped anyhow they all come through, damage costs nothing but itself, nothing odd is read."""

import math
import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.framing import Framer
from steerclear.shield.bridge.mavlink.vehicle import MavlinkLink

PACKETS = 10_000


def frames_of(count, *, signed=False, first=False):
    """Frames of several kinds: MAVLink 2 and 1, short and long, with payloads full of frame markers."""
    mav = mavlink.MAVLink(None, srcSystem=7, srcComponent=1)
    if signed:
        mav.signing.secret_key, mav.signing.sign_outgoing = bytes(32), True
    kinds = [
        mavlink.MAVLink_heartbeat_message(11, 3, 1, 15, 4, 3),
        mavlink.MAVLink_statustext_message(4, b"\xfd\xfe\xfd\x09" * 12),
        mavlink.MAVLink_global_position_int_message(5, 420_000_000, -710_000_000, 0, 0, 100, -100, 0, 9000),
        mavlink.MAVLink_timesync_message(0, 2**62),
    ]
    frames = []
    for i in range(count):
        frames.append(bytes(kinds[i % len(kinds)].pack(mav, force_mavlink1=first and i % 2 == 0 and not signed)))
        mav.seq = (mav.seq + 1) % 256
    return frames


def mended(frame):
    """A MAVLink 2 frame with a right checksum, so that what is inside reaches the handlers; others as they are."""
    if len(frame) < 12 or frame[0] != 0xFD or frame[2]:
        return frame
    kind, body = mavlink.mavlink_map.get(int.from_bytes(frame[7:10], "little")), frame[: 10 + frame[1]]
    if kind is None or len(body) < 10 + frame[1]:
        return frame
    checksum = mavlink.x25crc(body[1:])
    checksum.accumulate(bytes([kind.crc_extra]))
    return body + checksum.crc.to_bytes(2, "little")


@settings(deadline=None)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=40), st.booleans(), st.booleans())
def test_a_stream_chopped_anyhow_gives_every_frame(cuts, signed, first):
    frames = frames_of(12, signed=signed, first=first)
    data, framer, got, i = b"".join(frames), Framer(False), [], 0
    while data:
        got += framer.feed(data[: cuts[i % len(cuts)]])
        data, i = data[cuts[i % len(cuts)] :], i + 1
    assert got == frames
    assert framer.damaged == 0


@settings(max_examples=60, deadline=None, derandomize=True)  # by chance a bent frame may hold another that is right
@given(st.integers(0, 7), st.floats(0.0, 1.0, exclude_max=True), st.integers(1, 255))
def test_a_damaged_frame_in_a_stream_costs_only_itself(victim, share, change):
    frames = frames_of(8)
    bent = bytearray(frames[victim])
    bent[int(share * len(bent))] ^= change
    rest = frames[:victim] + frames[victim + 1 :]
    got = Framer(False).feed(b"".join([*frames[:victim], bent, *frames[victim + 1 :], bytes(300)]))
    assert [frame for frame in got if frame in rest] == rest


def test_a_frame_split_over_two_datagrams_is_put_together():
    framer, (frame, *_) = Framer(True), frames_of(1)
    assert framer.feed(frame[:9]) == []
    assert framer.feed(frame[9:]) == [frame]


def test_frames_of_unknown_messages_are_counted_and_left_out():
    known = frames_of(1)[0]
    unknown = bytearray(known)
    unknown[7:10] = struct.pack("<I", 0xABCDEF)[:3]
    framer = Framer(True)
    assert framer.feed(bytes(unknown) + known) == [known]
    assert (framer.unknown, framer.damaged) == (1, 0)


@pytest.mark.parametrize("flag", [0x02, 0x80, 0xFE])
def test_flags_nobody_knows_are_refused(flag):
    frame, framer = bytearray(frames_of(1)[0]), Framer(True)
    frame[2] |= flag
    assert framer.feed(bytes(frame)) == []
    assert framer.damaged >= 1


@pytest.mark.parametrize("datagrams", [True, False])
def test_a_flood_of_markers_keeps_no_more_than_a_frame(datagrams):
    framer = Framer(datagrams)
    for _ in range(20):
        framer.feed(b"\xfd" * 2000)
    assert len(framer._rest) <= 300


class Bench:
    """A link whose wire is never opened: bytes go straight to where the wire's thread takes them."""

    def __init__(self):
        self.clock = ManualClock(100.0)
        self.endpoint = Endpoint("udpin:127.0.0.1:0", self.clock)
        self.link = MavlinkLink("blue_1", self.endpoint, 1, FieldFrame(42.0, -71.0), self.clock)
        self.endpoint._receivers = {1: self.link.autopilot}

    def take(self, data):
        self.clock.sleep_until(self.clock.now_s() + 0.001)
        self.endpoint.take(data, ("127.0.0.1", 5000), self.clock.now_s())

    def check(self):
        """What is read is finite with a finite age, or was never received."""
        reading = self.link.read()
        for value, age in (
            (reading.position_m[0], reading.position_age_s),
            (reading.position_m[1], reading.position_age_s),
            (reading.heading_rad, reading.heading_age_s),
            (reading.turn_rate_rads, reading.turn_rate_age_s),
        ):
            assert math.isfinite(value) == math.isfinite(age)
        assert not reading.ready
        assert all(text.isprintable() for text in reading.texts)


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


@pytest.mark.parametrize("packets", [PACKETS, pytest.param(10 * PACKETS, marks=pytest.mark.study)])
def test_bent_packets_by_the_thousand_break_nothing_and_afterwards_a_good_boat_is_heard(packets):
    bench, draw, frames = Bench(), random.Random(20240731), seeds()
    for i in range(packets):
        data = bend(frames[i % len(frames)], draw)
        bench.take(mended(data) if i % 2 else data)
        if i % 1000 == 0:
            bench.check()
    bench.check()
    assert bench.endpoint.faults["bad_checksum"] > packets // 10
    assert "undecodable" not in bench.endpoint.faults
    now_s, mav = bench.clock.now_s(), mavlink.MAVLink(None, srcSystem=1, srcComponent=1)
    bench.link.autopilot.telemetry.clock.sync(10.0, now_s - 0.001, now_s)
    for boot_ms in range(10_001, 13_001):
        place = mavlink.MAVLink_global_position_int_message(boot_ms, 420_001_000, -710_000_000, 0, 0, 0, 0, 0, 9000)
        bench.take(bytes(place.pack(mav)))
        mav.seq = (mav.seq + 1) % 256
    assert bench.link.read().position_age_s < 0.1
