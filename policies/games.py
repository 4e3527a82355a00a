"""What a team of somebody's own code relies on of its game: ours, a real Pyquaticus one, or any that a reader reads."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from steerclear.shield.exceptions import ConfigError, PolicyError
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.wrappers.readers import reader_of


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
        commands: (n, 2) speed m/s and relative heading deg of actions by boat, as the game plays them.
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
        if not agent_ids or len(set(agent_ids)) != len(agent_ids) or not set(agent_ids) <= set(self.agent_ids):
            raise PolicyError(f"agent_ids are {list(agent_ids)}; give different ones of {', '.join(self.agent_ids)}")
        if len({int(self.team[self.agent_ids.index(name)]) for name in agent_ids}) != 1:
            raise PolicyError(f"agent_ids {list(agent_ids)} are of both teams; one policy plays one team")


def seen_game(env: Any) -> SeenGame:
    """The game that an environment, or a wrapper round one, plays.

    Raises:
        PolicyError: nobody reads it.
    """
    try:
        reader = reader_of(env)
        facts, fleet = reader.facts(), reader.fleet(0, False)
    except ConfigError as error:
        raise PolicyError(f"{error} (a policy of your own plays in any game that a GameReader reads)") from None
    kinds = tuple(fleet.platforms)
    decision_s = facts.moves * facts.dt_s
    radius_m = tuple(map(float, facts.radius_m))
    shape = tuple(getattr(_space(env, reader.agent_ids[0]), "shape", None) or ())
    n_obs = int(shape[0]) if len(shape) == 1 else 0
    return SeenGame(reader.agent_ids, facts.team, kinds, radius_m, decision_s, n_obs, reader.commands)


def _space(env: Any, agent_id: str) -> Any:
    space = getattr(env, "observation_space", None)
    return space(agent_id) if callable(space) else (getattr(env, "observation_spaces", None) or {}).get(agent_id)
