"""Incidents of the whole loop: the operator, what breaks inside, clocks, disks, the geofence."""

import math
import time

import numpy as np
import pytest
from bridge_fakes import World, fleet_of, fleet_text, pair, straight
from steerclear.shield import Surroundings
from steerclear.shield.bridge.fleet_file import parse_fleet

NORTH = 0.0
GEOFENCE = "geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}"


def test_a_full_disk_is_answered_as_declared_until_it_is_not():
    world = pair()
    world.run(0.5)
    world.sink.full = True
    world.run(0.5)
    world.sink.full = False
    world.run(0.2)
    assert ("log", "hold_station") in {(a.condition, a.response) for a in world.sink.ticks[-2].actions}
    assert "free some" in next(a.text for a in world.sink.ticks[-2].actions if a.condition == "log")
    assert ("log", "hold_station") not in world.responses()


def test_stop_all_stops_all_through_the_shield_and_a_second_one_past_it():
    world = pair()
    world.run(1.0)
    world.operator.stop_all("key")
    world.run(2.0)
    assert all(entry[2] == 0.0 for link in world.links.values() for entry in link.sent[-10:])
    assert not any(link.stops for link in world.links.values())
    assert ("stop_all", "stop") in world.responses("all")
    world.operator.stop_all("key")
    world.run(0.3)
    assert all(link.stops == 3 for link in world.links.values())
    world.operator.resume()
    world.run(0.3)
    assert world.links["blue_1"].sent[-1][2] > 0.0


class Broken:
    """A shield that raises."""

    def __init__(self, error):
        self.error = error
        self.resets = 0

    def reset(self):
        self.resets += 1

    def decide(self, *_):
        raise self.error


@pytest.mark.parametrize("error", [ValueError("wrong"), ZeroDivisionError(), MemoryError("no memory")])
def test_whatever_breaks_in_the_decision_all_are_told_to_stop_and_the_loop_goes_on(error):
    fleet = fleet_of(blue=2, red=0)
    shield = Broken(error)
    world = World(fleet, [(0.0, 0.0, 0.0, 1.0), (30.0, 0.0, 0.0, 1.0)], straight(NORTH), shield=shield)
    world.run(1.0)
    assert len(world.sink.ticks) == 10
    assert [link.stops for link in world.links.values()] == [10, 10]
    assert shield.resets == 10
    assert any(action.condition == "decision" and type(error).__name__ in action.text for action in world.last.actions)
    assert world.last.decisions is None


def test_a_link_that_breaks_the_turn_leaves_all_told_to_stop():
    world = pair()
    world.run(0.5)
    world.links["blue_2"].read = lambda: 1 / 0
    world.run(0.5)
    assert world.links["blue_1"].stops == 5


GIVEN_BACK = {"ready": False, "released": True, "why_not": "it was taken from us (MANUAL) and given back"}


def test_a_boat_that_was_taken_and_given_back_is_left_alone_by_a_broken_turn_and_at_the_end():
    world = pair()
    taken, ours = world.links["blue_1"], world.links["blue_2"]
    taken.changed = GIVEN_BACK
    world.run(0.5)
    ours.read = lambda: 1 / 0
    world.run(0.5)
    assert (taken.stops, ours.stops) == (0, 5)
    world.loop.run(0.0)
    assert taken.stops == 0
    assert ours.stops > 5


def test_stop_all_past_the_shield_stops_also_a_boat_that_was_taken_and_given_back():
    world = pair()
    world.links["blue_1"].changed = GIVEN_BACK
    for _ in range(2):
        world.operator.stop_all("key")
    world.run(0.3)
    assert [link.stops for link in world.links.values()] == [3, 3]


def test_a_sink_that_breaks_stops_nobody():
    world = pair()
    world.sink.take = lambda tick: 1 / 0
    world.run(1.0)
    assert len(world.links["blue_1"].sent) == 10


