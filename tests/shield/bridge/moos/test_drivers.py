"""Who drives: hands, all-stops, other writers of what the gate writes; and what a mission file gives away."""

import math
from dataclasses import replace

import pytest
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.messages import BoatReading
from steerclear.shield.bridge.moos.checks import mission_faults, parse_mission
from steerclear.shield.bridge.moos.drivers import Drivers
from steerclear.shield.bridge.moos.gates import HelmGate, PidGate
from steerclear.shield.bridge.moos.wire import Message
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L


def said(key, text, source="pMarineViewer"):
    return Message("N", key, "S", source, text=text)


def number(key, value, source):
    return Message("N", key, "D", source, value=value)


@pytest.fixture
def drivers():
    watch = Drivers("gate", ("DESIRED_HEADING", "DESIRED_SPEED"), "RAW_")
    watch.hear(said("IVPHELM_STATE", "DRIVE", "pHelmIvP"), 0.0, 0.0)
    return watch


@pytest.mark.parametrize("key", ["MOOS_MANUAL_OVERRIDE", "MOOS_MANUAL_OVERIDE"])
def test_an_override_counts_at_once_in_both_spellings_and_ends_when_it_is_set_off_and_with_no_connection(drivers, key):
    assert drivers.why_not() == ""
    assert "took it by hand" in drivers.hear(said(key, "TRUE"), 1.0, 0.0)
    drivers.forget()
    assert "driven by hand" in drivers.why_not()
    assert "pMarineViewer" in drivers.why_not()
    assert "given back" in drivers.hear(said(key, "false"), 2.0, 0.0)
    assert drivers.why_not() == ""


@pytest.mark.parametrize(("reason", "stops"), [("clear", False), ("NothingToDo", False), ("BehaviorError", True)])
def test_an_all_stop_of_the_helm_is_told_and_an_error_of_it_stops_commands(drivers, reason, stops):
    text = drivers.hear(said("IVPHELM_ALLSTOP", reason, "pHelmIvP"), 1.0, 0.0)
    assert ("all-stop" in text) == (reason != "clear")
    assert bool(drivers.why_not()) == stops


def test_a_second_commander_is_named_and_the_helms_zeros_are_none(drivers):
    assert drivers.hear(number("DESIRED_HEADING", 0.0, "pHelmIvP"), 1.0, 0.0) == ""
    assert drivers.hear(number("DESIRED_SPEED", 1.0, "gate"), 1.0, 0.0) == ""
    assert not drivers.faults
    assert "set helm_prefix = RAW_" in drivers.hear(number("DESIRED_SPEED", 2.0, "pHelmIvP"), 1.0, 0.0)
    assert "pBehave" in drivers.hear(number("DESIRED_HEADING", 0.0, "pBehave"), 2.0, 0.0)
    assert drivers.faults["second_commander"] == 2
    assert (drivers.other, drivers.other_s) == ("pBehave", 2.0)


def test_what_stood_there_before_us_is_no_commander_but_its_type_counts(drivers):
    assert drivers.hear(number("DESIRED_HEADING", 90.0, "old"), 1.0, 60.0) == ""
    assert "is a string here" in drivers.hear(said("DESIRED_SPEED", "2.0", "script"), 1.0, 60.0)
    assert drivers.faults == {"type_clash": 1}
    drivers.hear(number("DESIRED_HEADING", 90.0, "old"), 2.0, 300.0)  # of now, its clock is wrong
    assert drivers.faults["second_commander"] == 1


def test_posts_that_do_not_come_back_are_told(drivers):
    drivers.posted(1.0)
    assert drivers.dropped(1.5) == ""
    assert "do not come back" in drivers.dropped(2.5)
    drivers.hear(number("DESIRED_SPEED", 1.0, "gate"), 2.6, 0.0)
    assert drivers.dropped(9.0) == ""


def reading(now_s=10.0, heading_rad=0.5, speed_mps=1.0):
    return BoatReading("blue_1", now_s, heading_rad=heading_rad, speed_mps=speed_mps)


def test_the_helms_gate_takes_both_raw_variables_or_stops_and_says_which_is_missing():
    gate = HelmGate(FieldFrame(42.0, -71.0, 30.0))
    assert "nobody posts RAW_DESIRED_HEADING" in gate.nominal(reading()).fault
    gate.hear(number("RAW_DESIRED_HEADING", 120.0, "helm"), 9.9)
    gate.hear(number("RAW_DESIRED_SPEED", 1.5, "helm"), 9.9)
    nominal = gate.nominal(reading())
    assert (nominal.speed_mps, nominal.heading_rad, nominal.fault) == (1.5, pytest.approx(math.radians(90.0)), "")
    gate.hear(number("RAW_DESIRED_SPEED", 1.5, "helm"), 11.2)
    late = gate.nominal(reading(11.3))
    assert (late.speed_mps, late.heading_rad) == (0.0, 0.5)
    assert "RAW_DESIRED_HEADING has been silent" in late.fault
    gate.hear(number("RAW_DESIRED_HEADING", math.nan, "helm"), 11.3)
    assert gate.nominal(reading(11.3)).fault  # no number is as good as silence
    assert gate.encode(math.radians(350.0), 1.0, reading()) == {
        "DESIRED_HEADING": pytest.approx(20.0),
        "DESIRED_SPEED": 1.0,
    }


