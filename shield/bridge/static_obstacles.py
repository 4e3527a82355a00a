"""`StaticObstacles`: what does not move around the boats, as the shield is given it at every turn."""

from __future__ import annotations

import math
from dataclasses import replace

from ..surroundings import OPEN_WATER, Surroundings
from .fleet_file import FleetFile
from .game_state import GameState


class StaticObstacles:
    """The operating area, obstacles, and the own flag's circle while a referee keeps the game.

    The game stops a boat in its own flag's circle, and who is stopped is caught: on the water the shield is told of it
    as in the simulator, whether the flag is home or not, for it may come home at any time. Without a referee, or once
    he is silent for longer than the file allows, nobody stops boats.

    Args:
        file: the file; its geofence is the operating area, whatever field the game has.
        grounds: static constraints of the game: its obstacles, and the own flag's circle as ``stops``.
    """

    def __init__(self, file: FleetFile, grounds: Surroundings = OPEN_WATER) -> None:
        self._game_max_age_s = file.limits.game.max_age_s
        fixed = file.surroundings
        self._with_referee = replace(
            grounds,
            field=fixed.field,
            polygons=(*fixed.polygons, *grounds.polygons),
            circles=(*fixed.circles, *grounds.circles),
        )
        self._without = replace(self._with_referee, stops=())

    @property
    def forms(self) -> tuple[Surroundings, ...]:
        """What may be around boats: without a referee, and with one."""
        return (self._without, self._with_referee) if self._with_referee.stops else (self._without,)

    def around(self, game: GameState | None = None, game_age_s: float = math.inf) -> Surroundings:
        """What is around boats now.

        A referee silent for too long counts as none: the circle is a rule of the game, and nothing on the water stops a
        boat in it, so it must not press boats towards opponents on the word of nobody.

        Args:
            game: the state of the game; None: none yet.
            game_age_s: its age, s.
        """
        is_kept = game is not None and not game.over and game_age_s <= self._game_max_age_s
        return self.forms[-1] if is_kept else self._without