def test_no_decision_no_command_before_the_first_fix():
    world = pair()
    for link in world.links.values():
        link.changed = {"position_m": (math.nan, math.nan), "position_age_s": math.inf}
    world.run(0.3)
    assert world.last.fleet is None
    assert [link.stops for link in world.links.values()] == [3, 3]
    assert all(not link.sent for link in world.links.values())


def test_a_boat_outside_the_geofence_is_steered_back():
    world = World(fleet_of(blue=1, red=0), [(20.0, 62.0, 0.0, 0.0)], straight(NORTH))
    world.run(1.0)
    assert ("geofence", "return") in world.responses("blue_1")
    world.run(40.0)
    assert world.fleet.geofence.holds(*world.links["blue_1"].row[:2])


def test_a_wall_clock_that_steps_by_an_hour_changes_nothing(monkeypatch):
    plain = pair().run(6.0)
    stepped = pair()
    wall = time.time

    def strike(world):
        if world.clock.now_s() >= 1002.0:
            monkeypatch.setattr(time, "time", lambda: wall() + 3600.0)
        if world.clock.now_s() >= 1004.0:
            monkeypatch.setattr(time, "time", lambda: wall() - 3600.0)

    stepped.run(6.0, strike)
    for before, after in zip(plain.sink.ticks, stepped.sink.ticks, strict=True):
        np.testing.assert_array_equal(before.decisions.filtered.values, after.decisions.filtered.values)
        assert before.actions == after.actions


LINES = "geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60, beyond_m: 5.0, then: stop}"


def test_a_boat_beyond_its_hard_line_is_stopped_by_its_link_at_once_and_handed_over_until_it_is_taken_back():
    fleet = parse_fleet(fleet_text(blue=1, red=0).replace(GEOFENCE, LINES))
    world = World(fleet, [(40.0, 64.0, 0.0, 0.0)], straight(NORTH)).run(0.5)
    link = world.links["blue_1"]
    assert link.stops == 0, "within the hard line it is steered"
    assert any("4.0 m outside the geofence" in a.text for a in world.last.actions)
    link.row[1], link._past = 66.0, []
    world.run(3.5)
    assert link.stops > 0
    first = next(tick for tick in world.sink.ticks if any(a.condition == "hard_line" for a in tick.actions))
    assert "beyond the hard line: stopped by its link, handed over" in first.actions[-1].text
    stops, sent = link.stops, len(link.sent)
    link.row[1] = 50.0  # somebody tows it in: it lies there until it is taken back
    world.run(3.0)
    assert (link.stops, len(link.sent)) == (stops + 30, sent)
    assert any("take it back" in a.text for a in world.last.actions)
    world.operator.take_back("blue_1")
    world.run(0.5)
    assert len(link.sent) > sent


def test_a_boat_that_is_beyond_its_hard_line_once_a_command_works_is_handed_over_in_that_turn():
    text = fleet_text(blue=1, red=0, more="shield: {delay_s: 0.3}").replace(GEOFENCE, LINES)
    world = World(parse_fleet(text), [(40.0, 64.6, 0.0, 2.0)], straight(NORTH)).run(0.2)
    first, second = world.sink.ticks[:2]
    assert first.decisions.outside_m[0] < 5.0, "the shield runs it on by the delay"
    assert [a.condition for a in first.actions if a.response == "stop"] == ["hard_line"]
    assert any(a.condition == "hard_line" and "take it back" in a.text for a in second.actions)


def test_a_boat_that_can_only_stop_before_a_shore_is_stopped_by_its_link_and_goes_on_by_itself():
    shore = Surroundings(polygons=[((-30.0, 20.0), (110.0, 20.0), (110.0, 30.0), (-30.0, 30.0))])
    fleet = parse_fleet(fleet_text(blue=1, red=0).replace(GEOFENCE, LINES))
    world = World(fleet, [(40.0, 5.0, 0.0, 2.0)], straight(NORTH), grounds=shore).run(25.0)
    assert world.links["blue_1"].row[1] < 20.0
    assert not world.loop.failsafe.handed_over
