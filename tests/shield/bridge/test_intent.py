"""Team-mates with a process each tell each other what they were told, and answer it."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from bridge_fakes import DT_S, FakeLink, FakePolicy, FakeSink, World, fleet_of, fleet_text, straight
from steerclear.shield.bridge.clock import ManualClock, MonotonicClock
from steerclear.shield.bridge.contact import Contact
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender
from steerclear.shield.bridge.feed_packets import Packet
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.intent import INTENT_AGE_S, Intent, IntentPublisher, fresh
from steerclear.shield.bridge.link import Sent
from steerclear.shield.bridge.loop import Loop
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.parts import Parts
from steerclear.shield.platforms import layout as L


class Recorder:
    def __init__(self):
        self.packets = []

    def send_courses(self, courses):
        self.packets.append(courses)

    def close(self):
        self.packets.append("closed")


def test_an_intent_counts_for_half_a_second():
    intent = Intent("blue_2", 1.0, 1.0, 100.0, "test")
    assert fresh(intent, 100.0 + INTENT_AGE_S) is intent
    assert fresh(intent, 100.01 + INTENT_AGE_S) is None
    assert fresh(Intent("blue_2", 1.0, 1.0, math.nan, "test"), 100.0) is None
    assert fresh(None, 100.0) is None


def test_what_left_is_told_at_every_turn_and_a_boat_that_was_not_reached_is_not():
    sender = Recorder()
    world = World(fleet_of(blue=2, red=0), [(10.0, 5.0, 90.0, 0.0), (50.0, 5.0, 0.0, 0.0)], straight(30.0, 1.0))
    publisher = IntentPublisher(sender, world.fleet.frame)
    world.loop.parts.sinks[0].take = publisher.take
    link = world.links["blue_2"]
    link.send = lambda heading, speed: Sent("blue_2", world.clock.now_s(), heading, speed, "fake", False)
    world.run(1.0)
    assert len(sender.packets) == 10
    (course,) = sender.packets[-1]
    assert (course.boat, course.heading_deg, course.speed_mps, course.age_s) == pytest.approx(
        ("blue_1", 30.0, 1.0, 0.0)
    )
    publisher.close()
    assert sender.packets[-1] == "closed"


def test_a_links_own_stop_keeps_the_boats_heading():
    sender = Recorder()
    world = World(fleet_of(blue=1, red=0), [(10.0, 5.0, 90.0, 0.0)], straight(0.0, 1.0))
    publisher = IntentPublisher(sender, world.fleet.frame)
    world.loop.parts.sinks[0].take = publisher.take
    world.operator.stop_all("test")
    world.operator.stop_all("test")
    world.run(0.1)
    ((course,),) = sender.packets
    assert (course.heading_deg, course.speed_mps) == pytest.approx((90.0, 0.0))


def test_a_course_that_cannot_be_sent_is_told_once_and_stops_nobody(caplog):
    frame = fleet_of(blue=1, red=0).frame
    with FeedSender("intents", ["127.0.0.1:9"]) as sender:
        publisher = IntentPublisher(sender, frame)
        many = {f"boat_{k}" + "x" * 600: Sent("b", 0.0, 0.0, 1.0, "fake", True) for k in range(64)}
        for _ in range(2):
            publisher.take(SimpleNamespace(sent=many, sent_s=0.0))
    assert caplog.text.count("courses not published") == 1


def test_it_is_heard_over_udp():
    fleet, clock = fleet_of(blue=2, red=0), MonotonicClock()
    with FeedReceiver("127.0.0.1:0", fleet.frame, clock, boats=fleet.names) as receiver:
        with FeedSender("intents_blue_1", [receiver.address]) as sender:
            publisher = IntentPublisher(sender, fleet.frame)
            sent = {"blue_1": Sent("blue_1", clock.now_s(), 1.25, 0.75, "fake", True)}
            for _ in range(200):
                publisher.take(SimpleNamespace(sent=sent, sent_s=clock.now_s()))
                if receiver.intents():
                    break
                clock.sleep_until(clock.now_s() + 0.01)
        found = receiver.intents()["blue_1"]
    assert (found.heading_rad, found.speed_mps) == pytest.approx((1.25, 0.75))


class Ear:
    """What one process hears: positions of the others a turn old, and what they were told, when they tell it."""

    def __init__(self, receiver):
        self.receiver = receiver
        self.contacts = ()

    def read(self):
        return self.contacts

    def send_courses(self, courses):
        self.receiver.take(Packet("mate", 1, self.receiver.seq, courses=tuple(courses)).encode(), "127.0.0.1")
        self.receiver.seq += 1

    def close(self):
        pass


class Quiet(FeedReceiver):
    """A receiver that packets are handed to."""

    seq = 0

    def _hear(self):
        pass


class Apart:
    """Boats of one team with a process each, on one clock; ``rules[i](k)``: what boat i wants, m/s and rad."""

    def __init__(self, starts, rules, tells):
        names = [f"blue_{i + 1}" for i in range(len(starts))]
        more = "coordination: per_boat\nshield: {position_error_m: 0.3}"
        fleet = parse_fleet(fleet_text(blue=len(starts), red=0, more=more))
        self.clock, self.closest_m, self.number = ManualClock(1000.0), math.inf, 0
        self.links = [FakeLink(name, self.clock, "heron", *start) for name, start in zip(names, starts, strict=True)]
        self.sinks = [FakeSink() for _ in names]
        self.ears = [Ear(Quiet("127.0.0.1:0", fleet.frame, self.clock, boats=names)) for _ in names]
        self.loops = []
        for i, link in enumerate(self.links):
            policy = FakePolicy(self.clock, lambda snapshot, i=i: self._wanted(rules[i], len(names), i))
            others = [IntentPublisher(ear, fleet.frame) for k, ear in enumerate(self.ears) if k != i and tells]
            parts = Parts(
                {link.boat: link},
                policy,
                contacts=(self.ears[i],),
                intents=self.ears[i].receiver,
                sinks=(self.sinks[i], *others),
            )
            policy.offer(SimpleNamespace(taken_s=self.clock.now_s()))
            self.loops.append(Loop(fleet, parts, Operator(), self.clock))

    def _wanted(self, rule, boats, i):
        values = np.full((boats, 2), np.nan)
        values[i] = rule(self.number)
        return values

    def run(self, seconds):
        for _ in range(round(seconds / DT_S)):
            for loop in self.loops:
                loop.turn(self.clock.now_s())
            seen = [self._contact(link) for link in self.links]
            for i, ear in enumerate(self.ears):
                ear.contacts = tuple(contact for k, contact in enumerate(seen) if k != i)
            for link in self.links:
                link.advance(DT_S)
            self.clock.sleep_until(self.clock.now_s() + DT_S)
            self.number += 1
            at = np.array([link.row[:2] for link in self.links])
            apart = np.hypot(*(at[:, None] - at[None]).transpose(2, 0, 1)) + np.diag(np.full(len(at), np.inf))
            self.closest_m = min(self.closest_m, float(apart.min()))
        for ear in self.ears:
            ear.receiver.close()
        return self

    def _contact(self, link):
        heading = math.radians(link.row[L.HEADING])
        return Contact(
            link.boat, tuple(link.row[:2]), heading, float(link.row[L.SPEED]), self.clock.now_s(), 0.3, "gps"
        )


def side_by_side(k):
    """Two boats side by side that turn towards each other now and then."""
    return 30.0 * ((k // 40) % 2)


def test_mates_told_of_each_others_commands_are_given_them_as_wanted():
    world = Apart(
        [(20.0, 0.0, 0.0, 2.0), (26.0, 0.0, 0.0, 2.0)],
        [
            lambda k: (2.0, math.radians(side_by_side(k))),
            lambda k: (2.0, math.radians(-side_by_side(k)) % (2 * math.pi)),
        ],
        tells=True,
    ).run(20.0)
    first, second = world.sinks
    compared = 0
    for before, now in zip(second.ticks, first.ticks[1:], strict=False):
        sent = before.sent["blue_2"]
        if "blue_2" in now.fleet.names:
            given = now.wanted.values[now.fleet.names.index("blue_2")]
            assert given == pytest.approx([sent.speed_mps, sent.heading_rad], abs=1e-6)
            compared += 1
    assert compared > 150
    assert world.closest_m >= 2.5


def test_without_a_word_they_keep_apart_all_the_same():
    world = Apart(
        [(20.0, 0.0, 0.0, 2.0), (20.3, 40.0, 180.0, 2.0)],
        [lambda k: (2.0, 0.0), lambda k: (2.0, math.pi)],
        tells=False,
    ).run(20.0)
    assert world.closest_m >= 2.5
    assert world.sinks[0].ticks[50].wanted.values[1] == pytest.approx([2.0, math.pi], abs=0.2)
