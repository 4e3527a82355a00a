"""Where a boat goes under an escape manoeuvre: turn to one side at full rudder, then straight, at a set speed.

Paths are sampled every ``STRIDE`` steps of the boat's model. Sample 0 is where the boat is one step from now: after the
candidate command, or after the manoeuvre's own first step.
"""

from __future__ import annotations

from ..jit import Array, kernel
from ..platforms import layout as L
from ..platforms.actuator import actuate

STRIDE = 2
"""Model steps between samples of a path."""

STEADY_SPEED = 1e-4
"""Change of speed per step, m/s, below which a straight run is taken as steady."""


@kernel
def angle_to_go(heading_deg: float, target_deg: float, side: float) -> float:
    """Turn, deg in [0, 360), that takes a boat to a heading going clockwise (side 1) or the other way (-1)."""
    return ((target_deg - heading_deg) * side) % 360.0


@kernel
def sail(params: Array, row: Array, side: float, togo_deg: float, speed_mps: float, dt_s: float) -> float:
    """One model step of an escape manoeuvre on ``row``, in place; returns the turn still to make, deg."""
    before = row[L.HEADING]
    actuate(params, row, speed_mps, side * togo_deg, dt_s)
    if togo_deg <= 0.0:
        return 0.0
    turned = (row[L.HEADING] - before) * side
    if turned < -180.0:
        turned += 360.0
    togo_deg -= turned
    return togo_deg if togo_deg > 1e-9 else 0.0


@kernel
def trace_path(
    params: Array,
    row: Array,
    side: float,
    togo_deg: float,
    speed_mps: float,
    dt_s: float,
    done: int,
    samples: int,
    path: Array,
) -> None:
    """Fill ``path[: samples + 1]`` with positions, m, along an escape manoeuvre.

    Args:
        params: platform row of the boat.
        row: state to start from; used up.
        side: 1 clockwise, -1 the other way.
        togo_deg: turn to make before running straight, deg, >= 0.
        speed_mps: speed commanded throughout, m/s.
        dt_s: model step, s.
        done: 1 when ``row`` is the state one step from now, 0 when it is the present one.
        samples: number of samples after sample 0.
        path: shape (>= samples + 1, 2), float64.
    """
    if done == 0:
        togo_deg = sail(params, row, side, togo_deg, speed_mps, dt_s)
    path[0, 0], path[0, 1] = row[L.X], row[L.Y]
    k = 1
    step = 0
    while k <= samples:
        x, y, speed = row[L.X], row[L.Y], row[L.SPEED]
        straight = togo_deg <= 0.0
        togo_deg = sail(params, row, side, togo_deg, speed_mps, dt_s)
        step += 1
        if step % STRIDE == 0:
            path[k, 0], path[k, 1] = row[L.X], row[L.Y]
            k += 1
        if straight and step > 1 and abs(row[L.SPEED] - speed) < STEADY_SPEED and row[L.TURN_RATE] == 0.0:
            _run_on(row[L.X], row[L.Y], row[L.X] - x, row[L.Y] - y, step, k, samples, path)
            return


@kernel
def _run_on(x: float, y: float, dx: float, dy: float, step: int, k: int, samples: int, path: Array) -> None:
    """Fill the rest of a path with equal steps: a steady straight run needs no model."""
    while k <= samples:
        ahead = k * STRIDE - step
        path[k, 0], path[k, 1] = x + ahead * dx, y + ahead * dy
        k += 1
