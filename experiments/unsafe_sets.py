"""The set the shield cannot promise to save, beside the set reachability says nobody can."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.jit import Array
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.tables.areas import HEADINGS_DEG, SPEED_SHARES, area_m2
from steerclear.shield.tables.files import ValueTable
from steerclear.shield.tables.margin import full_thrust_state

from .markdown import MADE, table

RANGES, BEARINGS = 200, 72
RATIO_BAR = 1.15
HEADS = ("own/other m/s", "relative heading", "shield, m²", "reachability, m²", "ratio")


@dataclass(frozen=True)
class SetPair:
    """Areas of both sets for one pair of speeds and one relative heading.

    Attributes:
        own_mps: own speed, m/s.
        other_mps: the opponent's speed, m/s.
        heading_deg: heading of the opponent relative to the own one, deg; 180 is head-on.
        shield_m2: positions of the opponent at which the shield's certificate is negative, m^2.
        reach_m2: positions at which the table's value is below the radius, m^2.
    """

    own_mps: float
    other_mps: float
    heading_deg: float
    shield_m2: float
    reach_m2: float

    @property
    def ratio(self) -> float:
        """The shield's set by area, times the reachability set."""
        return self.shield_m2 / self.reach_m2


def compare_sets(
    values: ValueTable, config: ShieldConfig, notice: Callable[[int, int], None] | None = None
) -> list[SetPair]:
    """Areas of both sets at `SPEED_SHARES` and `HEADINGS_DEG`, both boats at full thrust.

    Args:
        values: worst-case table of the pair.
        config: settings; the radius is its ``separation_m``, without buffer.
        notice: called with pairs done and all.
    """
    bare = replace(config, buffer_m=0.0)
    grid, found = values.card.make_grid(), []
    places = [(a * grid.own_top_mps, b * grid.other_top_mps, h) for a, b in SPEED_SHARES for h in HEADINGS_DEG]
    for own_mps, other_mps, heading_deg in places:
        shield_m2 = shield_area_m2(values, bare, heading_deg, own_mps, other_mps)
        reach_m2 = area_m2(values, config.separation_m, heading_deg, own_mps, other_mps)
        found.append(SetPair(own_mps, other_mps, heading_deg, shield_m2, reach_m2))
        if notice is not None:
            notice(len(found), len(places))
    return found


def shield_area_m2(
    values: ValueTable, config: ShieldConfig, heading_deg: float, own_mps: float, other_mps: float
) -> float:
    """Area, m^2, of the opponent's positions, up to the table's range, at which the certificate is negative."""
    radius_m = config.separation_m
    edges = np.linspace(radius_m, values.card.make_grid().rho_last_m, RANGES + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    bearings = np.arange(BEARINGS) * (2.0 * math.pi / BEARINGS)
    rho, beta = (axis.ravel() for axis in np.meshgrid(middles, bearings, indexing="ij"))
    names = values.card.own, values.card.other
    own = full_thrust_state(get_platform(names[0]), own_mps)
    other = full_thrust_state(get_platform(names[1]), other_mps, heading_deg)
    state = np.tile(np.stack([own, other]), (rho.size, 1, 1))
    state[:, 1, L.X], state[:, 1, L.Y] = rho * np.sin(beta), rho * np.cos(beta)
    lost = _certificate_m(state, names, config) < 0.0
    cells = 0.5 * np.diff(edges**2) * (2.0 * math.pi / BEARINGS)
    return math.pi * radius_m**2 + float((lost.reshape(RANGES, BEARINGS) * cells[:, None]).sum())


def _certificate_m(state: Array, names: tuple[str, str], config: ShieldConfig) -> Array:
    shield = BatchedShield(config, len(state), names, (0, 1))
    wanted = np.zeros((len(state), 2, 2))
    wanted[:, :, 0] = get_platform(names[0]).max_speed_mps
    shield.decide(state, wanted, np.tile([True, False], (len(state), 1)))
    return np.asarray(shield.certificate_m[:, 0])


def rows_of(pairs: Sequence[SetPair]) -> list[list[str]]:
    """Rows under `HEADS`."""
    return [
        [
            f"{pair.own_mps:g}/{pair.other_mps:g}",
            f"{pair.heading_deg:g}°",
            f"{pair.shield_m2:.1f}",
            f"{pair.reach_m2:.1f}",
            f"{pair.ratio:.2f}",
        ]
        for pair in pairs
    ]


def content_of(values: ValueTable, config: ShieldConfig, pairs: Sequence[SetPair]) -> dict[str, Any]:
    """The comparison as JSON."""
    return {
        "command": "reach-compare",
        "own": values.card.own,
        "other": values.card.other,
        "radius_m": config.separation_m,
        "pairs": [asdict(pair) for pair in pairs],
    }


def sets_page(contents: Sequence[Mapping[str, Any]]) -> str:
    """Write the page of the sets from contents of `content_of`."""
    lines = ["# Sets that cannot be saved", "", MADE, ""]
    lines += [
        "Positions of an opponent from which the radius cannot be kept, by area: where the shield's certificate is"
    ]
    lines += ["negative, and where the worst-case value table is below the radius. Both boats at full thrust.", ""]
    for content in contents:
        pairs = [SetPair(**pair) for pair in content["pairs"]]
        lines += [f"## {content['own']} meets {content['other']}, {content['radius_m']:g} m", ""]
        lines += [*table(HEADS, rows_of(pairs)), ""]
        worst = max(pair.ratio for pair in pairs)
        met = sum(pair.ratio <= RATIO_BAR for pair in pairs)
        lines += [f"Largest ratio {worst:.2f}; {met} of {len(pairs)} within {RATIO_BAR:g}.", ""]
    return "\n".join(lines)
