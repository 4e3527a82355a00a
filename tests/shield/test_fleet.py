"""Fleets are checked every time they are handed over: shapes, numbers, ages, error bounds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shield_scenes import relative
from steerclear.shield import Commands, Fleet, Reason, Shield
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms import layout as L

AHEAD = relative((2.0, 0.0), (2.0, 0.0))


def fleet(**changes):
    good = {"position_m": [[0.0, 0.0], [0.0, 9.0]], "speed_mps": [2.0, 2.0], "team": [0, 1], "platforms": "heron"}
    headings = {} if {"heading_rad", "heading_deg"} & set(changes) else {"heading_rad": [0.0, math.pi]}
    return Fleet.of(**{**good, **headings, **changes})


@pytest.mark.parametrize("names", ["hron", ["heron", "hron"]])
def test_an_unknown_platform_is_told_the_known_ones(names):
    with pytest.raises(PlatformError, match="known platforms: ardurover_boat, blueboat, di, heron"):
        fleet(platforms=names)
    kinds = (names,) * 2 if isinstance(names, str) else tuple(names)
    with pytest.raises(PlatformError, match="known platforms: ardurover_boat, blueboat, di, heron"):
        Shield().decide(replace(fleet(), platforms=kinds), AHEAD)


@pytest.mark.parametrize("value", [1e6, 5000.0])
def test_a_boat_whose_place_is_hardly_known_is_decided_on_all_the_same(value):
    """Errors that programs work out are not refused: they keep clear of such a boat as well as may be."""
    vague = replace(fleet(), position_error_m=np.array([0.0, value]))
    assert Shield().decide(vague, AHEAD)[0].reason in Reason


def test_numbers_at_the_ends_of_their_ranges_are_taken():
    ends = fleet(position_error_m=[0.0, 1000.0], age_s=[0.0, 3600.0], thrust=[-100.0, 100.0], speed_mps=[50.0, -50.0])
    assert ends.position_error_m.tolist() == [0.0, 1000.0]
    assert ends.age_s.tolist() == [0.0, 3600.0]
    assert np.isinf(fleet(adversary_horizon_s=[math.inf, math.nan]).adversary_horizon_s[0])
    table = fleet(team=[False, True], controlled=[True, 0], visiting=np.array([1, 0]))
    assert (table.team.tolist(), table.controlled.tolist()) == ([0, 1], [True, False])
    assert table.visiting.tolist() == [True, False]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.floats(-50.0, 50.0), st.floats(-1e3, 1e3), st.floats(0.0, 3.0))
def test_positions_headings_and_speeds_come_back_as_given(heading, east, speed):
    table = fleet(heading_rad=[heading, 0.0], position_m=[[east, 1.0], [2.0, 3.0]], speed_mps=[speed, 0.0])
    assert abs(math.remainder(table.heading_rad[0] - heading, 2.0 * math.pi)) < 1e-9
    assert abs(table.state[0, L.HEADING]) <= 180.0
    assert table.position_m.tolist() == [[east, 1.0], [2.0, 3.0]]
    assert table.speed_mps.tolist() == [speed, 0.0]
    assert (len(table), table.names, table.controlled.tolist()) == (2, ("boat_0", "boat_1"), [True, False])
    by_deg = fleet(heading_deg=np.degrees([heading, 0.0]))
    np.testing.assert_allclose(by_deg.state[:, L.HEADING], table.state[:, L.HEADING], atol=1e-9)


def test_a_fleet_without_boats_has_no_decisions():
    nobody = Fleet.of(position_m=np.zeros((0, 2)), heading_rad=[], speed_mps=[], team=[], platforms="heron")
    for coordination in ("team", "per_boat"):
        decisions = Shield(coordination=coordination).decide(nobody, Commands.relative_deg(np.zeros((0, 2))))
        assert (len(decisions), list(decisions)) == (0, [])
        assert decisions.filtered.values.shape == (0, 2)
