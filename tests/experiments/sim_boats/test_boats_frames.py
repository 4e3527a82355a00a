import itertools
import random

import pytest
from boat_bench import Bench, attitude
from hypothesis import given, settings
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.sim_boats.wires import TARGET_OFFSETS, FrameCutter, target_of


def packets(count=20, version=2):
    mav = mavlink.MAVLink(None, 255, 190)
    made = []
    for i in range(count):
        message = (
            mavlink.MAVLink_command_long_message(i % 5, 1, 400, 0, i, 0, 0, 0, 0, 0, 0)
            if i % 2
            else mavlink.MAVLink_heartbeat_message(6, 8, 0, i, 0, 3)
        )
        made.append(bytes(message.pack(mav, force_mavlink1=version == 1)))
    return made


@pytest.mark.parametrize("version", [1, 2])
@given(cuts=st.lists(st.integers(0, 900), max_size=30))
@settings(max_examples=50, deadline=None)
def test_packets_are_found_however_the_stream_is_cut(version, cuts):
    whole = packets(version=version)
    data = b"".join(whole)
    bounds = sorted({min(cut, len(data)) for cut in cuts} | {0, len(data)})
    cutter = FrameCutter()
    found = [p for a, b in itertools.pairwise(bounds) for p in cutter.cut(data[a:b])]
    assert found == whole


@given(st.binary(max_size=2000))
@settings(deadline=None)
def test_any_bytes_are_survived(data):
    bench = Bench()
    cutter = FrameCutter()
    for packet in cutter.cut(data):
        target_of(packet)
        bench.boat.hear(packet, 0.0)
    assert len(cutter._kept) < 300


def test_a_signed_packet_keeps_its_signature():
    mav = mavlink.MAVLink(None, 255, 190)
    mav.signing.secret_key, mav.signing.sign_outgoing = bytes(32), True
    packet = bytes(mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 0, 3).pack(mav))
    assert list(FrameCutter().cut(b"\x00\x01" + packet)) == [packet]


def sample_of(kind):
    """A message of a type, for system 9; constructors take the fields in the order of their names."""
    values = []
    for name, field in zip(kind.fieldnames, kind.fieldtypes, strict=True):
        length = kind.array_lengths[kind.ordered_fieldnames.index(name)]
        plain = {"float": 1.0, "double": 1.0, "char": b"x"}.get(field, 1)
        value = 9 if name == "target_system" else plain
        values.append([value] * length if length and field != "char" else value)
    return kind(*values)


def test_targets_are_those_that_decoding_finds():
    mav = mavlink.MAVLink(None, 255, 190)
    reader = mavlink.MAVLink(None)
    checked = 0
    for number in TARGET_OFFSETS:
        kind = mavlink.mavlink_map[number]
        message = sample_of(kind)
        for version_1 in (False, True):
            if version_1 and number > 255:
                continue
            packet = bytes(message.pack(mav, force_mavlink1=version_1))
            assert target_of(packet) == reader.decode(bytearray(packet)).target_system == 9
            checked += 1
    assert checked > 100


def test_trailing_zeros_left_out_are_target_zero():
    mav = mavlink.MAVLink(None, 255, 190)
    packet = mavlink.MAVLink_param_request_list_message(0, 0).pack(mav)
    assert target_of(bytes(packet)) == 0


def test_damaged_packets_are_refused_and_never_raise():
    random.seed(1)
    bench = Bench().guided()
    good = bytes(attitude(1.0, 0.5).pack(bench.ground))
    taken = bench.boat.autopilot.counts["taken"]
    for _ in range(2000):
        data = bytearray(good)
        for _ in range(random.randint(1, 4)):
            data[random.randrange(len(data))] ^= 1 << random.randrange(8)
        for packet in FrameCutter().cut(bytes(data)):
            bench.boat.hear(packet, 0.0)
    # a 16-bit checksum lets one in 65536 damaged ones through, and even numbers of equal flips undo each other
    assert bench.boat.autopilot.counts["taken"] - taken < 20
    assert bench.boat.autopilot.counts["refused"] > 1500
