"""One wire, several boats: each hears its own, nobody else gets in between, and nothing ends the thread."""

import pytest
from fake_boat import FakeBoat
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.mavlink.connection import Endpoint
from steerclear.shield.exceptions import LinkError
from waiting import until

BEAT = mavlink.MAVLink_heartbeat_message(6, 8, 0, 0, 4, 3)


class Ear:
    """Keeps what it is told."""

    def __init__(self):
        self.messages, self.foreign, self.refused = [], [], []
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
        pass


@pytest.fixture
def endpoint():
    made = Endpoint("udpin:127.0.0.1:0", MonotonicClock())
    made.open()
    yield made
    made.close()


def attached(endpoint, count=1):
    """Ears of the first boats; of one boat the ear itself."""
    ears = [Ear() for _ in range(count)]
    for i, ear in enumerate(ears, start=1):
        endpoint.attach(i, ear)
    return ears if count > 1 else ears[0]


def test_boats_on_one_wire_are_kept_apart_and_strangers_go_to_everybody(endpoint):
    ears = attached(endpoint, 2)
    with (
        FakeBoat(endpoint.port, system_id=1) as boat_1,
        FakeBoat(endpoint.port, system_id=2) as boat_2,
        FakeBoat(endpoint.port, system_id=9),
    ):
        assert until(lambda: all(ear.messages and ear.foreign for ear in ears))
        assert endpoint.send(1, BEAT)
        for boat in (boat_1, boat_2):
            assert until(lambda boat=boat: any(m.get_type() == "HEARTBEAT" for m in boat.heard))
    for number, ear in enumerate(ears, start=1):
        assert {m.get_srcSystem() for m in ear.messages} == {number}
        assert {m.get_srcSystem() for m in ear.foreign} == {9}


def test_one_system_id_for_two_links_is_refused(endpoint):
    attached(endpoint)
    with pytest.raises(LinkError, match=r"two links want system id 1 on udpin.*; give each boat its own SYSID_THISMAV"):
        endpoint.attach(1, Ear())


def test_a_second_sender_with_the_boats_id_is_not_believed(endpoint):
    ear = attached(endpoint)
    with FakeBoat(endpoint.port) as boat:
        assert until(lambda: ear.messages)
        with FakeBoat(endpoint.port) as other:
            assert until(lambda: "second_sender" in ear.refused)
            boat.heard.clear()
            assert until(lambda: boat.heard), "commands still go to the first"
            assert not other.heard


def test_nothing_is_sent_before_a_boat_was_heard_nor_by_opening_alone(endpoint):
    assert not endpoint.send(1, BEAT)
    attached(endpoint)
    assert not endpoint.send(1, BEAT)
    with FakeBoat() as boat:
        made = Endpoint(f"udpout:127.0.0.1:{boat.port}", MonotonicClock())
        made.open()
        assert not until(lambda: boat.heard, 0.3)
        attached(made)
        assert until(lambda: boat.heard)
        made.close()


def test_a_receiver_that_breaks_does_not_end_the_wire(endpoint):
    bad, good = attached(endpoint, 2)
    bad.breaks = True
    with FakeBoat(endpoint.port, system_id=1), FakeBoat(endpoint.port, system_id=2):
        assert until(lambda: len(good.messages) > 5)
    assert endpoint.faults["unexpected"] > 0


def test_every_frame_is_recorded_and_a_failing_record_costs_no_link():
    frames = []

    def keep(direction, frame, unix_us):
        frames.append((direction, frame, unix_us))
        if len(frames) > 5:
            raise OSError("disk full")

    made = Endpoint("udpin:127.0.0.1:0", MonotonicClock(), on_bytes=keep)
    ear = attached(made)
    with FakeBoat(made.port):
        assert until(lambda: made.faults["log"])
        seen = len(ear.messages)
        assert until(lambda: len(ear.messages) > seen + 3)
    made.close()
    assert {direction for direction, _, _ in frames} == {"in", "out"}
    assert all(frame[0] == 0xFD and unix_us > 1.6e15 for _, frame, unix_us in frames)


def test_the_wire_is_given_back_with_the_last_boat_and_can_be_attached_again(endpoint):
    port = endpoint.port
    attached(endpoint, 2)
    endpoint.detach(1)
    assert endpoint.is_open
    endpoint.detach(2)
    assert not endpoint.is_open
    again = Endpoint(f"udpin:127.0.0.1:{port}", MonotonicClock())
    again.open()
    again.close()
    again.close()
    ear = attached(endpoint)
    with FakeBoat(endpoint.port):
        assert until(lambda: ear.messages)
