"""`ReachGuard`: commands filtered by the reachability value tables alone, in the place where the shield stands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError, TableError
from steerclear.shield.fleet import LARGEST
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tables.files import ValueTable, load_table, stack_tables
from steerclear.shield.tables.settings import OtherMay

from .decide import decide_games
from .values import Setup

NAME = "reach"
SETTINGS = ("response_per_s", "margin_cap_m", "hysteresis_m", "speed_weight", "opponent_share", "buffer_m")
"""Settings of `ShieldConfig` that may be given with the name; separation, position error and step count too."""


def check_settings(settings: dict[str, Any]) -> None:
    """Check settings given with the name.

    Raises:
        ConfigError: one that this guard has no use for, or a bad value.
    """
    for key in settings:
        if key not in SETTINGS:
            raise ConfigError(f"guard {NAME!r} has no setting {key!r}; it knows {', '.join(SETTINGS)}")
    ShieldConfig.of(**settings)


class ReachGuard:
    """Commands of B games of the same fleet, kept where the value tables promise the separation.

    Reasons are the shield's: 0 passed bit for bit, 1 changed by the program, 3 escape, 4 best effort (no rudder and no
    braking keeps the separation), 5 no usable command, so the boat holds, 6 not decided for. Fixed things and the
    field's edge are not kept clear of.

    Args:
        config: settings; see `SETTINGS`. ``opponent_share`` is what opponents are granted within a step.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.

    Raises:
        ConfigError: a pair of boats without a table, a fleet that does not fit, a radius the tables cannot tell, or a
            delay.
    """

    def __init__(
        self, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...], team: tuple[int, ...]
    ) -> None:
        if config.delay_s > 0:
            raise ConfigError(f"delay_s is {config.delay_s}; guard {NAME!r} knows no delay, set 0")
        if isinstance(games, bool) or not isinstance(games, (int, np.integer)) or games < 1:
            raise ConfigError(f"games is {games!r}; give a whole number >= 1")
        if len(platforms) != len(team) or not platforms:
            raise ConfigError(f"{len(platforms)} platforms and {len(team)} team entries; give one of each per boat")
        self.config = config
        self._setup = _setup(config, [get_platform(kind) for kind in platforms], team)
        shape = (int(games), len(platforms))
        self._side = np.zeros(shape)
        self.reason = np.zeros(shape, np.int64)
        self.certificate_m = np.full(shape, np.inf)
        self.sent = np.zeros((*shape, 2))

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the escapes of the games in ``mask`` (B,), or of all."""
        which = slice(None) if mask is None else mask
        self._side[which] = 0.0
        self.reason[which] = 0
        self.certificate_m[which] = np.inf

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """Filtered commands.

        Args:
            state: (B, n, N_STATE) boat states.
            wanted: (B, n, 2) speed m/s and relative heading deg.
            ours: (B, n) boats to decide for.

        Returns:
            (B, n, 2) commands, reused by the next call. ``reason`` (B, n) tells why; ``certificate_m`` (B, n) is the
            least value after this step less the radius kept, m, inf where nobody is within the tables' range.

        Raises:
            FleetError: an array has the wrong shape or a state is not finite.
        """
        state, wanted, ours = np.asarray(state), np.asarray(wanted), np.asarray(ours)
        for what, array, shape in (
            ("state", state, (*self.reason.shape, L.N_STATE)),
            ("wanted", wanted, self.sent.shape),
            ("ours", ours, self.reason.shape),
        ):
            if array.shape != shape:
                raise FleetError(f"{what} has shape {array.shape}; expected {shape}")
        if not (np.abs(state[:, :, : L.SPEED_ERROR]) <= LARGEST).all() or (np.abs(state) > LARGEST).any():
            raise FleetError(f"a boat's position, heading, speed, thrust or rudder is not finite or beyond {LARGEST:g}")
        decide_games(
            self._setup,
            np.ascontiguousarray(state, dtype=np.float64),
            np.ascontiguousarray(wanted, dtype=np.float64),
            np.ascontiguousarray(ours, dtype=np.bool_),
            self._side,
            self.sent,
            self.reason,
            self.certificate_m,
        )
        return self.sent


def _setup(config: ShieldConfig, platforms: list[Platform], team: tuple[int, ...]) -> Setup:
    tables, index = _tables(platforms, team)
    radius_m = config.separation_m + config.buffer_m + 2.0 * config.position_error_m
    cap_m = min((table.card.make_grid().cap_m for table in tables), default=math.inf)
    if radius_m >= cap_m:
        raise ConfigError(
            f"the radius to keep is {radius_m:g} m with buffer and position error, and the value tables tell distances "
            f"up to {cap_m:g} m; choose a smaller separation_m"
        )
    return Setup(
        tables=stack_tables(tables),
        table=index,
        params=np.array([kind.pack() for kind in platforms]),
        team=np.array(team, dtype=np.int64),
        radius_m=radius_m,
        decay=math.exp(-config.response_per_s * config.dt_s),
        cap_m=min(config.margin_cap_m, cap_m - radius_m),
        dt_s=config.dt_s,
        share=config.opponent_share,
        speed_weight=config.speed_weight,
        hysteresis_m=config.hysteresis_m,
        look=max((round(table.card.dt_s / config.dt_s) for table in tables), default=1),
    )


def _tables(platforms: list[Platform], team: tuple[int, ...]) -> tuple[list[ValueTable], IntArray]:
    """Tables of all pairs, each once, and which is whose."""
    index = np.full((len(platforms), len(platforms)), -1, dtype=np.int64)
    found: dict[tuple[Platform, Platform, OtherMay], int] = {}
    tables: list[ValueTable] = []
    for i, own in enumerate(platforms):
        for j, other in enumerate(platforms):
            if i == j:
                continue
            key = own, other, OtherMay.COOPERATIVE if team[i] == team[j] else OtherMay.WORST_CASE
            if key not in found:
                try:
                    tables.append(load_table(*key))
                except TableError as error:
                    raise ConfigError(f"guard {NAME!r}: {error}") from error
                found[key] = len(tables) - 1
            index[i, j] = found[key]
    return tables, index
