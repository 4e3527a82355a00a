"""Simulated boats behind stand-in MOOSDBs, and links to them, for tests."""

import contextlib

from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.sim_boats import SimFleet
from steerclear.shield.bridge.clock import MonotonicClock
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.moos.links import MoosLinks

HEAD = """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40], y_axis_deg: 30}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
boats:
"""


def fleet_text(blue=1, red=0, platform="heron", gate="helm", more=""):
    lines = [HEAD.rstrip()]
    game = blue == red
    for i, port in enumerate(free_ports(blue)):
        side = f"agent: agent_{i}" if game else "team: blue"
        stop = ", nothing_stops_it: true" if gate == "pid" else ""
        link = f'{{kind: moos, address: "moos://127.0.0.1:{port}", gate: {gate}{stop}}}'
        lines.append(f"  - {{name: blue_{i + 1}, {side}, platform: {platform}, link: {link}}}")
    for i in range(red):
        side = f"agent: agent_{blue + i}" if game else "team: red"
        lines.append(f"  - {{name: red_{i + 1}, {side}, platform: {platform}}}")
    return "\n".join([*lines, more])


def fleet_of(*args, **settings):
    return parse_fleet(fleet_text(*args, **settings))


@contextlib.contextmanager
def sim_of(fleet, speed=1.0, **settings):
    with SimFleet.from_file(fleet, speed=speed, **settings) as boats:
        yield boats


@contextlib.contextmanager
def link_of(fleet, speed=1.0, boat="blue_1"):
    maker = MoosLinks(fleet, MonotonicClock(speed))
    link = maker.link(fleet.boat(boat))
    try:
        link.connect(10.0)
        link.prepare(1.0)
        yield link, maker
    finally:
        link.release()
