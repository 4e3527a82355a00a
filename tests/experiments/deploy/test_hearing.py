"""Boats heard at their own links, by who commands none of them."""

import socket
import time

import pytest
from steerclear.experiments.deploy.referee import Hearing, Referee
from steerclear.experiments.sim_boats import AutopilotSettings, SimFleet
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.feed import FeedReceiver, FeedSender, Fix
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import Contact
from steerclear.shield.exceptions import FleetFileError

FLEET = """
version: 1
field: {{origin: {{latitude_deg: 42.0, longitude_deg: -71.0}}, size_m: [80, 40], y_axis_deg: 20.0}}
geofence: {{xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}}
team: blue
{feed}
boats:
  - {{name: b1, agent: agent_0, platform: heron, link: {{kind: mavlink, address: "udpin:127.0.0.1:{}", system_id: 1}}}}
  - {{name: r1, agent: agent_1, platform: heron, link: {{kind: mavlink, address: "udpin:127.0.0.1:{}", system_id: 2}}}}
"""
FEED = 'feed: {{listen: "127.0.0.1:{}", referee: "127.0.0.1:{}"}}'


def fleet_of(feed=FEED, text=FLEET):
    ports = []
    for _ in range(4):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            ports.append(probe.getsockname()[1])
    return parse_fleet(text.format(*ports, feed=feed.format(*ports[2:])))


def modes_of(boats):
    vehicles = [boat.autopilot.vehicle for boat in boats.boats.values()]
    return [(vehicle.mode, vehicle.armed) for vehicle in vehicles]


def wait_for(condition):
    end_s = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.01)


def test_links_are_listened_to_and_left_as_they_were():
    fleet = fleet_of()
    clock = MonotonicClock()
    settings = {"autopilot": AutopilotSettings(boot_s=0.0), "feed_to": (), "waits": True}
    with SimFleet.from_file(fleet, **settings) as boats:
        before = modes_of(boats)
        with Hearing(fleet, clock, links=True) as hearing:
            wait_for(lambda: len(hearing.contacts()) == 2)
            found = {contact.boat: contact for contact in hearing.contacts()}
            assert found["b1"].position_m == pytest.approx((25.0, 20.0), abs=0.1)
            assert found["r1"].position_m == pytest.approx((55.0, 20.0), abs=0.1)
            now_s = clock.now_s()
            with FeedSender("hub", [fleet.feed.referee]) as hub:
                hub.send_positions([Fix("b1", 42.0, -71.0, 0.0, 1.0, 60.0, 0.1)])
                wait_for(lambda: hearing.feed.read())
            assert all(contact.fixed_s > now_s - 10.0 for contact in hearing.contacts()), "of two the fresher one"
        time.sleep(0.2)
        assert modes_of(boats) == before
    assert isinstance(found["b1"], Contact)


def test_boats_that_run_moos_are_heard_at_their_links_too():
    link = '{{kind: mavlink, address: "udpin:127.0.0.1:{}", system_id: 1}}'
    fleet = fleet_of(feed="", text=FLEET.replace(link, '"moos://127.0.0.1:{}"'))
    with SimFleet.from_file(fleet, autopilot=AutopilotSettings(boot_s=0.0), feed_to=()) as boats:
        with Hearing(fleet, MonotonicClock(), links=True) as hearing:
            wait_for(lambda: {contact.boat for contact in hearing.contacts()} == {"b1", "r1"})
        assert not boats.boats["b1"].is_commanded


def test_it_must_be_told_where_to_hear():
    fleet = fleet_of(feed="")
    with pytest.raises(FleetFileError, match="give --listen or --links"):
        Hearing(fleet, MonotonicClock())
    with Hearing(fleet, MonotonicClock(), listen="127.0.0.1:0") as hearing:
        assert hearing.contacts() == ()


def test_with_signing_boats_and_referee_seal_what_they_say_and_nobody_else_is_heard(tmp_path):
    key_file = tmp_path / "feed.key"
    key_file.write_text("12" * 32)
    key_file.chmod(0o600)
    fleet, key = fleet_of(FEED + f"\nsigning: {{{{key_file: {key_file}}}}}"), bytes.fromhex("12" * 32)
    clock = MonotonicClock()
    strange = Fix("r1", 42.0001, -71.0, 0.0, 0.0, 0.0, 0.0)
    with (
        FeedReceiver(fleet.feed.listen, fleet.frame, clock, boats=fleet.names, key=key) as runner,
        Referee(fleet, clock) as referee,
        FeedSender("gps_hub", [fleet.feed.listen, fleet.feed.referee]) as liar,
        SimFleet.from_file(fleet, autopilot=AutopilotSettings(boot_s=0.0)) as boats,
    ):
        wait_for(lambda: liar.send_positions([strange]) or len(referee.hearing.contacts()) == 2)
        wait_for(lambda: referee.turn() and runner.game() is not None and len(runner.read()) == 2)
        x_m, y_m = boats.states()["r1"][:2]
        for told in (runner.read(), referee.hearing.contacts()):
            found = {contact.boat: contact for contact in told}
            assert found["r1"].position_m == pytest.approx((x_m, y_m), abs=0.5)
        wait_for(lambda: liar.send_positions([strange]) or runner.faults().get("unsigned", 0) > 3)
        assert set(runner.faults()) == {"unsigned"}
        assert runner.alarms() == ()
