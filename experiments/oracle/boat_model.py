"""Model of boat and autopilot, written from their published equations for the post-hoc analysis alone.

``p`` is a parameter row of `N_ROW` columns: kind (0 usv, 1 single, 2 double integrator, 3 rate), top speed, speed
factor, max thrust, max rudder, turn loss, turn rate, max acc, max dec, rotation; speed kp, ki, kd, limit, gain; heading
kp, ki, kd, limit; max turn rate, max angular acceleration (of a usv: the speed from which it turns at its turn rate);
number of points of the thrust map, 8 thrusts, 8 speeds.
``s`` is a state row of `N_STATE` columns.
"""

from __future__ import annotations

import contextlib
import hashlib
import math
from collections.abc import Callable, Iterable
from dataclasses import astuple, dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numba.core.caching import FunctionCache
from numpy.typing import NDArray

from .verdict import Array as Array
from .verdict import OracleError

F = TypeVar("F", bound=Callable[..., Any])
IntArray = NDArray[np.int64]
N_STATE, N_ROW = 11, 38
"""Columns of a state row (x, y, heading, speed, thrust, rudder, speed error and integral, heading error and integral,
turn rate), and of a parameter row."""
MEMORY = (6, 8)
"""Columns of a state that are NaN until the controllers first run."""
KINDS = ("usv", "single_integrator", "double_integrator", "rate")
MAP_SIZE, THRUSTS, SPEEDS = 21, 22, 30
"""Columns of the thrust map in a parameter row."""
LARGEST_ERROR_DEG = 179.9
"""Largest relative heading commanded, deg: at 180 an absolute heading leaves the side of the turn open."""
DOWN, HOLD, UP = 0, 1, 2
"""Speed choices of a search: slow down, hold the thrust, speed up."""


