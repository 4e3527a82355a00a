"""`ShieldedParallelEnv`: the shield around a PettingZoo environment of the game."""

from __future__ import annotations

import logging
from collections.abc import Mapping
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
from .checks import SIDES, ShieldedGame, check_boats, facts_of, layers_of, one_game_shield, team_number, words_of
from .readers import GameReader, check_members, reader_of

logger = logging.getLogger(__name__)
_OWN = ("env", "masks", "decisions", "_game", "_own", "_said", "_forgotten", "_decided")
"""Attributes of the wrapper itself."""


class ShieldedParallelEnv(BaseParallelWrapper[str, Any, Any]):  # type: ignore[misc] # pettingzoo has no types
    """Shields one team's boats in every step and stores the decisions in ``infos[agent]["shield"]``.

    In our own env the shield acts inside the step, after every other decider. It therefore also covers game-controlled
    boats (tagged, out of bounds). In a Pyquaticus env the shield acts after the env has read the actions and before it
    moves the boats. It cannot reach boats that this env controls itself. To shield both teams, wrap twice with two
    shields; other PettingZoo wrappers may stand in between.

    The wrapped env is not changed: stepped itself, it plays as if there were no wrapper. Copies and pickles of the
    wrapper hold a copy of the game and of the shield.

    Args:
        env: an `MctfEnv`, a ``PyQuaticusEnv``, or a PettingZoo wrapper around one.
        shield: the shield; it must not serve another game at the same time. ``Shield.for_game(env)`` fits.
        team: "blue" or "red".
        shield_autopilot: also decide for game-controlled boats (our env only).
        keep_out: keep clear of the own flag's circle, in which the game stops boats.
        reader: reads the game, for example through sensors with errors; None: the env's own exact state.
        masks: also store ``infos[agent]["action_mask"]``: (17,) int8, 1 for each discrete action that the shield would
            pass in the next step, assuming that teammates go straight on; all 1 if none would pass.

    Attributes:
        shield: the shield at work: the given one, or a copy with the game's distances where those are larger and the
            user chose none.
        decisions: the last decisions, or None.

    Raises:
        ConfigError: the env cannot be read or has settings that no shield can be built for; the shield is none, is for
            another step or serves the other team; the team is unknown or has a shield in this env already.
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
        check_members(found)
        _check_not_shielded(env, number, one_game_shield(shield))
        self._game = ShieldedGame(shield, found, number, shield_autopilot, keep_out)
        self.masks = masks
        self._own = {agent for agent, of in zip(found.agent_ids, facts_of(found).team, strict=True) if of == number}
        _check_in_game(env, number, self._own, found)
        self._said: set[str] = set()
        self._forgotten = np.zeros(len(found.agent_ids), np.bool_)
        self._decided = False
        self.decisions: Decisions | None = None

    @property
    def shield(self) -> Any:
        """The shield at work."""
        return self._game.shield

    @property
    def team(self) -> int:
        """Number of the shielded team, 0 or 1."""
        return self._game.team

    @property
    def reader(self) -> GameReader:
        """Reader of the game."""
        return self._game.reader

    def __repr__(self) -> str:
        return f"<ShieldedParallelEnv of {SIDES[self.team]} in {self.env!r}: {words_of(self.shield)}>"

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Start a game with a reset shield.

        Raises:
            ConfigError: the env's settings have changed and the shield does not fit them.
        """
        self._game.begin()
        self.decisions = None
        self._said.clear()
        observations, infos = self.env.reset(seed=seed, options=options)
        self._mask(infos)
        return observations, infos

    def step(self, actions: dict[str, Any]) -> Any:
        """Play one step. The shield changes unsafe commands of its team before the boats move.

        Raises:
            ConfigError: the env's settings have changed since its reset, the shield has begun to serve someone else, or
                the reader moved the boats without asking it.
        """
        self._game.check()
        self._note_forgotten(actions)
        over, self._decided = not getattr(self.env, "agents", True), False
        with self.reader.filtering(self._safe):
            outcome = self.env.step(actions)
        if not (self._decided or over):
            raise ConfigError(
                f"filtering of the reader {type(self.reader).__name__} never called safe in this step, so that boats "
                "play bare; let it play safe(commands) before the boats move, see GameReader.filtering"
            )
        infos = outcome[-1]
        if self.decisions is not None:
            for i, agent in self._covered(self.decisions.fleet.team, infos):
                infos[agent]["shield"] = self.decisions[i]
        self._mask(infos)
        return outcome

    def __getattr__(self, name: str) -> Any:
        """Look an attribute up in the game, private ones too: Pyquaticus' own policies read those of the env.

        Special names and the wrapper's own are never looked up there: copying and pickling ask for them before they are
        set.
        """
        if name.startswith("__") or name in _OWN:
            raise AttributeError(f"{type(self).__name__!r} has no attribute {name!r}")
        return getattr(self.env if not name.startswith("_") else self.env.unwrapped, name)

    def _safe(self, commands: Array) -> Array:
        """Return the filtered commands (n, 2) for nominal ones; a boat without an action of its own is held."""
        forgotten = self._forgotten & ~np.asarray(commands).any(axis=1)  # boats that the game drives have its commands
        if forgotten.any():
            commands = np.where(forgotten[:, None], np.nan, commands)
        self.decisions, self._decided = self._game.decide(commands), True
        sent = self.decisions.filtered.values
        return np.where(np.isnan(sent), 0.0, sent) if forgotten.any() else sent  # nan: of those it does not decide for

    def _note_forgotten(self, actions: Any) -> None:
        """Note the team's boats without an action, and log each once a game."""
        if not isinstance(actions, Mapping):  # which the env refuses
            return
        self._forgotten = np.array([agent in self._own and agent not in actions for agent in self.reader.agent_ids])
        for agent in sorted(self._own - actions.keys() - self._said):
            self._said.add(agent)
            logger.warning("no action for %s; boats without an action hold", agent)

    def _covered(self, team: Any, infos: Any) -> list[tuple[int, str]]:
        """Return numbers and ids of the shielded team's boats that have infos."""
        agents = enumerate(self.reader.agent_ids)
        return [(i, agent) for i, agent in agents if team[i] == self.team and agent in infos]

    def _mask(self, infos: dict[str, dict[str, Any]]) -> None:
        """Store in each shielded boat's info which discrete actions the shield would pass."""
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
    """Refuse a class, and an environment whose boats act in turn (AEC)."""
    if isinstance(env, type):
        raise ConfigError(f"{env.__name__} is a class; give an environment: {env.__name__}(...)")
    if callable(getattr(type(env), "last", None)) and callable(getattr(type(env), "agent_iter", None)):
        raise ConfigError(
            f"{type(env).__name__} is an AEC env, in which boats act in turn, and the shield decides for all at once; "
            "wrap the parallel env: parallel_to_aec(ShieldedParallelEnv(mctf_v0.parallel_env(...), Shield()))"
        )


def _check_in_game(env: Any, team: int, own: set[str], reader: GameReader) -> None:
    """Refuse a team without boats, and boats of it that are no agents of the game: they get no decisions."""
    if not own:
        raise ConfigError(f"the reader {type(reader).__name__} has no boat of team {SIDES[team]}; shield the other one")
    check_boats(env, sorted(own), reader)


def _check_not_shielded(env: Any, team: int, shield: Any) -> None:
    """Refuse a second shield for a team, which would filter the first one's commands, and one shield for both teams."""
    others = [layer for layer in layers_of(env) if isinstance(layer, ShieldedParallelEnv)]
    if any(layer.shield is shield for layer in others):
        raise ConfigError("this shield serves the other team of this environment; give each team a Shield of its own")
    if any(layer.team == team for layer in others):
        raise ConfigError(
            f"the {SIDES[team]} team of this environment has a shield already; wrap env.unwrapped, or shield the other "
            "team"
        )
