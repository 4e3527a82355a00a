"""The shield around a policy instead of an environment: what the policy answers is already safe."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from ..commands import Commands
from ..decision import Decisions
from ..exceptions import ConfigError, PolicyError
from ..fleet import Fleet
from ..shield import Shield
from .reading import GameReader, reader_of


class ShieldedTeamPolicy:
    """A team policy (``reset(env, agent_ids, seed)``, ``act(observations, infos)``) whose commands pass the shield.

    Only the policy's own commands do: boats the game drives itself are out of its reach. `ShieldedParallelEnv` on our
    env covers those too.

    Attributes:
        policy: the policy inside.
        shield: its shield.
        decisions: the last decisions, or None.
    """

    def __init__(self, policy: Any, shield: Shield, keep_out: bool = True) -> None:
        self.policy = policy
        self.shield = shield
        self.keep_out = keep_out
        self.name = f"shielded {getattr(policy, 'name', type(policy).__name__)}"
        self.decisions: Decisions | None = None
        self._reader: GameReader | None = None
        self._team = 0
        self._agent_ids: tuple[str, ...] = ()

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game.

        Raises:
            ConfigError: the env cannot be read, or the boats are of two teams.
        """
        self._reader = reader_of(env)
        self._agent_ids = tuple(agent_ids)
        team = self._reader.fleet(0, False).team
        teams = {int(team[self._reader.agent_ids.index(agent)]) for agent in agent_ids}
        if len(teams) != 1:
            raise ConfigError(f"{', '.join(agent_ids)} are of two teams; give the boats of one")
        self._team = teams.pop()
        self.shield.reset()
        self.policy.reset(env, agent_ids, seed)

    def act(self, observations: Mapping[str, Any], infos: Mapping[str, Any]) -> dict[str, Any]:
        """Actions of the boats; those the shield had to change are (speed m/s, relative heading deg) pairs.

        Raises:
            PolicyError: `reset` has not been called.
        """
        if self._reader is None:
            raise PolicyError("call reset(env, agent_ids, seed) before act()")
        actions = dict(self.policy.act(observations, infos))
        fleet = self._reader.fleet(self._team, False)
        around = self._reader.surroundings(self._team, self.keep_out)
        wanted = Commands.relative_deg(self._reader.commands(actions))
        self.decisions = self.shield.decide(fleet, wanted, around)
        for agent in self._agent_ids:
            i = self._reader.agent_ids.index(agent)
            if self.decisions.intervened[i]:
                actions[agent] = self.decisions.sent.values[i].copy()
        return actions

    def __getattr__(self, name: str) -> Any:
        if name == "policy":  # not set yet: do not look it up on itself
            raise AttributeError(name)
        return getattr(self.policy, name)


class ShieldedCallable:
    """Any function of what is seen to commands, with the fleet read from what is seen.

    Args:
        policy: ``policy(seen) -> Commands`` for all boats of the fleet.
        shield: the shield.
        read: ``read(seen) -> Fleet``.
    """

    def __init__(self, policy: Callable[[Any], Commands], shield: Shield, read: Callable[[Any], Fleet]) -> None:
        self.policy = policy
        self.shield = shield
        self.read = read
        self.decisions: Decisions | None = None

    def __call__(self, seen: Any) -> Commands:
        """Safe commands. A policy that raises or answers something else holds all boats; the reason says so."""
        fleet = self.read(seen)
        try:
            wanted = self.policy(seen)
            usable = isinstance(wanted, Commands) and len(wanted) == len(fleet)
        except Exception as error:
            _log_failure(error)
            usable = False
        if not usable:
            wanted = Commands.relative_deg(np.full((len(fleet), 2), np.nan))
        self.decisions = self.shield.decide(fleet, wanted)
        return self.decisions.sent


def _log_failure(error: Exception) -> None:
    import logging

    logging.getLogger(__name__).error("policy failed (%s: %s); all boats hold", type(error).__name__, error)


def wrap_policy(policy: Any, shield: Shield, read: Callable[[Any], Fleet] | None = None) -> Any:
    """Put a shield around a policy, see `Shield.wrap`."""
    if hasattr(policy, "act") and hasattr(policy, "reset"):
        return ShieldedTeamPolicy(policy, shield)
    if callable(policy) and read is not None:
        return ShieldedCallable(policy, shield, read)
    if callable(policy):
        raise ConfigError(
            "a plain function needs read=, which turns what it sees into a Fleet; or build a team "
            "policy with steerclear.policies.from_callable"
        )
    raise ConfigError(
        f"cannot wrap {type(policy).__name__}; build a team policy with steerclear.policies.make(name, path or "
        "'sb3:model.zip'), from_agents or from_callable first"
    )
