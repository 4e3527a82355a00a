"""Commands keep the frame they were given in, and say the same thing in the other."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shield_scenes import bits
from steerclear.shield import Commands
from steerclear.shield.exceptions import FleetError

quick = settings(max_examples=100, deadline=None, derandomize=True)
PAIRS = st.lists(st.tuples(st.floats(-20.0, 20.0), st.floats(-720.0, 720.0)), min_size=1, max_size=6)


def apart_rad(a, b):
    return abs(math.remainder(a - b, 2.0 * math.pi))


@quick
@given(PAIRS, st.data())
def test_absolute_and_relative_say_the_same(pairs, data):
    n = len(pairs)
    heading = np.array(data.draw(st.lists(st.floats(-180.0, 180.0), min_size=n, max_size=n)))
    relative = Commands.relative_deg(pairs)
    absolute = Commands.absolute_rad(
        [(speed, math.radians(heading[i] + turn)) for i, (speed, turn) in enumerate(pairs)]
    )
    back = absolute.as_relative_deg(heading)
    assert back[:, 0].tolist() == [speed for speed, _ in pairs]
    assert ((back[:, 1] >= -180.0) & (back[:, 1] <= 180.0)).all()
    for i in range(n):
        assert apart_rad(math.radians(back[i, 1]), math.radians(pairs[i][1])) < 1e-9
        own, other = relative.absolute(i, math.radians(heading[i])), absolute.absolute(i, math.radians(heading[i]))
        assert own[0] == other[0] == pairs[i][0]
        assert apart_rad(own[1], other[1]) < 1e-9
        assert 0.0 <= own[1] <= 2.0 * math.pi


@quick
@given(PAIRS)
def test_relative_commands_are_handed_on_untouched(pairs):
    commands = Commands.relative_deg(pairs)
    assert bits(commands.as_relative_deg(np.full(len(pairs), 33.3))) == bits(np.array(pairs))


@quick
@given(PAIRS, st.data())
def test_replacing_rows_keeps_the_others_bit_for_bit(pairs, data):
    n = len(pairs)
    changed = np.array(data.draw(st.lists(st.booleans(), min_size=n, max_size=n)))
    heading = np.array(data.draw(st.lists(st.floats(-180.0, 180.0), min_size=n, max_size=n)))
    new = np.column_stack([np.full(n, 1.25), np.linspace(-170.0, 170.0, n)])
    for commands in (Commands.relative_deg(pairs), Commands.absolute_rad(pairs)):
        before = bits(commands.values)
        replaced = commands.replaced(changed, new, heading)
        assert bits(commands.values) == before
        assert replaced.relative == commands.relative
        assert bits(replaced.values[~changed]) == bits(commands.values[~changed])
        told = replaced.as_relative_deg(heading)[changed]
        assert told[:, 0].tolist() == [1.25] * int(changed.sum())
        assert all(abs(math.remainder(a - b, 360.0)) < 1e-9 for a, b in zip(told[:, 1], new[changed, 1], strict=True))


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_headings_that_are_none_stay_none_without_a_warning(value):
    commands = Commands.absolute_rad([[1.0, value], [value, 1.0]])
    relative = commands.as_relative_deg(np.zeros(2))
    assert not math.isfinite(relative[0, 1])
    assert math.degrees(1.0) == pytest.approx(relative[1, 1])
    assert not math.isfinite(commands.absolute(0, 0.0)[1])


@pytest.mark.parametrize("heading", [1.1e6, -1.1e6, 1e15, 1e300, 1.7e308])
def test_huge_headings_are_none(heading):
    assert math.isnan(Commands.absolute_rad([[1.0, heading]]).as_relative_deg(np.zeros(1))[0, 1])


@pytest.mark.parametrize("heading", [0.9e6, -0.9e6])
def test_headings_of_many_turns_are_the_direction_that_is_told(heading):
    commands = Commands.absolute_rad([[1.0, heading]])
    relative = commands.as_relative_deg(np.zeros(1))[0, 1]
    assert apart_rad(math.radians(relative), commands.absolute(0, 0.0)[1]) < 1e-8


@pytest.mark.parametrize("make", [Commands.relative_deg, Commands.absolute_rad])
@pytest.mark.parametrize("values", [[1.0, 2.0], [[1.0, 2.0, 3.0]], [[[1.0, 2.0]]], 3.0, [[1.0]], np.zeros((2, 2, 2))])
def test_other_shapes_are_refused_with_the_one_wanted(make, values):
    with pytest.raises(FleetError, match=r"commands have shape .*give \(n, 2\): speed m/s and heading"):
        make(values)


BOOLS = [
    [[True, False]],
    [[1.0, True]],
    [(np.False_, 0.5)],
    np.ones((2, 2), bool),
    [np.array([True, False])],
    np.array([[1.0, True]], object),
]


@pytest.mark.parametrize(
    "make", [Commands.relative_deg, Commands.game_deg, Commands.absolute_rad, Commands.absolute_deg]
)
@pytest.mark.parametrize("values", BOOLS)
def test_true_and_false_are_no_commands(make, values):
    with pytest.raises(
        FleetError, match=r"commands are not numbers \(some are True or False\); give an \(n, 2\) array"
    ):
        make(values)


@pytest.mark.parametrize("values", [[["fast", 0.0]], [[1.0, 2.0], [3.0]], [[object(), 1.0]]])
def test_what_is_no_number_is_refused(values):
    with pytest.raises(FleetError, match=r"commands are not numbers .*\(n, 2\)"):
        Commands.relative_deg(values)


def test_a_missing_value_becomes_nan_and_is_held_later():
    assert math.isnan(Commands.relative_deg([[None, 2.0]]).values[0, 0])


def test_commands_are_a_copy_of_what_was_given():
    given_values = np.ones((2, 2))
    commands = Commands.relative_deg(given_values)
    given_values[:] = 9.0
    assert (commands.values == 1.0).all()
    assert len(commands) == 2
