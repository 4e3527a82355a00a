"""Boats change hands: at a run's end not into somebody's way, and back from a pilot only when the operator asks."""

import math
import threading
import time

import numpy as np
import pytest
from bridge_fakes import DT_S, World, fleet_of, pair, straight
from steerclear.shield.bridge.failsafe import nearing
from steerclear.shield.exceptions import LinkError, LinkRefused
from steerclear.shield.platforms import layout as L

END = "end: {clear_s: 10.0, longest_s: 40.0}"


def ending(world, hunts=lambda world: False):
    """End the loop's own ``run`` at once while the world moves; others hunt ours while told to. How long it took, s."""
    tick = world.clock.sleep_until

    def move(time_s):
        while world.clock.now_s() < time_s - 1e-9:
            if hunts(world):
                ours, row = world.links["blue_1"].row, world.contacts.rows["red_1"]
                bearing = math.degrees(math.atan2(ours[L.X] - row[L.X], ours[L.Y] - row[L.Y]))
                world.contacts.commands["red_1"] = (bearing, 2.0)
            for link in world.links.values():
                link.advance(DT_S)
            world.contacts.advance(DT_S)
            world.closest_m = min(world.closest_m, world.distance_m())
            tick(min(time_s, world.clock.now_s() + DT_S))

    world.clock.sleep_until = move
    began = world.clock.now_s()
    world.loop.run(0.3)
    return world.clock.now_s() - began


def lying(other, end=END):
    """One boat of ours that lies still, and another."""
    return World(fleet_of(blue=1, red=1, more=end), [(40.0, 20.0, 0.0, 0.0)], straight(0.0, 0.0), others=[other])


def near(world):
    return nearing(world.fleet, world.loop.tracker, world.loop._readings)


def test_at_the_end_boats_are_brought_to_rest_behind_the_shield():
    world = pair().run(6.0)
    ending(world)
    assert all(abs(link.row[L.SPEED]) < 0.5 for link in world.links.values())
    assert world.closest_m >= 2.5
    assert ("end", "stop") in world.responses("all")


def test_a_boat_that_is_hunted_at_the_end_is_kept_out_of_the_way_until_it_is_left_in_peace():
    world = lying(("red_1", 40.0, 5.0, 0.0, 2.0))

    def hunts(world):
        if world.clock.now_s() < 1008.0:
            return True
        world.contacts.commands["red_1"] = (180.0, 2.0)
        return False

    assert 8.0 < ending(world, hunts) < 38.0, "neither while it is hunted nor for ever"
    assert world.closest_m >= 2.5
    assert world.loop.near == ()
    assert world.links["blue_1"].stops == 1


@pytest.mark.parametrize(("longest_s", "is_told"), [(3.0, True), (40.0, False)])
def test_a_long_hunt_is_kept_clear_of_and_who_is_near_after_the_longest_time_is_told(longest_s, is_told, caplog):
    """Still on its way when a short time is over; how a hunt of minutes ends hangs on every turn of it."""
    world = lying(("red_1", 40.0, 2.0, 0.0, 2.0), f"end: {{clear_s: 10.0, longest_s: {longest_s}}}")
    assert ending(world, lambda world: True) <= longest_s + 0.8
    assert world.closest_m >= 2.5
    if is_told:
        assert len(world.loop.near) == 1
        assert "red_1 comes within" in world.loop.near[0]
        assert "take it over by hand" in caplog.text


@pytest.mark.parametrize(
    ("other", "error_m", "told"),
    [
        ((40.0, 12.0, 0.0, 2.0), 0.0, True),
        ((40.0, 12.0, 180.0, 2.0), 0.0, False),
        ((40.0, -5.0, 0.0, 2.0), 0.0, False),  # 11 s away
        ((45.0, 12.0, 0.0, 2.0), 0.0, False),  # passes 5 m off
        ((45.0, 12.0, 0.0, 2.0), 1.5, True),  # may be 3 m nearer: both places are that uncertain
        ((41.0, 21.0, 0.0, 0.0), 0.0, False),  # lies still
    ],
)
def test_who_is_on_the_way_is_told_and_nobody_else_nor_one_not_heard_of_any_more(other, error_m, told):
    world = lying(("red_1", *other), f"{END}\nshield: {{position_error_m: {error_m}}}").run(0.2)
    assert bool(near(world)) == told
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
    world.links["blue_2"].fall_silent()
    world.run(6.0)
    assert near(world) == [], "one not heard of any more holds nothing up"


