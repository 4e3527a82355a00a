"""`ReachGuard`: commands filtered by the reachability value tables alone, in the place where the shield stands."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import Platform
from steerclear.shield.tables.files import ValueTable, load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S
from steerclear.shield.tables.settings import OtherMay

from ..batch_guard import BatchGuard
from .decide import decide_games
from .values import Setup

NAME = "reach"
SETTINGS = ("response_per_s", "margin_cap_m", "hysteresis_m", "speed_weight", "adversary_s", "profile", "buffer_m")
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


class ReachGuard(BatchGuard):
    """Commands of B games of the same fleet, kept where the value tables promise the separation.

    Reasons are the shield's: 0 passed bit for bit, 1 changed by the program, 3 backup, 4 best effort (no rudder and no
    braking keeps the separation), 5 no usable command, so the boat holds, 6 not decided for. ``certificate_m`` is the
    least value after this step less the radius kept, m, inf where nobody is within the tables' range. Static
    constraints and the field's edge are not kept clear of.

    Args:
        config: settings; see `SETTINGS`. Opponents do their worst within a step, and by the tables for `feared_s`.
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
        super().__init__(NAME, config, games, platforms, team)
        self._setup = _setup(config, self._platforms, team)
        self._side = np.zeros(self.reason.shape)

    @property
    def setup(self) -> Setup:
        """Tables and settings, which `values` is asked with."""
        return self._setup

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the backups of the games in ``mask`` (B,), or of all."""
        super().reset(mask)
        self._side[slice(None) if mask is None else mask] = 0.0

    def _decide(self, state: Array, wanted: Array, ours: BoolArray) -> None:
        decide_games(self._setup, state, wanted, ours, self._side, self.sent, self.reason, self.certificate_m)


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
        fear_s=min(config.feared_s, WHOLE_S),
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
