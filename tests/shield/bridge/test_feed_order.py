"""Whose packets count: nobody's packet moves a sender's place for good, and junk fills no table."""

import pytest
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.feed import (
    GONE_S,
    MAX_SENDERS,
    MOST_AHEAD,
    REFEREE_GONE_S,
    FeedReceiver,
    FlagStatus,
    GameState,
    Packet,
)
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.signing import TICKS_PER_S, SigningClock

GAME = GameState(1.0, {}, (FlagStatus(0.0, 0.0, False), FlagStatus(1.0, 0.0, False)))


KEY = bytes(range(32))


class Order(FeedReceiver):
    """A receiver that packets are handed to."""

    def __init__(self, key=None):
        super().__init__("127.0.0.1:0", FieldFrame(42.0, -71.0), ManualClock(), key=key)
        super().close()

    def _hear(self):
        pass

    def problem(self, packet, now_s):
        """Kind and text of what is refused; None: it is taken."""
        self._clock.sleep_until(now_s)
        before = {kind: count for kind, count in self.faults().items() if kind != "late"}
        data = packet.encode()
        self.take(data if self._seal is None else self._seal.close(data), "127.0.0.1")
        return next(
            ((k, self.fault_texts()[k]) for k, n in self.faults().items() if k != "late" and n > before.get(k, 0)), None
        )


def packet(seq, run=7, sender="hub", game=None, stamp=None):
    return Packet(sender, run, seq, game=game, stamp=stamp)


def told(order, seconds, now_s=0.0, rate_hz=20.0, first=1, **changes):
    """Lets a sender speak for so long; how many of its packets were taken, of how many."""
    count = round(seconds * rate_hz)
    taken = sum(order.problem(packet(first + k, **changes), now_s + k / rate_hz) is None for k in range(count))
    return taken, count


INTRUDERS = [{"run": 8, "seq": 0}, {"run": 8, "seq": 2**62}, {"seq": 2**62}, {"seq": 21 + MOST_AHEAD}, {"seq": -0}]


@pytest.mark.parametrize("intruder", INTRUDERS, ids=str)
def test_one_packet_in_a_senders_name_costs_it_none_of_its_own(intruder):
    order = Order()
    assert told(order, 1.0) == (20, 20)
    kind, text = order.problem(packet(**intruder), 1.0)
    assert kind in ("second run", "old")
    assert "hub" in text
    assert told(order, 12.0, 1.05, first=21) == (240, 240), "234 of 240 were refused before"


def test_a_count_moved_within_bounds_costs_a_sender_seconds_and_not_the_rest_of_the_day():
    order = Order()
    told(order, 1.0)
    assert order.problem(packet(20 + MOST_AHEAD), 1.0) is None
    taken, count = told(order, 12.0, 1.05, first=21)
    assert count - taken <= GONE_S * 20.0
    assert told(order, 1.0, 14.0, first=261) == (20, 20)


def test_an_intruder_that_speaks_on_never_gets_in_beside_the_one_that_was_there():
    order = Order()
    counts = {7: 0, 8: 0}
    for k in range(2400):  # 12 s: the true one at 20 Hz, the other at 200 Hz
        now_s = k / 200.0
        counts[8] += k > 0 and order.problem(packet(k, run=8), now_s) is None
        if k % 10 == 0:
            counts[7] += order.problem(packet(k // 10, run=7), now_s) is None
    assert counts == {7: 240, 8: 0}


def test_a_new_start_counts_after_the_old_ones_silence_and_so_does_the_old_one_again():
    order = Order()
    told(order, 1.0)
    assert order.problem(packet(0, run=8), 1.0 + 0.5 * GONE_S)[0] == "second run"
    assert order.problem(packet(1, run=8), 1.0 + GONE_S) is None
    assert order.problem(packet(21, run=7), 1.5 + GONE_S)[0] == "second run", "a late one of the old start"
    assert order.problem(packet(22, run=7), 1.0 + 2.0 * GONE_S) is None, "it held its place while it spoke, no longer"


def test_small_disorder_is_old_and_no_sign_of_a_second_program():
    order = Order()
    told(order, 1.0)
    assert order.problem(packet(20), 1.0)[0] == "repeated"
    assert order.problem(packet(18), 1.0)[0] == "old"
    order.problem(packet(900), 1.0)
    assert order.problem(packet(20), 1.1)[0] == "second run", "somebody counts far behind"


@pytest.mark.parametrize("junk", [64, 1000])
def test_junk_names_keep_nobody_out_and_push_out_nobody_who_was_there(junk):
    order = Order()
    counts = {"hub": 0, "late": 0}
    for k in range(4000):  # 20 s of junk at 200 Hz, each name speaking again before it is silent for long
        now_s = k / 200.0
        order.problem(packet(k, sender=f"junk_{k % junk}"), now_s)
        if k % 10 == 5:
            counts["hub"] += order.problem(packet(k, sender="hub"), now_s) is None
            counts["late"] += k > 2000 and order.problem(packet(k, sender="late"), now_s) is None
    assert counts == {"hub": 400, "late": 200}
    assert len(order._senders) <= MAX_SENDERS


def test_a_game_is_kept_by_one_referee_and_taken_over_only_after_its_silence():
    order = Order()
    assert order.problem(packet(1, sender="referee", game=GAME), 0.0) is None
    assert order.problem(packet(0, run=99, sender="referee", game=GAME), 0.1)[0] == "second run"
    assert order.problem(packet(1, sender="other", game=GAME), 0.1)[0] == "second referee"
    assert order.problem(packet(2, sender="referee", game=GAME), 0.2) is None
    assert order.problem(packet(2, sender="other", game=GAME), 0.2 + REFEREE_GONE_S) is None


@pytest.fixture
def clock():
    return SigningClock()


def test_sealed_packets_must_be_of_our_time_and_rise(clock):
    order, now = Order(KEY), clock.now()
    assert order.problem(packet(1), 0.0)[0] == "malformed"
    for off_s in (-61.0, 61.0, 1e9, -1e8):
        assert order.problem(packet(1, stamp=int(now + off_s * TICKS_PER_S)), 0.0)[0] == "old_signature"
    assert order.problem(packet(1, stamp=now), 0.0) is None
    assert order.problem(packet(2, stamp=now), 0.1)[0] == "replayed"
    assert order.problem(packet(2, stamp=now + 1), 0.1) is None


def test_sealed_packets_are_not_believed_again_however_long_their_sender_is_silent(clock):
    order, now = Order(KEY), clock.now()
    old = [packet(k, stamp=now - 1000 + k) for k in range(10)]
    new = [packet(k, run=8, stamp=now + k) for k in range(10)]
    assert [order.problem(entry, 0.1 * k) for k, entry in enumerate(old)] == [None] * 10
    assert [order.problem(entry, 50.0 + 0.1 * k) for k, entry in enumerate(new)] == [None] * 10
    for entry in (*old, *new):
        assert order.problem(entry, 500.0)[0] == "replayed"
