"""A boat that lies still and a source that froze say the same: the boat's model on its commands tells them apart."""

import math

import numpy as np
import pytest
from bridge_fakes import World, fleet_of, straight
from steerclear.shield.bridge.estimator import GONE_M, LEFT_M, MOST_UNSEEN_M
from steerclear.shield.platforms import layout as L


def world(rule, speed=0.0, platform="heron"):
    return World(fleet_of(blue=1, red=0, platform=platform), [(20.0, 10.0, 90.0, speed)], rule)


def still(snapshot):
    return np.tile([0.0, math.pi / 2], (len(snapshot.seen), 1))


def freeze(world):
    """All the link says stays as it is, with fresh time stamps, while the boat goes on."""
    link = world.links["blue_1"]
    heading = math.radians(link.row[L.HEADING]) % (2.0 * math.pi)
    link.changed = {"position_m": tuple(link.row[:2]), "heading_rad": heading, "speed_mps": float(link.row[L.SPEED])}


def seconds_until_stopped(world, longest_s=10.0):
    began = world.clock.now_s()
    while world.clock.now_s() < began + longest_s:
        world.run(0.1)
        if ("navigation", "stop") in world.responses("blue_1"):
            return world.clock.now_s() - began
    return math.inf


def nothing_is_refused(world):
    assert world.loop.tracker.faults == {}


@pytest.mark.parametrize("platform", ["heron", "surveyor", "blueboat"])
def test_a_boat_at_rest_without_noise_is_believed_and_goes_when_it_is_told(platform):
    afloat = world(still, platform=platform)
    afloat.run(20.0, nothing_is_refused)
    afloat.policy.rule = straight(90.0, 1.2)
    afloat.run(6.0, nothing_is_refused)
    assert afloat.links["blue_1"].row[L.SPEED] > 0.4


def test_a_boat_that_starts_late_is_stopped_once_and_then_goes():
    afloat = world(straight(90.0, 1.2))
    afloat.links["blue_1"].deaf = True
    assert seconds_until_stopped(afloat) < 3.0
    afloat.links["blue_1"].deaf = False
    afloat.run(20.0)
    nothing_is_refused(afloat)
    assert afloat.links["blue_1"].row[L.SPEED] > 0.8


@pytest.mark.parametrize("speed", [0.4, 1.2, 2.0])
def test_a_source_that_freezes_under_way_is_seen_within_a_second(speed):
    afloat = world(straight(90.0, speed), speed)
    afloat.run(3.0)
    freeze(afloat)
    assert seconds_until_stopped(afloat) <= 1.05
    assert "frozen" in afloat.loop.tracker.faults["blue_1"]


def test_a_source_that_froze_at_rest_is_seen_within_a_second_of_the_boats_leaving():
    afloat = world(still)
    afloat.run(5.0)
    freeze(afloat)
    afloat.policy.rule = straight(90.0, 1.2)
    link = afloat.links["blue_1"]
    while math.dist(link.row[:2], (20.0, 10.0)) < LEFT_M:
        afloat.run(0.1)
    assert seconds_until_stopped(afloat) <= 1.05
    assert math.dist(link.row[:2], (20.0, 10.0)) < GONE_M + 0.2


def test_a_source_that_stays_frozen_leads_a_boat_no_farther_than_its_error_covers():
    afloat = world(still)
    afloat.run(2.0)
    freeze(afloat)
    afloat.policy.rule = straight(90.0, 1.2)
    link, farthest_m = afloat.links["blue_1"], 0.0
    for _ in range(900):
        afloat.run(0.1)
        farthest_m = max(farthest_m, math.dist(link.row[:2], (20.0, 10.0)))
        track = afloat.loop.tracker.track("blue_1")
        assert math.dist(track.position_m(), link.row[:2]) <= track.error_m + GONE_M + 0.1
    assert farthest_m < MOST_UNSEEN_M + 1.5
    assert link.row[L.SPEED] == pytest.approx(0.0, abs=0.05)
    link.changed = {}
    afloat.run(10.0)
    assert link.row[L.SPEED] > 0.5  # it moves again with the first value that changes


def test_who_takes_a_boat_by_hand_and_gives_it_back_begins_anew():
    afloat = world(still)
    afloat.run(2.0)
    freeze(afloat)
    afloat.policy.rule = straight(90.0, 1.2)
    afloat.run(90.0)
    assert "frozen" in afloat.loop.tracker.faults["blue_1"]
    afloat.links["blue_1"].changed = {"ready": False, "why_not": "driven by hand"}
    afloat.run(1.0)
    afloat.links["blue_1"].changed = {}
    afloat.run(8.0)
    assert afloat.links["blue_1"].row[L.SPEED] > 0.5
