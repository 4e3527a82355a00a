"""What foreign code may rely on in its game, whoever plays the game, and checks of its answers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.arrays import NoNumbersError, numbers
from steerclear.shield.exceptions import ConfigError, GameError, PolicyError
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.wrappers.actions import check_boats, short
from steerclear.shield.wrappers.readers import reader_of

HOLD = (0.0, 0.0)
"""Action of a boat without a usable answer: speed 0, heading unchanged."""
MAX_SPEED_FACTOR = 10.0
"""A speed beyond this multiple of the boat's top speed counts as an error and is not clipped."""
MAX_HEADING_DEG = 360.0
"""A larger relative heading counts as an error."""
Fault = tuple[str, str]
"""A fault of an answer: kind, explanation."""


@dataclass(frozen=True)
class SeenGame:
    """One game, whoever plays it.

    Attributes:
        agent_ids: names of all boats.
        team: (n,) team of each.
        platforms: each boat's platform, or its name.
        agent_radius_m: (n,) radius of each, m.
        decision_s: time from decision to decision, s.
        n_obs: length of an observation; 0: they are no arrays.
        commands: returns (n, 2) speed m/s and relative heading deg for actions by boat, as the game plays them.
    """

    agent_ids: tuple[str, ...]
    team: IntArray
    platforms: tuple[str | Platform, ...]
    agent_radius_m: tuple[float, ...]
    decision_s: float
    n_obs: int
    commands: Callable[[Mapping[str, Any]], Array]

    @property
    def top_speed_mps(self) -> dict[str, float]:
        """Top speed of each boat, m/s."""
        kinds = map(get_platform, self.platforms)
        return {name: float(kind.max_speed_mps) for name, kind in zip(self.agent_ids, kinds, strict=True)}

    def check_team(self, agent_ids: Sequence[str]) -> None:
        """Check that these are boats of one team.

        Raises:
            PolicyError: none, unknown or repeated boats, or boats of both teams.
        """
        check_boats(agent_ids, self.agent_ids)
        if len({int(self.team[self.agent_ids.index(name)]) for name in agent_ids}) != 1:
            raise PolicyError(f"agent_ids {list(agent_ids)} are of both teams; one policy plays one team")


def seen_game(env: Any) -> SeenGame:
    """Return the game that an environment, or a wrapper around one, plays.

    Raises:
        PolicyError: no `GameReader` reads it.
    """
    try:
        reader = reader_of(env)
        facts, fleet = reader.facts(), reader.fleet(0, False)
    except ConfigError as error:
        raise PolicyError(f"{error} (a policy of your own plays in any game that a GameReader reads)") from None
    first, space = reader.agent_ids[0], getattr(env, "observation_space", None)
    space = space(first) if callable(space) else (getattr(env, "observation_spaces", None) or {}).get(first)
    shape = tuple(getattr(space, "shape", None) or ())
    return SeenGame(
        reader.agent_ids,
        facts.team,
        tuple(fleet.platforms),
        tuple(map(float, facts.radius_m)),
        facts.moves * facts.dt_s,
        int(shape[0]) if len(shape) == 1 else 0,
        reader.commands,
    )


class ActionReader:
    """Reads actions for the boats of one game.

    Args:
        env: an `MctfEnv`, a Pyquaticus env, a wrapper around one, or a `SeenGame`.

    Raises:
        PolicyError: ``env`` is none of these.
    """

    def __init__(self, env: Any) -> None:
        self._game = env if isinstance(env, SeenGame) else seen_game(env)
        self._top_mps = self._game.top_speed_mps

    def command(self, agent_id: str, action: Any) -> tuple[float, float]:
        """Return speed m/s and relative heading deg of an action, for the boat's present place.

        Args:
            agent_id: the acting boat.
            action: a whole number, a pair (speed m/s, relative heading deg) or the name of a field point.

        Raises:
            PolicyError: the action is none of these, not finite, or absurdly large.
        """
        found = self.problem(agent_id, action)
        if found is not None:
            raise PolicyError(f"{found[0]}: {found[1]}")
        row = self._decode(agent_id, action)
        return float(row[0]), float(row[1])

    def problem(self, agent_id: str, action: Any) -> Fault | None:
        """Return the fault of an action; None if it is usable."""
        if action is None:
            return "no answer", "the policy returned None; return an action"
        try:
            if not isinstance(action, (str, bytes)) and not np.isfinite(numbers(action)).all():
                return "not finite", f"{short(action)} is not finite"
        except NoNumbersError:  # no or too large numbers: the game's decoder refuses those
            pass
        try:
            row = self._decode(agent_id, action)
        except GameError as error:
            return "no action", str(error)[:300]
        limit_mps = MAX_SPEED_FACTOR * self._top_mps[agent_id]
        if abs(row[0]) > limit_mps:
            return "too large", f"speed {row[0]:g} m/s is beyond {limit_mps:g} m/s"
        if abs(row[1]) > MAX_HEADING_DEG:
            return "too large", f"relative heading {row[1]:g} deg is beyond {MAX_HEADING_DEG:g} deg"
        return None

    def _decode(self, agent_id: str, action: Any) -> np.ndarray:
        return self._game.commands({agent_id: action})[self._game.agent_ids.index(agent_id)]


def to_command(env: Any, agent_id: str, action: Any) -> tuple[float, float]:
    """Return one action as (speed m/s, relative heading deg). For many, `ActionReader.command` is faster.

    Raises:
        PolicyError: no reader for ``env``, an unknown agent, or an unusable action.
    """
    game = seen_game(env)
    if agent_id not in game.agent_ids:
        raise PolicyError(f"unknown agent {agent_id!r}; agents are {', '.join(game.agent_ids)}")
    return ActionReader(game).command(agent_id, action)
