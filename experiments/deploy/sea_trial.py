"""`SeaTrial`: the manoeuvres by which ships are proved (IMO MSC.137(76)), one boat after the other, behind the shield.

Speed steps, right angles, a zig-zag, turning circles and stops, each begun from the middle of the geofence towards its
widest water and broken off before the edge. It stands where a policy stands; the black box keeps what came of it, and
`steerclear fit` reads that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Answer, Snapshot, Tick
from steerclear.shield.commands import Commands
from steerclear.shield.jit import Array

HOME_M, HOME_SIDE, HOME_S = 6.0, 0.2, 30.0
"""A boat is home within so many m of the middle, or that share of the shorter side; after so long it begins anyway."""
STEADY_S = 5.0
EDGE_M, LOOK_S = 4.0, 2.5
"""A manoeuvre is broken off when the boat would be so near to the geofence within so long."""
ZIGZAG_DEG, ZIGZAG_LEGS = 20.0, 5
CIRCLE_DEG, CARROT_DEG = 400.0, 75.0
"""A turning circle is told as a heading that stays so far ahead of the boat's."""
HOME_SHARE = 0.6

Wanted = tuple[float, float]


@dataclass
class Leg:
    """Where a manoeuvre stands.

    Attributes:
        base_deg: heading it was begun on.
        turned_deg: turned since, clockwise.
        count: legs of a zig-zag done.
    """

    base_deg: float
    turned_deg: float = 0.0
    count: int = 0


Steer = Callable[[Leg, float, Array], Wanted | None]
"""Speed share and heading, deg, from the leg, the time in it, s, and the boat's row; None: it is done."""


def _steps(leg: Leg, into_s: float, row: Array) -> Wanted | None:
    shares = ((0.5, 6.0), (1.0, 6.0), (0.4, 5.0), (0.0, 7.0))
    for share, lasts_s in shares:
        if into_s < lasts_s:
            return share, leg.base_deg
        into_s -= lasts_s
    return None


def _stop(leg: Leg, into_s: float, row: Array) -> Wanted | None:
    if into_s < 12.0:
        return 0.0, leg.base_deg
    return None


def _right_angle(side: float, share: float) -> Steer:
    def steer(leg: Leg, into_s: float, row: Array) -> Wanted | None:
        return (share, leg.base_deg + 90.0 * side) if into_s < 9.0 else None

    return steer


def _zigzag(leg: Leg, into_s: float, row: Array) -> Wanted | None:
    side = 1.0 if leg.count % 2 == 0 else -1.0
    if side * leg.turned_deg >= 0.8 * ZIGZAG_DEG:
        leg.count += 1
    if leg.count >= ZIGZAG_LEGS or into_s > 60.0:
        return None
    side = 1.0 if leg.count % 2 == 0 else -1.0
    return 0.8, leg.base_deg + ZIGZAG_DEG * side


def _circle(side: float) -> Steer:
    def steer(leg: Leg, into_s: float, row: Array) -> Wanted | None:
        if abs(leg.turned_deg) >= CIRCLE_DEG or into_s > 45.0:
            return None
        return 0.8, float(row[2]) + CARROT_DEG * side

    return steer


MANOEUVRES: tuple[tuple[str, float, Steer], ...] = (
    ("speed steps", 0.0, _steps),
    ("right angle to starboard", 0.5, _right_angle(1.0, 0.5)),
    ("stop from half speed", 0.5, _stop),
    ("right angle to port", 1.0, _right_angle(-1.0, 1.0)),
    ("stop from full speed", 1.0, _stop),
    ("zig-zag", 0.8, _zigzag),
    ("turning circle to starboard", 0.8, _circle(1.0)),
    ("speed steps again", 0.0, _steps),
    ("right angle to port at half speed", 0.5, _right_angle(-1.0, 0.5)),
    ("turning circle to port", 0.8, _circle(-1.0)),
    ("right angle to starboard at full speed", 1.0, _right_angle(1.0, 1.0)),
    ("stop from full speed again", 1.0, _stop),
)
"""Name, share of the trial's speed it is begun at, and how it is steered."""


