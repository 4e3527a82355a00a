"""`SeaTrial`: standard ship manoeuvring trials (IMO MSC.137(76)), one boat after the other, filtered by the shield.

Speed steps, right angles, a zig-zag, turning circles and stops. Each begins near the middle of the geofence along its
longer side, and is aborted before the edge. It takes the place of a policy. `steerclear fit` reads the black box.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Answer, Snapshot, Tick
from steerclear.shield.bridge.operator import Operator
from steerclear.shield.commands import Commands
from steerclear.shield.jit import Array

HOME_M, HOME_SIDE, HOME_S = 6.0, 0.2, 30.0
"""A boat is home within this distance, m, or share of the shorter side, of the middle; after this time it begins."""
STEADY_S = 5.0
EDGE_M, LOOK_S = 4.0, 2.5
"""A manoeuvre is aborted if the boat would come this near to the geofence, m, within this time, s."""
ZIGZAG_DEG, ZIGZAG_LEGS = 20.0, 5
CIRCLE_DEG, CARROT_DEG = 400.0, 75.0  # a turning circle is commanded as a heading this far ahead of the boat's
HOME_SHARE = 0.6

Wanted = tuple[float, float]


@dataclass
class Leg:
    """State of a manoeuvre: its initial heading, deg turned since, clockwise, most of it, and zig-zag legs done."""

    base_deg: float
    turned_deg: float = 0.0
    most_deg: float = 0.0
    count: int = 0


Steer = Callable[[Leg, float, float], Wanted | None]
"""Returns speed share and heading, deg, from leg, time in it, s, and the boat's heading, deg; None: it is done."""


def _steps(leg: Leg, into_s: float, heading_deg: float) -> Wanted | None:
    for share, until_s in ((0.5, 6.0), (1.0, 12.0), (0.4, 17.0), (0.0, 24.0)):
        if into_s < until_s:
            return share, leg.base_deg
    return None


def _stop(leg: Leg, into_s: float, heading_deg: float) -> Wanted | None:
    return (0.0, leg.base_deg) if into_s < 12.0 else None


def _right_angle(side: float, share: float, leg: Leg, into_s: float, heading_deg: float) -> Wanted | None:
    return (share, leg.base_deg + 90.0 * side) if into_s < 9.0 else None


def _zigzag(leg: Leg, into_s: float, heading_deg: float) -> Wanted | None:
    side = 1.0 - 2.0 * (leg.count % 2)
    if side * leg.turned_deg >= 0.8 * ZIGZAG_DEG:
        leg.count, side = leg.count + 1, -side
    if leg.count >= ZIGZAG_LEGS or into_s > 60.0:
        return None
    return 0.8, leg.base_deg + ZIGZAG_DEG * side


def _circle(side: float, leg: Leg, into_s: float, heading_deg: float) -> Wanted | None:
    """Ask for a heading ahead of the boat that never goes back.

    Where the platform is wrong, estimated headings jump with each fix. A heading controller with a derivative answers
    each jump, and what is logged is the phase of its clock, not the boat.
    """
    if abs(leg.turned_deg) >= CIRCLE_DEG or into_s > 45.0:
        return None
    leg.most_deg = max(leg.most_deg, side * leg.turned_deg)
    return 0.8, heading_deg + side * (CARROT_DEG + leg.most_deg - side * leg.turned_deg)


MANOEUVRES: tuple[tuple[str, float, Steer], ...] = (
    ("speed steps", 0.0, _steps),
    ("right angle to starboard", 0.5, partial(_right_angle, 1.0, 0.5)),
    ("stop from half speed", 0.5, _stop),
    ("right angle to port", 1.0, partial(_right_angle, -1.0, 1.0)),
    ("stop from full speed", 1.0, _stop),
    ("zig-zag", 0.8, _zigzag),
    ("turning circle to starboard", 0.8, partial(_circle, 1.0)),
    ("speed steps again", 0.0, _steps),
    ("right angle to port at half speed", 0.5, partial(_right_angle, -1.0, 0.5)),
    ("turning circle to port", 0.8, partial(_circle, -1.0)),
    ("right angle to starboard at full speed", 1.0, partial(_right_angle, 1.0, 1.0)),
    ("stop from full speed again", 1.0, _stop),
)
"""Name, share of the trial's speed it begins at, and steering function."""


