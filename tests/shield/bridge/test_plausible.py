"""Fixes that cannot be true are refused; a boat that really is elsewhere is believed in the end."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.bridge.plausible import BELIEVED_AFTER_S, Fix, Gate


def test_a_boat_that_goes_its_way_is_let_through():
    gate = Gate(2.0)
    assert [gate.refuse(Fix(0.2 * k, 0.0, math.pi / 2, 2.0, 0.1 * k)) for k in range(50)] == [""] * 50


@pytest.mark.parametrize("field", range(5))
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_not_finite_is_refused(field, value):
    values = [0.0, 0.0, 0.0, 0.0, 0.0]
    values[field] = value
    assert Gate(2.0).refuse(Fix(*values)) == "a value is not finite"


@pytest.mark.parametrize(
    ("fix", "word"), [(Fix(2e5, 0.0, 0.0, 0.0, 0.0), "nowhere"), (Fix(0.0, 0.0, 0.0, 9.0, 0.0), "beyond the boat")]
)
def test_impossible_values_are_refused(fix, word):
    assert word in Gate(2.0).refuse(fix)


def test_a_jump_is_refused_and_the_way_back_is_not():
    gate = Gate(2.0)
    gate.refuse(Fix(0.0, 0.0, 0.0, 0.0, 0.0))
    assert gate.refuse(Fix(30.0, 0.0, 0.0, 0.0, 0.1)) == "position jumped 30 m"
    assert gate.refuse(Fix(0.0, 0.0, 0.0, 0.0, 0.2)) == ""


def test_a_place_told_long_enough_is_believed():
    gate = Gate(2.0)
    gate.refuse(Fix(0.0, 0.0, 0.0, 0.0, 0.0))
    said = [gate.refuse(Fix(30.0, 0.0, 0.0, 0.0, 0.1 * k)) for k in range(1, 40)]
    first = said.index("")
    assert 0.1 * first == pytest.approx(BELIEVED_AFTER_S, abs=0.11)
    assert said[first:] == [""] * (39 - first)


@pytest.mark.parametrize(("seen_m", "believed"), [(0.0, False), (29.0, True), (60.0, False)])
def test_a_new_place_is_not_believed_while_somebody_sees_the_boat_elsewhere(seen_m, believed):
    gate = Gate(2.0)
    gate.refuse(Fix(0.0, 0.0, 0.0, 0.0, 0.0))
    said = [gate.refuse(Fix(30.0, 0.0, 0.0, 0.0, 0.1 * k), Fix(seen_m, 0.0, 0.0, 0.0, 0.1 * k)) for k in range(1, 80)]
    assert ("" in said) == believed
    if not believed:
        assert "the feed sees it elsewhere" in said[-1]
        assert gate.refuse(Fix(1.0, 0.0, 0.0, 0.0, 8.0), Fix(0.0, 0.0, 0.0, 0.0, 8.0)) == "", "the way back is"


def test_a_witness_who_is_wrong_does_no_harm_to_a_boat_that_goes_its_way():
    gate = Gate(2.0)
    wrong = Fix(50.0, 0.0, 0.0, 0.0, 0.0)
    assert [gate.refuse(Fix(0.2 * k, 0.0, math.pi / 2, 2.0, 0.1 * k), wrong) for k in range(50)] == [""] * 50


def way(k, off_m=0.0):
    """A boat at 2 m/s along x, its k-th fix at 10 Hz, so far off it."""
    return Fix(0.2 * k, off_m, math.pi / 2, 2.0, 0.1 * k)


def test_one_outlier_under_a_witness_who_is_a_little_off_does_not_silence_the_boat():
    gate = Gate(2.0)
    said = [gate.refuse(way(k, 30.0 if k == 20 else 0.0), way(k, 4.0)) for k in range(600)]
    assert said[:20] == [""] * 20
    assert "jumped" in said[20]
    assert said[21:] == [""] * 579


def test_a_witness_who_knows_how_wrong_it_may_be_contradicts_less():
    def believed(error_m):
        gate = Gate(2.0)
        gate.refuse(Fix(0.0, 0.0, 0.0, 0.0, 0.0))
        seen = [Fix(24.0, 0.0, 0.0, 0.0, 0.1 * k, error_m) for k in range(80)]
        return "" in [gate.refuse(Fix(30.0, 0.0, 0.0, 0.0, 0.1 * k), seen[k]) for k in range(1, 80)]

    assert not believed(0.3)
    assert believed(3.5)


def test_jumps_all_over_the_place_are_never_believed():
    gate = Gate(2.0)
    gate.refuse(Fix(0.0, 0.0, 0.0, 0.0, 0.0))
    said = [gate.refuse(Fix(30.0 + 40.0 * (k % 2), 0.0, 0.0, 0.0, 0.1 * k)) for k in range(1, 80)]
    assert all(said)


@settings(max_examples=100, derandomize=True)
@given(st.floats(-2.0, 2.0), st.floats(-math.pi, math.pi), st.floats(0.05, 1.9), st.floats(-0.5, 0.5))
def test_whatever_a_boat_can_do_between_two_fixes_passes(speed, heading, seconds, noise):
    gate = Gate(2.0)
    gate.refuse(Fix(0.0, 0.0, 0.0, 2.0, 0.0))
    way = speed * seconds
    fix = Fix(way * math.sin(heading) + noise, way * math.cos(heading), heading, speed, seconds)
    assert gate.refuse(fix) == ""


def test_a_position_that_stays_while_the_boat_runs_is_frozen():
    gate = Gate(2.0)
    said = [gate.refuse(Fix(5.0, 5.0, 0.0, 2.0, 0.1 * k)) for k in range(20)]
    assert said[:3] == ["", "", ""]
    assert all("frozen" in text for text in said[4:])
    assert gate.refuse(Fix(5.0, 8.0, 0.0, 2.0, 2.0)) == ""


def test_a_boat_at_rest_is_not_frozen():
    gate = Gate(2.0)
    assert not any(gate.refuse(Fix(5.0, 5.0, 0.0, 0.05, 0.1 * k)) for k in range(600))


def test_a_boat_that_creeps_is_not_frozen():
    gate = Gate(2.0)
    assert not any(gate.refuse(Fix(0.01 * k, 5.0, math.pi / 2, 0.1, 0.1 * k)) for k in range(600))
