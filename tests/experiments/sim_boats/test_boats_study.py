"""Processor time of boats that another process commands, this file with SECONDS ADDRESS=ID ... as its arguments."""

import logging
import math
import subprocess
import sys
import time

import pytest
from boat_links import READY
from pymavlink import mavutil
from steerclear.experiments.sim_boats import SimBoat, SimFleet

logger = logging.getLogger(__name__)
SECONDS = 20.0
STREAMS = (33, 30, 32)
INTERVAL_US = 50_000


def command_boats(places, seconds):
    """Three messages at 20 Hz from each boat, heading and speed at 10 Hz to each; how many packets came."""
    links = []
    for place in places:
        address, boat = place.split("=")
        link = mavutil.mavlink_connection(address, dialect="ardupilotmega", source_system=255)
        link.mav.heartbeat_send(6, 8, 0, 0, 0)
        links.append((link, int(boat)))
    time.sleep(0.2)
    wishes = [*((511, message, INTERVAL_US) for message in STREAMS), (176, 1, 15), (400, 1)]
    for link, boat in links:
        for command, *values in wishes:
            link.mav.command_long_send(boat, 1, command, 0, *values, *[0] * (7 - len(values)))
    end, heard, turn = time.monotonic() + seconds, 0, 0
    while time.monotonic() < end:
        turn += 1
        half = 0.02 * turn
        for link, boat in links:
            q = [math.cos(half), 0.0, 0.0, math.sin(half)]
            link.mav.set_attitude_target_send(0, boat, 1, 7, q, 0, 0, 0, 0.6)
            while link.recv_msg() is not None:
                heard += 1
        time.sleep(0.1)
    for link, _ in links:
        link.close()
    return heard


@pytest.mark.study
@pytest.mark.parametrize(("boats", "speed"), [(16, 1.0), (16, 5.0), (6, 10.0)])
def test_boats_fit_one_core(boats, speed):
    """Processor time of boats that stream 60 messages a second each and obey at 10 Hz (real s)."""
    specs = [SimBoat(f"b{i}", team=2, start=(10.0 * i, 5.0, 0.0)) for i in range(boats)]
    with SimFleet(specs, autopilot=READY, noise=1.0, speed=speed) as fleet:
        places = [f"{address}={fleet.system_ids[name]}" for name, address in fleet.addresses.items()]
        arguments = [sys.executable, __file__, str(SECONDS), *places]
        with subprocess.Popen(arguments, stdout=subprocess.PIPE, text=True) as commander:
            time.sleep(3.0)
            cpu_s, time_s, wall_s = fleet.cpu_s, fleet.time_s, time.monotonic()
            time.sleep(SECONDS - 8.0)
            cpu_s, time_s = fleet.cpu_s - cpu_s, fleet.time_s - time_s
            wall_s = time.monotonic() - wall_s
            heard = int(commander.communicate(timeout=60.0)[0])
        assert all(boat.autopilot.vehicle.armed for boat in fleet.boats.values())
        share, each_ms = cpu_s / wall_s, 1e3 * cpu_s / time_s / boats
        logger.warning(
            "%d boats at %gx: %.1f %% of a core, %.2f ms a boat and simulated s, %.2f s let go, %d packets heard",
            boats, speed, 100.0 * share, each_ms, fleet.let_go_s, heard,
        )  # fmt: skip
        assert share < 0.8
        assert fleet.let_go_s == 0.0
        assert heard > 0.5 * boats * 60.0 * SECONDS * min(speed, 1.0)


if __name__ == "__main__":
    sys.stdout.write(f"{command_boats(sys.argv[2:], float(sys.argv[1]))}\n")
