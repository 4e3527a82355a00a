"""Own boats' positions as others hear them."""

import math

import pytest
from bridge_fakes import World, fleet_of, straight
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender
from steerclear.shield.bridge.publishing import EVERY, PositionPublisher


class Recorder:
    sender = "test"

    def __init__(self):
        self.packets = []

    def send_positions(self, fixes):
        self.packets.append(fixes)

    def close(self):
        self.packets.append("closed")


def world_with(sender):
    world = World(fleet_of(blue=2, red=0), [(10.0, 5.0, 90.0, 0.0), (30.0, 5.0, 0.0, 0.0)], straight(0.0, 0.0))
    publisher = PositionPublisher(sender, world.fleet.frame, 0.3)
    world.loop.parts.sinks[0].take = publisher.take
    return world, publisher


def test_every_second_tick_is_sent_and_says_where_boats_are():
    sender = Recorder()
    world, publisher = world_with(sender)
    world.run(1.0)
    assert len(sender.packets) == 10 // EVERY
    fix = sender.packets[0][0]
    x, y = world.fleet.frame.to_field_m(fix.latitude_deg, fix.longitude_deg)
    assert (x, y) == pytest.approx((10.0, 5.0), abs=1e-6)
    assert (fix.heading_deg, fix.error_m) == pytest.approx((90.0, 0.3))
    publisher.close()
    assert sender.packets[-1] == "closed"


def test_a_boat_nobody_has_heard_is_not_sent():
    sender = Recorder()
    world, _ = world_with(sender)
    world.links["blue_1"].changed = {"heading_rad": math.nan, "heading_age_s": math.inf}
    world.run(0.2)
    assert [fix.boat for fix in sender.packets[0]] == ["blue_2"]


def test_what_is_sent_is_what_a_receiver_hears():
    clock = MonotonicClock()
    fleet = fleet_of(blue=2, red=0)
    with FeedReceiver("127.0.0.1:0", fleet.frame, clock, boats=fleet.names) as receiver:
        with FeedSender("runner", [receiver.address]) as sender:
            world, _ = world_with(sender)
            for _ in range(100):
                world.run(0.2)
                if len(receiver.read()) == 2:
                    break
                clock.sleep_until(clock.now_s() + 0.05)
        heard = {contact.boat: contact for contact in receiver.read()}
    assert heard["blue_1"].position_m == pytest.approx((10.0, 5.0), abs=1e-6)
    assert heard["blue_1"].heading_rad == pytest.approx(math.pi / 2)
