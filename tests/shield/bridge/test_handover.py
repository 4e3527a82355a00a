"""The end of a run: boats are not left lying in somebody's way while something can still be done."""

import math

import numpy as np
import pytest
from bridge_fakes import DT_S, World, fleet_of, straight
from steerclear.shield.bridge.failsafe import nearing
from steerclear.shield.platforms import layout as L

END = "end: {clear_s: 10.0, longest_s: 40.0}"


def ending(world, hunts=lambda world: True):
    """Let the world move while the loop's own ``run`` ends at once; the other boat hunts ours while told to."""
    tick = world.clock.sleep_until
    link = world.links["blue_1"]

    def move(time_s):
        while world.clock.now_s() < time_s - 1e-9:
            row = world.contacts.rows["red_1"]
            if hunts(world):
                bearing = math.degrees(math.atan2(link.row[L.X] - row[L.X], link.row[L.Y] - row[L.Y]))
                world.contacts.commands["red_1"] = (bearing, 2.0)
            link.advance(DT_S)
            world.contacts.advance(DT_S)
            world.closest_m = min(world.closest_m, world.distance_m())
            tick(min(time_s, world.clock.now_s() + DT_S))

    world.clock.sleep_until = move
    began = world.clock.now_s()
    world.loop.run(0.3)
    return world.clock.now_s() - began


def lying(other, end=END, **more):
    """One boat of ours that lies still, and another."""
    return World(
        fleet_of(blue=1, red=1, more=end), [(40.0, 20.0, 0.0, 0.0)], straight(0.0, 0.0), others=[other], **more
    )


def near(world):
    return nearing(world.fleet, world.loop.tracker, world.loop._readings)


def test_a_boat_that_is_hunted_at_the_end_is_kept_out_of_the_way_until_it_is_left_in_peace():
    world = lying(("red_1", 40.0, 5.0, 0.0, 2.0))

    def hunts(world):
        if world.clock.now_s() < 1008.0:
            return True
        world.contacts.commands["red_1"] = (180.0, 2.0)
        return False

    took = ending(world, hunts)
    assert 8.0 < took < 38.0, "neither while it is hunted nor for ever"
    assert world.closest_m >= 2.5
    assert world.loop.near == ()
    assert world.links["blue_1"].stops == 1


def test_who_comes_near_after_the_longest_time_is_told(caplog):
    """Still on its way when the time is over: how a hunt of minutes ends would hang on every turn of it."""
    world = lying(("red_1", 40.0, 2.0, 0.0, 2.0), "end: {clear_s: 10.0, longest_s: 3.0}")
    took = ending(world)
    assert took == pytest.approx(3.3, abs=0.5)
    assert len(world.loop.near) == 1
    assert "red_1 comes within" in world.loop.near[0]
    assert "take it over by hand" in caplog.text


def test_a_boat_at_rest_keeps_clear_of_a_long_hunt():
    world = lying(("red_1", 40.0, 2.0, 0.0, 2.0))
    ending(world)
    assert world.closest_m >= 2.5


@pytest.mark.parametrize(
    ("other", "told"),
    [
        ((40.0, 12.0, 0.0, 2.0), True),
        ((40.0, 12.0, 180.0, 2.0), False),
        ((40.0, -5.0, 0.0, 2.0), False),  # 11 s away
        ((45.0, 12.0, 0.0, 2.0), False),  # passes 5 m off
        ((41.0, 21.0, 0.0, 0.0), False),  # lies still
    ],
)
def test_who_is_on_the_way_is_told_and_nobody_else(other, told):
    world = lying(("red_1", *other)).run(0.2)
    assert bool(near(world)) == told


def test_a_boat_not_heard_of_any_more_holds_nothing_up():
    world = lying(("red_1", 40.0, 12.0, 0.0, 2.0)).run(0.2)
    assert near(world)
    world.contacts.silent.add("red_1")
    world.contacts.rows["red_1"][: L.Y + 1] = np.array([0.0, 0.0])
    world.run(6.0)
    assert near(world) == []


@pytest.mark.parametrize("is_piloted", [True, False])
def test_a_boat_of_ours_that_its_pilot_steers_at_another_is_told(is_piloted):
    starts = [(40.0, 20.0, 0.0, 0.0), (40.0, 8.0, 0.0, 2.0)]
    world = World(fleet_of(blue=2, red=0, more=END), starts, straight(0.0, 0.0))
    if is_piloted:
        world.links["blue_2"].changed = {"ready": False, "why_not": "it is in MANUAL"}
    world.run(0.2)
    found = near(world)
    assert len(found) == is_piloted, "a boat that obeys is the shield's business"
    assert all("blue_2 comes within" in text and "of blue_1" in text for text in found)
    world.links["blue_2"].silent_since_s = world.clock.now_s()
    world.run(6.0)
    assert near(world) == [], "one not heard of any more holds nothing up"
