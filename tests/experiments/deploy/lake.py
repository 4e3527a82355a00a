"""Two simulated boats behind sockets, their links and the loop, all on one clock moved by hand."""

import math
import time

import numpy as np
from made_ticks import repeating
from steerclear.experiments.deploy.demo import free_ports
from steerclear.experiments.sim_boats import AutopilotSettings, SimBoat, SimFleet
from steerclear.shield import Commands
from steerclear.shield.bridge.blackbox import McapWriter, header_of_fleet, log_path
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts
from steerclear.shield.bridge.fleet_file import load_fleet
from steerclear.shield.bridge.messages import Answer
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.bridge.session import VehicleSession
from steerclear.shield.platforms import layout as L

STEP_S, LISTEN_S = 0.05, 0.004
KEY = bytes(range(32))
STARTS = {"blue_1": (20.0, 0.0, 0.0), "blue_2": (20.3, 40.0, 180.0)}
HEAD_ON = ((2.0, 0.0), (2.0, math.pi))
TEXT = """\
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
shield: {separation_m: 2.5, position_error_m: 0.3, delay_s: 0.2}
log_dir: ./logs
boats:
"""


class Wants:
    """Wants the same of the boats all the time."""

    def __init__(self, commands):
        self.commands = Commands.absolute_rad(np.array(commands))

    def offer(self, snapshot):
        """Nothing to see."""

    def latest(self):
        return Answer(self.commands, 0.0, "")

    def close(self):
        """Nothing to end."""


class Lake:
    """Two boats and what commands them; what links count and the loop declares, with the time of the first."""

    def __init__(self, folder, signed=False, *, text=TEXT, starts=STARTS, wants=HEAD_ON, boxed=False, **water):
        (self.port,) = free_ports(1)
        address = f"udpin:127.0.0.1:{self.port}"
        link = f'link: {{kind: mavlink, address: "{address}", system_id: %d}}'
        boats = "".join(
            f"  - {{name: {name}, team: blue, platform: heron, {link % (k + 1)}}}\n" for k, name in enumerate(starts)
        )
        (folder / "FLEET.yaml").write_text(text + boats + "signing: {key_file: my.key}\n" * signed)
        (folder / "my.key").write_text(KEY.hex())
        (folder / "my.key").chmod(0o600)
        self.clock, self.told, self.wants, self.boxed = ManualClock(1000.0), {}, wants, boxed
        places = [SimBoat(name, address=address, start=start) for name, start in starts.items()]
        key = KEY if signed else None
        settings = {"autopilot": AutopilotSettings(boot_s=0.0), "noise": 1.0, "seed": 5, **water}
        self.water = SimFleet(places, clock=self.clock, key=key, **settings)
        self.station = VehicleSession(load_fleet(folder / "FLEET.yaml"), None, self.clock)

    def __enter__(self):
        with repeating(self.move, 0.0):
            self.station.connect(30.0)
            self.station.prepare(60.0)
        fleet, sinks = self.station.fleet, [self]
        if self.boxed:
            text = (fleet.log_dir.parent / "FLEET.yaml").read_text()
            now_s = self.clock.now_s()
            header = header_of_fleet(fleet, text, policy="wants", commanded=self.station.links, clock_s=now_s)
            self.box = McapWriter(log_path(fleet.log_dir, ".mcap"), header)
            sinks.append(self.box)
        parts = Parts(self.station.links, Wants(self.wants), sinks=tuple(sinks))
        self.loop = ControlLoop(fleet, parts, Operator(), self.clock)
        return self

    def __exit__(self, *_):
        with repeating(self.move, 0.0):
            self.station.close()
        self.water.close()
        if self.boxed:
            self.box.close()

    def take(self, tick):
        """Note what was counted at links and declared."""
        kinds = [kind for reading in tick.readings.values() for kind, count in reading.faults.items() if count]
        for kind in (*kinds, *(action.condition for action in tick.actions)):
            self.told.setdefault(kind, tick.began_s)

    def close(self):
        """Nothing to give back."""

    def move(self):
        """Boats live for a step, and everybody has time to listen."""
        self.clock.sleep_until(self.clock.now_s() + STEP_S)
        self.water.advance(STEP_S)
        time.sleep(LISTEN_S)

    def turn(self):
        """A turn of the loop and the time until the next; the true distance at its end, m."""
        self.loop.turn(self.clock.now_s())
        for _ in range(round(0.1 / STEP_S)):
            self.move()
        first, second = (state[[L.X, L.Y]] for state in self.water.states().values())
        return float(np.hypot(*(first - second)))
