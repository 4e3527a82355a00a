"""`ShieldedParallelEnv`: the shield around a PettingZoo environment of the game."""

from __future__ import annotations

from typing import Any

import numpy as np
from pettingzoo.utils.wrappers import BaseParallelWrapper

from ..commands import Commands
from ..decision import Decisions
from ..exceptions import ConfigError
from ..jit import Array
from ..platforms import get_platform
from ..shield import Shield
from .actions import DISCRETE
from .checks import SIDES, ShieldedGame, layers_of, one_game_shield, team_number, words_of
from .readers import GameReader, reader_of

_OWN = ("env", "masks", "decisions", "_game")
"""Attributes of the wrapper itself."""


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
        _check_parallel(env)
        super().__init__(env)
        number, found = team_number(team), reader_of(env) if reader is None else reader
        _check_not_shielded(env, number, one_game_shield(shield))
        self._game = ShieldedGame(shield, found, number, shield_autopilot, keep_out)
        self.masks = masks
        self.decisions: Decisions | None = None

    @property
    def shield(self) -> Any:
        """The shield at work."""
        return self._game.shield

    @property
    def team(self) -> int:
        """The team it decides for, 0 or 1."""
        return self._game.team

    @property
    def reader(self) -> GameReader:
        """What reads the game."""
        return self._game.reader

    def __repr__(self) -> str:
        return f"<ShieldedParallelEnv of {SIDES[self.team]} in {self.env!r}: {words_of(self.shield)}>"

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start a game with a shield that remembers nothing.

        Raises:
            ConfigError: the env was set since to what the shield is not for.
        """
        self._game.begin()
        self.decisions = None
        observations, infos = self.env.reset(seed=seed, options=options)
        self._mask(infos)
        return observations, infos

    def step(self, actions: dict[str, Any]) -> Any:
        """One step; commands of the shielded team that are not safe are changed before the boats move.

        Raises:
            ConfigError: the env was set since its reset to what the shield is not for, or it has begun to serve others.
        """
        self._game.check()
        with self.reader.filtering(self._safe):
            outcome = self.env.step(actions)
        infos = outcome[-1]
        if self.decisions is not None:
            for i, agent in self._covered(self.decisions.fleet.team, infos):
                infos[agent]["shield"] = self.decisions[i]
        self._mask(infos)
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
        self.decisions = self._game.decide(commands)
        return self.decisions.filtered.values

    def _covered(self, team: Any, infos: Any) -> list[tuple[int, str]]:
        """Numbers and ids of the shielded team's boats that have infos."""
        agents = enumerate(self.reader.agent_ids)
        return [(i, agent) for i, agent in agents if team[i] == self.team and agent in infos]

    def _mask(self, infos: dict[str, dict[str, Any]]) -> None:
        """Leave in each covered boat's info which of the discrete actions would pass."""
        if not self.masks:
            return
        fleet, around = self._game.seen()
        top_mps = np.array([[get_platform(kind).max_speed_mps] for kind in fleet.platforms])
        pairs = DISCRETE[:, None] * np.concatenate([top_mps, np.ones_like(top_mps)], axis=1)
        passes = self.shield.safe_actions(fleet, [Commands.game_deg(pair) for pair in pairs], around)
        passes[~passes.any(axis=1)] = True
        for i, agent in self._covered(fleet.team, infos):
            infos[agent]["action_mask"] = passes[i].astype(np.int8)


def _check_parallel(env: Any) -> None:
    """Refuse an environment whose boats act in turn (AEC), and a class."""
    if isinstance(env, type):
        raise ConfigError(f"{env.__name__} is a class; give an environment: {env.__name__}(...)")
    if callable(getattr(type(env), "last", None)) and callable(getattr(type(env), "agent_iter", None)):
        raise ConfigError(
            f"{type(env).__name__} is an AEC env, in which boats act in turn, and the shield decides for all at once; "
            "wrap the parallel env: parallel_to_aec(ShieldedParallelEnv(mctf_v0.parallel_env(...), Shield()))"
        )


def _check_not_shielded(env: Any, team: int, shield: Any) -> None:
    """Refuse a second wrapper of a team, which would mend the first one's commands, and one shield for both teams."""
    others = [layer for layer in layers_of(env) if isinstance(layer, ShieldedParallelEnv)]
    if any(layer.shield is shield for layer in others):
        raise ConfigError("this shield serves the other team of this environment; give each team a Shield of its own")
    if any(layer.team == team for layer in others):
        raise ConfigError(
            f"the {SIDES[team]} team of this environment has a shield already; wrap env.unwrapped, or shield the other "
            "team"
        )
