"""The boat and its autopilot, written from their published equations, for the post-hoc analysis alone.

``p`` is `Boat.numbers`: kind, top speed, speed factor, max thrust, max rudder, turn loss, turn rate, max acc, max dec,
rotation, speed kp ki kd limit gain, heading kp ki kd limit, max turn rate, max angular acceleration, then the thrust
map's points. ``s`` is a state row of `N_STATE` columns.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .compiled import compiled
from .verdict import OracleError

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
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
    plain: dict[str, Any] = dict(zip([one.name for one in fields(Boat)][1:10], row[1:10], strict=True))
    return Boat(
        KINDS[int(row[0])],
        **plain,
        speed_pid=(row[10], row[11], row[12], row[13]),
        speed_gain=row[14],
        heading_pid=(row[15], row[16], row[17], row[18]),
        max_turn_dps=row[19],
        max_angular_acc=row[20],
        thrust_map=tuple(zip(thrusts, speeds, strict=True)),
    )


LARGEST_ERROR_DEG = 179.9
"""Largest relative heading commanded: at 180 an absolute heading no longer tells to which side."""
DOWN, HOLD, UP = 0, 1, 2
"""Speed choices of a search: slow down, leave the thrust as it is, speed up."""


@compiled
def within(value: float, limit: float) -> float:
    """Cut to [-limit, limit]."""
    return max(-limit, min(limit, value))


@compiled
def speed_at(p: Array, thrust: float) -> float:
    """Straight-line speed of a thrust, m/s, between the points of the map; flat beyond its ends."""
    last = p.size - 2
    if thrust <= p[21]:
        return p[22]
    for i in range(23, last + 1, 2):
        if thrust <= p[i]:
            share = (thrust - p[i - 2]) / (p[i] - p[i - 2])
            return p[i - 1] + share * (p[i + 1] - p[i - 1])
    return p[last + 1]


@compiled
def _set_thrust(p: Array, s: Array, speed_mps: float, dt_s: float) -> None:
    if p[2] != 0.0:
        thrust = p[2] * speed_mps
    else:
        error = speed_mps - s[3]
        slope = 0.0 if math.isnan(s[6]) else (error - s[6]) / dt_s
        s[6] = error
        s[7] = within(s[7] + p[11] * error * dt_s, p[13])
        thrust = s[4] + p[14] * within(p[10] * error + s[7] + p[12] * slope, p[3])
    s[4] = within(thrust, p[3]) if thrust >= 0.01 else 0.0


@compiled
def _set_rudder(p: Array, s: Array, error_deg: float, dt_s: float) -> None:
    if not s[4] > 0.0:
        s[5] = 0.0
        return
    slope = 0.0 if math.isnan(s[8]) else (error_deg - s[8]) / dt_s
    s[8] = error_deg
    s[9] = within(s[9] + p[16] * error_deg * dt_s, p[18])
    s[5] = within(p[15] * error_deg + s[9] + p[17] * slope, min(p[4], 100.0))


@compiled
def _hull(p: Array, s: Array, dt_s: float) -> None:
    thrust, rudder = s[4], s[5]
    speed = speed_at(p, thrust) * (1.0 - p[5] * abs(rudder) / 100.0)
    if p[7] > 0.0:
        speed = min(speed, s[3] + p[7] * dt_s)
    if p[8] > 0.0:
        speed = max(speed, s[3] - p[8] * dt_s)
    turn = rudder / 100.0 * p[6] * dt_s * abs(thrust) / 50.0
    turn = 0.0 if speed == 0.0 else math.copysign(1.0, thrust) * turn
    mean = 0.5 * (speed + s[3])
    _go(s, mean, turn + p[9] * dt_s, dt_s)
    s[3] = max(0.0, min(mean, p[1]))


@compiled
def _integrate(p: Array, s: Array, speed_mps: float, error_deg: float, dt_s: float) -> None:
    if p[0] == 1.0:
        speed, rate = within(speed_mps, p[1]), within(error_deg / dt_s, p[19])
    elif p[0] == 3.0:
        speed, rate = _rate_loop(p, s, speed_mps, _asked(p, error_deg - 0.5 * dt_s * s[10]), dt_s)
        s[10] = rate
    else:
        speed = within(s[3] + dt_s * within((speed_mps - s[3]) / dt_s, p[7]), p[1])
        rate = within(s[10] + dt_s * within((error_deg / dt_s - s[10]) / dt_s, p[20]), p[19])
        s[10] = rate
    _go(s, 0.5 * (speed + s[3]), rate * dt_s, dt_s)
    s[3] = max(0.0, min(speed, p[1]))


@compiled
def _lag(lag_s: float, dt_s: float) -> float:
    return 1.0 if lag_s <= 0.0 else 1.0 - math.exp(-dt_s / lag_s)


@compiled
def _turns(p: Array, speed_mps: float) -> float:
    """Highest turn rate at a speed, deg/s."""
    return max(0.0, min(p[19], p[4] + p[6] * speed_mps))


@compiled
def _asked(p: Array, error_deg: float) -> float:
    """Turn rate that a heading error asks for: kp e, beyond a corner its square root (ArduPilot)."""
    corner = p[20] / p[15] ** 2
    rate = p[15] * abs(error_deg)
    if abs(error_deg) > corner:
        rate = math.sqrt(p[20] * (2.0 * abs(error_deg) - corner))
    return math.copysign(rate, error_deg)


@compiled
def _rate_loop(p: Array, s: Array, speed_mps: float, asked_dps: float, dt_s: float) -> tuple[float, float]:
    """Speed and turn rate of a rate-controlled boat after a step."""
    rate = s[10] + within(_lag(p[17], dt_s) * (within(asked_dps, _turns(p, s[3])) - s[10]), p[20] * dt_s)
    wanted = max(0.0, min(speed_mps, p[1])) * max(0.0, 1.0 - p[5] * abs(rate) / p[19])
    change = _lag(p[12], dt_s) * (wanted - s[3])
    return s[3] + max(-p[8] * dt_s, min(p[7] * dt_s, change)), rate


@compiled
def _go(s: Array, speed_mps: float, turn_deg: float, dt_s: float) -> None:
    course = math.radians(s[2] + 0.5 * turn_deg)
    s[0] += speed_mps * dt_s * math.sin(course)
    s[1] += speed_mps * dt_s * math.cos(course)
    s[2] = turned(s[2], turn_deg)


@compiled
def turned(heading_deg: float, turn_deg: float) -> float:
    """Heading after a turn, within [-180, 180]."""
    heading = heading_deg + turn_deg
    if heading > 180.0:
        return heading - 360.0
    return heading + 360.0 if heading < -180.0 else heading


@compiled
def step(p: Array, s: Array, speed_mps: float, error_deg: float, dt_s: float) -> None:
    """Advance the whole boat by one step, in place.

    Args:
        p: parameters.
        s: state row.
        speed_mps: commanded speed.
        error_deg: commanded heading, relative to the boat's.
        dt_s: length of the step.
    """
    if p[0] != 0.0:
        _integrate(p, s, speed_mps, error_deg, dt_s)
        return
    _set_thrust(p, s, speed_mps, dt_s)
    _set_rudder(p, s, error_deg, dt_s)
    _hull(p, s, dt_s)


@compiled
def command_of(p: Array, s: Array, choice: int, rudder: float, dt_s: float) -> tuple[float, float]:
    """Command (speed m/s, relative heading deg) by which the autopilot now does what a search chose.

    The heading controller answers a command at once through its derivative, so nearly any rudder can be had in any
    step; what cannot (a relative heading beyond 179.9 deg) is cut, and the boat then does what the command gives.

    Args:
        p: parameters.
        s: state row.
        choice: DOWN, HOLD or UP.
        rudder: share of full rudder (or turn rate), -1 to 1, positive to the right.
        dt_s: length of the step.
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
    """Heading error for a rudder: kp e + I + ki e dt + kd (e - last)/dt = rudder, I cut at its limit."""
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
def gap_m(s: Array, others: Array) -> float:
    """Distance to the nearest of the others (m, 2), m; infinite without any."""
    nearest = np.inf
    for m in range(others.shape[0]):
        dx, dy = others[m, 0] - s[0], others[m, 1] - s[1]
        nearest = min(nearest, dx * dx + dy * dy)
    return math.sqrt(nearest)


@compiled
def replay(p: Array, start: Array, commands: Array, others: Array, dt_s: float, path: Array, headings: Array) -> float:
    """Drive a boat by commands and return the smallest distance to the others after any step, m.

    Args:
        p: parameters.
        start: state row at the beginning.
        commands: (S, 2) speed m/s, relative heading deg.
        others: (S+1, m, 2) tracks, index 0 at the beginning.
        dt_s: length of a step.
        path: (S+1, 2), filled with the positions.
        headings: (S,), filled with the heading before each step, deg.
    """
    s = start.copy()
    path[0, 0], path[0, 1] = s[0], s[1]
    closest = np.inf
    for k in range(commands.shape[0]):
        headings[k] = s[2]
        step(p, s, commands[k, 0], commands[k, 1], dt_s)
        path[k + 1, 0], path[k + 1, 1] = s[0], s[1]
        closest = min(closest, gap_m(s, others[k + 1]))
    return closest
