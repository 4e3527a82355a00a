"""Putting boats into one encounter: the random numbers, sizes, places and boats that a family works with."""

from __future__ import annotations

import math
from typing import Any
from zlib import crc32

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import fresh_state, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracks import thrust_at

from ..play.conditions import draw
from . import scene as S
from .scene import Box, Conditions

STANDARD_FIELD_M = (80.0, 40.0)
ROOMY_FOR = 20
"""Boats for which the standard field has room; more get a field with the same area for each, all starting under way."""
FAR_M = 2000.0
Point = tuple[float, float]


class SceneBuilder:
    """One encounter in the making; everything random in it comes from ``rng``, of seed, family, platforms and number.

    ``other`` is the platform of the others, and of the second teammate, where a family has only teammates.
    """

    def __init__(self, own: str, other: str, conditions: Conditions, seed: int, family: str, number: int) -> None:
        self.own, self.other, self.names, self.number = own, other, (own, other), number
        self.own_mps, self.other_mps = self.top(own), self.top(other)
        self.radius_m, self.scale = conditions.radius_m, max(_scale(own), _scale(other))
        self.rng = np.random.default_rng([seed, crc32(f"{family}|{own}|{other}".encode()), number])
        self.nearest_m = 9.0 * self.scale + 2.0 * (self.radius_m - 2.5)
        """Distance at which others start, at least, m: outside of what a boat of its size can force."""
        self.farthest_m = 30.0 * self.scale
        self.length_s = 30.0 + 15.0 * min(self.scale, 4.0)
        self.clear()

    def clear(self) -> None:
        """Take all boats out again."""
        self.platforms: list[str] = []
        self.team: list[int] = []
        self.state: list[Array] = []
        self.script: list[Array] = []
        self.goals: list[list[Point]] = []
        self.variants: list[tuple[int, Array]] = []

    def settle(self) -> None:
        """Draw what is not a boat: the current's direction and the seed of the position errors."""
        self.current, self.noise_seed = draw(self.rng)

    def scripts(self) -> list[list[Array]]:
        """Scripts of all boats, once per variant."""
        if not self.variants:
            return [self.script]
        return [[row if k == boat else own for k, own in enumerate(self.script)] for boat, row in self.variants]

    def field(self, boats: int = 2) -> Box:
        """The field for so many boats, m: 80 x 40 for herons, 160 x 80 for surveyors, larger for large crowds."""
        size = self.scale * math.sqrt(max(1.0, boats / ROOMY_FOR))
        return 0.0, 0.0, STANDARD_FIELD_M[0] * size, STANDARD_FIELD_M[1] * size

    def top(self, platform: str) -> float:
        """Top speed, m/s."""
        return get_platform(platform).max_speed_mps

    def uniform(self, low: float, high: float) -> float:
        """A number between two others."""
        return float(self.rng.uniform(low, high))

    def side(self) -> float:
        """-1 or 1."""
        return float(self.rng.choice((-1.0, 1.0)))

    def chance(self, share: float) -> bool:
        """True with that probability."""
        return bool(self.rng.random() < share)

    def reached_m(self, platform: str) -> float:
        """Distance within which a goal counts as reached, m."""
        return 3.0 * _scale(platform)

    def add_own(self, x: float, y: float, heading_deg: float, speed: float, *goals: Point, name: str = "") -> int:
        """An own boat that makes for its goals at top speed; ``speed`` is the share of top speed it starts with."""
        platform = name or self.own
        row = S.to_goals(self.top(platform), self.reached_m(platform))
        return self._add(0, platform, (x, y, heading_deg), speed, row, list(goals))

    def add_other(self, x: float, y: float, heading_deg: float, speed: float, row: Array, *goals: Point) -> int:
        """A boat of the others, with its script."""
        return self._add(1, self.other, (x, y, heading_deg), speed, row, list(goals) or [(FAR_M, FAR_M)])

    def _add(
        self, team: int, platform: str, pose: tuple[float, float, float], share: float, row: Array, goals: list[Point]
    ) -> int:
        self.platforms.append(platform)
        self.team.append(team)
        self.state.append(under_way(platform, *pose, share * self.top(platform)))
        self.script.append(row)
        self.goals.append(goals)
        return len(self.state) - 1

    def is_clear(self, x: float, y: float, gap_m: float) -> bool:
        """Whether a place is at least ``gap_m`` from every boat there is."""
        return all(math.hypot(x - row[L.X], y - row[L.Y]) >= gap_m for row in self.state)

    def free_place(self, box: Box, gap_m: float) -> Point:
        """A place in the box at least ``gap_m`` from every boat there is.

        Raises:
            ConfigError: none was found in many tries.
        """
        for _ in range(5000):
            x, y = self.place_in(box)
            if self.is_clear(x, y, gap_m):
                return x, y
        raise ConfigError(f"no room for {len(self.state) + 1} boats {gap_m:.1f} m apart; choose a smaller --separation")

    def place_in(self, box: Box) -> Point:
        """Any place in the box."""
        return self.uniform(box[0], box[2]), self.uniform(box[1], box[3])

    def places_in(self, box: Box, count: int) -> list[Point]:
        """So many places in the box."""
        return [self.place_in(box) for _ in range(count)]

    def turn(self, angle_deg: float) -> None:
        """Turn the whole encounter about the origin, clockwise."""
        angle = math.radians(angle_deg)
        cos, sin = math.cos(angle), math.sin(angle)
        for row in self.state:
            row[L.X], row[L.Y] = row[L.X] * cos + row[L.Y] * sin, row[L.Y] * cos - row[L.X] * sin
            row[L.HEADING] = wrapped(row[L.HEADING] + angle_deg)
        self.goals = [[(x * cos + y * sin, y * cos - x * sin) for x, y in line] for line in self.goals]
        for row in (*self.script, *(row for _, row in self.variants)):
            phases = row[S.PHASE :].reshape(S.PHASES, S.N_PHASE)
            by_heading = phases[:, S.AIM] == S.AIM_HEADING
            phases[by_heading, S.ANGLE_DEG] = wrapped(phases[by_heading, S.ANGLE_DEG] + angle_deg)

    def closest_m(self) -> float:
        """Least distance of any two boats, m."""
        places = np.array([row[[L.X, L.Y]] for row in self.state])
        return min(float(np.hypot(*(places[k + 1 :] - here).T).min()) for k, here in enumerate(places[:-1]))


def ahead(x: float, y: float, heading_deg: float, way_m: float) -> Point:
    """The place so many metres ahead."""
    angle = math.radians(heading_deg)
    return x + way_m * math.sin(angle), y + way_m * math.cos(angle)


def bearing(start: Point, end: Point) -> float:
    """Direction from one place to another, deg clockwise from north."""
    return math.degrees(math.atan2(end[0] - start[0], end[1] - start[1]))


def wrapped(angle_deg: Any) -> Any:
    """An angle, or an array of them, in [-180, 180), deg."""
    return (angle_deg + 180.0) % 360.0 - 180.0


def under_way(platform: str, x: float, y: float, heading_deg: float, speed_mps: float) -> Array:
    """State of a boat that has been holding course and speed."""
    row = np.asarray(fresh_state(x, y, wrapped(heading_deg), speed_mps))
    kind = get_platform(platform)
    row[[L.SPEED_ERROR, L.HEADING_ERROR]] = 0.0
    if kind.kind == "usv":
        row[L.THRUST] = thrust_at(kind.pack(), speed_mps)
    return row


def _scale(platform: str) -> float:
    """How much room a platform needs, a heron being 1 and a surveyor 2."""
    return max(1.0, get_platform(platform).max_speed_mps - 1.0)