@dataclass(frozen=True)
class Boat:
    """A boat and its autopilot. Speeds m/s, accelerations m/s2, angles deg, thrust and rudder percent.

    Controllers are kp, ki, kd, integral limit. Kind "usv" steers by thrust and rudder; its ``turn_rate`` is at full
    rudder and thrust 50, and, if ``max_angular_acc`` is above 0, from that speed, m/s, on (in proportion below). Kind
    "rate" steers by a rate loop: ``max_rudder`` is its turn rate at rest, deg/s; ``turn_rate`` the gain with speed,
    deg/s per m/s; the heading kp the rate commanded per deg of error, 1/s; kd of both controllers are lags, s. With a
    speed factor of 0, a speed controller changes the thrust. A max acc or dec of 0 means no limit.

    Raises:
        OracleError: values no boat can have.
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
        rows_of([self])

    def row(self) -> Array:
        """Return the parameter row."""
        plain = [value for entry in astuple(self)[1:-1] for value in np.atleast_1d(entry)]
        points = np.zeros((SPEEDS - THRUSTS, 2))
        points[: len(self.thrust_map)] = self.thrust_map
        return np.array([KINDS.index(self.kind), *plain, len(self.thrust_map), *points.T.ravel()], dtype=np.float64)


def rows_of(boats: Iterable[Any]) -> Array:
    """Return parameter rows (n, N_ROW) of boats given as `Boat`s or as the simulator's rows.

    Raises:
        OracleError: wrong shape, or values no boat can have.
    """
    given = [boat.row() if isinstance(boat, Boat) else np.asarray(boat, dtype=np.float64) for boat in boats]
    for row in given:
        if row.shape != (N_ROW,):
            raise OracleError(f"a parameter row has {N_ROW} columns; got shape {row.shape}: give one row per boat")
        if not np.isfinite(row).all() or not (0 <= row[0] < len(KINDS) and row[1] > 0.0):
            raise OracleError(f"a parameter row is not finite, of no kind or without a top speed: {row.tolist()}")
        size = int(row[MAP_SIZE])
        if not (2 <= size <= SPEEDS - THRUSTS and (np.diff(row[THRUSTS:][:size]) > 0.0).all()):
            raise OracleError(f"a thrust map needs 2 to 8 map points with rising thrust; got {row[MAP_SIZE:].tolist()}")
    return np.array(given).reshape(-1, N_ROW)


def top_mps(p: Array) -> float:
    """Return a speed over ground the boat never exceeds, m/s, if it starts within its top speed."""
    return float(max(p[1], p[SPEEDS:][: int(p[MAP_SIZE])].max()))


@cache
def _stamp() -> tuple[str, int]:
    """Return a fingerprint of the whole folder: numba tracks one file, but functions are inlined across files."""
    files = sorted(Path(__file__).parent.glob("*.py"))
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).hexdigest(), len(files)


class _Kept(FunctionCache):
    """numba's disk cache that rewrites unreadable files and caches nothing on a full disk."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled code of a signature, or None if it must be compiled."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # a damaged file can raise anything
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Save the compiled code of a signature."""
        try:
            super().save_overload(sig, data)
        except Exception:  # unreadable index, or nothing can be written
            with contextlib.suppress(OSError):
                self.flush()
                super().save_overload(sig, data)


def compiled(function: F) -> F:
    """Compile with numba, with IEEE division and no fast-math."""
    dispatcher: Any = njit(nogil=True, error_model="numpy")(function)
    with contextlib.suppress(RuntimeError, OSError):  # no writable folder: compile at every start
        kept = _Kept(function)
        kept._cache_file._source_stamp = _stamp()
        dispatcher._cache = kept
    return cast(F, dispatcher)


@compiled
def within(value: float, limit: float) -> float:
    """Clip to [-limit, limit]."""
    return max(-limit, min(limit, value))


@compiled
def speed_at(p: Array, thrust: float) -> float:
    """Return the straight-line speed of a thrust, m/s: linear between points of the map, constant beyond its ends."""
    if thrust <= p[THRUSTS]:
        return p[SPEEDS]
    last = int(p[MAP_SIZE]) - 1
    for i in range(1, last + 1):
        if thrust <= p[THRUSTS + i]:
            share = (thrust - p[THRUSTS + i - 1]) / (p[THRUSTS + i] - p[THRUSTS + i - 1])
            return p[SPEEDS + i - 1] + share * (p[SPEEDS + i] - p[SPEEDS + i - 1])
    return p[SPEEDS + last]


@compiled
def _controller(p: Array, s: Array, at: int, memory: int, error: float, dt_s: float, most: float) -> float:
    """Return the output of the controller with gains from ``p[at]`` on and memory from ``s[memory]`` on."""
    slope = 0.0 if math.isnan(s[memory]) else (error - s[memory]) / dt_s
    s[memory] = error
    s[memory + 1] = within(s[memory + 1] + p[at + 1] * error * dt_s, p[at + 3])
    return within(p[at] * error + s[memory + 1] + p[at + 2] * slope, most)


@compiled
def _usv(p: Array, s: Array, speed_mps: float, error_deg: float, dt_s: float) -> None:
    """Advance thrust, rudder, then the hull."""
    thrust = p[2] * speed_mps
    if p[2] == 0.0:
        thrust = s[4] + p[14] * _controller(p, s, 10, 6, speed_mps - s[3], dt_s, p[3])
    s[4] = within(thrust, p[3]) if thrust >= 0.01 else 0.0
    s[5] = 0.0
    if s[4] > 0.0:
        s[5] = _controller(p, s, 15, 8, error_deg, dt_s, min(p[4], 100.0))
    speed = speed_at(p, s[4]) * (1.0 - p[5] * abs(s[5]) / 100.0)
    if p[7] > 0.0:
        speed = min(speed, s[3] + p[7] * dt_s)
    if p[8] > 0.0:
        speed = max(speed, s[3] - p[8] * dt_s)
    turn = s[5] / 100.0 * p[6] * dt_s * abs(s[4]) / 50.0
    turn = 0.0 if speed == 0.0 else math.copysign(1.0, s[4]) * turn
    if p[20] > 0.0:
        turn *= max(0.0, min(1.0, speed / p[20]))
    mean = 0.5 * (speed + s[3])
    _go(s, mean, turn + p[9] * dt_s, dt_s)
    s[3] = max(0.0, min(mean, p[1]))


@compiled
def _turns(p: Array, speed_mps: float) -> float:
    """Return the highest turn rate at a speed, deg/s."""
    return max(0.0, min(p[19], p[4] + p[6] * speed_mps))


@compiled
def _lag(lag_s: float, dt_s: float) -> float:
    return 1.0 if lag_s <= 0.0 else 1.0 - math.exp(-dt_s / lag_s)


@compiled
def _integrate(p: Array, s: Array, speed_mps: float, error_deg: float, dt_s: float) -> None:
    """Advance integrators and rate-loop boats; the loop's rate is kp e, a square root beyond a corner (ArduPilot)."""
    if p[0] == 1.0:
        speed, rate = within(speed_mps, p[1]), within(error_deg / dt_s, p[19])
    elif p[0] == 3.0:
        error, corner = error_deg - 0.5 * dt_s * s[10], p[20] / p[15] ** 2
        asked = p[15] * abs(error)
        if abs(error) > corner:
            asked = math.sqrt(p[20] * (2.0 * abs(error) - corner))
        asked = within(math.copysign(asked, error), _turns(p, s[3]))
        rate = s[10] + within(_lag(p[17], dt_s) * (asked - s[10]), p[20] * dt_s)
        held = max(0.0, min(speed_mps, p[1])) * max(0.0, 1.0 - p[5] * abs(rate) / p[19])
        speed = s[3] + max(-p[8] * dt_s, min(p[7] * dt_s, _lag(p[12], dt_s) * (held - s[3])))
        s[10] = rate
    else:
        speed = within(s[3] + dt_s * within((speed_mps - s[3]) / dt_s, p[7]), p[1])
        rate = within(s[10] + dt_s * within((error_deg / dt_s - s[10]) / dt_s, p[20]), p[19])
        s[10] = rate
    _go(s, 0.5 * (speed + s[3]), rate * dt_s, dt_s)
    s[3] = max(0.0, min(speed, p[1]))


