"""The one place where commands pass the shield: what goes in, what leaves, and nothing in between."""

import math

import numpy as np
import pytest
from bridge_fakes import FakeLink, World, fleet_of, fleet_text, straight
from steerclear.shield import Commands, Shield
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.contact import Contact
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.freshness import Verdict
from steerclear.shield.bridge.helm import Helm
from steerclear.shield.bridge.roster import Roster
from steerclear.shield.exceptions import LinkError


def test_a_safe_command_of_the_policy_leaves_bit_for_bit():
    random = np.random.default_rng(2)
    rule = random.uniform((0.0, 0.0), (2.0, 2.0 * math.pi), (60, 1, 2))
    world = World(fleet_of(blue=1, red=0), [(40.0, 20.0, 0.0, 0.0)], lambda snapshot: rule[snapshot.number])
    world.run(5.0)
    left = np.array([entry[:0:-1] for entry in world.links["blue_1"].sent])
    np.testing.assert_array_equal(left[1:], rule[: len(left) - 1, 0])


def test_what_the_tick_says_was_decided_is_what_left():
    world = World(
        fleet_of(blue=3, red=0),
        [(20.0, 0.0, 0.0, 2.0), (20.3, 30.0, 180.0, 2.0), (5.0, 15.0, 90.0, 2.0)],
        lambda s: np.array([[2.0, 0.0], [2.0, math.pi], [2.0, 0.5 * math.pi]]),
    )
    world.run(10.0)
    assert sum(tick.decisions.count_intervened for tick in world.sink.ticks) > 10
    for k, tick in enumerate(world.sink.ticks):
        for i, link in enumerate(world.links.values()):
            decision = tick.decisions[i]
            assert link.sent[k][1:] == (decision.sent_heading_rad, decision.sent_speed_mps)


def test_a_command_the_link_refuses_becomes_a_stop():
    world = World(fleet_of(blue=1, red=0), [(0.0, 0.0, 0.0, 0.0)], straight(0.0))

    def refuse(heading, speed):
        raise LinkError("no")

    world.links["blue_1"].send = refuse
    world.run(0.5)
    assert world.links["blue_1"].stops == 5
    assert world.last.sent["blue_1"].route == "stop"


def test_team_mates_behind_a_shield_of_their_own_are_taken_to_give_way_too():
    fleet = parse_fleet(fleet_text(blue=2, red=0, more="coordination: per_boat"))
    clock = ManualClock(100.0)
    link = FakeLink("blue_1", clock, "heron", 0.0, 0.0, 0.0, 1.0)
    roster = Roster(fleet, ["blue_1"])
    seen = Contact("blue_2", (0.3, 20.0), math.pi, 1.0, 100.0, 0.0, "test")
    roster.update(100.0, {"blue_1": link.read()}, [seen])
    helm = Helm(fleet, Shield(fleet.shield_config, fleet.surroundings), {"blue_1": link}, clock)
    wanted = Commands.absolute_rad([[2.0, 0.0], [math.nan, math.nan]])
    steered = helm.steer(roster, wanted, Verdict(), mates={"blue_2"})
    assert steered.fleet.controlled.tolist() == [True, True]
    assert steered.wanted.values[1] == pytest.approx([1.0, math.pi])
    assert list(steered.sent) == ["blue_1"]
    alone = Helm(fleet, Shield(fleet.shield_config, fleet.surroundings), {"blue_1": link}, clock)
    assert alone.steer(roster, wanted, Verdict()).fleet.controlled.tolist() == [True, False]


def test_the_shield_is_reset_once_at_the_start():
    world = World(fleet_of(blue=1, red=0), [(0.0, 0.0, 0.0, 0.0)], straight(0.0))
    world.run(1.0)
    assert [tick.shield_reset for tick in world.sink.ticks] == [True] + [False] * 9
