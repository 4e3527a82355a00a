"""Fault drills of the whole loop on simulated boats: what the remaining information can prevent is prevented."""

import dataclasses
import math

import numpy as np
import pytest
from bridge_fakes import World, fleet_of, pair, straight
from steerclear.shield import Shield
from steerclear.shield.platforms import layout as L

NORTH = 0.0


def duel(rule=None, **settings):
    """One own boat, one other coming straight at it."""
    world = World(
        fleet_of(blue=1, red=1, **settings),
        [(20.0, 0.0, 0.0, 2.0)],
        rule or straight(NORTH),
        others=[("red_1", 20.3, 40.0, 180.0, 2.0)],
    )
    return world


def test_two_boats_told_to_collide_do_not():
    world = pair().run(20.0)
    assert 2.5 <= world.closest_m < 10.0
    assert any(tick.decisions is not None and tick.decisions.count_intervened for tick in world.sink.ticks)


class Unheeded(Shield):
    """Decides, and sends what was wanted."""

    def decide(self, fleet, wanted, surroundings=None):
        return dataclasses.replace(super().decide(fleet, wanted, surroundings), filtered=wanted)


def test_without_the_shield_they_would():
    assert pair(shield=Unheeded()).run(20.0).closest_m < 1.0


def test_telemetry_that_stops_stops_the_boat_by_its_link_and_the_other_keeps_clear():
    world = pair()

    def strike(world):
        if world.clock.now_s() >= 1004.0 and world.links["blue_1"].silent_since_s is None:
            world.links["blue_1"].silent_since_s = world.clock.now_s()

    world.run(4.7, strike)
    assert ("navigation", "stop") in world.responses("blue_1")
    assert world.links["blue_1"].stops == 0
    world.run(4.6, strike)
    assert world.links["blue_1"].stops > 0, "after lost_after_s its state is unknown"
    fleet = world.last.fleet
    assert fleet.names == ("blue_1", "blue_2")
    assert fleet.controlled.tolist() == [False, True]
    world.run(20.0, strike)
    assert world.closest_m >= 2.5
    grown = [tick.fleet.position_error_m[0] for tick in world.sink.ticks if tick.fleet is not None]
    assert grown[-1] > 2.0
    assert max(grown) < 20.0


def test_telemetry_that_stops_is_replaced_by_the_feed_where_it_knows_the_boat():
    world = pair()
    link = world.links["blue_1"]
    world.contacts.rows["blue_1"] = link.row  # somebody else watches it
    world.contacts.advance = lambda dt_s: None

    def strike(world):
        if world.clock.now_s() >= 1004.0 and link.silent_since_s is None:
            link.silent_since_s = world.clock.now_s()
            link.changed = {"heartbeat_age_s": 0.2}

    world.run(8.0, strike)
    assert ("navigation", "stop") in world.responses("blue_1")
    assert any("known from the feed" in action.text for action in world.last.actions)
    assert world.last.fleet.controlled.tolist() == [True, True]
    assert link.stops == 0
    assert np.hypot(*(world.last.fleet.state[0, :2] - link.row[:2])) < 0.3
    world.run(15.0, strike)
    assert world.closest_m >= 2.5


def test_a_boat_that_hears_nothing_any_more_is_kept_clear_of():
    """Both directions of its link are lost: it goes on with its last command, then stops by its own time-out."""
    world = pair()

    def strike(world):
        link, now = world.links["blue_1"], world.clock.now_s()
        if now >= 1003.0 and link.silent_since_s is None:
            link.silent_since_s, link.deaf = now, True
        if now >= 1006.0:
            link.command = (link.row[L.HEADING], 0.0)

    world.run(25.0, strike)
    assert ("link", "stop") in world.responses("blue_1")
    assert world.closest_m >= 2.5


def test_a_boat_that_stays_where_it_jumped_to_is_believed_in_the_end():
    world = pair()
    world.run(2.0)
    world.links["blue_1"].offset_m = (30.0, 0.0)
    world.run(1.5)
    assert abs(world.last.fleet.state[0, L.X] - 20.0) < 3.0
    world.run(2.0)
    assert world.last.fleet.state[0, L.X] == pytest.approx(world.links["blue_1"].row[L.X] + 30.0, abs=0.5)


@pytest.mark.parametrize("value", [math.nan, math.inf, 1e9])
@pytest.mark.parametrize("field", ["position_m", "heading_rad", "speed_mps"])
def test_impossible_telemetry_never_reaches_the_shield(field, value):
    world = pair()

    def strike(world):
        bad = (value, 3.0) if field == "position_m" else value
        wrong = 1003.0 <= world.clock.now_s() < 1004.5
        world.links["blue_1"].changed = {field: bad} if wrong and not (field == "heading_rad" and value == 1e9) else {}

    world.run(15.0, strike)
    assert world.closest_m >= 2.5
    for tick in world.sink.ticks:
        assert np.isfinite(tick.fleet.state[:, :4]).all()


def test_a_lost_contact_slows_then_stops_us_and_is_kept_clear_of():
    world = duel()

    def strike(world):
        if world.clock.now_s() >= 1002.0:
            world.contacts.silent.add("red_1")

    world.run(3.5, strike)
    assert ("contact", "slow") in world.responses("red_1")
    world.run(4.0, strike)
    assert ("contact", "stop") in world.responses("red_1")
    assert world.closest_m >= 2.5
    ages = [tick.fleet.age_s[1] for tick in world.run(8.0, strike).sink.ticks]
    assert max(ages) <= world.fleet.shield_config.max_track_age_s


def test_an_override_of_a_lost_contact_leaves_it_out_and_says_so():
    world = duel()
    world.contacts.silent.add("red_1")
    world.contacts.read()
    world.run(1.0)
    assert ("contact", "stop") in world.responses("red_1")
    world.operator.override("contact", "red_1", 30.0, world.clock.now_s())
    world.run(1.0)
    assert ("override", "contact") in world.responses("red_1")
    assert ("contact", "stop") not in world.responses()
    assert "red_1" not in world.last.fleet.names
    world.run(31.0)
    assert ("contact", "stop") in world.responses("red_1")


def test_a_boat_in_another_mode_is_left_alone_and_kept_clear_of():
    world = pair()
    world.run(2.0)
    link = world.links["blue_1"]
    link.changed = {"ready": False, "why_not": "mode is MANUAL"}
    before = len(link.sent)
    link.command = (0.0, 2.0)
    world.run(15.0)
    assert len(link.sent) == before
    assert link.stops == 0
    assert ("mode", "none") in world.responses("blue_1")
    assert not world.last.sent["blue_1"].delivered
    assert world.closest_m >= 2.5
