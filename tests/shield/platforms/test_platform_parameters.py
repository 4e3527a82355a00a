"""Platforms refuse parameters that make no sense, in words that help."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield.exceptions import ConfigError, PlatformError, SteerclearError
from steerclear.shield.platforms import PLATFORMS, Gains, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.proving import reference_models
from steerclear.shield.platforms.registry import HERON

NUMBERS = [
    "max_speed_mps",
    "speed_factor",
    "max_thrust",
    "max_rudder",
    "turn_loss",
    "turn_gain",
    "max_acc",
    "max_dec",
    "speed_gain",
    "max_turn_rate_dps",
    "max_angular_acc_dps2",
]


def boat(**changes):
    """A heron of another name."""
    return replace(HERON, **{"name": "tub", **changes})


@pytest.mark.parametrize("name", [*NUMBERS, "rotate_speed_dps"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, "2", None, True])
def test_values_that_are_no_finite_numbers_are_refused_by_name(name, value):
    with pytest.raises(PlatformError, match=f"tub.*{name} is .*give a (finite )?number"):
        boat(**{name: value})


@pytest.mark.parametrize("name", NUMBERS)
def test_negative_values_are_refused_by_name(name):
    with pytest.raises(PlatformError, match=f"{name} is -0.5; it must be >="):
        boat(**{name: -0.5})


def test_a_boat_that_cannot_move_is_refused():
    with pytest.raises(PlatformError, match=r"max_speed_mps is 0\.0; it must be > 0"):
        boat(max_speed_mps=0.0)


def test_a_turn_cannot_cost_more_than_all_speed():
    with pytest.raises(PlatformError, match=r"turn_loss is 1\.5"):
        boat(turn_loss=1.5)


@pytest.mark.parametrize("gain", ["kp", "ki", "kd", "integral_limit"])
@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, "1"])
def test_controller_gains_are_checked(gain, value):
    with pytest.raises(PlatformError, match=gain):
        Gains(**{gain: value})


@pytest.mark.parametrize(
    "points",
    [
        (),
        ((0.0, 0.0),),
        ((0.0, 0.0), (0.0, 1.0)),
        ((10.0, 0.0), (0.0, 1.0)),
        ((0.0, 0.0), (math.nan, 1.0)),
        ((0.0, 0.0), (100.0, math.nan)),
        ((0.0, 0.0), (100.0, math.inf)),
        ((0.0, 0.0), (100.0, 1.0, 2.0)),
        tuple((float(k), float(k)) for k in range(L.MAP_CAPACITY + 1)),
    ],
)
def test_thrust_maps_that_cannot_be_read_are_refused(points):
    with pytest.raises(PlatformError, match="thrust_map"):
        boat(thrust_map=points)


def test_a_thrust_map_may_be_given_as_lists():
    listed = boat(thrust_map=[[0.0, 0.0], [100.0, 2.0]])
    assert hash(listed) == hash(boat(thrust_map=((0.0, 0.0), (100.0, 2.0))))


def test_an_unknown_kind_is_told_the_known_ones():
    with pytest.raises(PlatformError, match=r"unknown kind 'hovercraft'.*double_integrator.*single_integrator.*usv"):
        boat(kind="hovercraft")


@pytest.mark.parametrize("name", ["hron", "", "HERON", 3, None, ["heron"]])
def test_an_unknown_name_is_told_the_known_ones(name):
    with pytest.raises(
        PlatformError,
        match="known platforms: ardurover_boat, blueboat, di, heron, large_usv, mctf2024_sim, otter, si, surveyor",
    ):
        get_platform(name)


def test_platform_errors_are_setting_errors_of_this_package():
    assert issubclass(PlatformError, ConfigError)
    assert issubclass(PlatformError, SteerclearError)
    assert issubclass(PlatformError, ValueError)


def test_a_platform_passes_through_and_cannot_be_changed():
    own = boat()
    assert get_platform(own) is own
    with pytest.raises(AttributeError):
        own.max_speed_mps = 9.0


@pytest.mark.parametrize("name", sorted(PLATFORMS))
def test_packing_is_complete_and_repeatable(name):
    row = get_platform(name).pack()
    assert row.shape == (L.N_PARAM,)
    assert row.dtype == np.float64
    assert np.isfinite(row).all()
    assert get_platform(name).name == name
    row[:] = -1.0
    assert get_platform(name).pack()[L.MAX_SPEED] == get_platform(name).max_speed_mps


@given(thrusts=st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=8, unique=True), speed=st.floats(-3.0, 12.0))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_any_rising_thrust_map_is_taken(thrusts, speed):
    points = tuple((thrust, speed) for thrust in sorted(thrusts))
    with reference_models():  # most are no boats
        row = boat(thrust_map=points).pack()
    assert row[L.MAP_SIZE] == len(points)
    assert row[L.MAP_THRUST : L.MAP_THRUST + len(points)] == pytest.approx([p[0] for p in points], rel=0, abs=0)
