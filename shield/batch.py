"""`BatchedShield`: the same decision for thousands of games, compiled, no Python in the loop."""

from __future__ import annotations

from typing import Any

import numpy as np

from .config import ShieldConfig
from .exceptions import ConfigError, FleetError
from .fleet import LARGEST
from .flow import Plan, decide_compiled, new_plan
from .jit import Array, BoolArray, IntArray, kernel
from .platforms import Platform
from .platforms import layout as L
from .scene import Boats, Fixed, Memory, Tuning, Work, new_memory, new_work
from .setup import boats_of, plans_of, tuning_of
from .surroundings import OPEN_WATER, Surroundings


@kernel
def decide_games(
    state: Array,
    wanted: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
    margin_m: Array,
    sent: Array,
    reason: IntArray,
    clearance_m: Array,
) -> None:
    """Decide for every game in turn; arrays carry a leading games axis."""
    n = state.shape[1]
    for b in range(state.shape[0]):
        own = Memory(
            memory.kept[b],
            memory.side[b],
            memory.target_deg[b],
            memory.speed_mps[b],
            memory.margin_m[b],
            memory.escaping[b],
        )
        decide_compiled(state[b], wanted[b], margin_m, ours[b], boats, fixed, plans, tuning, own, work, plan)
        for i in range(n):
            sent[b, i, 0], sent[b, i, 1] = plan.commands[i, 0], plan.commands[i, 1]
            reason[b, i] = plan.reason[i]
            clearance_m[b, i] = work.clear[i, 0] if ours[b, i] else np.inf


class BatchedShield:
    """`Shield` for B games of the same fleet, with the exact compiled projection as its QP solver.

    Decisions are those of `Shield` to rounding: the stages are the same functions. Tracks are taken as fresh and
    exact up to ``position_error_m``; age and delay belong to boats, not to a batch.

    Args:
        config: settings; coordination must be "team" and delay 0.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        surroundings: fixed things, the same for all games.

    Raises:
        ConfigError: a setting that a batch cannot honour.
    """

    def __init__(
        self,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        surroundings: Surroundings = OPEN_WATER,
    ) -> None:
        if config.coordination != "team" or config.delay_s > 0:
            raise ConfigError("a batch decides for whole teams at once: set coordination='team' and delay_s=0")
        if isinstance(games, bool) or not isinstance(games, (int, np.integer)) or games < 1:
            raise ConfigError(f"games is {games!r}; give a whole number >= 1")
        if len(platforms) != len(team) or not platforms:
            raise ConfigError(f"{len(platforms)} platforms and {len(team)} team entries; give one of each per boat")
        self.config = config
        n = len(platforms)
        self._boats = boats_of(config, tuple(platforms), tuple(int(t) for t in team))
        self._fixed = surroundings.pack(config)
        self._plans, self._tuning = plans_of(config), tuning_of(config)
        self._memory = new_memory(games, n)
        self._work = new_work(n, int(self._boats.hunt_samples.max()))
        self._plan = new_plan(n, n * (n + 5) + 2)
        self._margin = np.full(n, config.position_error_m)
        self.reason = np.zeros((games, n), np.int64)
        self.certificate_m = np.full((games, n), np.inf)
        self.sent = np.zeros((games, n, 2))

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the escapes of the games in ``mask`` (B,), or of all."""
        which = slice(None) if mask is None else mask
        self._memory.kept[which] = False
        self._memory.escaping[which] = False

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """Safe commands.

        Args:
            state: (B, n, N_STATE) boat states.
            wanted: (B, n, 2) speed m/s and relative heading deg.
            ours: (B, n) boats to decide for.

        Returns:
            (B, n, 2) commands; rows of boats not decided for, and safe ones, bit for bit as wanted. The array is
            reused by the next call. ``reason`` and ``certificate_m`` (B, n) tell why.

        Raises:
            FleetError: an array has the wrong shape or a state is not finite.
        """
        for name, array, shape in (
            ("state", state, (*self.reason.shape, L.N_STATE)),
            ("wanted", wanted, self.sent.shape),
            ("ours", ours, self.reason.shape),
        ):
            if np.shape(array) != shape:
                raise FleetError(f"{name} has shape {np.shape(array)}; expected {shape}")
        if not (np.abs(state[:, :, : L.SPEED_ERROR]) <= LARGEST).all() or (np.abs(state) > LARGEST).any():
            raise FleetError(f"a boat's position, heading, speed, thrust or rudder is not finite or beyond {LARGEST:g}")
        decide_games(
            state,
            wanted,
            ours,
            self._boats,
            self._fixed,
            self._plans,
            self._tuning,
            self._memory,
            self._work,
            self._plan,
            self._margin,
            self.sent,
            self.reason,
            self.certificate_m,
        )
        return self.sent

    def filter_for(self, team: int, shield_autopilot: bool = True) -> Any:
        """Command filter for a batched game: ``step(actions, command_filter=shield.filter_for(0))``.

        Args:
            team: the team to shield.
            shield_autopilot: also decide for boats the game drives (tagged, out of bounds).
        """

        def command_filter(core: Any, commands: Array) -> Array:
            ours = np.broadcast_to(core.team == team, core.driven.shape)
            ours = ours.copy() if shield_autopilot else ours & ~core.driven
            return self.decide(core.state, commands, ours)

        return command_filter
