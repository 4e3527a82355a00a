"""Three against three on one clock, positions by packets of the real feed, and an attacker who sends 200 a second."""

import math

import numpy as np
from bridge_fakes import FakeContacts, World, fleet_of
from steerclear.shield.bridge.feed import FeedReceiver
from steerclear.shield.bridge.feed_packets import Fix, Packet, Seal
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.mavlink.signing import SigningClock
from steerclear.shield.platforms import layout as L

FRAME = FieldFrame(42.0, -71.0)
KEY = bytes(range(32))
CLOCK = SigningClock()
SEPARATION_M = 2.5
PER_TURN = 20
"""Packets of the attacker in a turn of 0.1 s."""


class Deaf(FeedReceiver):
    """A receiver that hears nothing by itself: packets are handed to it."""

    def _hear(self):
        pass


class FedContacts(FakeContacts):
    """What a runner hears: the hub's packets and the attacker's, through a real receiver.

    ``attack(name of boat -> x, y)`` gives the datagrams of one turn; None: no attacker.
    """

    def __init__(self, clock, key=None, attack=None):
        super().__init__(clock)
        boats = [f"{side}_{k}" for side in ("blue", "red") for k in (1, 2, 3)]
        self.receiver = Deaf("127.0.0.1:0", FRAME, clock, boats=boats, key=key)
        self.seal = None if key is None else Seal(key)
        self.attack = attack
        self.links = {}
        self.seq = 0

    def read(self):
        everyone = {**self.rows, **{name: link.row for name, link in self.links.items()}}
        fixes = tuple(self._fix(name, row) for name, row in everyone.items() if name not in self.silent)
        self.seq += 1
        stamp = None if self.seal is None else CLOCK.take()
        data = Packet("gps_hub", 1, self.seq, fixes=fixes, stamp=stamp).encode()
        packets = [] if self.attack is None else self.attack({name: row[:2] for name, row in everyone.items()})
        half, true = PER_TURN // 2, data if self.seal is None else self.seal.close(data)
        for datagram in [*packets[:half], true, *packets[half:]]:
            self.receiver.take(datagram, "127.0.0.1")
        return self.receiver.read()

    def alarms(self):
        return self.receiver.alarms()

    def close(self):
        self.receiver.close()

    @staticmethod
    def _fix(name, row):
        place = FRAME.to_geodetic_deg(float(row[L.X]), float(row[L.Y]))
        return Fix(name, *place, float(row[L.HEADING]), float(row[L.SPEED]), 0.0, 0.1)


class Courses:
    """Where boats go: each to places drawn for it, one after the other."""

    def __init__(self, names, seed):
        self.random = np.random.default_rng(seed)
        self.goal = {name: self._draw() for name in names}

    def _draw(self):
        return self.random.uniform((5.0, 2.0), (75.0, 38.0))

    def heading_rad(self, name, x, y):
        if math.hypot(self.goal[name][0] - x, self.goal[name][1] - y) < 6.0:
            self.goal[name] = self._draw()
        return math.atan2(self.goal[name][0] - x, self.goal[name][1] - y) % (2.0 * math.pi)


def fed_world(seed=0, key=None, attack=None):
    """Boats of both sides cross each other's way without end; ours behind the shield."""
    fleet = fleet_of(blue=3, red=3)
    courses = Courses(fleet.names, seed)

    def rule(snapshot):
        rows = [
            (2.0, courses.heading_rad(name, row[0], row[1])) if np.isfinite(row).all() else (0.0, 0.0)
            for name, row in zip(fleet.names, snapshot.seen, strict=True)
        ]
        return np.array(rows)

    starts = [(25.0, 8.0 + 12.0 * k, 90.0, 1.5) for k in range(3)]
    others = [(f"red_{k + 1}", 55.0, 8.0 + 12.0 * k, 270.0, 1.5) for k in range(3)]
    world = World(fleet, starts, rule, others, contacts=lambda clock: FedContacts(clock, key, attack))
    world.contacts.links = world.links
    foes = Courses(fleet.names, [seed, 1])
    world.hits = {}

    def each(moved):
        for name, row in moved.contacts.rows.items():
            heading = foes.heading_rad(name, float(row[L.X]), float(row[L.Y]))
            moved.contacts.commands[name] = math.degrees(heading), 1.5
        count_hits(moved)

    world.each = each
    return world


def count_hits(world):
    """Note the closest approach of each pair of an own boat and another while it is a violation."""
    rows = {**{name: link.row for name, link in world.links.items()}, **world.contacts.rows}
    for own in world.links:
        for other, row in rows.items():
            apart_m = float(np.hypot(*(rows[own][:2] - row[:2])))
            if own < other and apart_m < SEPARATION_M:
                world.hits[own, other] = min(apart_m, world.hits.get((own, other), math.inf))
