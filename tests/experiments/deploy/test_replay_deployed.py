"""The black box of boats that were really commanded over MAVLink: its replay proves every decision."""

import math

import numpy as np
import pytest
from pymavlink import mavutil
from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.deploy.replay import judge, replay_log
from steerclear.experiments.deploy.run import warm_up
from steerclear.experiments.sim_boats import AutopilotSettings, SimBoat, SimFleet
from steerclear.shield import Commands
from steerclear.shield.bridge.blackbox import LogReader, McapWriter, header_of_fleet, log_path
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.messages import Answer
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.session import VehicleSession

SECONDS = 5.0
TEXT = """\
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, y_axis_deg: 20.0, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
shield: {separation_m: 2.5, position_error_m: 0.3, delay_s: 0.2}
limits: {policy: {max_age_s: 60.0, give_up_after_s: 60.0}}
log_dir: ./logs
boats:
"""
STARTS = {
    "blue_1": (33.0, 20.0, 90.0),
    "blue_2": (48.0, 20.0, -90.0),
    "red_1": (40.0, 35.0, 0.0),
    "red_2": (5.0, 5.0, 0.0),
}


class HeadOn:
    """Wants the two blue boats to drive straight at each other."""

    def offer(self, snapshot):
        """Nothing to see."""

    def latest(self):
        values = np.full((4, 2), np.nan)
        values[:2] = (2.0, math.pi / 2), (2.0, 1.5 * math.pi)
        return Answer(Commands.absolute_rad(values), 0.0, "")

    def close(self):
        """Nothing to end."""


@pytest.fixture(scope="module")
def deployed(tmp_path_factory):
    """Two boats of ours driven head-on over MAVLink: black box, tlog."""
    path = tmp_path_factory.mktemp("deployed") / "FLEET.yaml"
    address = f"udpin:127.0.0.1:{free_ports(1)[0]}"
    link = f'link: {{kind: mavlink, address: "{address}", system_id: %d}}'
    rows = [
        f"  - {{name: {name}, agent: agent_{i}, platform: heron, {link % (i + 1)}}}" for i, name in enumerate(STARTS)
    ]
    path.write_text(TEXT + "\n".join(rows) + "\n")
    fleet, clock = load_fleet(path), MonotonicClock()
    warm_up(fleet)
    boats = [SimBoat(name, team=int(name[0] == "r"), address=address, start=start) for name, start in STARTS.items()]
    with (
        SimFleet(boats, y_axis_deg=20.0, autopilot=AutopilotSettings(boot_s=0.0)),
        VehicleSession(fleet, None, clock) as station,
    ):
        station.connect()
        station.prepare()
        header = header_of_fleet(
            fleet, path.read_text(), policy="head_on", commanded=station.links, clock_s=clock.now_s()
        )
        box = McapWriter(log_path(fleet.log_dir, ".mcap"), header)
        parts = Parts(links=station.links, policy=HeadOn(), ears=station.ears, sinks=(box,))
        ControlLoop(fleet, parts, Operator(), clock).run(SECONDS)
        box.close()
    assert box.fault == ""
    return box.path, next(fleet.log_dir.glob("*.tlog"))


@pytest.fixture(scope="module")
def replayed(deployed):
    with LogReader(deployed[0]) as log:
        found = replay_log(log, keep_tracks=True)
    judge(found)
    return found


def test_every_decision_on_the_water_is_made_again_bit_for_bit_by_what_the_log_holds(replayed):
    proof, header = replayed.proof, replayed.header
    assert replayed.complete
    assert proof.ticks > 20
    assert proof.same == proof.decisions > 10
    assert proof.missing == []
    assert header.fleet_text.startswith("version: 1\n")
    assert [(boat.name, boat.team, boat.ours) for boat in header.boats] == [
        ("blue_1", 0, True),
        ("blue_2", 0, True),
        ("red_1", 1, False),
        ("red_2", 1, False),
    ]
    assert header.config.delay_s == 0.2


def test_the_shield_kept_them_apart(replayed):
    assert replayed.reasons.total() > replayed.reasons["PASSED"]
    assert replayed.judged["closest_teammate_m"] > 2.5
    assert replayed.judged["breaches"] == []


def test_the_tlog_holds_both_directions_of_all_boats(deployed):
    log = mavutil.mavlink_connection(str(deployed[1]))
    seen = set()
    while (message := log.recv_match()) is not None:
        seen.add((message.get_type(), message.get_srcSystem(), message._link))
    log.close()
    assert {("GLOBAL_POSITION_INT", boat, 0) for boat in (1, 2, 3, 4)} <= seen
    assert any(kind == "SET_ATTITUDE_TARGET" and link == 1 for kind, _, link in seen)
    assert not any(kind == "BAD_DATA" for kind, _, _ in seen)