@compiled
def _go(s: Array, speed_mps: float, turn_deg: float, dt_s: float) -> None:
    course = math.radians(s[2] + 0.5 * turn_deg)
    s[0] += speed_mps * dt_s * math.sin(course)
    s[1] += speed_mps * dt_s * math.cos(course)
    s[2] = turned(s[2], turn_deg)


@compiled
def turned(heading_deg: float, turn_deg: float) -> float:
    """Return the heading after a turn, within [-180, 180]."""
    heading = heading_deg + turn_deg
    if heading > 180.0:
        return heading - 360.0
    return heading + 360.0 if heading < -180.0 else heading


@compiled
def step(p: Array, s: Array, speed_mps: float, error_deg: float, dt_s: float) -> None:
    """Advance boat and autopilot by ``dt_s``, in place, under a commanded speed and relative heading."""
    if p[0] != 0.0:
        _integrate(p, s, speed_mps, error_deg, dt_s)
    else:
        _usv(p, s, speed_mps, error_deg, dt_s)


@compiled
def command_of(p: Array, s: Array, choice: int, rudder: float, dt_s: float) -> tuple[float, float]:
    """Return the command (speed m/s, relative heading deg) that makes the autopilot apply a choice of the search.

    The derivative of the heading controller responds at once, so nearly any rudder (share of full, or of the turn rate,
    positive to the right) is available in any step. Beyond a relative heading of 179.9 deg the command is clipped, and
    the boat does what the clipped command yields.
    """
    if choice == HOLD:
        speed = s[4] / p[2] if p[0] == 0.0 and p[2] != 0.0 else s[3]
    else:
        speed = 0.0 if choice == DOWN else p[1]
    if p[0] == 3.0:
        asked = rudder * _turns(p, s[3])
        error = abs(asked) / p[15]
        if error > p[20] / p[15] ** 2:
            error = 0.5 * (asked**2 / p[20] + p[20] / p[15] ** 2)
        return speed, within(math.copysign(error, asked) + 0.5 * dt_s * s[10], LARGEST_ERROR_DEG)
    if p[0] != 0.0:
        return speed, within(rudder * p[19] * dt_s, LARGEST_ERROR_DEG)
    return speed, within(_error_for(p, s, rudder * min(p[4], 100.0), dt_s), LARGEST_ERROR_DEG)


@compiled
def _error_for(p: Array, s: Array, rudder: float, dt_s: float) -> float:
    """Solve kp e + I + ki e dt + kd (e - last)/dt = rudder for the heading error e, with I clipped at its limit."""
    slope, known = p[15], rudder
    if not math.isnan(s[8]):
        slope += p[17] / dt_s
        known += p[17] / dt_s * s[8]
    steep = slope + p[16] * dt_s
    if steep <= 0.0:
        return 0.0
    error = (known - s[9]) / steep
    if abs(s[9] + p[16] * dt_s * error) <= p[18] or slope <= 0.0:
        return error
    return (known - within(s[9] + p[16] * dt_s * error, p[18])) / slope


@compiled
def replay(p: Array, start: Array, commands: Array, others: Array, dt_s: float, path: Array, headings: Array) -> float:
    """Simulate a boat under commands (S, 2); return its smallest distance to the others (S+1, m, 2) after any step, m.

    Writes positions into ``path`` (S+1, 2) and the heading before each step, deg, into ``headings`` (S,).
    """
    s, closest = start.copy(), np.inf
    path[0, 0], path[0, 1] = s[0], s[1]
    for k in range(commands.shape[0]):
        headings[k] = s[2]
        step(p, s, commands[k, 0], commands[k, 1], dt_s)
        path[k + 1, 0], path[k + 1, 1] = s[0], s[1]
        for m in range(others.shape[1]):
            dx, dy = others[k + 1, m, 0] - s[0], others[k + 1, m, 1] - s[1]
            closest = min(closest, math.sqrt(dx * dx + dy * dy))
    return closest
