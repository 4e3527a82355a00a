"""Which answers of a policy can be used, and how old the last usable one is."""

import math

import numpy as np
import pytest
from bridge_fakes import fleet_of
from steerclear.shield import Commands
from steerclear.shield.bridge.policy_watch import PolicyWatch

GOOD = np.array([[2.0, 1.0], [1.0, -3.0], [np.nan, np.nan], [np.nan, np.nan]])


def watch():
    return PolicyWatch(fleet_of(blue=2, red=2), ("blue_1", "blue_2"))


def test_finite_commands_of_own_boats_are_usable_whatever_the_others_rows_hold():
    made = watch()
    made.update(10.0, Commands.absolute_rad(GOOD), 0.1, "")
    assert made.usable == {"blue_1", "blue_2"}
    assert made.ages(10.5) == pytest.approx({"blue_1": 0.6, "blue_2": 0.6})
    assert made.fault == ""


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e9, -1e9])
@pytest.mark.parametrize("column", [0, 1])
def test_what_is_no_command_is_not_used(value, column):
    made, values = watch(), GOOD.copy()
    made.update(10.0, Commands.absolute_rad(GOOD), 0.0, "")
    values[0, column] = value
    made.update(11.0, Commands.absolute_rad(values), 0.0, "")
    assert made.usable == {"blue_2"}
    assert "blue_1" in made.fault
    assert made.ages(11.0) == pytest.approx({"blue_1": 1.0, "blue_2": 0.0})


@pytest.mark.parametrize(
    ("commands", "said"),
    [
        (Commands.relative_deg(GOOD), "relative"),
        (Commands.absolute_rad(GOOD[:3]), "3 boats of 4"),
        (None, "it died"),
    ],
)
def test_answers_that_are_none_are_not_used(commands, said):
    made = watch()
    made.update(10.0, commands, 0.0, "it died" if commands is None else "")
    assert made.usable == frozenset()
    assert said in made.fault
    assert made.ages(10.0) == {"blue_1": math.inf, "blue_2": math.inf}


@pytest.mark.parametrize("age", [math.nan, -1.0])
def test_an_answer_from_the_future_is_not_used(age):
    made = watch()
    made.update(10.0, Commands.absolute_rad(GOOD), age, "")
    assert made.usable == frozenset()
