"""Platforms and their files: every setting has a unit, and each boat of the package is one."""

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import Fleet
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms import PLATFORMS, Gains, Platform, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.files import PlatformFile, load_platform, parse_platform, to_text
from steerclear.shield.platforms.proving import fault_of, reference_models
from steerclear.shield.platforms.registry import HERON, SHIPPED
from steerclear.shield.platforms.schema import ENTRIES, MEASURED

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


@given(thrusts=st.lists(st.floats(-100.0, 100.0), min_size=2, max_size=8, unique=True), speed=st.floats(-3.0, 12.0))
@settings(max_examples=50, deadline=None, derandomize=True)
def test_any_rising_thrust_map_is_taken(thrusts, speed):
    points = tuple((thrust, speed) for thrust in sorted(thrusts))
    with reference_models():  # most are no boats
        row = boat(thrust_map=points).pack()
    assert row[L.MAP_SIZE] == len(points)
    assert row[L.MAP_THRUST : L.MAP_THRUST + len(points)] == pytest.approx([p[0] for p in points], rel=0, abs=0)


@pytest.mark.parametrize("name", sorted(PLATFORMS))
def test_the_boats_of_the_package_are_boats(name):
    assert fault_of(PLATFORMS[name]) is None
    assert replace(PLATFORMS[name], name="mine") == replace(PLATFORMS[name], name="mine")


def test_models_with_known_answers_need_not_be_boats():
    with reference_models():
        rail = Platform(name="rail", kind="single_integrator", max_speed_mps=2.0)
    assert "commanded to turn" in fault_of(rail)
    with pytest.raises(PlatformError, match="commanded to turn"):
        replace(rail, name="rail too")


RATE = "name: tub\nkind: rate\nmax_speed_mps: 2\nmax_acc: 1\nmax_turn_rate_dps: 40\nmax_angular_acc_dps2: 60\n"

RATE += "turn_rate_per_mps: 30\nheading_pid: {kp: 1.5}\n"


@pytest.mark.parametrize("name", sorted(path.stem for path in SHIPPED.glob("*.yaml")))
def test_shipped_files_are_the_boats_of_their_names(name):
    file = load_platform(SHIPPED / f"{name}.yaml")
    assert file.platform == PLATFORMS[name] == get_platform(str(SHIPPED / f"{name}.yaml"))
    assert parse_platform(to_text(file)) == file


def test_files_that_cannot_be_read_are_named_in_one_line(tmp_path):
    (tmp_path / "tub.yaml").write_text(f"{RATE}max_dec: fast\n")
    with pytest.raises(PlatformError, match="give a plain number in m/s2") as error:
        load_platform(tmp_path / "tub.yaml")
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"platform file {tmp_path / 'tub.yaml'}: ")
    with pytest.raises(PlatformError, match=r"no platform file .*none.yaml; make one with: steerclear platform new"):
        get_platform(str(tmp_path / "none.yaml"))
    with pytest.raises(PlatformError, match="no plain file"):
        load_platform(tmp_path)
    (tmp_path / "big.yaml").write_text("#" * 70_000)
    with pytest.raises(PlatformError, match="larger than 64 KiB"):
        load_platform(tmp_path / "big.yaml")
    (tmp_path / "bytes.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(PlatformError, match="no text"):
        load_platform(tmp_path / "bytes.yaml")


def test_every_entry_of_a_platform_has_a_unit_and_a_word():
    settings = set(vars(get_platform("heron"))) - {"name", "kind"}
    assert settings == set(ENTRIES)
    assert all(entry.words for entry in (*ENTRIES.values(), *MEASURED.values()))


@given(values=st.fixed_dictionaries({key: st.floats(0.01, 30.0) for key in ("max_acc", "max_dec", "turn_lag_s")}))
@settings(max_examples=40, deadline=None, derandomize=True)
def test_what_is_written_is_read_back_bit_for_bit(values):
    with reference_models():
        platform = replace(
            get_platform("blueboat"), name='a "b" \\c', heading_pid=Gains(kp=values["max_acc"]), **values
        )
        file = PlatformFile(platform, {"delay_s": values["turn_lag_s"]})
        assert parse_platform(to_text(file, "a head\nof two lines")) == file


def test_a_fleet_takes_a_file_for_a_platform(tmp_path):
    path = tmp_path / "tub.yaml"
    path.write_text(RATE)
    fleet = Fleet.of(position_m=[[0, 0]], heading_deg=[0], speed_mps=[1], team=[0], platforms=str(path))
    assert isinstance(fleet.platforms[0], Platform)
    path.write_text(RATE.replace("max_speed_mps: 2", "max_speed_mps: 2.5"))
    assert get_platform(str(path)).max_speed_mps == 2.5  # a file that changed is read anew
    assert fleet.platforms[0].max_speed_mps == 2.0


def test_errors_grow_with_the_time_ahead():
    file = parse_platform(RATE + "measured: {position_error_m: 0.2, error_growth_mps: 0.1, delay_s: 0.3}\n")
    assert (file.error_m(0.5), file.error_m(1.0), file.delay_s) == (0.2, 0.2, 0.3)
    assert file.error_m(3.0) == pytest.approx(0.4)
