"""Checking what is to be judged before anything is searched."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from .boat import MEMORY, N_STATE, Array, as_boats
from .errors import OracleError


@dataclass(frozen=True)
class Case:
    """One boat's side of a breach, ready to be searched.

    Attributes:
        states: (T+1, n, 11).
        tracks: (T+1, n-1, 2) positions of all other boats, in their order.
        numbers: parameters of the own boat.
        top_mps: speed it never exceeds.
        other: index of the boat it came too close to.
        partner: that boat's place among the tracks.
        radius_m: separation radius.
    """

    states: Array
    tracks: Array
    numbers: Array
    top_mps: float
    other: int
    partner: int
    radius_m: float


def checked(states: Any, boats: Any, own: int, step: int, radius_m: float, dt_s: float, other: int | None) -> Case:
    """Check the arguments of `judge`.

    Raises:
        OracleError: something cannot be judged; the text says what to give instead.
    """
    table = check_states(states)
    steps, n = table.shape[0] - 1, table.shape[1]
    for name, value in (("radius_m", radius_m), ("dt_s", dt_s)):
        if not (math.isfinite(value) and value > 0.0):
            raise OracleError(f"{name} is {value}; give a positive, finite number")
    for boat in (own, *(() if other is None else (other,))):
        if not 0 <= boat < n:
            raise OracleError(f"there is no boat {boat}; the record's boats are 0..{n - 1}")
    if not 1 <= step <= steps:
        raise OracleError(f"there is no step {step} to judge; the record's steps are 1..{steps}")
    chosen = as_boats(boats, n)[own]
    gaps = np.hypot(table[step, :, 0] - table[step, own, 0], table[step, :, 1] - table[step, own, 1])
    gaps[own] = np.inf
    partner = int(np.argmin(gaps)) if other is None else int(other)
    if not gaps[partner] <= radius_m:
        raise OracleError(
            f"boats {own} and {partner} are {gaps[partner]:.3f} m apart at step {step}, which is no breach of "
            f"{radius_m:g} m; give the first step inside the radius"
        )
    before = np.hypot(*(table[step - 1, partner, :2] - table[step - 1, own, :2]))
    if step > 1 and before <= radius_m:
        raise OracleError(
            f"boats {own} and {partner} are inside already before step {step}; give the first step inside"
        )
    tracks = np.ascontiguousarray(np.delete(table[:, :, :2], own, axis=1))
    place = partner - (partner > own)
    return Case(table, tracks, chosen.numbers(), chosen.top_mps(), partner, place, float(radius_m))


def check_states(states: Any) -> Array:
    """Return the record's states as an array (T+1, n, 11).

    Raises:
        OracleError: another shape, a single boat or step, or numbers that are not finite.
    """
    try:
        table = np.ascontiguousarray(states, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise OracleError(f"states must be numbers in one array (steps + 1, boats, {N_STATE}); got {error}") from error
    if table.ndim != 3 or table.shape[2] != N_STATE:
        raise OracleError(f"states have shape (steps + 1, boats, {N_STATE}); got {table.shape}")
    if table.shape[0] < 2 or table.shape[1] < 2:
        raise OracleError(f"a breach takes two boats and at least one step; the states have shape {table.shape}")
    plain = np.delete(table, MEMORY, axis=2)
    if not np.isfinite(plain).all() or np.isinf(table).any():
        k, boat = np.argwhere(~np.isfinite(plain).all(axis=2) | np.isinf(table).any(axis=2))[0]
        raise OracleError(f"the state of boat {boat} at step {k} is not finite; check the recorder or cut the record")
    return table
