"""What a value table is solved for: which boats, which rules of the game, which grid."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import StrEnum

import numpy as np

from ..exceptions import TableError
from ..jit import Array
from ..platforms.limits import limits_of
from ..platforms.platform import Platform
from ..platforms.registry import get_platform
from .grid import Grid
from .moves import moves_of, sub_steps

RUDDERS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Rudders both boats choose among, shares of full."""


class OtherMay(StrEnum):
    """What the other boat is granted."""

    WORST_CASE = "worst-case"
    """It answers each own move with the worst one, knowing it."""
    COOPERATIVE = "cooperative"
    """It helps: both boats make the best of it together."""


@dataclass(frozen=True)
class Problem:
    """One pairwise game, ready to be solved.

    Attributes:
        own, other: the boats.
        other_may: what the other boat is granted.
        grid: nodes of the table.
        dt_s: table step, s: rudders are held for so long.
        horizon_s: play looked ahead at most, s.

    Raises:
        TableError: a setting is out of range.
    """

    own: Platform
    other: Platform
    other_may: OtherMay
    grid: Grid
    dt_s: float
    horizon_s: float

    def __post_init__(self) -> None:
        sub_steps(self.dt_s)
        if not (self.dt_s <= self.horizon_s < math.inf):
            raise TableError(f"the horizon of a table is {self.horizon_s} s; make it finite and >= {self.dt_s} s")

    @property
    def name(self) -> str:
        """Name of the table: own boat, other boat, what the other may do."""
        return table_name(self.own.name, self.other.name, self.other_may)


def table_name(own: str, other: str, other_may: OtherMay) -> str:
    """Name of the table of a pair, as used for files."""
    return f"{own}-{other}-{other_may.value}"


def read_other_may(text: str | OtherMay) -> OtherMay:
    """The mode of that name.

    Raises:
        TableError: no mode has that name.
    """
    try:
        return OtherMay(text)
    except ValueError:
        names = ", ".join(mode.value for mode in OtherMay)
        raise TableError(f"other-may is {text!r}; choose one of {names}") from None


def problem_of(
    own: str | Platform,
    other: str | Platform,
    other_may: str | OtherMay = OtherMay.WORST_CASE,
    *,
    coarser: float = 1.0,
    dt_s: float | None = None,
    horizon_s: float | None = None,
) -> Problem:
    """The problem of a pair with a grid fitted to its boats.

    The step is the longest in which neither boat turns more than about 24 deg at full rudder; relative headings
    are spaced by half the smaller full turn, so that the common moves land on nodes; the range covers what the
    boats close in a half turn of the slower turner.

    Args:
        own, other: platforms or their names.
        other_may: what the other boat is granted.
        coarser: factor on all spacings, for convergence checks and quick looks.
        dt_s: step, s, instead of the fitted one.
        horizon_s: longest play, s, instead of the fitted one.

    Raises:
        TableError: a boat is of a kind without table, or a setting is out of range.
    """
    boats = get_platform(own), get_platform(other)
    mode = read_other_may(other_may)
    dt_s = dt_s or _fitted_step(boats)
    turns = [
        float(abs(moves_of(boat, np.array([boat.max_speed_mps]), np.ones(1), dt_s).turn_rad[0, 0])) for boat in boats
    ]
    half_turn_s = max(limits_of(boat).half_turn_s for boat in boats)
    psi_step = min(max(min(turns) / 2.0, math.radians(7.5)), math.radians(12.0))
    n_psi = 2 * round(math.pi / psi_step / coarser)
    closing = boats[0].max_speed_mps + boats[1].max_speed_mps
    grid = Grid(
        rho_last_m=round(6.0 + 1.7 * closing * half_turn_s, 1),
        n_rho=round(64 / coarser),
        n_psi=n_psi,
        n_beta=n_psi + 1,
        n_own=_speed_nodes(boats[0], coarser),
        n_other=_speed_nodes(boats[1], coarser),
        own_top_mps=boats[0].max_speed_mps,
        other_top_mps=boats[1].max_speed_mps,
    )
    return Problem(*boats, mode, grid, dt_s, horizon_s or _fitted_horizon(boats))


def _fitted_step(boats: tuple[Platform, Platform]) -> float:
    rates = [boat.max_turn_rate_at(boat.max_speed_mps) for boat in boats]
    return max(0.1, round(math.floor(10.0 * 24.1 / max(*rates, 24.1)) / 10.0, 1))


def _fitted_horizon(boats: tuple[Platform, Platform]) -> float:
    """Long enough for two half turns and the return to top speed, 20 to 60 s."""
    slow = max(limits_of(boat).half_turn_s for boat in boats)
    return min(max(20.0, 6.0 * slow), 60.0)


def _speed_nodes(boat: Platform, coarser: float) -> int:
    """More nodes for boats that gain speed slowly: for those the speed is worth something."""
    slow = 0.0 < boat.max_acc < boat.max_speed_mps
    return max(3, round((7 if slow else 5) / coarser))


def places(speeds_mps: Array, top_mps: float, n_nodes: int) -> Array:
    """Cell and place in it of stored speeds on an even speed axis, shape ``(*speeds, 2)``."""
    cells = np.clip(speeds_mps / top_mps, 0.0, 1.0) * (n_nodes - 1)
    low = np.minimum(np.floor(cells + 1e-9), n_nodes - 2)
    place = np.clip(cells - low, 0.0, 1.0)
    place = np.where(place < 1e-7, 0.0, np.where(place > 1.0 - 1e-7, 1.0, place))
    return np.stack([low, place], axis=-1)
