"""`ReachGuard`: commands filtered by the reachability value tables alone, in the place where the shield stands."""

from __future__ import annotations

import math
from itertools import permutations
from typing import Any

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.jit import IntArray
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import turn_of_rudder
from steerclear.shield.tables.files import ValueTable, load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S
from steerclear.shield.tables.settings import OtherMay

from ..batch_guard import BatchGuard, Games
from .decide import decide_games
from .values import Setup

NAME = "reach"
SETTINGS = ("response_per_s", "margin_cap_m", "speed_weight", "adversary_s", "profile", "buffer_m")
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
    """Commands kept where the value tables promise the separation; what is not said here is as in `BatchGuard`.

    Reasons are the shield's: 0 passed bit for bit, 1 changed by the program, 3 backup, 4 best effort (no rudder and no
    braking keeps the separation), 5 no usable command, so the boat holds, 6 not decided for. ``certificate_m`` is the
    least value after this step less the radius kept, m, inf where nobody is within the tables' range. Static
    constraints and the field's edge are not kept clear of.

    Raises:
        ConfigError: a pair of boats without a table, a fleet that does not fit, a radius the tables cannot tell, or a
            delay.
    """

    columns, needs_commands = 1, False

    def __init__(
        self, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...], team: tuple[int, ...]
    ) -> None:
        super().__init__(NAME, config, games, platforms, team)
        tables, index = _tables(self._platforms, team)
        cap_m = min((table.card.make_grid().cap_m for table in tables), default=math.inf)
        if self.radius_m >= cap_m:
            raise ConfigError(
                f"the radius to keep is {self.radius_m:g} m with buffer and position error, and the value tables tell "
                f"distances up to {cap_m:g} m; choose a smaller separation_m"
            )
        rudders = [(row, row[L.MAX_THRUST], min(row[L.MAX_RUDDER], 100.0)) for row in self.params]
        self.setup = Setup(
            tables=stack_tables(tables),
            table=index,
            params=self.params,
            team=np.array(team, dtype=np.int64),
            full_deg=np.array([abs(turn_of_rudder(*rudder, config.dt_s)) for rudder in rudders]),
            radius_m=self.radius_m,
            decay=math.exp(-config.response_per_s * config.dt_s),
            cap_m=min(config.margin_cap_m, cap_m - self.radius_m),
            dt_s=config.dt_s,
            fear_s=min(config.feared_s, WHOLE_S),
            speed_weight=config.speed_weight,
            look=max((round(table.card.dt_s / config.dt_s) for table in tables), default=1),
        )

    def _decide(self, games: Games) -> None:
        decide_games(self.setup, games)


def _tables(platforms: list[Platform], team: tuple[int, ...]) -> tuple[list[ValueTable], IntArray]:
    """Tables of all pairs, each once, and which is whose."""
    index, found = np.full((len(team), len(team)), -1), dict[tuple[Platform, Platform, OtherMay], ValueTable]()
    for i, j in permutations(range(len(team)), 2):
        key = platforms[i], platforms[j], OtherMay.COOPERATIVE if team[i] == team[j] else OtherMay.WORST_CASE
        try:
            found.setdefault(key, load_table(*key))
        except TableError as error:
            raise ConfigError(f"guard {NAME!r}: {error}") from error
        index[i, j] = list(found).index(key)
    return list(found.values()), index
