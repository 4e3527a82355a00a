"""Commands boats from a process of its own: ``boat_commander.py SECONDS ADDRESS=ID ...``; counts packets heard."""

from __future__ import annotations

import math
import sys
import time

from pymavlink import mavutil

STREAMS = (33, 30, 32)
INTERVAL_US = 50_000


def command_boats(places: list[str], seconds: float) -> int:
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


if __name__ == "__main__":
    sys.stdout.write(f"{command_boats(sys.argv[2:], float(sys.argv[1]))}\n")
