"""Reading our own game."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

from ..fleet import Fleet
from ..jit import Array
from ..surroundings import Surroundings
from .reading import KEEP_OUT_MARGIN_M, obstacles_of


class MctfReader:
    """Reads an `MctfEnv`: exact state with the autopilots' memory, commands inside its step."""

    filters_inside = True

    def __init__(self, env: Any) -> None:
        self.env = env
        self.agent_ids: tuple[str, ...] = tuple(env.possible_agents)
        config = env.config
        kinds = config.platforms
        self._platforms = tuple(kinds) if isinstance(kinds, (tuple, list)) else (kinds,) * len(self.agent_ids)

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now; boats the game drives are controlled only with ``shield_autopilot``."""
        core = self.env.core
        controlled = core.team == team
        if not shield_autopilot:
            controlled = controlled & ~core.driven[0]
        # a copy: decisions are read after the step has moved the boats
        return Fleet(core.state[0].copy(), core.team, self._platforms, controlled, self.agent_ids)

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """Commands of actions of any kind the env understands."""
        decoded: Array = self.env.decode(actions)
        return decoded

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """The actions: the env takes all that there are."""
        return dict(actions)

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Field edge, obstacles and the own flag's circle."""
        return surroundings_of(self.env.core, team, keep_out)


def surroundings_of(core: Any, team: int, keep_out: bool = True) -> Surroundings:
    """Fixed things of a `BatchedMctf`: field edge, obstacles and, with ``keep_out``, the own flag's circle.

    It counts while the flag is away as well: the game throws out who is inside when the flag comes home, at any time.
    """
    return _surroundings(core.config, core.field.size, tuple(core.flag_home[team]), keep_out)


@lru_cache(maxsize=64)
def _surroundings_cached(
    size: tuple[float, float], circles: tuple[Any, ...], polygons: tuple[Any, ...], keep_out: tuple[Any, ...]
) -> Surroundings:
    return Surroundings((0.0, 0.0, size[0], size[1]), circles, polygons, stops=keep_out)


def _surroundings(config: Any, size: Any, flag: tuple[float, float], keep_out: bool) -> Surroundings:
    circles, polygons = obstacles_of(config.obstacles)
    radius = config.agent_radius_m
    widest = max(radius) if isinstance(radius, (tuple, list)) else radius
    circle = ((float(flag[0]), float(flag[1]), float(config.flag_keepout_m + widest + KEEP_OUT_MARGIN_M)),)
    return _surroundings_cached(
        (float(size[0]), float(size[1])), tuple(circles), tuple(polygons), circle if keep_out else ()
    )
