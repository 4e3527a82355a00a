"""With a key nobody without it speaks on the feed: packets unsealed, forged, changed or played again count nowhere."""

import hmac
import json
import socket
import time
from pathlib import Path

import pytest
from feed_attack import GAME, forged, sealed
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender, Fix, Packet
from steerclear.shield.bridge.feed_packets import MAX_BYTES, SEAL_BYTES, Seal, is_sealed
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError, FeedError

FRAME = FieldFrame(42.0, -71.0)
KEY, OTHER = bytes(range(32)), bytes(32)
LOCAL = "127.0.0.1"
TRUE = Fix("red_1", 42.0001, -71.0001, 90.0, 1.0, 0.0, 0.1)


@pytest.fixture
def receiver():
    with FeedReceiver("127.0.0.1:0", FRAME, ManualClock(100.0), boats=("red_1",), key=KEY) as opened:
        yield opened


def test_a_sealed_packet_is_taken_once(receiver):
    data = sealed(KEY, 1, fixes=(TRUE,))
    for _ in range(3):
        receiver.take(data, LOCAL)
    assert [found.boat for found in receiver.read()] == ["red_1"]
    assert receiver.faults() == {"replayed": 2}


@pytest.mark.parametrize("game", [None, GAME], ids=["positions", "game"])
def test_what_is_not_sealed_with_the_key_is_dropped_and_counted_by_kind(receiver, game):
    fixes = () if game else (TRUE,)
    good = sealed(KEY, 1, fixes=fixes, game=game)
    bare = good[:-SEAL_BYTES]
    assert json.loads(bare)["stamp"] > 0
    changed = bare.replace(b'"seq":1', b'"seq":9') + good[-SEAL_BYTES:]
    for data in (bare, bare + b"\n", bare + b"\nhmac-sha256:" + b"0" * 63, b"", b"\nhmac-sha256:"):
        receiver.take(data, LOCAL)
    for data in (sealed(OTHER, 1, fixes=fixes, game=game), changed, bare + b"\nhmac-sha256:" + b"0" * 64, good[1:]):
        receiver.take(data, LOCAL)
    assert receiver.faults() == {"unsigned": 5, "bad_signature": 4}
    assert (receiver.read(), receiver.game()) == ((), None)
    assert receiver.alarms() == (), "nobody without the key can make an alarm"


def test_a_sender_of_your_own_as_documented_is_heard(receiver):
    text = (Path(__file__).parents[3] / "docs" / "boat_reference.md").read_text()
    (block,) = (part.split("```")[0] for part in text.split("```python\n")[1:] if "feed_key" in part)
    packet = json.loads(Packet("mine", 1, 1, fixes=(TRUE,)).encode())
    names = {"json": json, "hmac": hmac, "time": time, "packet": packet, "key": KEY}
    exec(block, names)
    receiver.take(names["datagram"], LOCAL)
    assert [found.source for found in receiver.read()] == ["mine"]


def test_every_changed_bit_is_found():
    seal, data = Seal(KEY), sealed(KEY, 1, fixes=(TRUE,))
    assert seal.fault(data) == ""
    for at in range(len(data)):
        for bit in range(8):
            changed = bytearray(data)
            changed[at] ^= 1 << bit
            assert seal.fault(bytes(changed)), (at, bit)


def test_keys_of_another_length_and_packets_that_leave_no_room_for_the_seal_are_refused():
    with pytest.raises(ConfigError, match="32"):
        FeedSender("hub", ["127.0.0.1:9"], b"short")
    with pytest.raises(ConfigError, match="32"):
        FeedReceiver("127.0.0.1:0", FRAME, ManualClock(), key=b"short")
    text = Packet("hub", 1, 1, fixes=(TRUE,)).encode()
    assert not is_sealed(text)
    with pytest.raises(FeedError, match="fewer boats"):
        Packet("hub", 1, 1, fixes=(Fix("b" * 60, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0),) * 200).encode()
    assert len(Seal(KEY).close(b"x" * (MAX_BYTES - SEAL_BYTES))) == MAX_BYTES


def test_forged_packets_cost_a_tenth_so_that_more_of_them_leave_the_true_ones_room():
    with FeedReceiver("127.0.0.1:0", FRAME, MonotonicClock(), boats=("red_1",), key=KEY) as receiver:
        host, port = receiver.address.rsplit(":", 1)
        data = next(forged("red_1"))
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            for _ in range(3000):
                out.sendto(data, (host, int(port)))
                time.sleep(0.0001)
        with FeedSender("gps_hub", [receiver.address], KEY) as hub:
            end = time.monotonic() + 10.0
            while not receiver.read():
                hub.send_positions([TRUE])
                time.sleep(0.02)
                assert time.monotonic() < end
        assert "flood" not in receiver.faults()


def test_fixes_of_packets_that_were_held_back_are_not_fresh(receiver, monkeypatch):
    now = receiver._stamps.now
    held = [sealed(KEY, seq, fixes=(TRUE,)) for seq in (1, 2)]
    receiver.take(held[0], LOCAL)
    monkeypatch.setattr(receiver._stamps, "now", lambda: now() + 30 * 100_000)
    receiver.take(held[1], LOCAL)
    (contact,) = receiver.read()
    assert 100.0 - contact.fixed_s == pytest.approx(30.0, abs=0.5)
    assert receiver.faults() == {"late": 1}
    assert "packets of hub come 30.0 s late" in receiver.fault_texts()["late"]
