"""What a value table is solved for: boats, what the other boat may do, grid."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..compat import StrEnum
from ..exceptions import TableError
from ..jit import Array
from ..platforms.limits import limits_of
from ..platforms.platform import Platform
from ..platforms.registry import get_platform
from .grid import Grid
from .moves import moves_of, sub_steps

FAR_M = 30.0
"""Range beyond which tables have fewer ranges, with closer spacing of the nearest."""
LONGEST_CHASE_S = 30.0
"""Longest fitted play against a faster boat. Over longer ones it catches the most agile boat from anywhere (the
homicidal chauffeur), and the table would be useless.
"""
LONGEST_S = 90.0
"""Longest fitted play against other boats. A boat that has lost speed can be chased until it has regained it; a shorter
table would promise separations that are lost just after its end.
"""
SPEED_NODES = 5
"""Nodes along each axis of speed."""
RUDDERS = (-1.0, -0.5, 0.0, 0.5, 1.0)
"""Rudders that both boats choose among, shares of full."""


class OtherMay(StrEnum):
    """What the other boat may do."""

    WORST_CASE = "worst-case"
    """It answers each own move with the worst one, knowing it."""
    COOPERATIVE = "cooperative"
    """It helps: both boats choose the joint optimum."""


@dataclass(frozen=True)
class Problem:
    """A game of two boats, ready to be solved.

    Raises:
        TableError: a setting is out of range.
    """

    own: Platform  # the boats
    other: Platform
    other_may: OtherMay  # what the other boat may do
    grid: Grid  # nodes of the table
    dt_s: float  # table step, s, during which rudders are held
    horizon_s: float  # longest play, s

    def __post_init__(self) -> None:
        sub_steps(self.dt_s)
        if not (self.dt_s <= self.horizon_s < math.inf):
            raise TableError(f"horizon_s is {self.horizon_s}; make it finite and >= {self.dt_s} s")

    @property
    def name(self) -> str:
        """Name of the table: own boat, other boat, what the other may do."""
        return table_name(self.own.name, self.other.name, self.other_may)


def table_name(own: str, other: str, other_may: OtherMay) -> str:
    """Return the name of the table of a pair, as used for files."""
    return f"{own}-{other}-{other_may.value}"


def read_other_may(text: str | OtherMay) -> OtherMay:
    """Return the mode of that name."""
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
    dt_s: float | None = None,
    horizon_s: float | None = None,
) -> Problem:
    """Return the problem of a pair, with a grid fitted to its boats.

    A step is about as long as a turn of 24 deg (for unlike boats the geometric mean). Headings are spaced by a fraction
    1/k of a full-rudder turn in one step, and bearings by half of that. Common moves therefore end on nodes and cause
    no blur. Ranges go as far as the boats close in a half turn of the slower turner.

    Args:
        own: platform of the own boat, or its name.
        other: platform of the other boat, or its name.
        other_may: what the other boat may do.
        dt_s: step, s, instead of the fitted one.
        horizon_s: longest play, s, instead of the fitted one.

    Raises:
        TableError: a boat is of a kind without table, or a setting is out of range.
    """
    boats = get_platform(own), get_platform(other)
    mode = read_other_may(other_may)
    dt_s = _fitted_step(boats) if dt_s is None else dt_s
    spacing_deg = _fitted_spacing_deg(boats, dt_s)
    half_turn_s = max(limits_of(boat).half_turn_s for boat in boats)
    rho_last_m = 6.0 + 1.3 * (boats[0].max_speed_mps + boats[1].max_speed_mps) * half_turn_s
    far = rho_last_m > FAR_M
    grid = Grid(
        rho_last_m=round(rho_last_m, 1),
        n_rho=48 if far else 64,
        n_psi=round(360.0 / spacing_deg),
        n_beta=1 + round(360.0 / spacing_deg),
        n_own=SPEED_NODES,
        n_other=SPEED_NODES,
        own_top_mps=boats[0].max_speed_mps,
        other_top_mps=boats[1].max_speed_mps,
        rho_ratio=8.0 if far else 5.0,
    )
    return Problem(*boats, mode, grid, dt_s, _fitted_horizon(boats) if horizon_s is None else horizon_s)


def _fitted_step(boats: tuple[Platform, Platform]) -> float:
    steps = [min(max(24.1 / max(boat.max_turn_rate_at(boat.max_speed_mps), 1e-6), 0.1), 1.0) for boat in boats]
    tenths = [math.floor(10.0 * step) for step in steps]
    return math.ceil(math.sqrt(tenths[0] * tenths[1]) - 1e-9) / 10.0


def _fitted_spacing_deg(boats: tuple[Platform, Platform], dt_s: float) -> float:
    turn = max(min(_full_turn_deg(boat, dt_s) for boat in boats), 8.0)
    return turn / max(1, round(turn / 11.0))


def _full_turn_deg(boat: Platform, dt_s: float) -> float:
    """Return the turn of one step at top speed and full rudder, deg."""
    moves = moves_of(boat, np.array([boat.max_speed_mps]), np.ones(1), dt_s)
    return math.degrees(abs(moves.turn_rad[0, 0]))


def _fitted_horizon(boats: tuple[Platform, Platform]) -> float:
    """Return the time of several half turns, s; against a boat that is not faster, plus that of regaining top speed."""
    own, other = limits_of(boats[0]), limits_of(boats[1])
    turns_s = 7.0 * max(own.half_turn_s, other.half_turn_s)
    if boats[1].max_speed_mps > boats[0].max_speed_mps:
        return min(max(20.0, turns_s), LONGEST_CHASE_S)
    return min(max(20.0, turns_s + own.regain_s), LONGEST_S)


def places(speeds_mps: Array, top_mps: float, n_nodes: int) -> Array:
    """Return cell and place in it of stored speeds on an even speed axis, shape ``(*speeds, 2)``."""
    cells = np.clip(speeds_mps / top_mps, 0.0, 1.0) * (n_nodes - 1)
    low = np.minimum(np.floor(cells + 1e-9), n_nodes - 2)
    place = np.clip(cells - low, 0.0, 1.0)
    place = np.where(place < 1e-7, 0.0, np.where(place > 1.0 - 1e-7, 1.0, place))
    return np.stack([low, place], axis=-1)