class SeaTrial:
    """A `WantedSource` and a `TickSink`.

    Args:
        fleet: the file.
        boats: to drive, in order; all others of the process lie still.
        speed_mps: highest speed told; None: each boat's top speed.
        tell: is told what begins.

    Attributes:
        done: whether all boats went through all manoeuvres.
        broken_off: names of manoeuvres that the geofence ended early, by boat.
        changed: turns whose commands the shield changed, and all turns, by boat.
    """

    def __init__(
        self,
        fleet: FleetFile,
        boats: Sequence[str],
        speed_mps: float | None = None,
        tell: Callable[[str], None] = lambda text: None,
    ) -> None:
        self.done = False
        self.broken_off: dict[str, list[str]] = {name: [] for name in boats}
        self.changed = {name: [0, 0] for name in boats}
        self._fleet, self._boats, self._tell = fleet, tuple(boats), tell
        self._speed_mps = speed_mps
        self._at = (0, 0)
        self._phase, self._since_s = "home", math.nan
        self._leg = Leg(0.0)
        self._last_deg = math.nan
        self._commands: Commands | None = None

    @property
    def boat(self) -> str:
        """Whose turn it is; empty when all is done."""
        return "" if self.done else self._boats[self._at[0]]

    def offer(self, snapshot: Snapshot) -> None:
        """See `WantedSource`."""
        values = np.column_stack([np.zeros(len(snapshot.seen)), np.radians(snapshot.seen[:, 2])])
        if not self.done and self._boats:
            i = self._fleet.names.index(self.boat)
            if np.isfinite(snapshot.seen[i]).all():
                values[i] = self._wanted(snapshot.seen[i], snapshot.taken_s)
        self._commands = Commands.absolute_rad(values)

    def latest(self) -> Answer:
        """See `WantedSource`."""
        return Answer() if self._commands is None else Answer(self._commands, 0.0)

    def take(self, tick: Tick) -> None:
        """See `TickSink`: counts turns in which the shield gave way."""
        boat = self.boat
        if boat and tick.decisions is not None and tick.fleet is not None and boat in tick.fleet.names:
            self.changed[boat][0] += int(bool(tick.decisions.intervened[tick.fleet.names.index(boat)]))
            self.changed[boat][1] += 1

    def close(self) -> None:
        """Nothing is held."""

    def _wanted(self, row: Array, now_s: float) -> Wanted:
        """Speed, m/s, and heading, rad, of the boat whose turn it is."""
        if math.isnan(self._since_s):
            self._begin("home", row, now_s)
        top = self._top_mps(self.boat)
        if self._phase == "home":
            away = self._from_middle(row)
            if math.hypot(*away) > self._home_m() and now_s - self._since_s < HOME_S:
                return HOME_SHARE * top, math.atan2(-away[0], -away[1])
            self._begin("steady", row, now_s)
        _, share, steer = MANOEUVRES[self._at[1]]
        if self._phase == "steady":
            if now_s - self._since_s < STEADY_S:
                return share * top, math.radians(self._leg.base_deg)
            self._begin("going", row, now_s)
        self._leg.turned_deg += math.remainder(float(row[2]) - self._last_deg, 360.0)
        self._last_deg = float(row[2])
        wanted = steer(self._leg, now_s - self._since_s, row)
        near = self._near_edge(row)
        if wanted is None or (near and wanted[0] > 0.0):
            if near and wanted is not None:
                self.broken_off[self.boat].append(MANOEUVRES[self._at[1]][0])
            self._next(row, now_s)
            return HOME_SHARE * top, math.radians(float(row[2]))
        return wanted[0] * top, math.radians(wanted[1])

    def _begin(self, phase: str, row: Array, now_s: float) -> None:
        self._phase, self._since_s = phase, now_s
        if phase == "steady":
            self._tell(f"{self.boat}: {MANOEUVRES[self._at[1]][0]}")
            self._leg = Leg(self._widest_deg(row))
        elif phase == "going":
            self._leg, self._last_deg = Leg(self._leg.base_deg), float(row[2])

    def _next(self, row: Array, now_s: float) -> None:
        boat, manoeuvre = self._at
        if manoeuvre + 1 < len(MANOEUVRES):
            self._at = boat, manoeuvre + 1
        elif boat + 1 < len(self._boats):
            self._at = boat + 1, 0
        else:
            self.done = True
            return
        self._begin("home", row, now_s)

    def _top_mps(self, boat: str) -> float:
        top = self._fleet.platform_of[boat].max_speed_mps
        return top if self._speed_mps is None else min(top, self._speed_mps)

    def _from_middle(self, row: Array) -> tuple[float, float]:
        xmin, ymin, xmax, ymax = self._fleet.geofence.box
        return float(row[0]) - 0.5 * (xmin + xmax), float(row[1]) - 0.5 * (ymin + ymax)

    def _home_m(self) -> float:
        xmin, ymin, xmax, ymax = self._fleet.geofence.box
        return max(HOME_M, HOME_SIDE * min(xmax - xmin, ymax - ymin))

    def _widest_deg(self, row: Array) -> float:
        """Along the geofence's longer side, the way that needs the smaller turn."""
        xmin, ymin, xmax, ymax = self._fleet.geofence.box
        along = 90.0 if xmax - xmin >= ymax - ymin else 0.0
        off = abs(math.remainder(along - float(row[2]), 360.0))
        return along if off <= 90.0 else along + 180.0

    def _near_edge(self, row: Array) -> bool:
        heading, way = math.radians(float(row[2])), float(row[3]) * LOOK_S
        xmin, ymin, xmax, ymax = self._fleet.geofence.box
        x, y = float(row[0]) + way * math.sin(heading), float(row[1]) + way * math.cos(heading)
        return not (xmin + EDGE_M < x < xmax - EDGE_M and ymin + EDGE_M < y < ymax - EDGE_M)


def longest_s(boats: int) -> float:
    """More than a trial of so many boats takes, s."""
    return boats * len(MANOEUVRES) * (HOME_S + STEADY_S + 60.0)
