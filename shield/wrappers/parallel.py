"""`ShieldedParallelEnv`: the shield around a PettingZoo environment of the game."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from pettingzoo.utils.wrappers import BaseParallelWrapper

from ..commands import Commands
from ..decision import Decisions
from ..exceptions import FleetError
from ..jit import Array
from ..shield import Shield
from .reading import GameReader, one_game_shield, parallel_game, reader_of, team_number


class ShieldedParallelEnv(BaseParallelWrapper[str, Any, Any]):  # type: ignore[misc] # pettingzoo has no types
    """Shields one team's boats in every step and leaves the decisions in ``infos[agent]["shield"]``.

    In our own env the shield sits after the last decider, inside the step, so that it also covers boats the game
    drives (tagged, out of bounds). In a Pyquaticus env it changes the actions before the step; those boats are then
    out of its reach. Wrap twice to shield both teams, each with a shield of its own.

    Args:
        env: an `MctfEnv`, a ``PyQuaticusEnv``, or a PettingZoo wrapper around one.
        shield: the shield; it must not serve another game at the same time.
        team: "blue" or "red".
        shield_autopilot: also decide for boats the game drives (our env only).
        keep_out: keep clear of the own flag's circle, in which the game stops boats.
        reader: what reads the game, such as sensors that err; None: the env's own state, exact.

    Raises:
        ConfigError: the env cannot be read, the shield is none, or the team is unknown.
    """

    def __init__(
        self,
        env: Any,
        shield: Shield,
        team: str | int = "blue",
        shield_autopilot: bool = True,
        keep_out: bool = True,
        reader: GameReader | None = None,
    ) -> None:
        super().__init__(parallel_game(env))
        self.shield = one_game_shield(shield)
        self.team = team_number(team)
        self.shield_autopilot = shield_autopilot
        self.keep_out = keep_out
        self.decisions: Decisions | None = None
        self._reader: GameReader = reader_of(env) if reader is None else reader
        if self._reader.filters_inside:
            base = env.unwrapped
            base.command_filter = self._after(base.command_filter)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start a game with a shield that remembers nothing."""
        self.shield.reset()
        self.decisions = None
        return self.env.reset(seed=seed, options=options)

    def step(self, actions: dict[str, Any]) -> Any:
        """One step; actions of the shielded team that are not safe are changed."""
        if not self._reader.filters_inside:
            actions = self._filtered(actions)
        outcome = self.env.step(actions)
        self._tell(outcome[-1])
        return outcome

    def __getattr__(self, name: str) -> Any:
        """What the game has, with an underscore too: Pyquaticus' own policies are built with the env and read such.

        Special names and those of this wrapper's own are never looked up there: copying and pickling ask for them
        before they are set.
        """
        if name.startswith("__") or name in _OWN:
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return getattr(self.env if not name.startswith("_") else self.env.unwrapped, name)

    def _decide(self, commands: Array) -> Decisions:
        fleet = self._reader.fleet(self.team, self.shield_autopilot)
        around = self._reader.surroundings(self.team, self.keep_out)
        self.decisions = self.shield.decide(fleet, Commands.game_deg(commands), around)
        return self.decisions

    def _after(self, earlier: Callable[[Any, Array], Array] | None) -> Callable[[Any, Array], Array]:
        """A command filter that shields what an earlier filter lets through."""

        def command_filter(core: Any, commands: Array) -> Array:
            if len(commands) != 1:
                raise FleetError("this wrapper shields one game; use BatchedShield for a batch")
            passed = commands if earlier is None else earlier(core, commands)
            return self._decide(passed[0]).sent.values[np.newaxis]

        return command_filter

    def _filtered(self, actions: dict[str, Any]) -> dict[str, Any]:
        """Actions with those of boats the shield had to correct replaced by (speed, relative heading) pairs."""
        decisions = self._decide(self._reader.commands(actions))
        changed = self._reader.playable(actions)
        for i in np.flatnonzero(decisions.intervened):
            changed[self._reader.agent_ids[i]] = decisions.sent.values[i].copy()
        return changed

    def _tell(self, infos: dict[str, dict[str, Any]]) -> None:
        """Leave each covered boat's decision in its info."""
        if self.decisions is None:
            return
        team = self.decisions.fleet.team
        for i, agent in enumerate(self._reader.agent_ids):
            if team[i] == self.team and agent in infos:
                infos[agent]["shield"] = self.decisions[i]


_OWN = ("env", "shield", "team", "shield_autopilot", "keep_out", "decisions", "_reader")
"""Attributes of the wrapper itself."""
