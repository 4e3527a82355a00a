"""Platform files: read strictly, written with units, the same boats as before."""

from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from steerclear.shield import Fleet
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms import PLATFORMS, Gains, Platform, get_platform
from steerclear.shield.platforms.files import PlatformFile, load_platform, parse_platform, to_text
from steerclear.shield.platforms.proving import reference_models
from steerclear.shield.platforms.registry import SHIPPED
from steerclear.shield.platforms.schema import ENTRIES, MEASURED

RATE = "name: tub\nkind: rate\nmax_speed_mps: 2\nmax_acc: 1\nmax_turn_rate_dps: 40\nmax_angular_acc_dps2: 60\n"
RATE += "turn_rate_per_mps: 30\nheading_pid: {kp: 1.5}\n"
BAD = {
    "speed in knots": ("max_speed_knots: 5", "max_speed_knots is in another unit.*max_speed_mps.*0.514444"),
    "turn rate in radians": ("max_turn_rate_rads: 1", "in another unit.*max_turn_rate_dps.*57.2958"),
    "a number with its unit": ("max_dec: 2 m/s", "max_dec is '2 m/s'; give a plain number in m/s2"),
    "a text": ("max_dec: fast", "give a plain number in m/s2"),
    "a misspelt entry": ("max_decc: 1", "unknown entry max_decc; did you mean max_dec"),
    "an entry of other boats": ("turn_gain: 60", "turn_gain is for boats of kind usv, this is a rate"),
    "a negative limit": ("max_dec: -1", "must be >= 0"),
    "not a number": ("max_dec: .nan", "finite"),
    "a word that programs read differently": ("max_dec: 010", "programs disagree"),
    "an entry given twice": ("max_acc: 1", "given twice"),
    "a measure that is none": ("measured: {delay_ms: 20}", "in another unit|unknown entry measured.delay_ms"),
    "a negative measure": ("measured: {delay_s: -1}", "measured.delay_s is -1"),
    "gains with units": ("speed_lag_s: [1, 2]", "give a plain number in s"),
}


@pytest.mark.parametrize("name", sorted(path.stem for path in SHIPPED.glob("*.yaml")))
def test_shipped_files_are_the_boats_of_their_names(name):
    file = load_platform(SHIPPED / f"{name}.yaml")
    assert file.platform == PLATFORMS[name] == get_platform(str(SHIPPED / f"{name}.yaml"))
    assert parse_platform(to_text(file)) == file


@pytest.mark.parametrize("case", sorted(BAD))
def test_bad_entries_are_refused_in_one_line_that_names_the_remedy(case, tmp_path):
    line, words = BAD[case]
    path = tmp_path / "tub.yaml"
    path.write_text(f"{RATE}{line}\n")
    with pytest.raises(PlatformError, match=words) as error:
        load_platform(path)
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(f"platform file {path}: ")


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("max_speed_mps: 2", "max_speed_mps: 0"), "must be > 0"),
        (("max_speed_mps: 2", "max_speed_mps: 300"), "give m/s, at most 40"),
        (("max_speed_mps: 2\n", ""), "max_speed_mps is missing"),
        (("turn_rate_per_mps: 30", "turn_rate_per_mps: 0"), "commanded to turn, 90 of 90 deg are left"),
        (("heading_pid: {kp: 1.5}", "heading_pid: {ki: 1.5}"), "heading_pid.kp is 0"),
        (("heading_pid: {kp: 1.5}", "heading_pid: {gain: 1.5}"), "unknown entry heading_pid.gain"),
        (("kind: rate", "kind: sail"), "choose one of"),
        (("name: tub", "name: 7"), "give the boat's name"),
        (("max_acc: 1", "max_acc: 0"), "max_acc is 0"),
    ],
)
def test_contradictions_are_refused(change, words):
    with pytest.raises(PlatformError, match=words):
        parse_platform(RATE.replace(*change))


@pytest.mark.parametrize("text", ["", "[1, 2]", "just words", "a: [", "\x00", "name: tub\n---\nname: tub"])
def test_what_is_no_file_of_settings_is_refused(text):
    with pytest.raises(PlatformError):
        parse_platform(text)


def test_files_that_cannot_be_read_are_named(tmp_path):
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
