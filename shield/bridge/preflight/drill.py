"""`Drill`: a short drive of one boat after the other, all of them behind the shield, to see how they respond.

It stands where a policy stands: the loop asks it what boats should do, the shield filters that, and the ticks it gets
back hold what was really sent and what the boats did.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...commands import Commands
from ...jit import Array
from ..fleet_file import FleetFile
from ..messages import Answer, BoatReading, Snapshot, Tick

AHEAD_S = 8.0
TURN_S = 7.0
STOP_S = 5.0
EACH_S = AHEAD_S + TURN_S + STOP_S
"""How long the drill of one boat takes, s."""

TURN_RAD = math.radians(60.0)
TOP_SHARE = 0.6
FASTEST_MPS = 1.5
COURSE_STEP_DEG = 15.0
ENOUGH_M, EDGE_M = 20.0, 10.0
"""Room beyond which others, and the geofence's edge, disturb no drill, m."""
TURN_COST_M = 0.5
"""A first turn that differs by a radian from a right angle counts as so much less room, m."""
SAME_MPS, SAME_RAD = 0.05, math.radians(1.0)
"""Commands that differ by less are the same."""


@dataclass(frozen=True)
class DrillSample:
    """One turn of the loop.

    Attributes:
        time_s: of the turn.
        reading: of the boat.
        heading_rad, speed_mps: as sent; NaN when nothing was.
        changed: whether something else than the drill's own command was decided: the shield gave way, a declared
            response was due, or nothing could be decided.
    """

    time_s: float
    reading: BoatReading
    heading_rad: float
    speed_mps: float
    changed: bool = False


class Drill:
    """A `WantedSource` and a `TickSink`.

    Args:
        fleet: the file.
        boats: to drill, in order; all others of the process lie still.

    Attributes:
        seconds: how long it takes.
        samples: by boat's name, of its own turn only.
    """

    def __init__(self, fleet: FleetFile, boats: Sequence[str]) -> None:
        self.samples: dict[str, list[DrillSample]] = {name: [] for name in boats}
        self.seconds = EACH_S * len(self.samples)
        self._fleet = fleet
        self._boats = tuple(self.samples)
        self._began_s = math.nan
        self._courses: dict[str, tuple[float, float]] = {}
        self._commands: Commands | None = None

    def offer(self, snapshot: Snapshot) -> None:
        """See `WantedSource`."""
        if math.isnan(self._began_s):
            self._began_s = snapshot.taken_s
        values = np.column_stack([np.zeros(len(snapshot.seen)), np.radians(snapshot.seen[:, 2])])
        boat, into_s = self.turn_of(snapshot.taken_s)
        if boat:
            i = self._fleet.names.index(boat)
            values[i] = self._wanted(boat, snapshot.seen[i], np.delete(snapshot.seen, i, axis=0), into_s)
        self._commands = Commands.absolute_rad(values)

    def latest(self) -> Answer:
        """See `WantedSource`."""
        return Answer() if self._commands is None else Answer(self._commands, 0.0)

    def take(self, tick: Tick) -> None:
        """See `TickSink`."""
        boat, _ = self.turn_of(tick.began_s)
        reading, sent = tick.readings.get(boat), tick.sent.get(boat)
        if reading is not None:
            told = (math.nan, math.nan) if sent is None else (sent.heading_rad, sent.speed_mps)
            self.samples[boat].append(DrillSample(tick.began_s, reading, *told, self._is_changed(boat, tick, told)))

    def turn_of(self, time_s: float) -> tuple[str, float]:
        """Whose turn it is and for how long already, s; no name before and after."""
        into_s = time_s - self._began_s
        if not 0.0 <= into_s < self.seconds:
            return "", 0.0
        return self._boats[int(into_s / EACH_S)], into_s % EACH_S

    def close(self) -> None:
        """Nothing is held."""

    def _is_changed(self, boat: str, tick: Tick, told: tuple[float, float]) -> bool:
        """Whether the tick's command is not the drill's; what the link made of it, such as a cap, does not count."""
        if self._commands is None:
            return True
        speed, heading = self._commands.values[self._fleet.names.index(boat)]
        if tick.decisions is not None and tick.fleet is not None and boat in tick.fleet.names:
            i = tick.fleet.names.index(boat)
            decided = tick.decisions.sent.absolute(i, tick.fleet.heading_rad[i])
        else:
            decided = told[1], told[0]
        turned = abs((decided[1] - heading + math.pi) % (2.0 * math.pi) - math.pi)
        return not (abs(decided[0] - speed) <= SAME_MPS and turned <= SAME_RAD)

    def _wanted(self, boat: str, row: Array, others: Array, into_s: float) -> tuple[float, float]:
        """Speed m/s and heading rad; speed 0 for a boat nobody sees."""
        if not np.isfinite(row).all():
            return 0.0, 0.0
        if boat not in self._courses:
            self._courses[boat] = self._courses_of(boat, row, others)
        first, second = self._courses[boat]
        speed = self._speed_mps(boat)
        if into_s < AHEAD_S:
            return speed, first
        return (speed if into_s < AHEAD_S + TURN_S else 0.0), second

    def _speed_mps(self, boat: str) -> float:
        return min(FASTEST_MPS, TOP_SHARE * self._fleet.platform_of[boat].max_speed_mps)

    def _courses_of(self, boat: str, row: Array, others: Array) -> tuple[float, float]:
        """Course and the course after the turn that lead farthest from other boats and from the geofence's edge.

        Where several leave room enough, the one that begins with a right angle: a turn tells of the steering.
        """
        places = others[np.isfinite(others[:, :2]).all(axis=1), :2]
        speed, best, most = self._speed_mps(boat), (0.0, 0.0), -math.inf
        for first in np.radians(np.arange(0.0, 360.0, COURSE_STEP_DEG)):
            for second in (first + TURN_RAD, first - TURN_RAD):
                path = self._path(row, speed, first, second)
                apart = np.hypot(*(path[:, None, :] - places[None, :, :]).transpose(2, 0, 1)).min(initial=ENOUGH_M)
                turn = abs(math.remainder(first - math.radians(row[2]), 2.0 * math.pi))
                room = (
                    min(ENOUGH_M, float(apart)) + min(EDGE_M, self._inside_m(path)) - TURN_COST_M * abs(turn - TURN_RAD)
                )
                if room > most:
                    best, most = (float(first % (2.0 * math.pi)), float(second % (2.0 * math.pi))), room
        return best

    def _path(self, row: Array, speed: float, first: float, second: float) -> Array:
        """Places on the way, (k, 2) m, as straight legs."""
        leg, at = np.arange(1.0, AHEAD_S + 1.0), row[:2]
        one = at + speed * leg[:, None] * np.array([math.sin(first), math.cos(first)])
        more = np.arange(1.0, TURN_S + STOP_S + 1.0)[:, None]
        return np.vstack([at, one, one[-1] + speed * more * np.array([math.sin(second), math.cos(second)])])

    def _inside_m(self, path: Array) -> float:
        xmin, ymin, xmax, ymax = self._fleet.geofence.box
        x, y = path.T
        return float(np.min([x - xmin, xmax - x, y - ymin, ymax - y]))
