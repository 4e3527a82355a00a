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
        ({"team": [0, 0.5]}, "team is not an array of whole numbers"),
        ({"team": [0, math.nan]}, "team is not an array of whole numbers"),
        ({"platforms": ["heron"]}, "platforms has 1 entries for 2 boats"),
        ({"platforms": None}, "platforms is None"),
        ({"platforms": ["heron", ["heron"]]}, "platforms holds .*give names of platforms"),
        ({"names": ["a"]}, "names has 1 entries for 2 boats"),
        ({"names": "ab"}, "names is 'ab'; give a list of names, one for each boat"),
        ({"names": ["a", "field"]}, "names holds 'field', by which decisions name walls and edges"),
        ({"names": ["a", "a"]}, "names holds 'a' more than once; give every boat a name of its own"),
        ({"platforms": 3}, "platforms is 3; give a platform's name, or one for each boat"),
        ({"controlled": [True]}, "controlled has shape"),
        ({"controlled": [1.0, math.nan]}, "controlled is not an array of True or False"),
        ({"controlled": [0.5, 1.0]}, "controlled is not an array of True or False"),
        ({"thrust": [1.0]}, "thrust has shape"),
        ({"thrust": [math.inf, 0.0]}, "memory of boat 'boat_0'.*give NaN where it is unknown"),
        ({"heading_error_rad": [0.0, -math.inf]}, "memory of boat 'boat_1'"),
        ({"age_s": [0.0]}, "age_s has shape"),
        ({"position_error_m": [0.0, math.nan]}, "position_error_m of boat .* give a bound in m"),
        ({"position_error_m": [0.0, -1.0]}, "position_error_m of boat .* give a bound in m"),
        ({"position_error_m": [math.inf, 0.0]}, "position_error_m of boat .* give a bound in m"),
        (
            {"position_error_m": [0.0, 1e6]},
            r"position_error_m of boat 'boat_1' is 1e\+06; give a bound in m from 0 to 1000",
        ),
        ({"age_s": [0.0, -0.1]}, "age_s of boat 'boat_1' is -0.1; give seconds since its fix from 0 to 3600"),
        ({"age_s": [math.nan, 0.0]}, "age_s of boat 'boat_0' is nan"),
        ({"age_s": [1.76e9, 0.0]}, r"age_s of boat 'boat_0' is 1.76e\+09; .* not the time of day"),
        ({"thrust": [1500.0, 0.0]}, "thrust of boat 'boat_0' is 1500; give percent up to 100 either way"),
        (
            {"adversary_horizon_s": [0.0, -1.0]},
            "adversary_horizon_s of boat 'boat_1' is -1; give s per boat, 0 to",
        ),
        ({"position_m": [[0.0, 0.0], [math.nan, 9.0]]}, "position of boat 'boat_1'.*give the last fix"),
        ({"heading_rad": [math.nan, 0.0]}, "heading of boat 'boat_0'"),
        ({"heading_rad": [0.0, math.inf]}, "heading of boat 'boat_1'"),
        ({"speed_mps": [math.inf, 0.0]}, "speed of boat 'boat_0'"),
        ({"speed_mps": [1e300, 0.0]}, "speed of boat 'boat_0'.*beyond"),
        ({"speed_mps": [0.0, -51.0]}, r"speed of boat 'boat_1' is not finite or beyond 50 m/s \(-51.0\)"),
        ({"position_m": [[0.0, 0.0], [0.0, 1e300]]}, "position of boat 'boat_1'.*beyond.*give m from a place nearby"),
        ({"speed_mps": [2000.0, 0.0]}, r"speed of boat 'boat_0'.*\(2000.0\); give m/s, not mm/s"),
        ({"speed_mps": [True, False]}, r"speed_mps is not an array of numbers \(some are True or False\)"),
        ({"speed_mps": [True, 2.0]}, "speed_mps is not an array of numbers"),
        ({"heading_rad": np.array([True, False])}, "heading_rad is not an array of numbers"),
        ({"heading_rad": [0.0, np.True_]}, "heading_rad is not an array of numbers"),
        ({"position_m": np.ones((2, 2), bool)}, "position_m is not an array of numbers"),
        ({"age_s": [False, False]}, "age_s is not an array of numbers"),
        ({"position_error_m": [True, False]}, "position_error_m is not an array of numbers"),
        ({"thrust": np.array([True, False], object)}, "thrust is not an array of numbers"),
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
        ({"state": np.zeros((2, L.N_STATE, 1))}, "state has shape"),
        ({"state": np.full((2, L.N_STATE), np.nan)}, "position of boat 'boat_0'"),
        ({"controlled": np.ones(1, bool)}, "controlled has shape"),
        ({"controlled": np.full(2, 0.5)}, "controlled is not an array of True or False"),
        ({"controlled": [True, None]}, "controlled is not an array of True or False"),
        ({"team": [0, 0.5]}, "team is not an array of whole numbers"),
        ({"age_s": [0.0, "new"]}, "age_s is not an array of numbers"),
        ({"position_error_m": [0.0, True]}, "position_error_m is not an array of numbers"),
        ({"team": np.zeros(3, np.int64)}, "team has shape"),
        ({"names": ("a",)}, "names has 1 entries"),
        ({"platforms": ("heron",)}, "platforms has 1 entries"),
        ({"age_s": np.zeros(1)}, "age_s has shape"),
        (
            {"age_s": np.array([0.0, 2.5])},
            r"track of 'boat_1' is 2.50 s old, limit 2.0 s; refresh it, raise max_track_age_s",
        ),
        ({"age_s": np.array([0.0, -0.1])}, "age_s holds a value that is negative"),
        ({"age_s": np.array([math.nan, 0.0])}, "age_s holds"),
        ({"position_error_m": np.array([math.nan, 0.0])}, "position_error_m of boat 'boat_0' is nan"),
        ({"age_s": np.zeros(2, bool)}, "age_s is not an array of numbers"),
        ({"state": np.ones((2, L.N_STATE), bool)}, "state is not an array of numbers"),
        ({"position_error_m": np.zeros(3)}, "position_error_m has shape"),
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


