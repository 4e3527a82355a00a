"""The bytes of MOOS: recorded traffic comes back byte for byte; what is bent is refused, whatever way it is bent."""

import random
import struct
from pathlib import Path

import pytest
from steerclear.shield.bridge.moos import wire
from steerclear.shield.bridge.moos.wire import (
    MOST_BYTES,
    PROTOCOL,
    Message,
    PacketReader,
    WireError,
    hello,
    notify,
    pack_message,
    pack_packet,
    register,
    timing,
    unpack_message,
)

CAPTURES = Path(__file__).parent / "captures"
SEEDS = [
    [hello("wirecli", 1.0)],
    [timing(2.0), register("NAV_X", "a", 2.0, 1.0), register("NODE_REPORT", "a", 2.0)],
    [notify("NAV_X", 1.25, "sim", 3.0), notify("NODE_REPORT", "NAME=red_1,X=1", "rep", 3.0)],
    [Message("*", "a", wire.STRING, "a", 1.0, text="AppPattern=*,VarPattern=NAV_*,Interval=0")],
]


@pytest.mark.parametrize("path", sorted(CAPTURES.glob("*.bin")), ids=lambda path: path.name)
def test_recorded_traffic_comes_back_byte_for_byte(path):
    data = path.read_bytes()
    stream = data[len(PROTOCOL) :] if data.startswith(b"ELKS") else data
    for chunk in (1, 7, len(stream)):
        reader = PacketReader()
        packets = [p for i in range(0, len(stream), chunk) for p in reader.feed(stream[i : i + chunk])]
        assert b"".join(pack_packet(packet) for packet in packets) == stream


def test_a_pshare_datagram_is_a_bare_message():
    message = notify("NODE_REPORT", "NAME=red_1", "pNodeReporter", 5.0)
    assert unpack_message(pack_message(message)) == (message, len(pack_message(message)))


def test_the_annotated_post_has_these_bytes():
    packed = pack_packet([Message("N", "W_DOUBLE", "D", "wirecli", 1795228132.818839, 1.25, number=3)])
    assert packed.hex() == (
        "4e000000010000000045000000030000004e440700000077697265636c69000000000000000008000000"
        "575f444f55424c45dc67347940c0da41000000000000f43f000000000000f0bf00000000"
    )


@pytest.mark.parametrize("value", [float("nan"), -float("inf")])
def test_a_number_that_is_none_is_not_posted(value):
    with pytest.raises(WireError, match="finite numbers only"):
        notify("DESIRED_SPEED", value, "gate", 1.0)
    with pytest.raises(WireError, match="finite numbers only"):
        notify("DESIRED_SPEED", 1.0, "gate", value)


@pytest.mark.parametrize("length", [-1, 0, 8, MOST_BYTES + 1, 2**31 - 1, -(2**31)])
def test_an_impossible_length_ends_the_stream_before_anything_is_kept(length):
    with pytest.raises(WireError, match="are possible"):
        PacketReader().feed(struct.pack("<i", length))


def bent(rng, data):
    """A packet with something wrong: a byte, a length, a count, the end, or the middle."""
    data = bytearray(data)
    kind = rng.randrange(5)
    if kind == 0:
        for _ in range(rng.randint(1, 8)):
            data[rng.randrange(len(data))] = rng.randrange(256)
    elif kind == 1:
        at = rng.choice([0, 4, 9, 13, 19, 23, 27, 31])
        struct.pack_into(
            "<i", data, min(at, len(data) - 4), rng.choice([-1, 0, 1, 53, 54, 2**31 - 1, rng.randrange(300)])
        )
    elif kind == 2:
        del data[rng.randrange(len(data)) :]
    elif kind == 3:
        at = rng.randrange(len(data))
        data[at:at] = rng.randbytes(rng.randint(1, 60))
    else:
        data = bytearray(rng.randbytes(rng.randint(1, 200)))
    return bytes(data)


def bend(packets, seed):
    rng, refused = random.Random(seed), 0
    seeds = [pack_packet(messages) for messages in SEEDS]
    for _ in range(packets):
        reader = PacketReader()
        try:
            for part in (bent(rng, rng.choice(seeds)), rng.choice(seeds)):
                for packet in reader.feed(part):
                    assert pack_packet(packet)  # what is taken for a packet is one
        except WireError:
            refused += 1
        assert len(reader._buffer) <= MOST_BYTES
    return refused


@pytest.mark.parametrize("packets", [3_000, pytest.param(100_000, marks=pytest.mark.study)])
def test_bent_packets_are_refused_and_break_nothing(packets):
    assert bend(packets, 1) > 0.3 * packets
