"""What a picture shows: the field, which does not change during a game, and one moment of the game."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.record import meta_of
from steerclear.env.record_file import NOT_COVERED
from steerclear.shield.exceptions import TraceError
from steerclear.shield.platforms.layout import HEADING, SPEED, X, Y

HULL_LENGTH_M = {"heron": 1.3, "surveyor": 1.8, "large_usv": 4.0}
"""Length of a drawn hull, m; other platforms get ``DEFAULT_HULL_M``."""

DEFAULT_HULL_M = 1.5

TRAIL_S = 12.0
"""Length of the track drawn behind each boat, s."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class Obstacle:
    """A fixed obstacle: a circle (``radius_m`` > 0 around the one point) or the corners of a polygon, m."""

    points_m: tuple[Pair, ...]
    radius_m: float = 0.0


@dataclass(frozen=True)
class Arena:
    """The settings a picture needs; distances in m."""

    bounds_m: Pair  # Width and height of the field
    flag_home_m: tuple[Pair, Pair]  # Home of each team's flag
    catch_radius_m: float  # Tag and grab radius
    flag_keepout_m: float  # Radius around a flag at home that its own boats must not enter
    separation_m: float  # Distance at which two boat centres violate the separation
    scrimmage_m: tuple[Pair, Pair]  # Two points of the line between the halves
    team: tuple[int, ...]  # Team of each boat; ``names`` and ``platforms`` likewise
    names: tuple[str, ...]
    platforms: tuple[str, ...]
    shielded: frozenset[str] = frozenset()  # Names of the boats a shield covers
    reason_names: tuple[str, ...] = ()  # Text of each shield reason code
    policies: tuple[str, str] = ("", "")  # What plays blue and red, for the header
    obstacles: tuple[Obstacle, ...] = ()  # Fixed obstacles
    dt_s: float = 0.1  # Length of a step
    title: str = ""  # Text for the header's middle
    steered: frozenset[str] = frozenset()  # Names of the boats that a human steers
    # Radius around the corners of each side where captures and untagging happen; 0 for none
    corner_radius_m: float = 0.0

    @classmethod
    def from_meta(cls, meta: Mapping[str, Any]) -> Arena:
        """Read a record's ``meta``, see ``record_file.META_KEYS``.

        Raises:
            TraceError: A key is missing or has a value of the wrong kind.
        """
        try:
            home, away = map(_point, meta["flag_home"])
            start, end = map(_point, meta.get("scrimmage") or _bisector(home, away))
            return cls(
                bounds_m=_point(meta["env_bounds_m"]),
                flag_home_m=(home, away),
                scrimmage_m=(start, end),
                catch_radius_m=float(meta["catch_radius_m"]),
                flag_keepout_m=float(meta["flag_keepout_m"]),
                separation_m=float(meta["separation_m"]),
                team=tuple(map(int, meta["team"])),
                names=tuple(map(str, meta["agent_ids"])),
                platforms=tuple(map(str, meta["platforms"])),
                shielded=frozenset(meta["shielded"]),
                reason_names=tuple(map(str, meta["reason_names"])),
                policies=(str(meta["policies"].get("blue", "")), str(meta["policies"].get("red", ""))),
                obstacles=_obstacles(meta.get("obstacles") or {}),
                dt_s=float(meta["dt_s"]),
                title=str(meta.get("title", "")),
                corner_radius_m=float(meta.get("corner_radius_m", 0.0)),
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise TraceError(
                f"the game's settings cannot be drawn ({error!r}). Use the meta that GameRecorder took."
            ) from error

    @classmethod
    def from_config(cls, config: GameConfig, **settings: Any) -> Arena:
        """Read a game's settings, and further ones that a game does not know: see ``meta_of``.

        Raises:
            TraceError: A setting has a value of the wrong kind.
        """
        return cls.from_meta(meta_of(config, **settings))

    def hull_length_m(self, boat: int) -> float:
        """Return the length of the boat's drawn hull."""
        return HULL_LENGTH_M.get(self.platforms[boat], DEFAULT_HULL_M)

    def reason_text(self, code: int) -> str:
        """Return the text of a reason code, or its number if there is none."""
        if code == NOT_COVERED:
            return "no shield"
        if not 0 <= code < len(self.reason_names):
            return f"reason {code}"
        return self.reason_names[code].replace("_", " ").lower().replace("qp", "QP")


def _point(values: Any) -> Pair:
    x, y = values
    return float(x), float(y)


def _bisector(home: Pair, away: Pair) -> tuple[Pair, Pair]:
    """Return two points of the line that has the same distance to both flag homes."""
    x, y = (home[0] + away[0]) / 2, (home[1] + away[1]) / 2
    return (x, y), (x + (away[1] - home[1]), y - (away[0] - home[0]))


def _obstacles(entries: Mapping[str, Any]) -> tuple[Obstacle, ...]:
    circles = [Obstacle((_point(centre),), float(radius)) for radius, centre in entries.get("circle", ())]
    return (*circles, *(Obstacle(tuple(map(_point, shape))) for shape in entries.get("polygon", ())))


@dataclass(frozen=True)
class Overlay:
    """Nominal commands of n boats and the shield's decisions on them."""

    nominal: np.ndarray  # (n, 2) nominal speed m/s and absolute heading deg
    filtered: np.ndarray  # (n, 2) likewise, the commands that the boats received
    reason: np.ndarray  # (n,) shield reason codes
    intervened: np.ndarray  # (n,) bool
    safety_margin_m: np.ndarray  # (n,) NaN where there is none

    @classmethod
    def of_commands(cls, nominal: np.ndarray, filtered: np.ndarray) -> Overlay:
        """Build an overlay from commands (n, 2) alone; those that differ count as changed."""
        changed = np.any(np.not_equal(nominal, filtered), axis=1)
        return cls(nominal, filtered, np.full(len(changed), NOT_COVERED), changed, np.full(len(changed), np.nan))


_OF_BOATS = ("has_flag", "is_tagged", "oob")


@dataclass(frozen=True)
class Scene:
    """One moment, n boats."""

    time_s: float  # Time since the start
    position_m: np.ndarray  # (n, 2)
    heading_deg: np.ndarray  # (n,) clockwise from north
    speed_mps: np.ndarray  # (n,)
    # (n,) bool; ``is_tagged``, ``oob`` (out of bounds), ``is_disabled`` (by a power play) likewise
    has_flag: np.ndarray
    is_tagged: np.ndarray
    oob: np.ndarray
    is_disabled: np.ndarray
    flag_position_m: np.ndarray  # (2, 2)
    captures: np.ndarray  # (2,) captures made by each team
    trail_m: np.ndarray  # (k, n, 2) positions up to now, oldest first
    overlay: Overlay | None = None  # Commands, or None

    @classmethod
    def from_view(cls, view: Any, trail_m: np.ndarray, overlay: Overlay | None = None) -> Scene:
        """Build a scene from a ``GameView``, positions (k, n, 2) up to now, and the commands of the last step."""
        state = np.asarray(view.state)
        marks = (np.asarray(getattr(view, name)) for name in (*_OF_BOATS, "is_disabled", "flag_position", "captures"))
        return cls(float(view.time_s), state[:, [X, Y]], state[:, HEADING], state[:, SPEED], *marks, trail_m, overlay)

    @classmethod
    def from_record(cls, record: Mapping[str, np.ndarray], step: int, dt_s: float) -> Scene:
        """Build a scene from step 0..T of a record, with the command given there.

        The last state shows the last command.
        """
        commanded = min(step, len(record["nominal"]) - 1)
        commands = ("nominal", "filtered", "reason", "intervened", "safety_margin_m")
        overlay = None if commanded < 0 else Overlay(*(record[name][commanded] for name in commands))
        trail_m = record["position"][max(0, step - round(TRAIL_S / dt_s)) : step + 1]
        boats = (record[name][step] for name in ("position", "heading_deg", "speed_mps", *_OF_BOATS))
        disabled = record["is_disabled"][step] if "is_disabled" in record else np.zeros(trail_m.shape[1], dtype=bool)
        flags = (record[name][step] for name in ("flag_position", "captures"))
        return cls(step * dt_s, *boats, disabled, *flags, trail_m, overlay)


def _gaps_m(scene: Scene) -> np.ndarray:
    """Return distances (n, n) above the diagonal, infinite elsewhere."""
    gap_m = np.linalg.norm(scene.position_m[:, None] - scene.position_m[None], axis=-1)
    gap_m[np.tril_indices(len(gap_m))] = np.inf
    return np.asarray(gap_m)


def closest_pair(scene: Scene, arena: Arena) -> tuple[int, int, float] | None:
    """Return the closest two boats and their distance, m; None without a pair.

    If any boat is shielded, at least one of the two is.
    """
    if len(scene.position_m) < 2:
        return None
    gap_m, covered = _gaps_m(scene), np.array([name in arena.shielded for name in arena.names])
    if covered.any():
        gap_m[~(covered[:, None] | covered[None])] = np.inf
    first, second = np.unravel_index(int(gap_m.argmin()), gap_m.shape)
    return int(first), int(second), float(gap_m[first, second])


def boats_in_violation(scene: Scene, separation_m: float) -> list[tuple[int, int]]:
    """List the pairs of boats within the separation radius."""
    first, second = np.nonzero(_gaps_m(scene) <= separation_m)
    return list(zip(first.tolist(), second.tolist(), strict=True))
