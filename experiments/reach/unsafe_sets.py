"""The set the shield cannot promise to save, beside the set reachability says nobody can."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.model import boats_of
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tables.areas import HEADINGS_DEG, SPEED_SHARES
from steerclear.shield.tables.files import ValueTable, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, table_value
from steerclear.shield.tables.margin import full_thrust_state

RANGES, BEARINGS = 200, 72
RATIO_BAR = 1.15
MISSED_PERCENT_BAR = 2.0
"""Share of the reachability set the shield may call safe, %: what the table's rounding (2.4 cm) and grid leave open."""
GIVEN = {
    "separation_m": "both sets are of the radius given with --radius",
    "buffer_m": "both sets are of the radius given with --radius, without buffer",
    "position_error_m": "the value table takes positions as exact; widen both sets with --radius",
    "delay_s": "the value table knows no delay; leave it out, or widen both sets with --radius",
}
"""Settings under which the two sets would answer different questions, and what to do instead."""


@dataclass(frozen=True)
class SetPair:
    """Areas of both sets for one pair of speeds and one relative heading, over the same cells.

    Attributes:
        own_mps: own speed, m/s.
        other_mps: the opponent's speed, m/s.
        heading_deg: heading of the opponent relative to the own one, deg; 180 is head-on.
        shield_m2: positions of the opponent at which the shield's certificate is negative, m^2.
        reach_m2: positions at which the table's value is below the radius, m^2.
        missed_m2: positions of the second kind and not of the first, m^2: the table calls them lost, the shield calls
            them safe, and one of the two is wrong.
    """

    own_mps: float
    other_mps: float
    heading_deg: float
    shield_m2: float
    reach_m2: float
    missed_m2: float

    @property
    def ratio(self) -> float:
        """The shield's set by area, times the reachability set."""
        return self.shield_m2 / self.reach_m2

    @property
    def missed_percent(self) -> float:
        """Share of the reachability set that the shield calls safe, %."""
        return 100.0 * self.missed_m2 / self.reach_m2


def sets_config(radius_m: float, settings: Mapping[str, Any]) -> ShieldConfig:
    """Settings of the shield whose set is compared at a radius.

    Raises:
        ConfigError: one of `GIVEN`, or one that the shield refuses.
    """
    for name, remedy in GIVEN.items():
        if name in settings:
            raise ConfigError(f"{name} cannot be set here: {remedy}")
    worst = {"profile": "rammers"}  # as reachability takes them
    return ShieldConfig.of(**{"separation_m": radius_m, "buffer_m": 0.0, **worst, **settings})


def looks_up(values: ValueTable, config: ShieldConfig) -> bool:
    """Whether the shield looks this opponent up in the value table itself: its set is then the table's, at a margin."""
    return bool(boats_of(config, (values.card.own, values.card.other), (0, 1)).table[0, 1] >= 0)


def places(values: ValueTable) -> list[tuple[float, float, float]]:
    """What is compared: relative headings, deg, own and the other's speeds, m/s."""
    grid = values.card.make_grid()
    return [(h, a * grid.own_top_mps, b * grid.other_top_mps) for a, b in SPEED_SHARES for h in HEADINGS_DEG]


def compare_sets(
    values: ValueTable, config: ShieldConfig, notice: Callable[[int], None] | None = None
) -> list[SetPair]:
    """Areas of both sets at `SPEED_SHARES` and `HEADINGS_DEG`, both boats at full thrust.

    Args:
        values: worst-case table of the pair.
        config: settings; both sets are of the radius it keeps, buffer and position error included.
        notice: called with the number of `places` done.
    """
    found: list[SetPair] = []
    for place in places(values):
        found.append(compare_pair(values, config, *place))
        if notice is not None:
            notice(len(found))
    return found


def compare_pair(
    values: ValueTable, config: ShieldConfig, heading_deg: float, own_mps: float, other_mps: float
) -> SetPair:
    """Areas of both sets, up to the table's range, for one relative heading and pair of speeds."""
    radius_m = config.separation_m + config.buffer_m + 2.0 * config.position_error_m
    edges = np.linspace(radius_m, values.card.make_grid().rho_last_m, RANGES + 1)
    names = values.card.own, values.card.other
    own = full_thrust_state(get_platform(names[0]), own_mps)
    other = full_thrust_state(get_platform(names[1]), other_mps, heading_deg)
    state = _all_round(own, other, 0.5 * (edges[1:] + edges[:-1]))
    ours, theirs = certificates_m(state, names, config) < 0.0, values_m(values, state) < radius_m
    cells = np.repeat(0.5 * np.diff(edges**2) * (2.0 * math.pi / BEARINGS), BEARINGS)
    disc, areas = math.pi * radius_m**2, [float(cells[lost].sum()) for lost in (ours, theirs, theirs & ~ours)]
    return SetPair(own_mps, other_mps, heading_deg, disc + areas[0], disc + areas[1], areas[2])


def _all_round(own: Array, other: Array, ranges_m: Array) -> Array:
    """States (ranges x BEARINGS, 2, N_STATE) with the other boat at the ranges, on `BEARINGS` bearings each."""
    bearings = np.arange(BEARINGS) * (2.0 * math.pi / BEARINGS)
    rho, beta = (axis.ravel() for axis in np.meshgrid(ranges_m, bearings, indexing="ij"))
    state = np.tile(np.stack([own, other]), (rho.size, 1, 1))
    state[:, 1, L.X], state[:, 1, L.Y] = rho * np.sin(beta), rho * np.cos(beta)
    return state


def certificates_m(state: Array, names: tuple[str, str], config: ShieldConfig) -> Array:
    """The shield's certificate for the first boat of every state, m."""
    shield = BatchedShield(config, len(state), names, (0, 1))
    wanted = np.zeros((len(state), 2, 2))
    wanted[:, :, 0] = get_platform(names[0]).max_speed_mps
    shield.decide(state, wanted, np.tile([True, False], (len(state), 1)))
    return np.asarray(shield.certificate_m[:, 0])


def values_m(values: ValueTable, state: Array) -> Array:
    """The table's value of every state, m."""
    tables = stack_tables([values])
    gap, heading = state[:, 1, : L.Y + 1] - state[:, 0, : L.Y + 1], np.radians(state[:, :, L.HEADING])
    rows = np.column_stack([gap, heading, state[:, :, L.SPEED]])
    return np.array([table_value(tables, 0, WHOLE_S, *row) for row in rows.tolist()])
