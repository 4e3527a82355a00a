"""What stays the same during a game and is drawn once: field, radii, obstacles, names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.env.record_file import NOT_COVERED
from steerclear.env.record_meta import meta_of
from steerclear.shield.exceptions import TraceError

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