def test_the_gate_after_the_pid_passes_what_the_shield_leaves_alone_bit_for_bit():
    gate = PidGate(get_platform("surveyor"), 0.1)
    assert "DESIRED_RUDDER_PRECBF" in gate.nominal(reading()).fault
    for k, (rudder, thrust) in enumerate([(12.345678901, 63.21), (-40.0, 63.3), (0.1, 70.0)]):
        now = 10.0 + 0.1 * k
        gate.hear(number("DESIRED_RUDDER_PRECBF", rudder, "pid"), now)
        gate.hear(number("DESIRED_THRUST_PRECBF", thrust, "pid"), now)
        nominal = gate.nominal(reading(now))
        posted = gate.encode(nominal.heading_rad, nominal.speed_mps, reading(now))
        assert posted == {"DESIRED_RUDDER": rudder, "DESIRED_THRUST": thrust}
        assert k or nominal.heading_rad > reading().heading_rad, "a rudder to starboard is a course to starboard"
    assert nominal.speed_mps == pytest.approx(2.25)


@pytest.mark.parametrize(
    ("platform", "told", "posted"),
    [
        ("heron", (0.0, -50.0), (0.0, 0.0)),  # it is not known to go astern, so nobody decided on that
        ("heron", (250.0, 160.0), (100.0, 100.0)),
        ("surveyor", (-101.0, -150.0), (-100.0, -100.0)),
        ("large_usv", (0.0, 90.0), (0.0, 70.0)),
    ],
)
def test_the_gate_after_the_pid_passes_nothing_that_the_platform_cannot_do(platform, told, posted):
    gate = PidGate(get_platform(platform), 0.1)
    for key, value in zip(gate.inputs, told, strict=True):
        gate.hear(number(key, value, "pid"), 10.0)
    nominal = gate.nominal(reading())
    found = gate.encode(nominal.heading_rad, nominal.speed_mps, reading())
    assert tuple(found.values()) == posted


def test_the_gate_after_the_pid_steers_as_the_platforms_autopilot_where_the_shield_decides_otherwise():
    platform = get_platform("surveyor")
    gate, row = PidGate(platform, 0.1), fresh_state(0.0, 0.0, math.degrees(0.5), 1.0)
    for _ in range(5):
        posted = gate.encode(1.2, 2.0, reading())
        row[L.HEADING], row[L.SPEED] = math.degrees(0.5), 1.0
        step_boat(platform.pack(), row, 2.0, math.degrees(0.7), 0.1)
        assert posted["DESIRED_RUDDER"] == pytest.approx(row[L.RUDDER], abs=1e-6)
        assert posted["DESIRED_THRUST"] == pytest.approx(row[L.THRUST], abs=1e-6)


MISSION = """
ServerPort = 9001   // of this boat
MOOSTimeWarp = 1
// ProcessConfig = pMarinePID { tardy_helm_threshold = 99 }
ProcessConfig = pHelmIvP
{
  AppTick = 4
  helm_prefix = RAW_
}
ProcessConfig = pMarinePIDV22
{
  AppTick = 10
  yaw_pid_kp = 0.9
  yaw_pid_kd = 0.6
  maxthrust = 100
}
"""


def faults(text, port=9001, warp=1.0, gate="helm", platform="heron"):
    return list(mission_faults(parse_mission(text), port, warp, get_platform(platform), gate, "RAW_"))


def test_a_mission_that_fits_has_no_faults():
    assert faults(MISSION) == []


@pytest.mark.parametrize(
    ("simulator", "turn_rate", "platform", "words"),
    [
        ("uSimMarine", 60, "heron", ""),
        ("uSimMarine", 60, "heron_v22", "turns this boat by 60 deg/s at 2 m/s and thrust 50, platform heron_v22 by 24"),
        ("uSimMarineV22", 60, "heron_v22", ""),
        ("uSimMarineV23", 60, "heron_v22", ""),
        ("uSimMarineV22", 60, "heron", "give the platform turn_gain: 60 and full_turn_speed_mps: 5"),
        ("uSimMarineV22", 90, "heron_v22", "give the platform turn_gain: 90"),
        (
            "uSimMarineV22",
            60,
            replace(get_platform("heron"), turn_gain=24.0),
            "full_turn_speed_mps: 5",
        ),
        ("uSimMarineV22", 60, "otter", ""),  # fitted, and checked by a drill
    ],
)
def test_a_simulator_that_turns_otherwise_than_the_platform_is_named(simulator, turn_rate, platform, words):
    block = f"ProcessConfig = {simulator}\n{{\n  AppTick = 10\n  turn_rate = {turn_rate}\n}}\n"
    found = faults(MISSION + block, platform=platform)
    assert len(found) == bool(words)
    assert all(words in fault for fault in found)


@pytest.mark.parametrize(
    ("old", "new", "word"),
    [
        ("helm_prefix = RAW_", "", "set helm_prefix = RAW_"),
        ("helm_prefix = RAW_", "helm_prefix = RAW_\n  allow_override = false", "allow_override"),
        ("9001", "9002", "ServerPort is 9002"),
        ("MOOSTimeWarp = 1", "MOOSTimeWarp = 4", "MOOSTimeWarp is 4"),
        ("AppTick = 10", "AppTick = 2", "AppTick 2"),
        ("AppTick = 10", "tardy_helm_threshold = 20", "tardy_helm_threshold 20"),
        ("AppTick = 10", "tardy_nav_threshold = none", "tardy_nav_threshold none"),
        ("yaw_pid_kp = 0.9", "yaw_pid_kp = 0.3", "yaw_pid_kp 0.3"),
        ("pMarinePIDV22", "pSomethingElse", "0 PIDs are configured"),
    ],
)
def test_what_undoes_the_shield_in_a_mission_is_named_with_its_remedy(old, new, word):
    found = faults(MISSION.replace(old, new, 1) if old != "9001" else MISSION.replace(old, new))
    assert any(word in fault for fault in found)
