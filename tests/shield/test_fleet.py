"""Fleets are checked every time they are handed over: shapes, numbers, ages, error bounds."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shield_scenes import head_on, relative
from steerclear.shield import Commands, Fleet, Reason, Shield
from steerclear.shield.exceptions import FleetError, PlatformError
from steerclear.shield.platforms import layout as L

AHEAD = relative((2.0, 0.0), (2.0, 0.0))
LAST_FIX = ".*of a boat that drops out the last fix with its age_s"


def fleet(**changes):
    good = {"position_m": [[0.0, 0.0], [0.0, 9.0]], "speed_mps": [2.0, 2.0], "team": [0, 1], "platforms": "heron"}
    headings = {} if {"heading_rad", "heading_deg"} & set(changes) else {"heading_rad": [0.0, math.pi]}
    return Fleet.of(**{**good, **headings, **changes})


NO_NUMBERS = {
    "speed_mps": [[True, False], [True, 2.0]],
    "heading_rad": [np.array([True, False]), [0.0, np.True_]],
    "position_m": [np.ones((2, 2), bool), [["a", "b"]]],
    "age_s": [[False, False], [0.0, "new"]],
    "position_error_m": [[True, False]],
    "thrust": [np.array([True, False], object)],
}


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"position_m": [0.0, 0.0]}, r"position_m has shape \(2,\); expected \('n', 2\)"),
        ({"position_m": [[0.0, 0.0, 0.0]]}, "position_m has shape"),
        ({"heading_rad": [0.0]}, r"heading_rad has shape \(1,\); expected \(2,\)"),
        ({"speed_mps": 2.0}, "speed_mps has shape"),
        *(({name: [1.0]}, f"{name} has shape") for name in ("team", "controlled", "thrust", "age_s", "visiting")),
        ({"team": [0, 0.5]}, "team is not an array of whole numbers"),
        ({"team": [0, math.nan]}, "team is not an array of whole numbers"),
        ({"controlled": [1.0, math.nan]}, "controlled is not an array of True or False"),
        ({"controlled": [0.5, 1.0]}, "controlled is not an array of True or False"),
        *(({name: wrong}, f"{name} is not an array of numbers") for name, all_ in NO_NUMBERS.items() for wrong in all_),
        ({"platforms": ["heron"]}, "platforms has 1 entries for 2 boats"),
        ({"platforms": None}, "platforms is None; give a list of them, one for each boat"),
        ({"platforms": 3}, "platforms is 3; give a list of them, one for each boat"),
        ({"platforms": ["heron", ["heron"]]}, "platforms holds .*give names of platforms"),
        ({"names": ["a"]}, "names has 1 entries for 2 boats"),
        ({"names": "ab"}, "names is 'ab'; give a list of them, one for each boat"),
        ({"names": ["a", "field"]}, "names holds 'field', not a name .*by which decisions name walls and edges"),
        ({"names": ["a", "a"]}, "names holds 'a', not a name of its own; give each boat one"),
        ({"names": ["a", ""]}, "names holds '', not a name of its own"),
        ({"names": ["a", 3]}, "names holds 3, not a name of its own"),
        ({"thrust": [math.inf, 0.0]}, "memory of boat 'boat_0' is inf; give NaN where it is unknown"),
        ({"thrust": [1500.0, 0.0]}, "thrust of boat 'boat_0' is 1500; give percent up to 100 either way"),
        ({"position_error_m": [0.0, math.nan]}, "position_error_m of boat 'boat_1' is nan; give a bound in m"),
        ({"position_error_m": [0.0, -1.0]}, "position_error_m of boat 'boat_1' is -1; give a bound in m"),
        ({"position_error_m": [math.inf, 0.0]}, "position_error_m of boat 'boat_0' is inf; give a bound in m"),
        (
            {"position_error_m": [0.0, 1e6]},
            r"position_error_m .* is 1e\+06; give a bound in m from 0 to 1000, not in mm",
        ),
        ({"age_s": [0.0, -0.1]}, "age_s of boat 'boat_1' is -0.1; give seconds since its track's fix"),
        ({"age_s": [math.nan, 0.0]}, "age_s of boat 'boat_0' is nan"),
        ({"age_s": [1.76e8, 0.0]}, r"age_s of boat 'boat_0' is 1.76e\+08; .*from 0 to 3600, not the time of day"),
        ({"adversary_horizon_s": [0.0, -1.0]}, "adversary_horizon_s of boat 'boat_1' is -1; give s per boat, 0 to"),
        ({"position_m": [[0.0, 0.0], [math.nan, 9.0]]}, f"position of boat 'boat_1' is nan; {LAST_FIX}"),
        (
            {"position_m": [[0.0, 0.0], [0.0, 1e300]]},
            r"position of boat 'boat_1' is 1e\+300; give m from a place nearby",
        ),
        ({"heading_rad": [math.nan, 0.0]}, f"heading of boat 'boat_0' is nan; {LAST_FIX}"),
        ({"heading_rad": [0.0, math.inf]}, "heading of boat 'boat_1'"),
        ({"speed_mps": [math.inf, 0.0]}, "speed of boat 'boat_0'"),
        ({"speed_mps": [0.0, -51.0]}, "speed of boat 'boat_1' is -51; give m/s up to 50 either way, not mm/s"),
        ({"heading_rad": None}, "give either heading_rad or heading_deg"),
        ({"heading_rad": [0.0, 0.0], "heading_deg": [0.0, 0.0]}, "give either heading_rad or heading_deg"),
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
        ({"state": [[0.0, "east"]]}, "state is not an array of numbers"),
        ({"state": np.full((2, L.N_STATE), np.nan)}, "position of boat 'boat_0'"),
        ({"controlled": [True, None]}, "controlled is not an array of True or False"),
        ({"team": [0, "red"]}, "team is not an array of whole numbers"),
        ({"team": np.zeros(3, np.int64)}, "team has shape"),
        ({"age_s": np.array([0.0, 2.5])}, r"track of 'boat_1' is 2.50 s old, limit 2.0 s; refresh it, raise max_track"),
        ({"age_s": np.array([math.nan, 0.0])}, "age_s of boat 'boat_0' is nan"),
        ({"position_error_m": np.array([math.nan, 0.0])}, "position_error_m of boat 'boat_0' is nan"),
    ],
)
def test_every_call_checks_not_just_the_first(changes, text):
    shield = Shield()
    shield.decide(fleet(), AHEAD)
    with pytest.raises(FleetError, match=text):
        shield.decide(replace(fleet(), **changes), AHEAD)
    assert shield.decide(fleet(), AHEAD)[0].reason in Reason, "the shield works on after refusing"


@pytest.mark.parametrize("column", range(4))
def test_states_that_change_after_the_fleet_was_built_are_looked_at_too(column):
    seen = head_on()
    seen.state[1, column] = np.nan
    with pytest.raises(FleetError, match="boat_1"):
        Shield().decide(seen, relative((2, 0), (2, 0)))


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


def test_rows_may_be_given_as_lists_and_decide_as_arrays_do():
    made = fleet()
    lists = {name: getattr(made, name).tolist() for name in ("state", "team", "controlled")}
    listed = Fleet(**lists, names=list(made.names), platforms=list(made.platforms))
    decided, again = (Shield().decide(one, AHEAD) for one in (made, listed))
    assert decided.filtered.values.tobytes() == again.filtered.values.tobytes()


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


def test_deciding_does_not_write_to_the_fleet():
    table = head_on(6.0)
    before = table.state.tobytes()
    Shield(delay_s=0.3).decide(table, AHEAD)
    assert table.state.tobytes() == before


def test_a_fleet_without_boats_has_no_decisions():
    nobody = Fleet.of(position_m=np.zeros((0, 2)), heading_rad=[], speed_mps=[], team=[], platforms="heron")
    for coordination in ("team", "per_boat"):
        decisions = Shield(coordination=coordination).decide(nobody, Commands.relative_deg(np.zeros((0, 2))))
        assert (len(decisions), list(decisions)) == (0, [])
        assert decisions.filtered.values.shape == (0, 2)
