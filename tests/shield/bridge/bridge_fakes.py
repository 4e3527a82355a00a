"""Boats, links, feeds and policies that need no sockets and no real time: a small world on a clock moved by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from steerclear.shield import Commands, Shield
from steerclear.shield.bridge.clock import ManualClock
from steerclear.shield.bridge.control_loop import ControlLoop, Parts
from steerclear.shield.bridge.feed_packets import FlagStatus, GameState
from steerclear.shield.bridge.fleet_file import parse_fleet
from steerclear.shield.bridge.messages import Answer, BoatReading, Contact, Sent
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.exceptions import BridgeError, LinkError
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.surroundings import OPEN_WATER
from steerclear.shield.tracks import thrust_at

DT_S = 0.1

HEAD = """
version: 1
field: {origin: {latitude_deg: 42.0, longitude_deg: -71.0}, size_m: [80, 40]}
geofence: {xmin_m: -20, ymin_m: -20, xmax_m: 100, ymax_m: 60}
team: blue
"""


def fleet_text(blue=1, red=1, platform="heron", more=""):
    """A FLEET.yaml of that many boats; ``more`` is appended. Unequal sides play no game: their boats have no agent."""
    lines = [HEAD, "boats:"]
    for i in range(blue):
        side = f"agent: agent_{i}" if blue == red else "team: blue"
        link = f'{{kind: mavlink, address: "udpin:127.0.0.1:14550", system_id: {i + 1}}}'
        lines.append(f"  - {{name: blue_{i + 1}, {side}, platform: {platform}, link: {link}}}")
    for i in range(red):
        side = f"agent: agent_{blue + i}" if blue == red else "team: red"
        lines.append(f"  - {{name: red_{i + 1}, {side}, platform: {platform}, contact: feed}}")
    return "\n".join([*lines, 'feed: {listen: "127.0.0.1:14700"}', more])


def fleet_of(**settings):
    return parse_fleet(fleet_text(**settings))


class Unheeded(Shield):
    """A shield whose decisions nobody heeds: what was wanted is sent."""

    def decide(self, fleet, wanted, surroundings=None):
        return replace(super().decide(fleet, wanted, surroundings), filtered=wanted)


class FakeLink:
    """A link to a simulated boat; faults are attributes switched while the world runs."""

    def __init__(self, name, clock, platform="heron", x=0.0, y=0.0, heading_deg=0.0, speed=0.0):
        self.boat = name
        self.clock = clock
        self.params = get_platform(platform).pack()
        self.row = fresh_state(x, y, heading_deg, speed)
        self.row[L.THRUST] = thrust_at(self.params, speed)  # under way, as one that has come here
        self.command = None
        self.sent = []
        self.stops = 0
        self.silent_since_s = None
        self.deaf = False
        self.offset_m = (0.0, 0.0)
        self.late_s = 0.0
        self.changed = {}
        self._past = []
        self._silent = None

    def connect(self, timeout_s):
        pass

    def prepare(self, timeout_s, is_off=lambda: False):
        pass

    def advance(self, dt_s):
        self._past = [*self._past[-40:], (self.clock.now_s(), self.row.copy())]
        if self.command is not None:
            heading_deg, speed = self.command
            error = (heading_deg - self.row[L.HEADING] + 180.0) % 360.0 - 180.0
            step_boat(self.params, self.row, speed, error, dt_s)

    def read(self):
        now = self.clock.now_s()
        until = now - self.late_s if self.silent_since_s is None else self.silent_since_s
        fixed_s, row = now, self.row
        if until < now:
            fixed_s, row = self._at(until)
        age = now - fixed_s
        values = {
            "position_m": (row[L.X] + self.offset_m[0], row[L.Y] + self.offset_m[1]),
            "position_age_s": age,
            "heading_rad": math.radians(row[L.HEADING]) % (2 * math.pi),
            "heading_age_s": age,
            "speed_mps": row[L.SPEED],
            "velocity_age_s": age,
            "mode": "GUIDED",
            "ready": True,
            "why_not": "",
            "heartbeat_age_s": age if self.silent_since_s is not None else 0.0,
        }
        return BoatReading(boat=self.boat, read_s=now, **{**values, **self.changed})

    def fall_silent(self):
        """Say nothing new from now on."""
        self.silent_since_s = self.clock.now_s() if self.silent_since_s is None else self.silent_since_s

    def _at(self, time_s):
        """The latest moment kept that is not after that time."""
        if self.silent_since_s is None or self._silent is None:
            self._silent = next((e for e in reversed(self._past) if e[0] <= time_s + 1e-9), (time_s, self.row.copy()))
        return self._silent

    def send(self, heading_rad, speed_mps):
        if not (math.isfinite(heading_rad) and math.isfinite(speed_mps)):
            raise LinkError("not finite")
        if not self.deaf:
            self.command = (float(np.degrees(heading_rad)), speed_mps)
        self.sent.append((self.clock.now_s(), heading_rad, speed_mps))
        return Sent(self.boat, self.clock.now_s(), heading_rad, speed_mps, "fake", True)

    def stop(self):
        self.stops += 1
        if not self.deaf:
            self.command = (self.row[L.HEADING], 0.0)
        return Sent(self.boat, self.clock.now_s(), math.nan, 0.0, "stop", True)

    def close(self):
        return "stopped"

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()


class FakeContacts:
    """Boats nobody of ours commands: each keeps its course unless told otherwise; heard unless ``silent``."""

    def __init__(self, clock):
        self.clock = clock
        self.rows = {}
        self.commands = {}
        self.params = get_platform("heron").pack()
        self.heard = {}
        self.silent = set()

    def add(self, name, x, y, heading_deg, speed):
        self.rows[name] = fresh_state(x, y, heading_deg, speed)
        self.rows[name][L.THRUST] = 100.0 if speed == 2.0 else 0.0
        self.commands[name] = (heading_deg, speed)

    def advance(self, dt_s):
        for name, row in self.rows.items():
            heading_deg, speed = self.commands[name]
            error = (heading_deg - row[L.HEADING] + 180.0) % 360.0 - 180.0
            step_boat(self.params, row, speed, error, dt_s)

    def read(self):
        for name, row in self.rows.items():
            if name not in self.silent:
                position = (float(row[L.X]), float(row[L.Y]))
                heading = math.radians(row[L.HEADING])
                self.heard[name] = Contact(
                    name, position, heading, float(row[L.SPEED]), self.clock.now_s(), 0.0, "fake"
                )
        return tuple(self.heard.values())

    def close(self):
        pass


class FakePolicy:
    """Answers every snapshot at once, one tick later as the loop sees it, until told to hang.

    ``rule(snapshot) -> (n, 2)`` absolute commands.
    """

    def __init__(self, clock, rule):
        self.clock = clock
        self.rule = rule
        self.hung = False
        self.fault = ""
        self.answer = None
        self.asked_s = -math.inf
        self.snapshots = []

    def offer(self, snapshot):
        self.snapshots = [*self.snapshots[-3:], snapshot]
        if not self.hung:
            self.answer = Commands.absolute_rad(self.rule(snapshot))
            self.asked_s = snapshot.taken_s

    def latest(self):
        return Answer(self.answer, self.clock.now_s() - self.asked_s, self.fault)

    def close(self):
        pass


class FakeGame:
    """A referee who says at each tick what ``told(number of the question)`` gives: a `GameState`, or None."""

    def __init__(self, told, age_s=0.0):
        self.told = told
        self.age_s = age_s
        self.asked = 0

    def game(self):
        state = self.told(self.asked)
        self.asked += 1
        return state

    def game_age_s(self):
        return self.age_s


def game_of(blue_taken=False, red_taken=False, over=False):
    """A state of the game in which only the flags matter."""
    flags = (FlagStatus(10.0, 20.0, blue_taken), FlagStatus(70.0, 20.0, red_taken))
    return GameState(time_s=1.0, boats={}, flags=flags, over=over)


class FakeSink:
    """Keeps ticks; full when told so."""

    def __init__(self):
        self.ticks = []
        self.full = False

    def take(self, tick):
        if self.full:
            raise BridgeError("no space left for the log; free some")
        self.ticks.append(tick)

    def close(self):
        pass


class World:
    """Own boats and others, one loop, one clock."""

    def __init__(
        self, fleet, starts, rule, others=(), shield=None, game=None, surroundings=OPEN_WATER, contacts=FakeContacts
    ):
        self.fleet = fleet
        self.clock = ManualClock(1000.0)
        names = [boat.name for boat in fleet.ours]
        platforms = {boat.name: boat.platform for boat in fleet.boats}
        self.links = {
            name: FakeLink(name, self.clock, platforms[name], *start) for name, start in zip(names, starts, strict=True)
        }
        self.contacts = contacts(self.clock)
        for name, *start in others:
            self.contacts.add(name, *start)
        self.policy = FakePolicy(self.clock, rule)
        self.sink = FakeSink()
        self.operator = Operator()
        parts = Parts(
            self.links, self.policy, contacts=(self.contacts,), game=game, surroundings=surroundings, sinks=(self.sink,)
        )
        self.loop = ControlLoop(fleet, parts, self.operator, self.clock, shield)
        self.closest_m = math.inf

    @property
    def last(self):
        return self.sink.ticks[-1]

    def run(self, seconds, each=None):
        """Turn and move, for so long; ``each(world)`` is called before every turn."""
        for _ in range(round(seconds / DT_S)):
            if each is not None:
                each(self)
            self.loop.turn_or_stop(self.clock.now_s())
            for link in self.links.values():
                link.advance(DT_S)
            self.contacts.advance(DT_S)
            self.closest_m = min(self.closest_m, self.distance_m())
            self.clock.sleep_until(self.clock.now_s() + DT_S)
        return self

    def distance_m(self):
        """Smallest distance between an own boat and any other."""
        own = [link.row[:2] for link in self.links.values()]
        others = (row[:2] for name, row in self.contacts.rows.items() if name not in self.links)
        rows = [*own, *others]
        return min(
            (float(np.hypot(*(a - b))) for k, a in enumerate(own) for b in rows[k + 1 :]),
            default=math.inf,
        )

    def responses(self, subject=None):
        """(condition, response) of the last tick's actions."""
        return {(a.condition, a.response) for a in self.last.actions if subject in (None, a.subject)}


def since(time_s, act):
    """Calls ``act(world)`` before every turn from that time on."""
    return lambda world: act(world) if world.clock.now_s() >= time_s - 1e-6 else None


def straight(heading_deg, speed=2.0):
    """A rule that commands every boat the same."""
    heading = math.radians(heading_deg) % (2 * math.pi)
    return lambda snapshot: np.tile([speed, heading], (len(snapshot.seen), 1))


def pair(rule=None, shield=None, **settings):
    """Two own boats head on, 40 m apart, both told to go on."""

    def head_on(snapshot):
        return np.array([[2.0, 0.0], [2.0, math.pi]])

    starts = [(20.0, 0.0, 0.0, 2.0), (20.3, 40.0, 180.0, 2.0)]
    return World(fleet_of(blue=2, red=0, **settings), starts, rule or head_on, shield=shield)
