"""Putting shields on a game and reading off what they did."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import NOT_COVERED
from steerclear.shield import Reason, Shield, ShieldConfig
from steerclear.shield.jit import Array
from steerclear.shield.wrappers import game_facts
from steerclear.shield.wrappers.parallel import ShieldedParallelEnv

from ..metrics import RADII_M
from ..oracle import AT_ONCE, Motion
from .conditions import Disturbances
from .spec import SIDES, MatchSpec

Listener = Callable[[Array, Array], None]
"""Called before the boats move with the commands (1, n, 2) wanted and those sent."""


@dataclass(frozen=True)
class Seen:
    """What the shields did in a step, for all n boats; `solve_time_s` is None where there is no shield."""

    reason: NDArray[np.uint8]
    intervened: NDArray[np.bool_]
    safety_margin_m: NDArray[np.float32]
    solve_time_s: float | None


@dataclass
class Shielding:
    """A game's env with its shields.

    Attributes:
        inner: the game itself.
        env: what to step: the game or the outermost wrapper.
        wrappers: one per shielded team.
        agent_ids: boats that a shield decides for.
        separation_m: radius the own shield keeps (the default's without one), m.
        disturbances: the conditions at work; None where there are none.
    """

    inner: MctfEnv
    env: Any
    wrappers: list[ShieldedParallelEnv] = field(default_factory=list)
    agent_ids: list[str] = field(default_factory=list)
    separation_m: float = RADII_M[0]
    disturbances: Disturbances | None = None
    _listener: Listener | None = None
    _commands: Array | None = None

    @property
    def motion(self) -> Motion:
        """What the oracle has to know of the conditions."""
        return AT_ONCE if self.disturbances is None else self.disturbances.motion

    @property
    def reason_names(self) -> list[str]:
        """Names of the reason codes, by code; none without a shield."""
        return [reason.name for reason in Reason] if self.wrappers else []

    def listen(self, listener: Listener) -> None:
        """Hear of every step's commands, before and after the shields; call once per game, after reset.

        The conditions come after that: commands are heard when they are given, however late they take effect.
        """
        self._listener = listener
        self.inner.command_filter = self._wanted
        if self.disturbances is not None:
            self.disturbances.begin()

    def step(self, actions: Mapping[str, Any]) -> tuple[Any, ...]:
        """One step of the game, with its shields and conditions."""
        with self.inner.filtered(self._sent):  # the first to be entered is the last to be asked
            return self.env.step(actions)

    def _wanted(self, core: BatchedMctf, commands: Array) -> Array:
        """Stands before the shields."""
        if self.disturbances is not None:
            self.disturbances.look(core)
        self._commands = commands.copy()
        return commands

    def _sent(self, core: BatchedMctf, commands: Array) -> Array:
        """Stands behind them."""
        if self._listener is not None and self._commands is not None:
            self._listener(self._commands, commands)
        return commands if self.disturbances is None else self.disturbances.carry(core, commands)

    def read(self) -> Seen:
        """Collect what the shields decided last."""
        n = len(self.inner.possible_agents)
        reason, intervened = np.full(n, NOT_COVERED, np.uint8), np.zeros(n, bool)
        margins_m, times_s = np.full(n, np.nan, np.float32), []
        for decisions in (wrapper.decisions for wrapper in self.wrappers):
            if decisions is not None:
                own = decisions.reason != NOT_COVERED
                reason[own], intervened[own] = decisions.reason[own], decisions.intervened[own]
                margin_m = decisions.safety_margin_m[own]
                margins_m[own] = np.where(np.isfinite(margin_m), margin_m, np.nan)
                times_s.append(decisions.solve_time_s)
        return Seen(reason, intervened, margins_m, max(times_s, default=None))


def shield_game(env: MctfEnv, spec: MatchSpec) -> Shielding:
    """Put the shields of a spec on a game, told of its conditions where their settings do not say otherwise.

    Only the own team's commands come late, so only its shield is told of the delay.

    Raises:
        ConfigError: a setting of a shield is unknown or out of range, or conditions that the game cannot have.
    """
    # the library warns of a shield that keeps less than the game's distance; here hits are counted at both
    logging.getLogger(game_facts.__name__).setLevel(logging.ERROR)
    shielding, dt_s, size = Shielding(env, env), env.config.dt_s, env.config.team_size
    if not spec.conditions.calm:
        shielding.disturbances = Disturbances(env, spec.conditions, spec.seed, spec.own_team)
    for team in (spec.own_team, 1 - spec.own_team):
        if (settings := spec.shields[team]) is None:
            continue
        told = spec.conditions if team == spec.own_team else replace(spec.conditions, delay_s=0.0)
        told_settings = {"dt_s": dt_s, "separation_m": RADII_M[0], **told.shield_settings(dt_s)}
        shield = Shield(ShieldConfig.of(**{**told_settings, **settings}))
        reader = None if shielding.disturbances is None else shielding.disturbances.reader()
        side, autopilot = SIDES[team], spec.shield_autopilot
        shielding.env = ShieldedParallelEnv(shielding.env, shield, side, autopilot, reader=reader)
        shielding.wrappers.append(shielding.env)
        shielding.agent_ids += env.possible_agents[size * team : size * (team + 1)]
    given = spec.shield if spec.shield is not None else spec.opponent_shield
    if given is not None:
        shielding.separation_m = float(given.get("separation_m", RADII_M[0]))
    return shielding
