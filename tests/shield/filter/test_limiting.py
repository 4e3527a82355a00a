"""Speeds that are sent are within what a platform does; games limit speeds themselves."""

import math

import numpy as np
import pytest
from shield_scenes import bits, fleet_of
from steerclear.shield import Commands, Reason, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield

ALONE = [(0, 0, 10.0, 1.0), (500, 0, -170.0, 2.0)]
TOP_MPS = {"heron": 2.0, "surveyor": 3.0, "si": 10.0}


def decide(rows, make, platform="heron", team=(0, 0)):
    return Shield().decide(fleet_of(ALONE, team, platform), make(rows))


@pytest.mark.parametrize("make", [Commands.absolute_rad, Commands.absolute_deg, Commands.relative_deg])
@pytest.mark.parametrize("platform", TOP_MPS)
@pytest.mark.parametrize("beyond", [1e-3, 1.14, 88.0, 1e5])
def test_no_more_than_top_speed_is_sent(make, platform, beyond):
    top = TOP_MPS[platform]
    decisions = decide([[top + beyond, 0.5], [1.0, 0.25]], make, platform)
    first, second = decisions
    assert (first.filtered_speed_mps, first.reason, first.intervened) == (top, Reason.LIMITED, True)
    assert first.nominal_speed_mps == top + beyond
    assert first.filtered_heading_rad == first.nominal_heading_rad
    assert first.active_constraints == ()
    assert (second.reason, second.intervened) == (Reason.PASSED, False)
    assert bits(decisions.filtered.values[1]) == bits(make([[1.0, 0.25]]).values[0])


def test_speed_and_heading_swapped_send_no_three_metres_to_a_boat_of_two():
    assert decide([[math.pi, 1.5], [0.0, 0.0]], Commands.absolute_rad)[0].filtered_speed_mps == 2.0


@pytest.mark.parametrize("platform", TOP_MPS)
def test_no_boat_is_told_to_go_astern(platform):
    first = decide([[-4.0, 0.5], [1.0, 0.25]], Commands.absolute_rad, platform)[0]
    assert (first.filtered_speed_mps, first.reason, first.intervened) == (0.0, Reason.LIMITED, True)


@pytest.mark.parametrize(("heading", "sent"), [(181.0, -179.0), (-181.0, 179.0), (1000.0, -80.0), (180.0, 180.0)])
def test_a_cut_command_turns_by_less_than_a_turn(heading, sent):
    decisions = decide([[9.0, heading], [1.0, 0.25]], Commands.relative_deg)
    assert decisions.filtered.values[0].tolist() == [2.0, sent]


@pytest.mark.parametrize("speed", [2.0, 2.0 + 1e-9, math.nextafter(2.0, 3.0), 0.0, -0.0, -1e-12])
def test_the_limits_themselves_pass_bit_for_bit(speed):
    wanted = Commands.absolute_rad([[speed, 0.5], [1.0, 0.25]])
    decisions = Shield().decide(fleet_of(ALONE, (0, 0)), wanted)
    assert bits(decisions.filtered.values) == bits(wanted.values)
    assert decisions.reason.tolist() == [Reason.PASSED] * 2


@pytest.mark.parametrize("speed", [math.nan, math.inf, 2e6, -2e6])
def test_what_is_no_speed_is_held(speed):
    first = decide([[speed, 0.5], [1.0, 0.25]], Commands.absolute_rad)[0]
    assert (first.reason, first.filtered_speed_mps) == (Reason.HELD, 0.0)


@pytest.mark.parametrize("make", [Commands.relative_deg, Commands.absolute_rad, Commands.absolute_deg])
@pytest.mark.parametrize("heading", [math.nan, math.inf, -math.inf])
def test_a_speed_beyond_the_limit_without_a_heading_is_held(make, heading):
    first = decide([[9.0, heading], [1.0, 0.25]], make)[0]
    assert (first.reason, first.filtered_speed_mps) == (Reason.HELD, 0.0)


def test_boats_not_decided_for_are_left_alone():
    decisions = decide([[9.0, 0.5], [9.0, 0.25]], Commands.absolute_rad, team=(0, 1))
    assert decisions.reason.tolist() == [Reason.LIMITED, Reason.NOT_COVERED]
    assert decisions.filtered.values[:, 0].tolist() == [2.0, 9.0]


def test_a_cut_command_that_is_not_safe_is_changed_for_that():
    meeting = fleet_of([(0, 0, 0.0, 2.0), (0, 5.5, 180.0, 2.0)], (0, 1))
    cut, plain = (
        Shield().decide(meeting, Commands.absolute_rad([[speed, 0.0], [2.0, math.pi]]))[0] for speed in (7.0, 2.0)
    )
    assert cut.reason == plain.reason != Reason.LIMITED
    assert (cut.filtered_speed_mps, cut.filtered_heading_rad) == (plain.filtered_speed_mps, plain.filtered_heading_rad)


@pytest.mark.parametrize("coordination", ["team", "per_boat"])
def test_both_ways_of_deciding_keep_the_limits(coordination):
    shield = Shield(ShieldConfig(coordination=coordination))
    decisions = shield.decide(fleet_of(ALONE, (0, 0)), Commands.absolute_rad([[5.0, 0.5], [-1.0, 0.0]]))
    assert decisions.filtered.values[:, 0].tolist() == [2.0, 0.0]


def test_commands_of_a_game_pass_as_they_are():
    wanted = Commands.game_deg([[7.0, 20.0], [-1.0, 0.0]])
    decisions = Shield().decide(fleet_of(ALONE, (0, 0)), wanted)
    assert bits(decisions.filtered.values) == bits(wanted.values)
    assert decisions.reason.tolist() == [Reason.PASSED] * 2
    batch = BatchedShield(ShieldConfig(), 1, ("heron", "heron"), (0, 0))
    state = np.nan_to_num(fleet_of(ALONE, (0, 0)).state[None])
    assert bits(batch.decide(state, wanted.values[None], np.ones((1, 2), bool))[0]) == bits(wanted.values)
