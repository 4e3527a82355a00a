"""Common base of batched safety filters: input checks and output arrays."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import NamedTuple

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.fleet import LARGEST
from steerclear.shield.jit import Array, BoolArray, IntArray, kernel
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.platforms import layout as L


class Games(NamedTuple):
    """Inputs and outputs of B games of n boats, or of one game; see `BatchFilter`."""

    state: Array
    nominal: Array
    ours: BoolArray
    memory: Array
    filtered: Array
    reason: IntArray
    safety_margin_m: Array


@kernel
def game_of(games: Games, b: int) -> Games:
    """Return one game: arrays without the leading games axis."""
    state, nominal, ours, memory, filtered, reason, safety_margin_m = games
    return Games(state[b], nominal[b], ours[b], memory[b], filtered[b], reason[b], safety_margin_m[b])


class BatchFilter(ABC):
    """Filter of the commands of B games of the same fleet, with the interface of the batched shield.

    Args:
        name: of the filter, for messages.
        config: settings.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.

    Attributes:
        reason: (B, n) why each command is what it is.
        safety_margin_m: (B, n) margin left, m; inf where no boat is near.
        filtered: (B, n, 2) commands of the last decision.
        memory: (B, n, columns) what the filter remembers of each boat between decisions.
        radius_m: required distance: separation, buffer and both position errors, m.
        params: (n, N_PARAM) platform rows.

    Raises:
        ConfigError: a fleet that does not fit, or a delay.
    """

    columns, forgotten, needs_commands = 0, 0.0, True
    """Columns of the memory, their initial value, and whether every own boat needs a usable command."""

    def __init__(
        self, name: str, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...], team: tuple[int, ...]
    ) -> None:
        if config.delay_s > 0:
            raise ConfigError(f"delay_s is {config.delay_s}; filter {name!r} knows no delay, set 0")
        if isinstance(games, bool) or not isinstance(games, (int, np.integer)) or games < 1:
            raise ConfigError(f"games is {games!r}; give a whole number >= 1")
        if len(platforms) != len(team) or not platforms:
            raise ConfigError(f"{len(platforms)} platforms and {len(team)} team entries; give one of each per boat")
        self.name, self.config, self.team = name, config, np.array(team, dtype=np.int64)
        self._platforms = [get_platform(kind) for kind in platforms]
        self.params = np.array([kind.pack() for kind in self._platforms])
        self.radius_m = config.separation_m + config.buffer_m + 2.0 * config.position_error_m
        shape = (int(games), len(platforms))
        self.reason, self.safety_margin_m = np.zeros(shape, np.int64), np.full(shape, np.inf)
        self.filtered, self.memory = np.zeros((*shape, 2)), np.full((*shape, self.columns), self.forgotten)

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the last decisions of the games in ``mask`` (B,), or of all."""
        which = slice(None) if mask is None else mask
        self.reason[which], self.safety_margin_m[which], self.memory[which] = 0, np.inf, self.forgotten

    def decide(self, state: Array, nominal: Array, ours: BoolArray) -> Array:
        """Return the filtered commands.

        Args:
            state: (B, n, N_STATE) boat states.
            nominal: (B, n, 2) speed m/s and relative heading deg.
            ours: (B, n) boats to decide for.

        Returns:
            (B, n, 2) commands, overwritten by the next call. ``reason`` and ``safety_margin_m`` (B, n) explain them.

        Raises:
            FleetError: an array has the wrong shape, a state is not finite, or the filter cannot decide on the input.
        """
        shapes = {"state": (*self.reason.shape, L.N_STATE), "nominal": self.filtered.shape, "ours": self.reason.shape}
        for (what, shape), array in zip(shapes.items(), (state, nominal, ours), strict=True):
            if np.shape(array) != shape:
                raise FleetError(f"{what} has shape {np.shape(array)}; expected {shape}")
        state, nominal = (np.ascontiguousarray(array, dtype=np.float64) for array in (state, nominal))
        boats = np.ascontiguousarray(ours, dtype=np.bool_)
        if not (np.abs(state[:, :, : L.SPEED_ERROR]) <= LARGEST).all() or (np.abs(state) > LARGEST).any():
            raise FleetError(f"a boat's position, heading, speed, thrust or rudder is not finite or beyond {LARGEST:g}")
        if self.needs_commands and not (np.abs(nominal[boats]) <= LARGEST).all():
            raise FleetError(f"a nominal command is not finite or beyond {LARGEST:g}; give a speed and a heading")
        self.filtered[:], self.reason[:], self.safety_margin_m[:] = nominal, 0, np.inf
        self._decide(Games(state, nominal, boats, self.memory, self.filtered, self.reason, self.safety_margin_m))
        return self.filtered

    @abstractmethod
    def _decide(self, games: Games) -> None:
        """Write commands, reasons and margins; ``filtered`` starts as the nominal commands; arrays are contiguous."""
