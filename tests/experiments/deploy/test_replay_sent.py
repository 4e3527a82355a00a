"""What the links sent is compared with what was decided: only what a link may change is let pass."""

import dataclasses
import math

import numpy as np
import pytest
from logged_runs import Encounter, header_of
from pymavlink.dialects.v20 import ardupilotmega as mavlink
from steerclear.experiments.deploy.proof import SentCheck, prove
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.commands import AttitudeRoute, VelocityRoute
from steerclear.shield.bridge.messages import Action, Sent
from steerclear.shield.decision import Reason

HEADER = header_of()


@pytest.fixture(scope="module")
def ticks():
    return list(Encounter(HEADER, 60))


def decided(tick, name="blue_1"):
    i = tick.fleet.names.index(name)
    return tick.decisions.filtered.absolute(i, float(tick.fleet.heading_rad[i]))


def with_decided(tick, speed_mps, heading_rad=1.0):
    """The tick with another decision for blue_1, and the same for blue_2."""
    values = tick.decisions.filtered.values.copy()
    values[0] = speed_mps, heading_rad
    sent = dataclasses.replace(tick.decisions.filtered, values=values)
    return dataclasses.replace(tick, decisions=dataclasses.replace(tick.decisions, filtered=sent))


def with_sent(tick, name="blue_1", **parts):
    return dataclasses.replace(tick, sent={**tick.sent, name: dataclasses.replace(tick.sent[name], **parts)})


def with_actions(tick, *actions):
    return dataclasses.replace(tick, actions=actions)


def strayed(tick, header=HEADER):
    return [(entry.boat, entry.what) for entry in SentCheck(header).strayed(tick)]


def test_what_was_decided_was_sent(ticks):
    check = SentCheck(HEADER)
    assert [check.strayed(tick) for tick in ticks] == [[]] * len(ticks)


def encoded(route, tick, y_axis_deg=30.0):
    """The tick with blue_1's command as a real link would have encoded it."""
    frame, (speed_mps, heading_rad) = FieldFrame(42.0, -71.0, y_axis_deg), decided(tick)
    said = route.encode((1, 1), 0, frame.heading_to_true_rad(heading_rad), speed_mps)
    heading_rad = frame.heading_to_field_rad(said.heading_rad)
    return with_sent(
        tick, speed_mps=said.speed_mps, heading_rad=heading_rad, route=route.name, limit_mps=said.limit_mps
    )


@pytest.mark.parametrize("route", [AttitudeRoute(2.0), AttitudeRoute(1.3), VelocityRoute(2.0), VelocityRoute(None)])
def test_rounding_and_limit_of_real_messages_are_let_pass(ticks, route):
    random, check = np.random.default_rng(1), SentCheck(HEADER)
    lowest = -2.0 if isinstance(route, AttitudeRoute) else 0.0
    for _ in range(300):
        tick = with_decided(ticks[5], random.uniform(lowest, 2.0), random.uniform(0.0, 2 * math.pi))
        assert check.strayed(encoded(route, tick)) == []


def test_a_link_that_cannot_go_astern_creeps(ticks):
    for speed_mps in (-1.0, 0.0):
        assert strayed(encoded(VelocityRoute(2.0), with_decided(ticks[5], speed_mps))) == []


@pytest.mark.parametrize(
    ("parts", "what"),
    [
        ({"speed_mps": 1.0}, "speed"), ({"speed_mps": 2.001}, "speed"), ({"speed_mps": -2.0}, "speed"),
        ({"speed_mps": 0.0}, "speed"), ({"speed_mps": math.nan}, "speed"), ({"speed_mps": math.inf}, "speed"),
        ({"heading_rad": 1.001}, "heading"), ({"heading_rad": 1.0 + math.pi}, "heading"),
        ({"heading_rad": math.nan}, "heading"), ({"heading_rad": math.inf}, "heading"),
        ({"speed_mps": 1.5, "limit_mps": 1.6}, "speed"),
    ],
)  # fmt: skip
def test_another_command_than_the_one_decided_is_found(ticks, parts, what):
    tick = with_sent(with_decided(ticks[5], 2.0), heading_rad=1.0, speed_mps=2.0, limit_mps=2.0)
    assert strayed(tick) == []
    assert strayed(with_sent(tick, **parts)) == [("blue_1", what)]


def test_a_heading_may_be_told_a_turn_further(ticks):
    tick = with_sent(with_decided(ticks[5], 2.0, 0.0), heading_rad=2.0 * math.pi - 1e-9, speed_mps=2.0)
    assert strayed(tick) == []


def test_a_boat_told_nothing_is_found(ticks):
    tick = dataclasses.replace(ticks[5], sent={"blue_2": ticks[5].sent["blue_2"]})
    assert strayed(tick) == [("blue_1", "command")]


