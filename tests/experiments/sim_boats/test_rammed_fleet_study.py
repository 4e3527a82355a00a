"""Boats fitted by the page's own commands among rammers: what their model misses is made up for.

Three boats of ours cruise among three that ram them, on one clock moved by hand; violations are by true places. What
our boats are told they are and what they are differ; their autopilots are simulated, links and feed are real.
"""

import logging
import math
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from boat_page import follow
from bridge_fakes import Unheeded
from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.deploy.orders import with_delay
from steerclear.experiments.sim_boats import AutopilotSettings, SimFleet
from steerclear.experiments.sim_boats.demo import off_platform
from steerclear.shield import Commands
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.messages import Answer
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.session import VehicleSession
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from waiting import repeating

OURS, THEIRS = ("blue_1", "blue_2", "blue_3"), ("red_1", "red_2", "red_3")
SEPARATION_M, APART_M = 2.5, 3.0
STEP_S, LISTEN_S = 0.05, 0.002
TURN_S = 0.1
TOP_MPS = 2.0
HEAD = """version: 1
team: blue
field: {{origin: {{latitude_deg: 42.0, longitude_deg: -71.0}}, size_m: [80, 40]}}
geofence: {{xmin_m: 0, ymin_m: 0, xmax_m: 80, ymax_m: 40}}
feed: {{listen: "127.0.0.1:{feed}"}}
boats:
"""
OURS_LINE = (
    "  - {{name: {name}, agent: agent_{k}, platform: '{platform}', "
    "link: {{kind: mavlink, address: 'udpin:127.0.0.1:{link}', system_id: {number}}}}}\n"
)
THEIRS_LINE = "  - {{name: {name}, agent: agent_{k}, platform: heron, contact: feed}}\n"


class Cruise:
    """Steers each boat of ours from one point of the field drawn at random to the next, at top speed."""

    def __init__(self, names, seed):
        self.names, self.random, self.goal, self.commands = names, np.random.default_rng(seed), {}, None

    def offer(self, snapshot):
        values = np.column_stack([np.zeros(len(snapshot.seen)), np.radians(snapshot.seen[:, 2])])
        for i, name in enumerate(self.names):
            if name not in OURS or not np.isfinite(snapshot.seen[i]).all():
                continue
            place = snapshot.seen[i, :2]
            if name not in self.goal or math.dist(self.goal[name], place) < 4.0 or self.random.random() < 0.003:
                self.goal[name] = self.random.uniform((5.0, 5.0), (75.0, 35.0))
            east, north = self.goal[name] - place
            values[i] = TOP_MPS, math.atan2(east, north)
        self.commands = Commands.absolute_rad(values)

    def latest(self):
        return Answer(self.commands, 0.0)

    def close(self):
        pass


@dataclass
class Violations:
    """Violations of the separation by true places: how many, and the least distance, m, with mates and with rammers."""

    mates: int = 0
    opponents: int = 0
    closest_m: list = field(default_factory=lambda: [math.inf, math.inf])
    _inside: set = field(default_factory=set)

    def look(self, states):
        place = {name: states[name][[L.X, L.Y]] for name in (*OURS, *THEIRS)}
        pairs = [(a, b) for k, a in enumerate(OURS) for b in (*OURS[k + 1 :], *THEIRS)]
        for a, b in pairs:
            gap_m, foe = float(np.hypot(*(place[a] - place[b]))), b in THEIRS
            self.closest_m[foe] = min(self.closest_m[foe], gap_m)
            if gap_m > APART_M:
                self._inside.discard((a, b))
            elif gap_m < SEPARATION_M and (a, b) not in self._inside:
                self._inside.add((a, b))
                self.opponents, self.mates = self.opponents + foe, self.mates + (not foe)


def sail(folder, told, true, minutes, seed, shielded):
    """Violations in that many minutes: boats ``told`` (a platform file) the shield, which are ``true``."""
    fleet, clock = _fleet(folder, told), ManualClock(1000.0)
    water = SimFleet.from_file(
        fleet,
        opponents="rammer",
        clock=clock,
        autopilot=AutopilotSettings(boot_s=0.0),
        noise=1.0,
        seed=seed,
        random_start=True,
        hulls=lambda name, platform: true if name in OURS else platform,
    )
    station = VehicleSession(fleet, None, clock, tlog=False)

    def move():
        clock.sleep_until(clock.now_s() + STEP_S)
        water.advance(STEP_S)
        time.sleep(LISTEN_S)

    with repeating(move, 0.0):
        station.connect(30.0)
        station.prepare(60.0)
    parts = Parts(station.links, Cruise(fleet.names, seed), contacts=(station.feed,), sinks=())
    shield = None if shielded else Unheeded(fleet.shield_config, fleet.surroundings)
    loop, found = ControlLoop(fleet, parts, Operator(), clock, shield), Violations()
    for _ in range(round(60.0 * minutes / TURN_S)):
        loop.turn(clock.now_s())
        for _ in range(round(TURN_S / STEP_S)):
            move()
            found.look(water.states())
    with repeating(move, 0.0):
        station.close()
    water.close()
    return found


def _fleet(folder, told):
    link, feed = free_ports(2)
    text = HEAD.format(feed=feed)
    for k, name in enumerate(OURS):
        text += OURS_LINE.format(name=name, k=k, platform=told, link=link, number=k + 1)
    for k, name in enumerate(THEIRS):
        text += THEIRS_LINE.format(name=name, k=k + len(OURS))
    (folder / "FLEET.yaml").write_text(text)
    return with_delay(load_fleet(folder / "FLEET.yaml"))


MINUTES, SEEDS = 15.0, (1, 2, 3, 4)


@pytest.mark.study
def test_a_fitted_fleet_among_rammers_keeps_its_distance(tmp_path, capsys):
    """An hour with the shield and one whose decisions nobody heeds, of boats 20 % off what they are said to be."""
    logging.disable(logging.WARNING)
    follow(tmp_path, "fit")
    true = off_platform(get_platform("ardurover_boat"), 0.2, "blue_1", 0)
    hits = {}
    for shielded in (True, False):
        hits[shielded] = [
            sail(tmp_path, Path(tmp_path / "my_boat.yaml"), true, MINUTES, seed, shielded) for seed in SEEDS
        ]
    logging.disable(logging.NOTSET)
    with capsys.disabled():
        for shielded, found in hits.items():
            closest = [[round(m, 2) for m in f.closest_m] for f in found]
            counts = f"mates {[f.mates for f in found]}, opponents {[f.opponents for f in found]}, closest, m {closest}"
            sys.stderr.write(f"\nshield {'on' if shielded else 'off'}: {counts}\n")
    assert sum(f.mates for f in hits[True]) == 0
    assert sum(f.opponents for f in hits[False]) > 100, "rammers ram"
    assert sum(f.opponents for f in hits[True]) <= 0.1 * sum(f.opponents for f in hits[False])
