"""What an entrant sees: one game in its own-end frame, with the own flag on the left, as plain numbers.

For a team with its flag on the left the frame is the field. For the other team it is the field turned by 180 deg. The
same play therefore serves both sides.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import layout as L

Point = tuple[float, float]


@dataclass(frozen=True)
class Boat:
    """One boat: place m, heading rad clockwise from the frame's north, speed and top speed m/s, and its state."""

    x: float
    y: float
    heading: float
    speed: float
    top: float
    radius: float
    tagged: bool
    carries: bool
    on_side: bool
    recharged: bool

    @property
    def at(self) -> Point:
        """Position, m."""
        return self.x, self.y

    @property
    def velocity(self) -> Point:
        """Velocity east and north, m/s."""
        return self.speed * math.sin(self.heading), self.speed * math.cos(self.heading)


@dataclass(frozen=True)
class Observation:
    """One moment of a game.

    Attributes:
        own: the entrant's boats, in order.
        foes: the other team's boats.
        size: field, m.
        home: own flag's home, m.
        goal: present place of the other flag, m.
        base: home of the other flag, m.
        flag: present place of the own flag, m.
        taken: an opponent carries the own flag.
        reach: radius of grabs and tags, m.
        keepout: distance that own boats keep from their own flag while it is home, without their radius, m.
        line: x of the dividing line, m.
        time: game time, s.
        docks: places where a carrier must bring the flag, m; empty if reaching the own side is enough.
    """

    own: tuple[Boat, ...]
    foes: tuple[Boat, ...]
    size: Point
    home: Point
    goal: Point
    base: Point
    flag: Point
    taken: bool
    reach: float
    keepout: float
    line: float
    time: float
    docks: tuple[Point, ...] = ()


def is_turned(core: BatchedMctf, team: int) -> bool:
    """Return whether the team's flag is on the right."""
    return bool(core.flag_home[team, 0] > 0.5 * core.config.env_bounds_m[0])


def look(core: BatchedMctf, team: int, game: int = 0) -> Observation:
    """Return what a team sees of a game."""
    turned, (width, height) = is_turned(core, team), core.config.env_bounds_m

    def place(point: Sequence[float]) -> Point:
        return (width - point[0], height - point[1]) if turned else (point[0], point[1])

    boats = _boats(core, game, place, math.pi if turned else 0.0)
    size = core.config.team_size
    sides = tuple(boats[:size]), tuple(boats[size:])
    homes, flags = core.flag_home.tolist(), core.flag_position[game].tolist()
    return Observation(
        own=sides[team],
        foes=sides[1 - team],
        size=(width, height),
        home=place(homes[team]),
        goal=place(flags[1 - team]),
        base=place(homes[1 - team]),
        flag=place(flags[team]),
        taken=bool(core.flag_taken[game, team]),
        reach=core.config.catch_radius_m,
        keepout=core.config.flag_keepout_m,
        line=0.5 * (place(homes[0])[0] + place(homes[1])[0]),
        time=float(core.time_s[game]),
        docks=tuple(place(dock) for dock in docks_of(core, team)),
    )


def docks_of(core: BatchedMctf, team: int) -> list[list[float]]:
    """Return where a team's carrier must bring the flag, in the field's frame, m; empty if its own side is enough."""
    rules, at = core.rules, core.config.capture_at
    if at == "own_side":
        return []
    found = rules.corner_marks[team] if at == "own_corners" else rules.flag_home[team][None]
    return [list(dock) for dock in found.tolist()]


def _boats(core: BatchedMctf, game: int, place: Callable[[Sequence[float]], Point], turn: float) -> list[Boat]:
    rows, tops = core.state[game].tolist(), core.max_speed_mps.tolist()
    tagged, carries, on_side = (flags[game].tolist() for flags in (core.is_tagged, core.has_flag, core.on_side))
    charge, full = core.tagging_cooldown_s[game].tolist(), core.config.tagging_cooldown_s
    radii: Any = core.config.agent_radius_m
    return [
        Boat(
            *place((row[L.X], row[L.Y])),
            math.radians(row[L.HEADING]) + turn,
            row[L.SPEED],
            tops[i],
            radii[i],
            tagged[i],
            carries[i],
            on_side[i],
            charge[i] >= full,
        )
        for i, row in enumerate(rows)
    ]
