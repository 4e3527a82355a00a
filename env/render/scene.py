"""What a picture shows: the field, which stays the same during a game, and one moment of the game."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.record_file import NOT_COVERED
from steerclear.env.record_meta import meta_of
from steerclear.shield.exceptions import ConfigError, TraceError
from steerclear.shield.platforms.layout import HEADING, SPEED, X, Y

HULL_LENGTH_M = {"heron": 1.3, "surveyor": 1.8, "large_usv": 4.0}
"""Length a hull is drawn with, m; other platforms get ``DEFAULT_HULL_M``."""

DEFAULT_HULL_M = 1.5


@dataclass(frozen=True)
class Obstacle:
    """A fixed obstacle: a circle (``radius_m`` > 0 around the one point) or a polygon.

    Attributes:
        points_m: Centre, or the corners in order, m.
        radius_m: Radius of a circle, 0 for a polygon.
    """

    points_m: tuple[tuple[float, float], ...]
    radius_m: float = 0.0


@dataclass(frozen=True)
class Arena:
    """The settings a picture needs.

    Attributes:
        bounds_m: Width and height of the field.
        flag_home_m: Home of each team's flag.
        catch_radius_m: Tag and grab radius.
        flag_keepout_m: Radius around a flag at home that its own boats stay out of.
        separation_m: Distance at which two boat centres are in breach.
        scrimmage_m: Two points of the line between the halves.
        team: Team of each boat.
        names: Name of each boat.
        platforms: Platform of each boat.
        shielded: Names of the boats a shield covers.
        reason_names: Text of each shield reason code.
        policies: What plays blue and red, for the header.
        obstacles: Fixed obstacles.
        dt_s: Length of a step.
        title: Text for the header's middle.
        steered: Names of the boats that a human steers.
        corner_radius_m: Radius around the corners of each side where captures and untagging happen; 0 for none.
    """

    bounds_m: tuple[float, float]
    flag_home_m: tuple[tuple[float, float], tuple[float, float]]
    catch_radius_m: float
    flag_keepout_m: float
    separation_m: float
    scrimmage_m: tuple[tuple[float, float], tuple[float, float]]
    team: tuple[int, ...]
    names: tuple[str, ...]
    platforms: tuple[str, ...]
    shielded: frozenset[str] = frozenset()
    reason_names: tuple[str, ...] = ()
    policies: tuple[str, str] = ("", "")
    obstacles: tuple[Obstacle, ...] = field(default=())
    dt_s: float = 0.1
    title: str = ""
    steered: frozenset[str] = frozenset()
    corner_radius_m: float = 0.0

    @classmethod
    def from_meta(cls, meta: Mapping[str, Any]) -> Arena:
        """Read a record's ``meta``.

        Args:
            meta: See ``record_file.META_KEYS``.

        Returns:
            The arena.

        Raises:
            TraceError: A key is missing or has a value of the wrong kind.
        """
        try:
            homes = _pair(meta["flag_home"])
            return cls(
                bounds_m=_point(meta["env_bounds_m"]),
                flag_home_m=homes,
                scrimmage_m=_pair(meta["scrimmage"]) if meta.get("scrimmage") else _bisector(homes),
                catch_radius_m=float(meta["catch_radius_m"]),
                flag_keepout_m=float(meta["flag_keepout_m"]),
                separation_m=float(meta["separation_m"]),
                team=tuple(int(side) for side in meta["team"]),
                names=tuple(str(name) for name in meta["agent_ids"]),
                platforms=tuple(str(name) for name in meta["platforms"]),
                shielded=frozenset(meta["shielded"]),
                reason_names=tuple(str(name) for name in meta["reason_names"]),
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
        """Read a game's settings.

        Args:
            config: The game's settings.
            **settings: What a game does not know: see ``meta_of``.

        Returns:
            The arena.

        Raises:
            TraceError: A setting has a value of the wrong kind.
        """
        return cls.from_meta(meta_of(config, **settings))

    def hull_length_m(self, boat: int) -> float:
        """Return the length the boat's hull is drawn with."""
        return HULL_LENGTH_M.get(self.platforms[boat], DEFAULT_HULL_M)

    def reason_text(self, code: int) -> str:
        """Return the text of a reason code, or its number when there is none."""
        if code == NOT_COVERED:
            return "no shield"
        known = 0 <= code < len(self.reason_names)
        words = self.reason_names[code].replace("_", " ").lower() if known else f"reason {code}"
        return words.replace("qp", "QP")


