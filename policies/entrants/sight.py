"""What an entrant sees: one game in its own-end frame, own flag on the left, as plain numbers.

The frame is the field for a team whose flag is on the left, and the field turned by 180 deg for the other, so that one
piece of play serves both sides.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from steerclear.env.core import BatchedMctf
from steerclear.shield.platforms import layout as L

Point = tuple[float, float]


@dataclass(frozen=True)
class Boat:
    """One boat: place m, heading rad clockwise from the frame's north, speed and top speed m/s, and its standing."""

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
        """Where it is, m."""
        return self.x, self.y

    @property
    def velocity(self) -> Point:
        """East and north, m/s."""
        return self.speed * math.sin(self.heading), self.speed * math.cos(self.heading)


@dataclass(frozen=True)
class Sight:
    """One moment of a game.

    Attributes:
        own: the entrant's boats, in order.
        foes: the other team's.
        size: field, m.
        home: own flag's home, m.
        goal: where the other flag is now, m.
        base: where it is at home, m.
        flag: where the own flag is now, m.
        taken: whether a foe carries it.
        reach: radius of grabs and tags, m.
        keepout: distance from the own flag that own boats keep while it is home, without their radius, m.
        line: the dividing line's x, m.
        time: game time, s.
        docks: where a carrier has to take the flag, m; none where the own side is enough.
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
    """Whether the team's flag is on the right."""
    return bool(core.flag_home[team, 0] > 0.5 * core.config.env_bounds_m[0])


def look(core: BatchedMctf, team: int, game: int = 0) -> Sight:
    """What a team sees of a game."""
    turned, (width, height) = is_turned(core, team), core.config.env_bounds_m

    def place(point: list[float]) -> Point:
        return (width - point[0], height - point[1]) if turned else (point[0], point[1])

    boats = _boats(core, game, place, math.pi if turned else 0.0)
    size = core.config.team_size
    sides = tuple(boats[:size]), tuple(boats[size:])
    homes, flags = core.flag_home.tolist(), core.flag_position[game].tolist()
    return Sight(
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
    """Where a team's carrier has to take the flag, in the field's own frame, m; empty where its own side is enough."""
    rules, at = core.rules, core.config.capture_at
    if at == "own_side":
        return []
    found = rules.corner_marks[team] if at == "own_corners" else rules.flag_home[team][None]
    return [list(dock) for dock in found.tolist()]


def _boats(core: BatchedMctf, game: int, place: object, turn: float) -> list[Boat]:
    rows, tops = core.state[game].tolist(), core.max_speed_mps.tolist()
    tagged, carries, on_side = (flags[game].tolist() for flags in (core.is_tagged, core.has_flag, core.on_side))
    charge, full = core.tagging_cooldown_s[game].tolist(), core.config.tagging_cooldown_s
    radii = core.config.agent_radius_m
    return [
        Boat(
            *place((row[L.X], row[L.Y])),  # type: ignore[operator]
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