def taken(prepare=lambda timeout_s, is_off: None):
    """A run in which a pilot took a boat, and its link, whose ``prepare`` is given."""
    world = pair().run(1.0)
    link = world.links["blue_1"]
    link.changed, link.prepare = {"ready": False, "why_not": "it is in MANUAL"}, prepare
    return world.run(0.5), link


def asked(world, boat="blue_1"):
    """Ask for a boat; what is told of that in the next turn, and once what is under way beside the loop has ended."""
    world.operator.take_back(boat, "keyboard")
    return told(world.run(0.1)), finish(world)


def told(world):
    return [action.text for action in world.last.actions if action.condition == "take_back"]


def finish(world):
    for thread in list(world.loop._reacquisition._threads.values()):
        thread.join(20.0)
    return told(world.run(0.2))


def test_nobody_takes_a_boat_back_by_itself():
    world, link = taken(lambda timeout_s, is_off: pytest.fail("nobody asked"))
    sent = len(link.sent)
    world.run(5.0)
    assert (len(link.sent), link.stops) == (sent, 0)
    assert told(world) == []


def test_the_operator_takes_it_back_and_it_is_in_the_record(caplog):
    world, link = taken(lambda timeout_s, is_off: setattr(link, "changed", {}))
    sent = len(link.sent)
    first, last = asked(world)
    assert "asked for by keyboard" in first[0] or "obeys" in first[0]
    assert "blue_1 is taken back and obeys" in last[0]
    assert "asked for by keyboard" in caplog.text
    world.run(1.0)
    assert len(link.sent) > sent
    world.run(11.0)
    assert told(world) == []


def test_a_boat_that_refuses_is_told_and_the_loop_goes_on():
    def refuse(timeout_s, is_off):
        raise LinkRefused("blue_1 refuses arming: safety switch; put that right, then start again")

    world, _ = taken(refuse)
    assert "not taken back: blue_1 refuses arming: safety switch" in asked(world)[1][0]
    assert not world.last.sent["blue_1"].delivered


def test_the_loop_never_waits_for_it_and_a_second_press_asks_no_second_time():
    goes_on, calls = threading.Event(), []
    world, _ = taken(lambda timeout_s, is_off: calls.append(timeout_s) or goes_on.wait(20.0))
    for _ in range(2):
        world.operator.take_back("blue_1")
        world.run(1.0)
    assert len(calls) == 1
    assert "is being taken back" in told(world)[0]
    goes_on.set()
    finish(world)


@pytest.mark.parametrize("by", ["stop_all", "end"])
def test_stop_all_and_the_end_call_it_off_and_nothing_is_taken_back_until_boats_go_on(by):
    calls = []

    def until_called_off(timeout_s, is_off):
        end = time.monotonic() + 20.0
        while not is_off() and time.monotonic() < end:
            time.sleep(0.005)
        calls.append(is_off())
        raise LinkError("blue_1: called off")

    world, _ = taken(until_called_off)
    world.operator.take_back("blue_1")
    world.run(0.1)
    if by == "end":
        world.operator.end("key")
        world.loop.run()
    else:
        world.operator.stop_all("key")
        world.run(0.1)
        assert "called off" in finish(world)[0]
        assert "STOP ALL" in asked(world)[1][0]
    assert calls == [True]


@pytest.mark.parametrize(("boat", "text"), [("blue_2", "obeys"), ("red_9", "not commanded here")])
def test_a_boat_that_need_not_be_taken_is_not_asked(boat, text):
    world, _ = taken(lambda timeout_s, is_off: pytest.fail("it was asked"))
    assert text in asked(world, boat)[0][0]
