"""`ShieldedParallelEnv`: the shield around a PettingZoo environment of the game."""

from __future__ import annotations

from typing import Any

import numpy as np
from pettingzoo.utils.wrappers import BaseParallelWrapper

from ..commands import Commands
from ..decision import Decisions
from ..jit import Array
from ..platforms import get_platform
from ..shield import Shield
from .actions import DISCRETE
from .checks import begin_serving, check_serving, check_unchanged, facts_now, refuse_second, shield_for, words_of
from .game_facts import GameFacts
from .readers import reader_of
from .reading import GameReader, one_game_shield, parallel_game, team_number


class ShieldedParallelEnv(BaseParallelWrapper[str, Any, Any]):  # type: ignore[misc] # pettingzoo has no types
    """Shields one team's boats in every step and leaves the decisions in ``infos[agent]["shield"]``.

    In our own env the shield sits after the last decider, inside the step, so that it also covers boats the game
    drives (tagged, out of bounds). In a Pyquaticus env it sits where that has read the actions and not yet moved the
    boats; boats the env drives itself are out of its reach. Wrap twice to shield both teams, each with a shield of its
    own; other PettingZoo wrappers may stand in between.

    It changes nothing outside: what is wrapped, stepped itself, plays as if there were no wrapper, and copies and
    pickles of the wrapper are games of their own, with a shield of their own.

    Args:
        env: an `MctfEnv`, a ``PyQuaticusEnv``, or a PettingZoo wrapper around one.
        shield: the shield; it must not serve another game at the same time. ``Shield.for_game(env)`` fits.
        team: "blue" or "red".
        shield_autopilot: also decide for boats the game drives (our env only).
        keep_out: keep clear of the own flag's circle, in which the game stops boats.
        reader: what reads the game, such as sensors that err; None: the env's own state, exact.
        masks: also leave ``infos[agent]["action_mask"]``: (17,) int8, 1 for each discrete action that the shield would
            let pass in the next step, beside teammates that go straight on; all 1 where none does.

    Attributes:
        shield: the shield at work: the one given, or, if the game's boats collide farther apart than it keeps them and
            nobody chose how far that is, one like it with the game's distance.
        decisions: the last decisions, or None.

    Raises:
        ConfigError: the env cannot be read or has settings that no shield can be built for, the shield is none or one
            for another step or serves the other team, the team is unknown, or has a shield in this env already.
    """

    def __init__(
        self,
        env: Any,
        shield: Shield,
        team: str | int = "blue",
        shield_autopilot: bool = True,
        keep_out: bool = True,
        reader: GameReader | None = None,
        masks: bool = False,
    ) -> None:
        super().__init__(parallel_game(env))
        self.team = team_number(team)
        self._reader: GameReader = reader_of(env) if reader is None else reader
        refuse_second(env, ShieldedParallelEnv, self.team, one_game_shield(shield))
        self.shield = shield_for(shield, self._reader, self.team)
        self._facts: GameFacts = facts_now(self._reader)
        self.shield_autopilot = shield_autopilot
        self.keep_out = keep_out
        self.masks = masks
        self.decisions: Decisions | None = None
        self._holder: object = None

    def __repr__(self) -> str:
        return f"<ShieldedParallelEnv of {('blue', 'red')[self.team]} in {self.env!r}: {words_of(self.shield)}>"

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start a game with a shield that remembers nothing.

        Raises:
            ConfigError: the env was set since to what the shield is not for.
        """
        self.shield = shield_for(self.shield, self._reader, self.team)
        self._facts = facts_now(self._reader)
        self._holder = begin_serving(self.shield)
        self.decisions = None
        observations, infos = self.env.reset(seed=seed, options=options)
        self._mask(infos)
        return observations, infos

    def step(self, actions: dict[str, Any]) -> Any:
        """One step; commands of the shielded team that are not safe are changed before the boats move.

        Raises:
            ConfigError: the env was set since its reset to what the shield is not for, or it has begun to serve others.
        """
        check_unchanged(self._facts, self._reader)
        check_serving(self.shield, self._holder)
        with self._reader.filtering(self._safe):
            outcome = self.env.step(actions)
        self._tell(outcome[-1])
        self._mask(outcome[-1])
        return outcome

    def __getattr__(self, name: str) -> Any:
        """What the game has, with an underscore too: Pyquaticus' own policies are built with the env and read such.

        Special names and those of this wrapper's own are never looked up there: copying and pickling ask for them
        before they are set.
        """
        if name.startswith("__") or name in _OWN:
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return getattr(self.env if not name.startswith("_") else self.env.unwrapped, name)

    def _safe(self, commands: Array) -> Array:
        """The commands (n, 2) to obey, for those wanted."""
        fleet = self._reader.fleet(self.team, self.shield_autopilot)
        around = self._reader.surroundings(self.team, self.keep_out)
        self.decisions = self.shield.decide(fleet, Commands.game_deg(commands), around)
        return self.decisions.filtered.values

    def _tell(self, infos: dict[str, dict[str, Any]]) -> None:
        """Leave each covered boat's decision in its info."""
        if self.decisions is None:
            return
        team = self.decisions.fleet.team
        for i, agent in enumerate(self._reader.agent_ids):
            if team[i] == self.team and agent in infos:
                infos[agent]["shield"] = self.decisions[i]

    def _mask(self, infos: dict[str, dict[str, Any]]) -> None:
        """Leave in each covered boat's info which of the discrete actions would pass."""
        if not self.masks:
            return
        fleet = self._reader.fleet(self.team, self.shield_autopilot)
        top_mps = np.array([[get_platform(kind).max_speed_mps] for kind in fleet.platforms])
        pairs = DISCRETE[:, None] * np.concatenate([top_mps, np.ones_like(top_mps)], axis=1)
        around = self._reader.surroundings(self.team, self.keep_out)
        passes = self.shield.safe_actions(fleet, [Commands.game_deg(pair) for pair in pairs], around)
        passes[~passes.any(axis=1)] = True
        for i, agent in enumerate(self._reader.agent_ids):
            if fleet.team[i] == self.team and agent in infos:
                infos[agent]["action_mask"] = passes[i].astype(np.int8)


_OWN = ("env", "shield", "team", "shield_autopilot", "keep_out", "masks", "decisions", "_reader", "_facts", "_holder")
"""Attributes of the wrapper itself."""
