"""Check that a platform moves, turns and stops in its own model. The shield's guarantees rely on this."""

from __future__ import annotations

from collections.abc import Callable, Iterator
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
"""Time for each of the three manoeuvres: the longest that the shield looks ahead (`limits.LONGEST_S`)."""
DT_S = 0.1
REACHED = 0.85
"""Share of its top speed that a boat must reach; the simulators' large boat has thrust for 0.875 of it."""
STOPPED = 0.05
"""Share of its top speed below which a boat counts as stopped."""
TURN_DEG = 90.0
NEAR_DEG = 30.0
"""How near the boat must come to the commanded heading."""

_REMEDIES = {
    "speed": {L.KIND_USV: "thrust_map, max_thrust and speed_pid or speed_factor"},
    "turn": {
        L.KIND_USV: "turn_gain, max_rudder and heading_pid",
        L.KIND_RATE: "turn_rate_at_rest_dps or turn_rate_per_mps, max_turn_rate_dps, max_angular_acc_dps2, turn_lag_s",
    },
    "stop": {
        L.KIND_USV: "thrust_map, max_dec and speed_pid",
        L.KIND_RATE: "max_dec and speed_lag_s",
        L.KIND_DOUBLE_INTEGRATOR: "max_acc",
    },
}
"""Settings that a manoeuvre depends on, by kind, if no single one is at fault; other kinds: `_LIMITS`."""

_LIMITS = {
    "speed": {"max_acc": L.MAX_ACC},
    "turn": {"max_turn_rate_dps": L.MAX_TURN_RATE, "max_angular_acc_dps2": L.MAX_ANGULAR_ACC},
    "stop": {"max_dec": L.MAX_DEC},
}
"""Limits of a manoeuvre, each of which alone may be at fault."""

_LAGS = {
    "speed": ("speed_lag_s", L.SPEED_LAG),
    "turn": ("turn_lag_s", L.TURN_LAG),
    "stop": ("speed_lag_s", L.SPEED_LAG),
}
"""Lags of a manoeuvre for boats of kind rate, each of which alone may be at fault."""

_AMPLE = 90.0
"""More than any boat needs of a limit to reach its speed, to turn or to stop: m/s2, deg/s, deg/s2."""

_unproved: ContextVar[bool] = ContextVar("unproved", default=False)


@contextmanager
def reference_models() -> Iterator[None]:
    """While inside, new platforms are not checked. Models are tested on such rails and cars with known answers.

    Never give such a platform to a shield. The package's own boats are also built in here: its tests check them, so
    that an import compiles nothing.
    """
    token = _unproved.set(True)
    try:
        yield
    finally:
        _unproved.reset(token)


def fault_of(platform: Platform) -> str | None:
    """Describe what a platform cannot do in its own model, and which settings decide it; None if it has no fault."""
    if _unproved.get():
        return None
    return _fault_of(platform.pack().tobytes())


@lru_cache(maxsize=256)
def _fault_of(packed: bytes) -> str | None:
    params = np.frombuffer(packed, np.float64).copy()
    state = fresh_state(0.0, 0.0, 0.0)
    for manoeuvre, fault_in in (("speed", _fault_in_speed), ("turn", _fault_in_turn), ("stop", _fault_in_stop)):
        before = state.copy()
        fault = fault_in(params, state)
        if fault:
            return f"{fault}; give its {_at_fault(manoeuvre, params, before, fault_in)}"
    return None


def _fault_in_speed(params: Array, state: Array) -> str:
    top_mps = float(params[L.MAX_SPEED])
    fastest = _run(params, state, top_mps, 0.0)
    if fastest >= REACHED * top_mps:
        return ""
    return f"commanded {top_mps:g} m/s it comes to {fastest:.3g} m/s within {WITHIN_S:g} s"


def _fault_in_turn(params: Array, state: Array) -> str:
    off_deg = _turn(params, state, float(params[L.MAX_SPEED]))
    if off_deg <= NEAR_DEG:
        return ""
    return f"commanded to turn, {off_deg:.3g} of {TURN_DEG:g} deg are left after {WITHIN_S:g} s"


def _fault_in_stop(params: Array, state: Array) -> str:
    _run(params, state, 0.0, 0.0)
    if state[L.SPEED] <= STOPPED * params[L.MAX_SPEED]:
        return ""
    return f"commanded to stop it does {state[L.SPEED]:.3g} m/s after {WITHIN_S:g} s"


def _at_fault(manoeuvre: str, params: Array, state: Array, fault_in: Callable[[Array, Array], str]) -> str:
    """Return the settings of which each alone, with another value, repairs a manoeuvre begun in ``state``.

    If there are none, return all settings of the manoeuvre.
    """
    kind, found = int(params[L.KIND]), []
    trials = [(name, column, max(_AMPLE, float(params[column]))) for name, column in _LIMITS[manoeuvre].items()]
    if kind == L.KIND_RATE:
        trials.append((*_LAGS[manoeuvre], 0.0))
    if kind == L.KIND_USV and manoeuvre == "turn":
        trials = [("full_turn_speed_mps", L.FULL_TURN_SPEED, 0.0)]
    for name, column, value in trials:
        mended = params.copy()
        mended[column] = value
        if not fault_in(mended, state.copy()):
            found.append(name)
    return " or ".join(found) or _REMEDIES[manoeuvre].get(kind, " and ".join(_LIMITS[manoeuvre]))


def _run(params: Array, state: Array, speed_mps: float, error_deg: float) -> float:
    """Return the highest speed, m/s, of a run under one command, straight ahead."""
    highest = 0.0
    for _ in range(round(WITHIN_S / DT_S)):
        step_boat(params, state, speed_mps, error_deg, DT_S)
        highest = max(highest, float(state[L.SPEED]))
    return highest


def _turn(params: Array, state: Array, speed_mps: float) -> float:
    """Return the smallest distance, deg, from the commanded heading."""
    goal, nearest = float(state[L.HEADING]) + TURN_DEG, TURN_DEG
    for _ in range(round(WITHIN_S / DT_S)):
        error_deg = float(wrap_degrees(goal - state[L.HEADING]))
        nearest = min(nearest, abs(error_deg))
        step_boat(params, state, speed_mps, error_deg, DT_S)
    return nearest
