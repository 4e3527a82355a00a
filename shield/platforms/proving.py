"""A platform is a boat only if it moves, turns and stops in its own model; what the shield promises rests on that."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from ..jit import Array
from . import layout as L
from .step import step_boat
from .usv import fresh_state, wrap_degrees

if TYPE_CHECKING:
    from .platform import Platform

WITHIN_S = 60.0
"""Time for each of the three, s: as long as the shield looks at boats at all (`limits.LONGEST_S`)."""
DT_S = 0.1
REACHED = 0.85
"""Share of its top speed that a boat must come to; the simulators' large one has thrust for 0.875 of it."""
STOPPED = 0.05
"""Share of its top speed below which a boat lies still."""
TURN_DEG = 90.0
NEAR_DEG = 30.0
"""How near to the heading commanded, deg, the boat must come."""

_unproved: ContextVar[bool] = ContextVar("unproved", default=False)


@contextmanager
def reference_models() -> Iterator[None]:
    """Platforms built inside need not be boats: rails and cars with known answers, which models are checked by.

    Never hand such a one to a shield. The package's own boats are built so too: its tests prove them, and importing it
    compiles nothing.
    """
    token = _unproved.set(True)
    try:
        yield
    finally:
        _unproved.reset(token)


def fault_of(platform: Platform) -> str | None:
    """What a platform cannot do in its own model, and which settings are in charge of it; None: nothing."""
    if _unproved.get():
        return None
    return _fault_of(platform.pack().tobytes())


@lru_cache(maxsize=256)
def _fault_of(packed: bytes) -> str | None:
    params = np.frombuffer(packed, np.float64).copy()
    usv = params[L.KIND] == L.KIND_USV
    top_mps, state = float(params[L.MAX_SPEED]), fresh_state(0.0, 0.0, 0.0)
    fastest = _run(params, state, top_mps, 0.0)
    if not fastest >= REACHED * top_mps:
        remedy = "thrust_map, max_thrust and speed_pid or speed_factor" if usv else "max_acc"
        return f"told {top_mps:g} m/s it comes to {fastest:.3g} m/s within {WITHIN_S:g} s; give its {remedy}"
    off_deg = _turn(params, state, top_mps)
    if not off_deg <= NEAR_DEG:
        remedy = "turn_gain, max_rudder and heading_pid" if usv else "max_turn_rate_dps and max_angular_acc_dps2"
        if params[L.KIND] == L.KIND_RATE:
            remedy = "turn_rate_at_rest_dps or turn_rate_per_mps, and max_turn_rate_dps"
        left = f"{off_deg:.3g} of {TURN_DEG:g} deg are left after {WITHIN_S:g} s"
        return f"told to turn, {left}; give its {remedy}"
    _run(params, state, 0.0, 0.0)
    if not state[L.SPEED] <= STOPPED * top_mps:
        remedy = "thrust_map, max_dec and speed_pid" if usv else "max_acc"
        return f"told to stop it does {state[L.SPEED]:.3g} m/s after {WITHIN_S:g} s; give its {remedy}"
    return None


def _run(params: Array, state: Array, speed_mps: float, error_deg: float) -> float:
    """Highest speed, m/s, of a run under one command, straight ahead."""
    highest = 0.0
    for _ in range(round(WITHIN_S / DT_S)):
        step_boat(params, state, speed_mps, error_deg, DT_S)
        highest = max(highest, float(state[L.SPEED]))
    return highest


def _turn(params: Array, state: Array, speed_mps: float) -> float:
    """Smallest distance, deg, from the heading commanded."""
    goal, nearest = float(state[L.HEADING]) + TURN_DEG, TURN_DEG
    for _ in range(round(WITHIN_S / DT_S)):
        error_deg = float(wrap_degrees(goal - state[L.HEADING]))
        nearest = min(nearest, abs(error_deg))
        step_boat(params, state, speed_mps, error_deg, DT_S)
    return nearest
