"""`gate: pid` on simulated boats: their PIDs post *_PRECBF, their hulls obey the plain names alone."""

import contextlib
import math
import threading
import time

import pytest
from drills import Gate
from moos_boats import fleet_of, fleet_text, link_of, sim_of
from steerclear.experiments.sim_boats import SimFleet
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.moos.checks import moos_checks
from steerclear.shield.bridge.preflight_checks import run_checks
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import layout as L
from waiting import until

WARP = 4.0
PRECBF = ("DESIRED_RUDDER_PRECBF", "DESIRED_THRUST_PRECBF")


@contextlib.contextmanager
def helms(boats, courses, speed_mps=1.2):
    """A helm aboard each boat, which posts DESIRED_* at 10 Hz to its PID."""
    ends = threading.Event()

    def post():
        while not ends.wait(0.1 / WARP):
            for name, heading_deg in courses.items():
                boats.boats[name].community.post("DESIRED_HEADING", heading_deg, "pHelmIvP")
                boats.boats[name].community.post("DESIRED_SPEED", speed_mps, "pHelmIvP")

    thread = threading.Thread(target=post, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ends.set()
        thread.join()


@contextlib.contextmanager
def afloat():
    """Simulated boats, the link to the one of ours, and its community."""
    fleet = fleet_of(1, 0, gate="pid")
    with sim_of(fleet, WARP) as boats, link_of(fleet, WARP) as (link, _):
        yield boats, link, boats.boats["blue_1"].community


def drive(link, community):
    for _ in range(30):
        link.send(1.0, 1.2)
        time.sleep(0.1 / WARP)
    assert community.actuators.thrust > 5.0


def test_two_boats_head_on_keep_clear_behind_the_gate_after_the_pid():
    fleet = fleet_of(2, 0, gate="pid")
    with sim_of(fleet, WARP) as boats:
        boats.place("blue_1", 24.0, 20.0, 90.0)
        boats.place("blue_2", 42.0, 20.0, -90.0)
        y_axis_deg = fleet.field.y_axis_deg
        with helms(boats, {"blue_1": 90.0 + y_axis_deg, "blue_2": 270.0 + y_axis_deg}):
            aboard = boats.boats["blue_1"].community.db
            assert until(lambda: aboard.latest.get(PRECBF[1]) is not None and aboard.latest[PRECBF[1]].value > 5.0)
            assert boats.states()["blue_1"][L.SPEED] == 0.0  # nobody posts the plain names yet
            with Gate(fleet, WARP) as gate:
                assert until(lambda: boats.states()["blue_1"][L.X] > boats.states()["blue_2"][L.X] + 3.0, 40.0)
                decided = [tick.decisions for tick in gate.ticks.all if tick.decisions is not None]
                thrust = aboard.latest["DESIRED_THRUST"]
        assert boats.closest_approaches()[0].distance_m >= fleet.shield_config.separation_m
        assert {bool(one.count_intervened) for one in decided} == {False, True}
        assert thrust.source == "steerclear_blue_1"


def test_a_loop_that_hangs_leaves_no_thrust_behind_nor_does_a_boat_that_is_left():
    with afloat() as (boats, link, community):
        drive(link, community)
        assert until(lambda: community.actuators.thrust == 0.0, 2.0)
        assert "no command for 1 s" in " ".join(link.read().texts)
        drive(link, community)  # and goes on with the next command
        assert "thrust" in link.close()
        assert until(lambda: community.actuators.thrust == 0.0, 1.0)
        assert until(lambda: boats.states()["blue_1"][L.SPEED] < 0.05, 10.0)


@pytest.mark.parametrize(
    ("key", "word"), [("MOOS_MANUAL_OVERRIDE", "true"), ("IVPHELM_ALLSTOP", "BehaviorError")], ids=["hand", "all-stop"]
)
def test_who_takes_a_boat_does_not_inherit_our_last_thrust(key, word):
    with afloat() as (_, link, community):
        drive(link, community)
        community.post(key, word, "somebody")
        assert until(lambda: not link.read().ready, 1.0)
        assert not link.send(1.0, 1.2).delivered  # decided just before it was heard
        assert until(lambda: community.actuators.thrust == 0.0, 1.0)
        community.post("DESIRED_THRUST", 20.0, "joystick")  # whose boat it is from now on
        time.sleep(0.5)
        assert community.actuators.thrust == 20.0


def test_actuators_keep_what_they_were_told_and_take_no_number_that_is_none():
    with sim_of(fleet_of(1, 0, gate="pid"), WARP) as boats:
        community = boats.boats["blue_1"].community
        for key, value in (("DESIRED_THRUST", 40.0), ("DESIRED_RUDDER", 10.0), ("DESIRED_RUDDER", math.nan)):
            community.post(key, value, "gate")
        assert (community.actuators.rudder, community.actuators.thrust) == (10.0, 40.0)
        assert until(lambda: boats.states()["blue_1"][L.SPEED] > 0.5)


def test_a_boat_without_rudder_and_thrust_is_refused():
    with pytest.raises(ConfigError, match="has no rudder and thrust"):
        SimFleet.from_file(fleet_of(1, 0, platform="blueboat", gate="pid"))


@pytest.mark.parametrize(
    ("answer", "simulator", "passed", "word"),
    [
        ("nothing_stops_it: true", True, True, "NOTHING stops it"),
        ("thrust_timeout_s: 1.5", False, True, "take thrust off after 1.5 s"),
        ("thrust_timeout_s: 1.5", True, False, "uSimMarine of its mission keeps its last thrust"),
    ],
)
def test_preflight_says_what_stops_a_boat_whose_gate_died(tmp_path, answer, simulator, passed, word):
    mission = tmp_path / "blue_one.moos"
    mission.write_text("ProcessConfig = uSimMarine\n{\n}\n" if simulator else "")
    text = fleet_text(1, 0, gate="pid").replace("nothing_stops_it: true", f"{answer}, mission: {mission}")
    fleet = parse_fleet(text)
    with sim_of(fleet), link_of(fleet) as (link, _):
        checks = [check for check in moos_checks({"blue_1": link}, fleet, 0.2) if check.name == "stop:blue_1"]
        (found,) = run_checks(checks)
    assert found.passed == passed
    assert word in found.text
