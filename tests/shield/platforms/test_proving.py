"""A platform must come to its top speed, turn and stop in its own model, or it is no boat."""

from dataclasses import replace

import pytest
from steerclear.shield.exceptions import PlatformError
from steerclear.shield.platforms import PLATFORMS, Gains, Platform, get_platform
from steerclear.shield.platforms.proving import fault_of, reference_models

HERON = get_platform("heron")
UNICYCLE = {"max_speed_mps": 3.0, "max_turn_rate_dps": 30.0, "max_acc": 1.0, "max_angular_acc_dps2": 60.0}


@pytest.mark.parametrize("name", sorted(PLATFORMS))
def test_the_boats_of_the_package_are_boats(name):
    assert fault_of(PLATFORMS[name]) is None
    assert replace(PLATFORMS[name], name="mine") == replace(PLATFORMS[name], name="mine")


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"speed_pid": Gains()}, r"commanded 2 m/s it comes to 0 m/s within 60 s; give its thrust_map.*speed_pid"),
        ({"max_speed_mps": 3.0}, r"commanded 3 m/s it comes to 2 m/s"),
        ({"max_thrust": 40.0}, r"comes to 1 m/s"),
        ({"speed_factor": 10.0}, r"commanded 2 m/s it comes to 0.5 m/s"),
        ({"heading_pid": Gains()}, r"to turn, 90 of 90 deg are left after 60 s; give its turn_gain.*heading_pid"),
        ({"turn_gain": 0.0}, r"commanded to turn, 90 of 90 deg are left"),
        ({"max_rudder": 0.0}, r"commanded to turn"),
        ({"thrust_map": ((0.0, 1.5), (100.0, 2.0))}, r"to stop it does 1.5 m/s after 60 s; give its thrust_map"),
        ({"max_dec": 0.001}, r"commanded to stop it does 1.9.* m/s after 60 s; give its max_dec$"),
        ({"max_acc": 0.001}, r"commanded 2 m/s it comes to .*; give its max_acc$"),
    ],
)
def test_thrust_boats_that_are_none_are_told_what_they_lack(changes, text):
    with pytest.raises(PlatformError, match=f"platform 'heron' is no boat that can be steered.*{text}"):
        replace(HERON, **changes)


@pytest.mark.parametrize(
    ("kind", "lacking", "text"),
    [
        ("single_integrator", "max_turn_rate_dps", r"commanded to turn.*give its max_turn_rate_dps$"),
        ("double_integrator", "max_turn_rate_dps", r"commanded to turn.*give its max_turn_rate_dps$"),
        ("double_integrator", "max_angular_acc_dps2", r"commanded to turn.*give its max_angular_acc_dps2$"),
        ("double_integrator", "max_acc", r"comes to 0 m/s within 60 s; give its max_acc"),
    ],
)
def test_integrators_that_are_none_are_told_what_they_lack(kind, lacking, text):
    Platform(name="mine", kind=kind, **UNICYCLE)
    with pytest.raises(PlatformError, match=text):
        Platform(name="mine", kind=kind, **UNICYCLE | {lacking: 0.0})


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"max_dec": 0.01}, r"commanded to stop it does .* m/s after 60 s; give its max_dec$"),
        ({"max_acc": 0.01}, r"it comes to .* within 60 s; give its max_acc$"),
        ({"speed_lag_s": 1000.0}, r"it comes to .* within 60 s; give its speed_lag_s$"),
        ({"turn_lag_s": 1e5}, r"commanded to turn, .* after 60 s; give its turn_lag_s$"),
        ({"max_angular_acc_dps2": 0.01}, r"commanded to turn, .*give its max_angular_acc_dps2$"),
        ({"max_turn_rate_dps": 0.01}, r"commanded to turn, .*give its max_turn_rate_dps$"),
        ({"turn_rate_at_rest_dps": 0.0, "turn_rate_per_mps": 0.0}, r"give its turn_rate_at_rest_dps or turn_rate_per"),
        ({"max_turn_rate_dps": 0.01, "turn_lag_s": 1e5}, r"give its turn_rate_at_rest.*max_turn_rate.*turn_lag_s$"),
    ],
)
def test_of_what_a_manoeuvre_hangs_on_the_setting_at_fault_is_named(changes, text):
    with pytest.raises(PlatformError, match=text):
        replace(get_platform("ardurover_boat"), **changes)


def test_a_name_a_kind_and_a_speed_make_no_boat():
    with pytest.raises(PlatformError, match="'blueboat' is no boat that can be steered"):
        Platform(name="blueboat", kind="usv", max_speed_mps=3.0)


@pytest.mark.parametrize(
    ("changes", "text"),
    [
        ({"name": ""}, "name is ''"),
        ({"name": 3}, "name is 3"),
        ({"kind": ["usv"]}, "unknown kind"),
        ({"speed_pid": 1.0}, r"speed_pid is 1.0; give Gains"),
        ({"heading_pid": None}, r"heading_pid is None; give Gains"),
        ({"thrust_map": 3.0}, r"thrust_map is 3.0; give \(thrust, speed\) points"),
        ({"thrust_map": (1.0, 2.0)}, r"thrust_map is .*give \(thrust, speed\) points"),
    ],
)
def test_what_is_of_another_kind_is_refused_by_name(changes, text):
    with pytest.raises(PlatformError, match=text):
        replace(HERON, **changes)


def test_models_with_known_answers_need_not_be_boats():
    with reference_models():
        rail = Platform(name="rail", kind="single_integrator", max_speed_mps=2.0)
    assert "commanded to turn" in fault_of(rail)
    with pytest.raises(PlatformError, match="commanded to turn"):
        replace(rail, name="rail too")
