"""Ticks of a simulated encounter, as the loop would make them, for tests of the black box and of replays."""

import math
from dataclasses import replace

import numpy as np
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig, Surroundings
from steerclear.shield.bridge.blackbox import LoggedBoat, LogHeader, McapWriter, platforms_of
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.bridge.messages import Action, BoatReading, Contact, Sent, Tick
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L

NAMES = ("blue_1", "blue_2", "red_1", "red_2")
FIELD = Surroundings(field=(-5.0, -5.0, 85.0, 45.0))
STARTS = ((10.0, 20.0, 90.0), (40.0, 35.0, 180.0), (70.0, 20.0, -90.0), (40.0, 5.0, 0.0))
"""Everybody faces the middle, and another boat beyond it: x m, y m, heading deg."""
START_S = 1000.25
UNIX_NS = 1_790_000_000_000_000_000


def header_of(config=None, **more):
    """Header of a 2 v 2 log; it does not depend on the machine's clock."""
    boats = tuple(LoggedBoat(name, f"agent_{i}", int(i >= 2), "heron", i < 2) for i, name in enumerate(NAMES))
    settings = {
        "config": config or ShieldConfig(delay_s=0.2, position_error_m=0.1),
        "surroundings": FIELD,
        "platforms": platforms_of(["heron"]),
        "boats": boats,
        "frame": FieldFrame(42.0, -71.0, 30.0),
        "field_size_m": (80.0, 40.0),
        "fleet_text": "version: 1\n",
        "preset": "aamas2024",
        "policy": "collider",
        "clock_s": START_S,
        "unix_ns": UNIX_NS,
    }
    return LogHeader(**(settings | more))


def reading_of(name, row, now_s, **more):
    """Telemetry that says just what the state row holds."""
    return BoatReading(
        boat=name,
        read_s=now_s,
        position_m=(float(row[L.X]), float(row[L.Y])),
        position_age_s=0.05,
        heading_rad=math.radians(row[L.HEADING]) % (2 * math.pi),
        heading_age_s=0.04,
        speed_mps=float(row[L.SPEED]),
        velocity_age_s=0.05,
        mode="GUIDED",
        ready=True,
        why_not="",
        heartbeat_age_s=0.5,
        **more,
    )


def contact_of(name, row, now_s):
    """A fix of another boat, a tenth of a second old."""
    place = (float(row[L.X]), float(row[L.Y]))
    return Contact(name, place, math.radians(row[L.HEADING]), float(row[L.SPEED]), now_s - 0.1, 0.3, "gps_hub")


class Encounter:
    """A shield in a simulated encounter; iterate over its ticks.

    Args:
        header: what the shield is built with.
        steps: ticks to make.
        shielded: whether boats obey the shield, else what was wanted.
        game: state of the game put into each tick.
        aims: (n, 2) point each boat wants to go to, m, and then back; None: where the boat that faces it starts.
        edit: called with each tick; returns what is logged instead.
    """

    def __init__(self, header, steps, shielded=True, game=None, aims=None, edit=None):
        self.header, self.steps, self.shielded, self.game = header, steps, shielded, game or {}
        self.shield = Shield(header.config, header.surroundings)
        self.state = np.zeros((4, L.N_STATE))
        self.state[:, :3] = STARTS
        self.state[:, [L.SPEED, L.THRUST]] = 1.0, 40.0
        self.state[:, [L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
        self.aims = np.array(STARTS)[[2, 3, 0, 1], :2] if aims is None else np.array(aims, dtype=float)
        self.edit = edit or (lambda tick: tick)

    def __iter__(self):
        params = get_platform("heron").pack()
        for number in range(self.steps):
            tick = self.tick(number)
            yield self.edit(tick)
            obeyed = tick.decisions.filtered if self.shielded else tick.nominal
            for i in range(4):
                speed, heading = obeyed.absolute(i, tick.fleet.heading_rad[i])
                error = (math.degrees(heading) - self.state[i, L.HEADING] + 180.0) % 360.0 - 180.0
                step_boat(params, self.state[i], speed, error, self.header.config.dt_s)

    def tick(self, number):
        """One turn of the loop."""
        now_s = START_S + number * self.header.config.dt_s
        fleet, fixed, reset = self.fleet(number), self.fixed(number), self.resets(number)
        wanted = self.wanted(number, fleet)
        if reset:
            self.shield.reset()
        decisions = self.shield.decide(fleet, wanted, fixed)
        sent = {
            name: Sent(
                name, now_s + 0.002, *decisions.filtered.absolute(i, fleet.heading_rad[i])[::-1], "attitude", True
            )
            for i, name in enumerate(NAMES[:2])
        }
        return Tick(
            number=number,
            due_s=now_s,
            began_s=now_s,
            sent_s=now_s + 0.002,
            readings={name: reading_of(name, self.state[i], now_s) for i, name in enumerate(NAMES[:2])},
            contacts=tuple(contact_of(name, self.state[i], now_s) for i, name in enumerate(NAMES) if i >= 2),
            fleet=fleet,
            nominal=wanted,
            surroundings=fixed,
            decisions=decisions,
            shield_reset=reset,
            sent=sent,
            policy_age_s=0.1,
            actions=(Action("red_1", "contact", "slow", "red_1 is late"),) if 20 <= number < 40 else (),
            game=self.game,
        )

    def fleet(self, number):
        """What is seen."""
        ours = np.array([True, True, False, False])
        return Fleet(self.state.copy(), np.array([0, 0, 1, 1]), ("heron",) * 4, ours, NAMES)

    def fixed(self, number):
        """Fixed things handed over with the decision."""
        return None

    def resets(self, number):
        """Whether the shield is reset before the decision."""
        return number == 0

    def wanted(self, number, fleet):
        """Everybody at full speed towards its aim; having come near, on to where it came from."""
        gap = self.aims - self.state[:, :2]
        near = np.hypot(*gap.T) < 3.0
        self.aims[near] = np.array(STARTS)[near, :2]
        course = np.arctan2(gap[:, 0], gap[:, 1]) % (2 * math.pi)
        return Commands.absolute_rad(np.stack([np.full(4, 2.0), course], axis=1))


def numbered(ticks, number):
    """One of the ticks, in turn, as that turn of the loop."""
    return replace(ticks[number % len(ticks)], number=number, began_s=START_S + 0.1 * number)


def write_log(path, steps=300, header=None, kind=Encounter, box=None, **more):
    """Write the log of an encounter, ``box``: settings of its writer; returns its header and ticks."""
    header = header or header_of()
    ticks = list(kind(header, steps, **more))
    writer = McapWriter(path, header, capacity=steps + 10, **(box or {}))
    for tick in ticks:
        writer.take(tick)
    writer.close()
    if writer.fault:
        raise RuntimeError(writer.fault)
    return header, ticks
