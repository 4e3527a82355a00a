"""Fleets are checked every time they are handed over: shapes, numbers, ages, error bounds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shield_scenes import fleet_of, head_on, relative
from steerclear.shield import Commands, Fleet, Reason, Shield
from steerclear.shield.exceptions import FleetError, PlatformError, SteerclearError
from steerclear.shield.platforms import layout as L

GOOD = {
    "position_m": [[0.0, 0.0], [0.0, 9.0]],
    "heading_rad": [0.0, math.pi],
    "speed_mps": [2.0, 2.0],
    "team": [0, 1],
    "platforms": "heron",
}
AHEAD = relative((2.0, 0.0), (2.0, 0.0))


def fleet(**changes):
    return Fleet.of(**{**GOOD, **changes})


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"position_m": [0.0, 0.0]}, r"position_m has shape \(2,\); expected \('n', 2\)"),
        ({"position_m": [[0.0, 0.0, 0.0]]}, "position_m has shape"),
        ({"position_m": [["a", "b"]]}, "position_m is not an array of numbers"),
        ({"heading_rad": [0.0]}, r"heading_rad has shape \(1,\); expected \(2,\)"),
        ({"speed_mps": 2.0}, "speed_mps has shape"),
        ({"team": [0]}, "team has shape"),
        ({"team": [0, 0.5]}, "team holds a value that is not a whole number"),
        ({"team": [0, math.nan]}, "team holds a value that is not a whole number"),
        ({"platforms": ["heron"]}, "platforms has 1 entries for 2 boats"),
        ({"platforms": None}, "platforms is None"),
        ({"platforms": ["heron", ["heron"]]}, "platforms holds .*give names of platforms"),
        ({"names": ["a"]}, "names has 1 entries for 2 boats"),
        ({"names": "ab"}, "names is the text 'ab'; give a list of names, one for each boat"),
        ({"names": ["a", "field"]}, "names holds 'field', by which decisions name walls and edges"),
        ({"names": ["a", "a"]}, "names holds 'a' more than once; give every boat a name of its own"),
        ({"platforms": 3}, "platforms is 3; give a platform's name, or one for each boat"),
        ({"controlled": [True]}, "controlled has shape"),
        ({"controlled": [1.0, math.nan]}, "controlled holds a value that is neither True nor False"),
        ({"controlled": [0.5, 1.0]}, "controlled holds a value that is neither True nor False"),
        ({"thrust": [1.0]}, "thrust has shape"),
        ({"thrust": [math.inf, 0.0]}, "memory of boat 'boat_0'.*give NaN where it is unknown"),
        ({"heading_error_rad": [0.0, -math.inf]}, "memory of boat 'boat_1'"),
        ({"age_s": [0.0]}, "age_s has shape"),
        ({"position_error_m": [0.0, math.nan]}, "position_error_m holds"),
        ({"position_error_m": [0.0, -1.0]}, "position_error_m holds"),
        ({"position_error_m": [math.inf, 0.0]}, "position_error_m holds"),
        ({"position_m": [[0.0, 0.0], [math.nan, 9.0]]}, "position of boat 'boat_1'.*give the last fix"),
        ({"heading_rad": [math.nan, 0.0]}, "heading of boat 'boat_0'"),
        ({"heading_rad": [0.0, math.inf]}, "heading of boat 'boat_1'"),
        ({"speed_mps": [math.inf, 0.0]}, "speed of boat 'boat_0'"),
        ({"speed_mps": [1e300, 0.0]}, "speed of boat 'boat_0'.*beyond"),
        ({"speed_mps": [0.0, -51.0]}, r"speed of boat 'boat_1' is not finite or beyond 50 m/s \(-51.0\)"),
        ({"position_m": [[0.0, 0.0], [0.0, 1e300]]}, "position of boat 'boat_1'.*beyond"),
    ],
)
def test_what_cannot_be_used_is_refused_in_words_that_help(changes, text):
    with pytest.raises(FleetError, match=text):
        fleet(**changes)


@pytest.mark.parametrize("names", ["hron", ["heron", "hron"]])
def test_an_unknown_platform_is_told_the_known_ones(names):
    with pytest.raises(PlatformError, match="known platforms: ardurover_boat, blueboat, di, heron"):
        fleet(platforms=names)
    kinds = (names,) * 2 if isinstance(names, str) else tuple(names)
    with pytest.raises(PlatformError, match="known platforms: ardurover_boat, blueboat, di, heron"):
        Shield().decide(replace(fleet(), platforms=kinds), AHEAD)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"state": np.zeros((2, 5))}, r"state has shape \(2, 5\)"),
        ({"state": np.zeros((2, L.N_STATE), np.float32)}, "float32"),
        ({"state": np.zeros((2, L.N_STATE, 1))}, "state has shape"),
        ({"state": np.full((2, L.N_STATE), np.nan)}, "position of boat 'boat_0'"),
        ({"controlled": np.ones(1, bool)}, "controlled has 1 entries"),
        ({"controlled": np.ones(2)}, "controlled is of float64"),
        ({"controlled": [True, False]}, "controlled is of list; give an array of True or False"),
        ({"team": [0, 1]}, "team is of list; give an array, or build the fleet by Fleet.of"),
        ({"age_s": [0.0, 0.0]}, "age_s is of list; give an array"),
        ({"position_error_m": [0.0, 0.0]}, "position_error_m is of list; give an array"),
        ({"team": np.zeros(3, np.int64)}, "team has 3 entries"),
        ({"names": ("a",)}, "names has 1 entries"),
        ({"platforms": ("heron",)}, "platforms has 1 entries"),
        ({"age_s": np.zeros(1)}, "age_s has 1 entries"),
        (
            {"age_s": np.array([0.0, 2.5])},
            r"track of 'boat_1' is 2.50 s old, limit 2.0 s; refresh it, raise max_track_age_s",
        ),
        ({"age_s": np.array([0.0, -0.1])}, "age_s holds a value that is negative"),
        ({"age_s": np.array([math.nan, 0.0])}, "age_s holds"),
        ({"position_error_m": np.array([math.nan, 0.0])}, "position_error_m holds"),
        ({"position_error_m": np.zeros(3)}, "position_error_m has 3 entries"),
    ],
)
@pytest.mark.parametrize("warm", [False, True])
def test_every_call_checks_not_just_the_first(changes, text, warm):
    shield = Shield()
    if warm:
        shield.decide(fleet(), AHEAD)
    with pytest.raises(FleetError, match=text):
        shield.decide(replace(fleet(), **changes), AHEAD)
    assert shield.decide(fleet(), AHEAD)[0].reason in Reason, "the shield works on after refusing"


@pytest.mark.parametrize("n", [0, 1, 3])
def test_one_command_per_boat_is_wanted(n):
    with pytest.raises(FleetError, match=r"commands of shape .* for 2 boats; give one row per boat"):
        Shield().decide(fleet(), relative(*[(2.0, 0.0)] * n))


def test_an_empty_fleet_gets_an_empty_answer():
    decisions = Shield().decide(fleet_of([], []), relative())
    assert len(decisions) == 0
    assert list(decisions) == []


def test_decisions_can_be_indexed_like_a_sequence():
    decisions = Shield().decide(fleet(), AHEAD)
    assert decisions[-1].boat == decisions[1].boat == "boat_1"
    assert [decision.boat for decision in decisions[:2]] == ["boat_0", "boat_1"]
    for index in (2, -3):
        with pytest.raises(IndexError, match="no boat"):
            decisions[index]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(st.floats(-50.0, 50.0), st.floats(-1e3, 1e3), st.floats(0.0, 3.0))
def test_positions_headings_and_speeds_come_back_as_given(heading, east, speed):
    table = fleet(heading_rad=[heading, 0.0], position_m=[[east, 1.0], [2.0, 3.0]], speed_mps=[speed, 0.0])
    assert abs(math.remainder(table.heading_rad[0] - heading, 2.0 * math.pi)) < 1e-9
    assert abs(table.state[0, L.HEADING]) <= 180.0
    assert table.position_m.tolist() == [[east, 1.0], [2.0, 3.0]]
    assert table.speed_mps.tolist() == [speed, 0.0]
    assert len(table) == 2
    assert table.names == ("boat_0", "boat_1")
    assert table.controlled.tolist() == [True, False]


def test_deciding_does_not_write_to_the_fleet():
    table = head_on(6.0)
    before = table.state.tobytes()
    Shield(delay_s=0.3).decide(table, AHEAD)
    assert table.state.tobytes() == before


def test_fleet_errors_are_of_the_one_tree():
    assert issubclass(FleetError, SteerclearError)
    assert issubclass(FleetError, ValueError)


def test_a_fleet_without_boats_has_no_decisions():
    nobody = Fleet.of(position_m=np.zeros((0, 2)), heading_rad=[], speed_mps=[], team=[], platforms="heron")
    for coordination in ("team", "per_boat"):
        decisions = Shield(coordination=coordination).decide(nobody, Commands.relative_deg(np.zeros((0, 2))))
        assert len(decisions) == 0
        assert decisions.sent.values.shape == (0, 2)
