"""`Water`: what does not move around the boats, as the shield is given it at every turn."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..fleet import Fleet
from ..surroundings import OPEN_WATER, Surroundings
from .fleet_file import FleetFile
from .parts import GameState

ROOM_M = 10.0
"""Room left behind a boat outside the geofence, m, at least."""


class Water:
    """The geofence, the game's obstacles, and the own flag's circle while a referee keeps the game.

    The game stops a boat in its own flag's circle, and who is stopped is caught: on the water the shield is told of it
    as in the simulator, whether the flag is home or not, for it may come home at any time. Without a referee, or once
    he is silent for longer than the file allows, nobody stops boats.

    Args:
        file: the file.
        grounds: static constraints of the game: its obstacles, and the own flag's circle as ``stops``. Its field is not
            looked at: the geofence is the edge of the water.
    """

    def __init__(self, file: FleetFile, grounds: Surroundings = OPEN_WATER) -> None:
        self._game_max_age_s = file.limits.game.max_age_s
        fixed = file.surroundings
        home = replace(
            grounds,
            field=fixed.field,
            polygons=(*fixed.polygons, *grounds.polygons),
            circles=(*fixed.circles, *grounds.circles),
        )
        self._open = replace(home, stops=())
        self._home = home if grounds.stops else self._open

    @property
    def forms(self) -> tuple[Surroundings, ...]:
        """What is around boats inside the geofence: without a referee, and with one."""
        return (self._open,) if self._home is self._open else (self._open, self._home)

    def around(self, fleet: Fleet, game: GameState | None = None, game_age_s: float = math.inf) -> Surroundings:
        """What is around a fleet now.

        The geofence is wider where a boat of ours is outside: it needs room to turn back, and a wall has none behind
        it. It grows in whole steps of `ROOM_M`, so that the shield packs few of them.

        Args:
            fleet: all boats.
            game: the state of the game; None: none yet.
            game_age_s: its age, s.
        """
        fixed = self._home if self._is_kept(game, game_age_s) else self._open
        own = fleet.position_m[fleet.controlled]
        if len(own) == 0 or fixed.field is None:
            return fixed
        xmin, ymin, xmax, ymax = fixed.field
        (left, low), (right, high) = own.min(axis=0), own.max(axis=0)
        grown = (_beyond(xmin - left), _beyond(ymin - low), _beyond(right - xmax), _beyond(high - ymax))
        if not any(grown):
            return fixed
        return replace(fixed, field=_wider(fixed.field, grown))

    def _is_kept(self, game: GameState | None, age_s: float) -> bool:
        """Whether somebody keeps the game.

        A referee silent for too long counts as none: the circle is a rule of the game, and nothing on the water stops
        a boat in it, so it must not press boats towards opponents on the word of nobody.
        """
        return game is not None and not game.over and age_s <= self._game_max_age_s


def _wider(box: Sequence[float], grown: Sequence[float]) -> tuple[float, float, float, float]:
    return box[0] - grown[0], box[1] - grown[1], box[2] + grown[2], box[3] + grown[3]


def _beyond(outside_m: float) -> float:
    """By how much an edge gives way to a boat that far outside, m."""
    return ROOM_M * (math.ceil(outside_m / ROOM_M) + 1) if outside_m > 0.0 else 0.0
