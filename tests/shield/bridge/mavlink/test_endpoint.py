"""One wire, several boats: each hears its own, nobody else gets in between, and nothing ends the thread."""

import threading

import pytest
from fake_boat import FakeBoat, wait_for
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.bridge.mavlink.signing import Signing
from steerclear.shield.exceptions import LinkError

KEY = bytes(range(32))
BEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


class Ear:
    """Keeps what it is told."""

    def __init__(self):
        self.messages, self.foreign, self.refused, self.ticks = [], [], [], 0
        self.breaks = False

    def on_message(self, message, received_s):
        if self.breaks:
            raise RuntimeError("a receiver broke")
        self.messages.append(message)

    def on_foreign(self, message, received_s):
        self.foreign.append(message)

    def on_refused(self, kind, count):
        self.refused.append(kind)

    def on_tick(self, now_s):
        self.ticks += 1


@pytest.fixture
def endpoint():
    made = Endpoint("udpin:127.0.0.1:0", MonotonicClock())
    made.open()
    yield made
    made.close()


def test_two_boats_on_one_wire_are_kept_apart(endpoint):
    one, two = Ear(), Ear()
    endpoint.attach(1, one)
    endpoint.attach(2, two)
    with FakeBoat(endpoint.port, system_id=1) as boat_1, FakeBoat(endpoint.port, system_id=2) as boat_2:
        assert wait_for(lambda: one.messages and two.messages)
        assert {m.get_srcSystem() for m in one.messages} == {1}
        assert {m.get_srcSystem() for m in two.messages} == {2}
        assert endpoint.send(1, BEAT)
        assert wait_for(lambda: boat_1.heard)
        for boat in (boat_1, boat_2):
            assert wait_for(lambda boat=boat: any(m.get_type() == "HEARTBEAT" for m in boat.heard))


def test_one_system_id_for_two_links_is_refused(endpoint):
    endpoint.attach(1, Ear())
    with pytest.raises(LinkError, match=r"two links want system id 1 on udpin.*; give each boat its own SYSID_THISMAV"):
        endpoint.attach(1, Ear())


def test_a_second_sender_with_the_boats_id_is_not_believed(endpoint):
    ear = Ear()
    endpoint.attach(1, ear)
    with FakeBoat(endpoint.port) as boat:
        assert wait_for(lambda: ear.messages)
        place = endpoint.place(1)
        with FakeBoat(endpoint.port) as other:
            assert wait_for(lambda: "second_sender" in ear.refused)
            assert endpoint.place(1) == place
            boat.heard.clear()
            assert wait_for(lambda: boat.heard), "commands still go to the first"
            assert not other.heard


def test_nothing_is_sent_before_a_boat_was_heard(endpoint):
    assert not endpoint.send(1, BEAT)
    endpoint.attach(1, Ear())
    assert not endpoint.send(1, BEAT)


def test_nothing_is_sent_by_opening_alone():
    with FakeBoat() as boat:
        made = Endpoint(f"udpout:127.0.0.1:{boat.port}", MonotonicClock())
        made.open()
        assert not wait_for(lambda: boat.heard, 0.3)
        made.attach(1, Ear())
        assert wait_for(lambda: boat.heard)
        made.close()


def test_strangers_go_to_everybody(endpoint):
    ears = [Ear(), Ear()]
    for i, ear in enumerate(ears):
        endpoint.attach(i + 1, ear)
    with FakeBoat(endpoint.port, system_id=9):
        assert wait_for(lambda: all(ear.foreign for ear in ears))
    assert not ears[0].messages


def test_a_receiver_that_breaks_does_not_end_the_wire(endpoint):
    bad, good = Ear(), Ear()
    bad.breaks = True
    endpoint.attach(1, bad)
    endpoint.attach(2, good)
    with FakeBoat(endpoint.port, system_id=1), FakeBoat(endpoint.port, system_id=2):
        assert wait_for(lambda: len(good.messages) > 5)
    assert endpoint.faults["unexpected"] > 0


def test_every_frame_is_recorded_and_a_failing_record_costs_no_link():
    frames, ear = [], Ear()
    calls = threading.Event()

    def keep(direction, frame, unix_us):
        frames.append((direction, frame, unix_us))
        if len(frames) > 5:
            calls.set()
            raise OSError("disk full")

    made = Endpoint("udpin:127.0.0.1:0", MonotonicClock(), on_bytes=keep)
    made.attach(1, ear)
    with FakeBoat(made.port):
        assert calls.wait(10.0)
        seen = len(ear.messages)
        assert wait_for(lambda: len(ear.messages) > seen + 3)
    made.close()
    assert {direction for direction, _, _ in frames} == {"in", "out"}
    assert all(frame[0] == 0xFD and unix_us > 1.6e15 for _, frame, unix_us in frames)
    assert made.faults["log"] > 0


def test_with_signing_unsigned_and_wrongly_signed_boats_are_refused():
    ear = Ear()
    made = Endpoint("udpin:127.0.0.1:0", MonotonicClock(), signing=Signing(KEY))
    made.attach(1, ear)
    with FakeBoat(made.port):
        assert wait_for(lambda: "unsigned" in ear.refused)
    with FakeBoat(made.port, key=KEY[::-1]):
        assert wait_for(lambda: "bad_signature" in ear.refused)
    assert not ear.messages
    with FakeBoat(made.port, key=KEY) as boat:
        assert wait_for(lambda: ear.messages)
        assert wait_for(lambda: boat.heard)
        assert all(m.get_header().incompat_flags & 1 for m in boat.heard)
        stolen = boat.send(mavlink.MAVLink_heartbeat_message(11, 3, 1, 0, 4, 3))
        boat.socket.sendto(stolen, ("127.0.0.1", made.port))
        assert wait_for(lambda: "replayed" in ear.refused)
    made.close()


def test_noise_is_counted_and_changes_nothing(endpoint):
    ear = Ear()
    endpoint.attach(1, ear)
    with FakeBoat(endpoint.port) as boat:
        assert wait_for(lambda: ear.messages)
        for noise in (b"\xfd" * 100, b"\x00" * 500, b"\xfe\xff" * 40, b""):
            boat.socket.sendto(noise, ("127.0.0.1", endpoint.port))
        seen = len(ear.messages)
        assert wait_for(lambda: "bad_checksum" in ear.refused)
        assert wait_for(lambda: len(ear.messages) > seen)


def test_the_wire_is_given_back_with_the_last_boat(endpoint):
    port = endpoint.port
    endpoint.attach(1, Ear())
    endpoint.attach(2, Ear())
    endpoint.detach(1)
    assert endpoint.is_open
    endpoint.detach(2)
    assert not endpoint.is_open
    again = Endpoint(f"udpin:127.0.0.1:{port}", MonotonicClock())
    again.open()
    again.close()
    again.close()


def test_a_wire_can_be_attached_again_after_it_was_given_back(endpoint):
    endpoint.attach(1, Ear())
    endpoint.detach(1)
    ear = Ear()
    endpoint.attach(1, ear)
    with FakeBoat(endpoint.port):
        assert wait_for(lambda: ear.messages)
