"""What does not move around the boats: shores and keep-out areas of a FLEET.yaml, and what the shield is given."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

from ..exceptions import FleetFileError
from ..surroundings import OPEN_WATER, Surroundings
from .feed_packets import GameState
from .fleet_settings import Obstacle
from .frame import FieldFrame

if TYPE_CHECKING:
    from .fleet_file import FleetFile

FORMS = ("polygon_m", "polygon_deg", "circle_m")
MOST_EDGES = 400  # of all obstacles together: the shield looks at each at every turn
FARTHEST_M = 20_000.0  # an obstacle farther from the geofence is in another water, or its numbers are in another order
Line = tuple[tuple[float, float], ...]


def check_obstacles(fleet: FleetFile) -> None:
    """See that the obstacles of a file bound its water.

    Raises:
        FleetFileError: one has not one form or lies far from the geofence, or they have too many edges; with its place
            in the file and the remedy.
    """
    edges = 0
    for number, obstacle in enumerate(fleet.obstacles):
        given = [form for form in FORMS if getattr(obstacle, form) is not None]
        if len(given) != 1:
            has = " and ".join(given) or "no form"
            raise FleetFileError(f"obstacles.{number} has {has}; give one of {', '.join(FORMS)}")
        corners = corners_m(obstacle, fleet.frame)
        edges += len(corners)
        far_m = max((fleet.geofence.outside_m(*corner) for corner in corners), default=0.0)
        if not far_m <= FARTHEST_M:
            raise FleetFileError(
                f"obstacles.{number}: a corner lies {far_m / 1e3:.0f} km from the geofence; give polygon_deg as "
                "[latitude, longitude], polygon_m in m"
            )
    if edges > MOST_EDGES:
        raise FleetFileError(f"obstacles have {edges} edges, more than {MOST_EDGES}; simplify them")


def corners_m(obstacle: Obstacle, frame: FieldFrame) -> Line:
    """Corners of a polygon, m in the field's frame; none of a circle."""
    if obstacle.polygon_deg is not None:
        return tuple(frame.to_field_m(*place) for place in obstacle.polygon_deg)
    return obstacle.polygon_m or ()


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
        """What is around boats now, by the state of the game (None: none yet) and its age, s.

        A referee silent for too long counts as none: the circle is a rule of the game, and nothing on the water stops a
        boat in it, so it must not press boats towards opponents on the word of nobody.
        """
        is_kept = game is not None and not game.over and game_age_s <= self._game_max_age_s
        return self.forms[-1] if is_kept else self._without