def test_teams_and_who_is_controlled_may_be_told_by_true_and_false():
    table = fleet(team=[False, True], controlled=[True, 0], visiting=np.array([1, 0]))
    assert (table.team.tolist(), table.controlled.tolist()) == ([0, 1], [True, False])
    assert table.visiting.tolist() == [True, False]


@pytest.mark.parametrize("n", [0, 1, 3])
def test_one_command_per_boat_is_wanted(n):
    with pytest.raises(FleetError, match=r"commands of shape .* for 2 boats; give one row per boat"):
        Shield().decide(fleet(), relative(*[(2.0, 0.0)] * n))


def test_rows_may_be_given_as_lists():
    """They decide as arrays do; what is no rows is refused in words."""
    made = fleet()
    names = ("state", "team", "controlled")
    lists = {name: getattr(made, name).tolist() for name in names} | {"names": list(made.names)}
    given_lists = Fleet(**lists, platforms=list(made.platforms))
    given_lists.check()
    for name in names:
        np.testing.assert_array_equal(getattr(given_lists, name), getattr(made, name))
    decided, again = (Shield().decide(one, AHEAD) for one in (made, given_lists))
    assert decided.filtered.values.tobytes() == again.filtered.values.tobytes()
    for name, wrong in (("state", [[0.0, "east"]]), ("team", [0, "red"]), ("controlled", ["yes", "no"])):
        with pytest.raises(FleetError, match=name):
            Shield().decide(Fleet(**{**lists, name: wrong}, platforms=made.platforms), AHEAD)


def test_decisions_print_as_a_table():
    lines = str(Shield().decide(fleet(), AHEAD)).splitlines()
    assert lines[0].split() == [
        *("boat", "nominal", "deg", "m/s", "filtered", "deg", "m/s", "reason", "active", "constraint", "margin", "m"),
    ]
    assert lines[1].startswith("boat_0 ")
    assert "NOT_COVERED" in lines[2]
    assert {len(line) <= 120 for line in lines} == {True}
    assert len(lines) == 3


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
    assert decisions[np.int64(1)] == decisions[1]


def test_decisions_can_be_indexed_by_name():
    decisions = Shield().decide(fleet(names=["ours", "theirs"]), AHEAD)
    assert decisions["ours"] == decisions[0]
    assert decisions["theirs"] == decisions[1] == decisions[np.str_("theirs")]
    assert "ours" in decisions
    assert "boat_0" not in decisions
    assert decisions[1] in decisions
    assert Shield().decide(fleet(), AHEAD)["boat_1"].boat == "boat_1"


@pytest.mark.parametrize(
    ("index", "text"),
    [
        ("boat_2", "no boat 'boat_2' in the fleet decided on; did you mean 'boat_1'?"),
        ("zzz", "no boat 'zzz' in the fleet decided on; there are boat_0, boat_1"),
        (1.0, "indexed by a boat's name or place in the fleet, not by 1.0"),
        (True, "not by True"),
        (np.False_, "not by np.False_"),
        (None, "not by None"),
        ([0, 1], r"not by \[0, 1\]; of several boats at once see their arrays: filtered.values"),
        (np.array([True, False]), "of several boats at once"),
        ((0, 1), "of several boats at once"),
        (b"boat_0", "not by b'boat_0'"),
    ],
)
def test_what_is_no_boat_of_the_decisions_is_told_how_to_ask(index, text):
    with pytest.raises(FleetError, match=text):
        Shield().decide(fleet(), AHEAD)[index]


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
        assert decisions.filtered.values.shape == (0, 2)