class SeaTrial:
    """A `NominalSource` and a `TickSink`.

    Args:
        fleet: the file.
        boats: to drive, in order; the process's other boats stay at rest.
        speed_mps: highest commanded speed; None: each boat's top speed.
        tell: called with each manoeuvre that begins.
        operator: ends the run after the trial; None: nobody does.

    Attributes:
        broken_off: manoeuvres that the geofence ended early, by boat.
        changed: turns in which the shield changed the command, and all turns, by boat.
    """

    def __init__(
        self,
        fleet: FleetFile,
        boats: Sequence[str],
        speed_mps: float | None = None,
        tell: Callable[[str], None] = lambda text: None,
        operator: Operator | None = None,
    ) -> None:
        self.broken_off: dict[str, list[str]] = {name: [] for name in boats}
        self.changed = {name: [0, 0] for name in boats}
        self._fleet, self._tell, self._operator, self._speed_mps = fleet, tell, operator, speed_mps
        self._left = [(boat, *manoeuvre) for boat in boats for manoeuvre in MANOEUVRES]
        self._phase, self._since_s = "home", math.nan
        self._leg, self._last_deg = Leg(0.0), math.nan
        self._commands: Commands | None = None
        box = np.array(fleet.geofence.box).reshape(2, 2)
        self._low, self._high, self._sides = box[0] + EDGE_M, box[1] - EDGE_M, box[1] - box[0]

    @property
    def done(self) -> bool:
        """Whether all boats completed all manoeuvres."""
        return not self._left

    def offer(self, snapshot: Snapshot) -> None:
        """See `NominalSource`."""
        values = np.column_stack([np.zeros(len(snapshot.seen)), np.radians(snapshot.seen[:, 2])])
        if self._left:
            i = self._fleet.names.index(self._left[0][0])
            if np.isfinite(snapshot.seen[i]).all():
                values[i] = self._wanted(snapshot.seen[i], snapshot.taken_s)
        self._commands = Commands.absolute_rad(values)

    def latest(self) -> Answer:
        """See `NominalSource`."""
        return Answer() if self._commands is None else Answer(self._commands, 0.0)

    def take(self, tick: Tick) -> None:
        """See `TickSink`: count interventions, and end the run after the trial."""
        if self.done and self._operator is not None and not self._operator.ended:
            self._operator.end("the trial is done")
        boat = self._left[0][0] if self._left else ""
        if tick.decisions is not None and tick.fleet is not None and boat in tick.fleet.names:
            self.changed[boat][0] += int(bool(tick.decisions.intervened[tick.fleet.names.index(boat)]))
            self.changed[boat][1] += 1

    def close(self) -> None:
        """Do nothing."""

    def _wanted(self, row: Array, now_s: float) -> Wanted:
        """Return speed, m/s, and heading, rad, of the boat whose turn it is; row: x m, y m, heading deg, speed m/s."""
        boat, manoeuvre, share, steer = self._left[0]
        place, heading_deg, speed_mps = row[:2], float(row[2]), float(row[3])
        top_mps = min(self._fleet.platform_of[boat].max_speed_mps, self._speed_mps or math.inf)
        if math.isnan(self._since_s):
            self._since_s = now_s
        if self._phase == "home":
            away = place - 0.5 * (self._low + self._high)
            if math.hypot(*away) > max(HOME_M, HOME_SIDE * self._sides.min()) and now_s - self._since_s < HOME_S:
                return HOME_SHARE * top_mps, math.atan2(-away[0], -away[1])
            self._phase, self._since_s = "steady", now_s
            self._tell(f"{boat}: {manoeuvre}")
            along = 90.0 if self._sides[0] >= self._sides[1] else 0.0  # along the longer side, with the smaller turn
            off = abs(math.remainder(along - heading_deg, 360.0))
            self._leg = Leg(along if off <= 90.0 else along + 180.0)
        if self._phase == "steady":
            if now_s - self._since_s < STEADY_S:
                return share * top_mps, math.radians(self._leg.base_deg)
            self._phase, self._since_s, self._last_deg = "going", now_s, heading_deg
        self._leg.turned_deg += math.remainder(heading_deg - self._last_deg, 360.0)
        self._last_deg = heading_deg
        wanted = steer(self._leg, now_s - self._since_s, heading_deg)
        way = math.radians(heading_deg)
        then = place + LOOK_S * speed_mps * np.array([math.sin(way), math.cos(way)])
        near_edge = not ((self._low < then) & (then < self._high)).all()
        if wanted is not None and not (near_edge and wanted[0] > 0.0):
            return wanted[0] * top_mps, math.radians(wanted[1])
        if wanted is not None:
            self.broken_off[boat].append(manoeuvre)
        self._left.pop(0)
        self._phase, self._since_s = "home", now_s
        return HOME_SHARE * top_mps, math.radians(heading_deg)


def longest_s(boats: int) -> float:
    """Return an upper bound of the duration of a trial of so many boats, s."""
    return boats * len(MANOEUVRES) * (HOME_S + STEADY_S + 60.0)
