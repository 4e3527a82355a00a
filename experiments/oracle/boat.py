"""A boat's parameters as plain numbers, and the columns of the arrays that come in from outside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import astuple, dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .errors import OracleError

Array = NDArray[np.float64]
N_STATE = 11
"""Columns of a state row: x, y, heading, speed, thrust, rudder, speed error and integral, heading error and integral,
turn rate."""
MEMORY = (6, 8)
"""Columns that are NaN as long as the controller has not run."""
KINDS = ("usv", "single_integrator", "double_integrator", "rate")
_N_ROW = 38
_N_PLAIN = 21
_MAP_POINTS = 8


@dataclass(frozen=True)
class Boat:
    """A boat and its autopilot. Speeds m/s, accelerations m/s2, angles deg, thrust and rudder percent.

    Attributes:
        kind: "usv" (thrust and rudder), "single_integrator", "double_integrator" or "rate" (turns by a rate loop: max
            rudder is its turn rate at rest, deg/s, turn rate what it gains with speed, deg/s per m/s, the heading
            controller's kp what is asked for per deg of error, 1/s; kd of both controllers are lags, s).
        max_speed_mps: top speed.
        speed_factor: thrust per commanded speed; 0: a speed controller changes the thrust instead.
        max_thrust: largest thrust.
        max_rudder: largest rudder.
        turn_loss: share of speed lost at full rudder.
        turn_rate: deg/s at full rudder and thrust 50.
        max_acc: 0 means no limit (of thrust boats).
        max_dec: 0 means no limit.
        rotate_dps: constant turn.
        speed_pid: kp, ki, kd, integral limit.
        speed_gain: thrust per output of the speed controller.
        heading_pid: kp, ki, kd, integral limit.
        max_turn_dps: of the integrators.
        max_angular_acc: of the double integrator, deg/s2.
        thrust_map: (thrust, speed) points, thrust rising.
    """

    kind: str
    max_speed_mps: float
    speed_factor: float = 0.0
    max_thrust: float = 100.0
    max_rudder: float = 100.0
    turn_loss: float = 0.0
    turn_rate: float = 0.0
    max_acc: float = 0.0
    max_dec: float = 0.0
    rotate_dps: float = 0.0
    speed_pid: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    speed_gain: float = 1.0
    heading_pid: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)
    max_turn_dps: float = 0.0
    max_angular_acc: float = 0.0
    thrust_map: tuple[tuple[float, float], ...] = ((0.0, 0.0), (100.0, 1.0))

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise OracleError(f"unknown kind of boat {self.kind!r}; choose one of {', '.join(KINDS)}")
        if not np.isfinite(self.numbers()).all() or not self.max_speed_mps > 0.0:
            raise OracleError(f"a boat needs finite parameters and a top speed above 0; got {self}")
        if len(self.thrust_map) < 2 or any(b[0] <= a[0] for a, b in pairwise(self.thrust_map)):
            raise OracleError(f"a thrust map needs two or more points with rising thrust; got {self.thrust_map}")

    def numbers(self) -> NDArray[np.float64]:
        """Return the parameters in one row, in the order `model` reads them."""
        flat = [KINDS.index(self.kind)] + [value for entry in astuple(self)[1:-1] for value in np.atleast_1d(entry)]
        return np.array([*flat, *(value for point in self.thrust_map for value in point)], dtype=np.float64)

    def top_mps(self) -> float:
        """Return a speed over ground the boat never exceeds, m/s, for a start within its top speed."""
        return float(max(self.max_speed_mps, *(speed for _, speed in self.thrust_map)))


def boats_of_rows(rows: ArrayLike) -> list[Boat]:
    """Read boats from the simulator's parameter rows.

    Args:
        rows: (n, 38): kind 0 usv, 1 single, 2 double integrator, 3 rate; top speed, speed factor, max thrust, max
            rudder, turn loss, turn rate, max acc, max dec, rotate speed; speed kp, ki, kd, integral limit, gain;
            heading kp, ki, kd, integral limit; max turn rate, max angular acc; points of the thrust map, 8 thrusts, 8
            speeds.

    Raises:
        OracleError: another shape, or values no boat can have.
    """
    table = np.asarray(rows, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] != _N_ROW:
        raise OracleError(f"parameter rows have shape (boats, {_N_ROW}); got {table.shape}: give one row per boat")
    if not np.isfinite(table).all():
        raise OracleError("parameter rows hold numbers that are not finite; take them from the platform anew")
    return [_boat_of(row.tolist()) for row in table]


def as_boats(boats: Any, n: int) -> list[Boat]:
    """Return ``n`` boats from boats or parameter rows.

    Raises:
        OracleError: not one per boat.
    """
    given: list[Boat] = list(boats) if _all_boats(boats) else boats_of_rows(boats)
    if len(given) != n:
        raise OracleError(f"the states hold {n} boats but {len(given)} parameter sets were given; give one per boat")
    return given


def _all_boats(boats: Any) -> bool:
    return isinstance(boats, Sequence) and all(isinstance(boat, Boat) for boat in boats)


def _boat_of(row: list[float]) -> Boat:
    size = int(row[_N_PLAIN])
    if not (0 <= row[0] < len(KINDS) and 2 <= size <= _MAP_POINTS):
        raise OracleError(f"a parameter row starts with kind {row[0]:g} and has {size} map points; check its columns")
    thrusts, speeds = row[_N_PLAIN + 1 :][:size], row[_N_PLAIN + 1 + _MAP_POINTS :][:size]
    return Boat(
        KINDS[int(row[0])],
        *row[1:10],
        speed_pid=(row[10], row[11], row[12], row[13]),
        speed_gain=row[14],
        heading_pid=(row[15], row[16], row[17], row[18]),
        max_turn_dps=row[19],
        max_angular_acc=row[20],
        thrust_map=tuple(zip(thrusts, speeds, strict=True)),
    )
