"""Frames out of bytes: chopped anyhow they all come through, and damage costs nothing but itself."""

import struct

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.mavlink.framing import Framer, message_id, source


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


def crc_of(content, extra):
    """X.25 checksum of a frame's content, by its definition (MAVLink: CRC-16/MCRF4XX)."""
    crc = 0xFFFF
    for byte in (*content, extra):
        crc ^= byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0x8408 if crc & 1 else crc >> 1
    return crc


def right_by_chance(stream, begins):
    """Whether a frame with a right checksum begins where none was sent: once in 65,536 markers nobody can tell."""
    for at, marker in enumerate(stream):
        if marker not in (0xFD, 0xFE) or at in begins or at + 12 > len(stream):
            continue
        header = 10 if marker == 0xFD else 6
        number = int.from_bytes(stream[at + 7 : at + 10], "little") if marker == 0xFD else stream[at + 5]
        kind, end = mavlink.mavlink_map.get(number), at + header + stream[at + 1]
        if kind is not None and crc_of(stream[at + 1 : end], kind.crc_extra) == int.from_bytes(
            stream[end : end + 2], "little"
        ):
            return True
    return False


def begins_of(parts, whose):
    """Places where the frames ``whose`` among consecutive parts begin."""
    return {sum(map(len, parts[:i])) for i in whose}


def test_a_frame_right_by_chance_is_told():
    frame = frames_of(1)[0]
    assert not right_by_chance(frame, {0})
    assert right_by_chance(frame, set())
    assert right_by_chance(b"ab" + frame, {0})


@settings(deadline=None)
@given(st.lists(st.integers(1, 60), min_size=1, max_size=40), st.booleans(), st.booleans())
def test_a_stream_chopped_anyhow_gives_every_frame(cuts, signed, first):
    frames = frames_of(12, signed=signed, first=first)
    data, framer, got, at = b"".join(frames), Framer(False), [], 0
    for i in range(10_000):
        piece = data[at : at + cuts[i % len(cuts)]]
        got += framer.feed(piece)
        at += len(piece)
        if at >= len(data):
            break
    assert got == frames
    assert framer.damaged == 0


@settings(deadline=None)
@given(st.binary(max_size=40), st.binary(max_size=40))
def test_noise_around_frames_in_a_stream_costs_no_frame(before, after):
    frames = frames_of(6)
    parts = [before, *frames, after, bytes(300)]
    assume(not right_by_chance(b"".join(parts), begins_of(parts, range(1, 7))))
    got = Framer(False).feed(b"".join(parts))
    assert [f for f in frames if f in got] == frames


@settings(max_examples=200, deadline=None)
@given(st.data())
def test_a_damaged_frame_in_a_stream_costs_only_itself(data):
    frames = frames_of(8)
    victim = data.draw(st.integers(0, 7))
    place = data.draw(st.integers(0, len(frames[victim]) - 1))
    change = data.draw(st.integers(1, 255))
    bent = bytearray(frames[victim])
    bent[place] ^= change
    sent = [bytes(bent) if i == victim else frame for i, frame in enumerate(frames)]
    parts = [*sent, bytes(300)]
    assume(not right_by_chance(b"".join(parts), begins_of(parts, set(range(8)) - {victim})))
    got = Framer(False).feed(b"".join(parts))
    rest = [frame for i, frame in enumerate(frames) if i != victim]
    assert [frame for frame in got if frame in rest] == rest


@settings(deadline=None)
@given(st.binary(max_size=300))
def test_a_whole_datagram_never_waits_for_the_rest_of_a_broken_one(noise):
    framer, frames = Framer(True), frames_of(4)
    framer.feed(noise)
    for frame in frames:
        assert frame in framer.feed(frame)


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
    frame = bytearray(frames_of(1)[0])
    frame[2] |= flag
    framer = Framer(True)
    assert framer.feed(bytes(frame)) == []
    assert framer.damaged >= 1


def test_who_and_what_a_frame_is():
    second, first = frames_of(1)[0], frames_of(1, first=True)[0]
    assert (second[0], first[0]) == (0xFD, 0xFE)
    for frame in (second, first):
        assert source(frame) == (7, 1)
        assert message_id(frame) == mavlink.MAVLINK_MSG_ID_HEARTBEAT


def test_a_flood_of_markers_keeps_no_more_than_a_frame():
    for datagrams in (True, False):
        framer = Framer(datagrams)
        for _ in range(20):
            framer.feed(b"\xfd" * 2000)
        assert len(framer._rest) <= 300