def handed_over(tick):
    """Blue_1 is steered by a person: nothing was decided for it, nothing left for it."""
    fleet = dataclasses.replace(tick.fleet, controlled=np.array([False, True, False, False]))
    decisions = dataclasses.replace(tick.decisions, fleet=fleet)
    return dataclasses.replace(tick, fleet=fleet, decisions=decisions)


def test_a_boat_that_a_person_steers_is_told_nothing(ticks):
    tick = handed_over(ticks[5])
    parts = {"speed_mps": math.nan, "heading_rad": math.nan}
    assert strayed(with_sent(tick, **parts, route="none: does not obey", delivered=False)) == []
    assert strayed(with_sent(tick, **parts)) == [("blue_1", "sent without a decision")]
    assert strayed(tick) == [("blue_1", "sent without a decision")]


@pytest.mark.parametrize("speed_mps", [0.0, 1e-3])
def test_a_boat_without_a_decision_may_be_stopped(ticks, speed_mps):
    assert strayed(with_sent(handed_over(ticks[5]), speed_mps=speed_mps)) == []
    assert strayed(with_sent(handed_over(ticks[5]), speed_mps=speed_mps, heading_rad=math.nan)) == []


def test_a_links_own_stop_needs_its_declaration(ticks):
    stopped = with_sent(with_decided(ticks[5], 2.0), speed_mps=0.0, heading_rad=0.3)
    assert strayed(stopped) != []
    assert strayed(with_actions(stopped, Action("blue_1", "send", "stop", "not sent"))) == []
    assert strayed(with_actions(stopped, Action("blue_2", "send", "stop", "not sent"))) != []
    assert strayed(with_actions(stopped, Action("blue_1", "navigation", "stop", "old"))) != []
    gone = with_actions(with_sent(stopped, speed_mps=1.0), Action("blue_1", "send", "stop", "not sent"))
    assert strayed(gone) != []


def test_a_decided_stop_asks_for_the_links_own_stop_itself(ticks):
    stopped = with_sent(with_decided(ticks[5], 0.0), speed_mps=0.0, heading_rad=0.3)
    reason = stopped.decisions.reason.copy()
    reason[0] = Reason.STOPPED
    asked = dataclasses.replace(stopped, decisions=dataclasses.replace(stopped.decisions, reason=reason))
    assert strayed(stopped) == [("blue_1", "heading")]
    assert strayed(asked) == []
    assert strayed(with_sent(asked, speed_mps=1.0)) != [], "that is no stop"


def test_a_team_mate_of_another_process_is_not_ours_to_send_to(ticks):
    boats = tuple(dataclasses.replace(boat, ours=boat.name == "blue_1") for boat in HEADER.boats)
    tick = dataclasses.replace(ticks[5], sent={"blue_1": ticks[5].sent["blue_1"]})
    alone = dataclasses.replace(HEADER.config, coordination="per_boat")
    assert strayed(tick, dataclasses.replace(HEADER, boats=boats, config=alone)) == []
    assert strayed(tick, dataclasses.replace(HEADER, boats=boats)) == [("blue_2", "command")]


def test_a_header_that_disowns_boats_hides_nothing(ticks):
    header = dataclasses.replace(HEADER, boats=tuple(dataclasses.replace(b, ours=False) for b in HEADER.boats))
    tick = with_sent(ticks[5], speed_mps=0.7)
    assert strayed(tick, header) == [("blue_1", "speed")]
    assert strayed(dataclasses.replace(tick, sent={}), header) == [("blue_1", "command"), ("blue_2", "command")]


def test_commands_that_a_limit_cut_are_counted(ticks):
    cut = [with_sent(with_decided(tick, 2.0), speed_mps=0.5, heading_rad=1.0, limit_mps=0.5) for tick in ticks]
    check = SentCheck(HEADER)
    assert [check.strayed(tick) for tick in cut] == [[]] * len(ticks)
    assert check.cut == {("blue_1", 0.5): len(ticks)}


def test_the_proof_counts_and_names_what_strayed(ticks):
    forged = [with_sent(tick, speed_mps=0.5) if 20 <= tick.number < 30 else tick for tick in ticks]
    proof = prove(HEADER, forged)
    assert (proof.same, proof.strayed, proof.unfounded) == (60, 10, 0)
    assert (proof.holds, proof.proved) == (False, False)
    assert (proof.first_sent.tick, proof.first_sent.boat, proof.first_sent.what) == (20, "blue_1", "speed")
    assert "0.5" in proof.first_sent.replayed


def test_what_the_tests_send_is_encoded_as_boats_hear_it():
    """Otherwise these tolerances are about nothing."""
    said = AttitudeRoute(2.0).encode((1, 1), 0, 1.0, 1.7)
    assert isinstance(said.message, mavlink.MAVLink_set_attitude_target_message)
    assert said.speed_mps != 1.7
    assert said.limit_mps == 2.0
    assert Sent("a", 0.0, 0.0, 0.0, "x", True).limit_mps == math.inf