def _point(values: Any) -> tuple[float, float]:
    x, y = values
    return float(x), float(y)


def _pair(values: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    first, second = values
    return _point(first), _point(second)


def _bisector(
    homes: tuple[tuple[float, float], tuple[float, float]],
) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return two points of the line that has the same distance to both flag homes."""
    (ax, ay), (bx, by) = homes
    x, y = (ax + bx) / 2, (ay + by) / 2
    return (x, y), (x + (by - ay), y - (bx - ax))


def _obstacles(entries: Mapping[str, Any]) -> tuple[Obstacle, ...]:
    """Read obstacles as ``GameConfig`` has them: circles (radius, centre) and polygons."""
    circles = [Obstacle((_point(centre),), float(radius)) for radius, centre in entries.get("circle", ())]
    return (*circles, *(Obstacle(tuple(_point(corner) for corner in shape)) for shape in entries.get("polygon", ())))


Colour = tuple[int, int, int]


@dataclass(frozen=True)
class Theme:
    """One set of colours, red-green-blue 0..255.

    Attributes:
        page: Around the field.
        water: Field of team 0 and of team 1.
        grid: Lines every 10 m.
        edge: Border of the field and the scrimmage line.
        ink: Text and strong marks.
        muted: Secondary text.
        team: Team 0 and team 1.
        wanted: Arrow of a command the shield did not send.
        changed: Arrow and halo of a command the shield changed.
        breach: Two boats inside the separation radius.
        obstacle: Fixed obstacles.
        plate: Behind labels.
    """

    page: Colour
    water: tuple[Colour, Colour]
    grid: Colour
    edge: Colour
    ink: Colour
    muted: Colour
    team: tuple[Colour, Colour]
    wanted: Colour
    changed: Colour
    breach: Colour
    obstacle: Colour
    plate: Colour


THEMES = {
    "light": Theme(
        page=(248, 250, 252),
        water=((226, 238, 250), (251, 233, 229)),
        grid=(255, 255, 255),
        edge=(100, 116, 139),
        ink=(15, 23, 42),
        muted=(84, 98, 118),
        team=((29, 92, 208), (206, 58, 48)),
        wanted=(71, 85, 105),
        changed=(240, 130, 0),
        breach=(190, 24, 147),
        obstacle=(120, 113, 108),
        plate=(255, 255, 255),
    ),
    "dark": Theme(
        page=(11, 18, 32),
        water=((16, 38, 66), (56, 27, 36)),
        grid=(38, 56, 84),
        edge=(120, 140, 168),
        ink=(236, 242, 250),
        muted=(148, 163, 184),
        team=((86, 156, 255), (255, 108, 96)),
        wanted=(190, 202, 220),
        changed=(255, 171, 46),
        breach=(255, 92, 214),
        obstacle=(148, 140, 132),
        plate=(20, 30, 48),
    ),
}
"""The themes by name."""


def get_theme(name: str) -> Theme:
    """Look up a theme.

    Args:
        name: One of ``THEMES``.

    Returns:
        The theme.

    Raises:
        ConfigError: There is no theme of that name.
    """
    if name not in THEMES:
        raise ConfigError(f"there is no theme {name!r}; choose {' or '.join(THEMES)}.")
    return THEMES[name]


def mix(first: Colour, second: Colour, share: float) -> Colour:
    """Blend two colours; ``share`` 0 gives the first, 1 the second."""
    red, green, blue = (round(a + (b - a) * share) for a, b in zip(first, second, strict=True))
    return red, green, blue


TRAIL_S = 12.0
"""Length of the track drawn behind each boat, s."""


@dataclass(frozen=True)
class Overlay:
    """What was asked of the boats and what the shield made of it, for n boats.

    Attributes:
        wanted: (n, 2) speed m/s and absolute heading deg asked for.
        sent: (n, 2) likewise, what the boats were told.
        reason: (n,) shield reason codes.
        intervened: (n,) bool.
        safety_margin_m: (n,) NaN where there is none.
    """

    wanted: np.ndarray
    sent: np.ndarray
    reason: np.ndarray
    intervened: np.ndarray
    safety_margin_m: np.ndarray

    @classmethod
    def of_commands(cls, wanted: np.ndarray, sent: np.ndarray) -> Overlay:
        """Show commands of which nothing but the values is known; those that differ count as changed.

        Args:
            wanted: (n, 2) speed m/s and absolute heading deg asked for.
            sent: (n, 2) likewise, what the boats were told.

        Returns:
            The overlay, without reasons and certificates.
        """
        changed = np.any(np.not_equal(wanted, sent), axis=1)
        return cls(wanted, sent, np.full(len(changed), NOT_COVERED), changed, np.full(len(changed), np.nan))


@dataclass(frozen=True)
class Scene:
    """One moment, n boats.

    Attributes:
        time_s: Time since the start.
        position_m: (n, 2).
        heading_deg: (n,) clockwise from north.
        speed_mps: (n,).
        has_flag: (n,) bool.
        is_tagged: (n,) bool.
        oob: (n,) bool, out of bounds.
        is_disabled: (n,) bool, stopped by a power play.
        flag_position_m: (2, 2).
        captures: (2,) captures made by each team.
        trail_m: (k, n, 2) positions up to now, oldest first.
        overlay: Commands, or None.
    """

    time_s: float
    position_m: np.ndarray
    heading_deg: np.ndarray
    speed_mps: np.ndarray
    has_flag: np.ndarray
    is_tagged: np.ndarray
    oob: np.ndarray
    is_disabled: np.ndarray
    flag_position_m: np.ndarray
    captures: np.ndarray
    trail_m: np.ndarray
    overlay: Overlay | None = None

    @classmethod
    def from_view(cls, view: Any, trail_m: np.ndarray, overlay: Overlay | None = None) -> Scene:
        """Take a live game.

        Args:
            view: A ``GameView``.
            trail_m: (k, n, 2) positions up to now.
            overlay: Commands of the last step.

        Returns:
            The scene.
        """
        state = np.asarray(view.state)
        return cls(
            float(view.time_s),
            state[:, [X, Y]],
            state[:, HEADING],
            state[:, SPEED],
            np.asarray(view.has_flag),
            np.asarray(view.is_tagged),
            np.asarray(view.oob),
            np.asarray(view.is_disabled),
            np.asarray(view.flag_position),
            np.asarray(view.captures),
            trail_m,
            overlay,
        )

    @classmethod
    def from_record(cls, record: Mapping[str, np.ndarray], step: int, dt_s: float) -> Scene:
        """Take a step of a record, with the command that is given at that step.

        Args:
            record: A record of T steps.
            step: 0..T; the last state shows the last command.
            dt_s: Length of a step.

        Returns:
            The scene.
        """
        first = max(0, step - round(TRAIL_S / dt_s))
        asked = min(step, len(record["wanted"]) - 1)
        commands = ("wanted", "sent", "reason", "intervened", "safety_margin_m")
        overlay = None if asked < 0 else Overlay(*(record[name][asked] for name in commands))
        trail_m = record["position"][first : step + 1]
        disabled = record["is_disabled"][step] if "is_disabled" in record else np.zeros(trail_m.shape[1], dtype=bool)
        states = ("position", "heading_deg", "speed_mps", "has_flag", "is_tagged", "oob")
        boats = (record[name][step] for name in states)
        flags = (record[name][step] for name in ("flag_position", "captures"))
        return cls(step * dt_s, *boats, disabled, *flags, trail_m, overlay)


def closest_pair(scene: Scene, arena: Arena) -> tuple[int, int, float] | None:
    """Find the closest two boats, of which a shielded one where there is any.

    Args:
        scene: The moment.
        arena: Names the shielded boats.

    Returns:
        Boat, boat, distance m; None with fewer than two boats.
    """
    n = len(scene.position_m)
    if n < 2:
        return None
    gap_m = np.linalg.norm(scene.position_m[:, None] - scene.position_m[None], axis=-1)
    gap_m[np.tril_indices(n)] = np.inf
    covered = np.array([name in arena.shielded for name in arena.names])
    if covered.any():
        gap_m[~(covered[:, None] | covered[None])] = np.inf
    first, second = np.unravel_index(int(gap_m.argmin()), gap_m.shape)
    return int(first), int(second), float(gap_m[first, second])


def boats_in_breach(scene: Scene, separation_m: float) -> list[tuple[int, int]]:
    """List the pairs of boats within the separation radius."""
    gap_m = np.linalg.norm(scene.position_m[:, None] - scene.position_m[None], axis=-1)
    first, second = np.nonzero(np.triu(gap_m <= separation_m, k=1))
    return list(zip(first.tolist(), second.tolist(), strict=True))
