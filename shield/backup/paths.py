"""Paths of backup manoeuvres: a turn to one side, then straight on, at a set speed.

``rudder`` is the share of full rudder in the turn, clockwise when > 0.

Paths are sampled every ``stride`` steps of the boat's model. Sample 0 is where the boat is one step from now: after
the candidate command, or after the manoeuvre's own first step.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..jit import Array, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import actuate, full_turn, held_rudder
from ..platforms.usv import kept_share, next_thrust, speed_of_thrust, speed_towards, turn_of_rudder

SAG_M = 0.022
"""Largest distance between the arc sailed between two samples and the straight line, m."""

FULL_THRUST_SAMPLE, FULL_THRUST_HEADING, FULL_THRUST_SPEED = range(3)
"""Notes on a path: the sample where thrust is full (-1: never), heading, rad, and speed, m/s, there."""

STEADY_SPEED = 1e-4
"""Change of speed (m/s) plus thrust (percent) per step below which a straight run counts as steady."""

ALIKE = 1e-4
"""A run settles if consecutive steps predict the same remaining gain of speed, to this share of it."""

SETTLED_MPS = 1e-3
"""It must also settle within this of the commanded speed, m/s, and that speed must exceed this: at 0 it is cut off.

Only a boat that gains speed counts: one that slows down may seem to settle there for one step on its way below."""


class Manoeuvre(NamedTuple):
    """A turn to one side, then straight on.

    Attributes:
        rudder: share of full rudder in the turn, clockwise when > 0.
        togo_deg: turn left before running straight, deg, >= 0.
        speed_mps: speed commanded throughout, m/s.
    """

    rudder: float
    togo_deg: float
    speed_mps: float


class Span(NamedTuple):
    """Which part of a manoeuvre's path is written, and how.

    Attributes:
        dt_s: model step, s.
        ahead: 0 if the manoeuvre starts in the present state. Else it starts in the state so many steps from now, and
            the samples until then are already written (the first, of one step, is written with the rest).
        stride: model steps between samples.
        samples: number of samples after sample 0.
        least: number of samples after which the path may end.
        beyond: number of samples for which the path continues after the one where thrust is full.
        earliest: first sample at which full thrust counts, at most ``samples``.
        full_thrust_percent: thrust, percent, that counts as full.
    """

    dt_s: float
    ahead: int
    stride: int
    samples: int
    least: int
    beyond: int
    earliest: int
    full_thrust_percent: float


class Straight(NamedTuple):
    """A straight run from (x, y), m, along the unit vector (ux, uy); x and ux east."""

    x: float
    y: float
    ux: float
    uy: float


class AtThrust(NamedTuple):
    """Result of a step at a thrust, percent: its turn, deg, and the speeds, m/s, tended to straight on and turning."""

    thrust: float
    turn_deg: float
    straight_mps: float
    turning_mps: float


class HalfTurn(NamedTuple):
    """A turn, deg, and cosine and sine of its half, in the direction of the manoeuvre."""

    turn_deg: float
    cosine: float
    sine: float


class Settling(NamedTuple):
    """How speed and thrust settle on a straight run: their shortfalls shrink in each step.

    Attributes:
        speed_mps: speed at which the run settles, m/s.
        short_mps: present shortfall from it, m/s; NaN: it does not settle yet.
        thrust: thrust at which the run settles, percent.
        short_thrust: present shortfall from it, percent.
        rate: share of both shortfalls that is left after a step.
        fall_mps: gain of speed in a step while it is constant, m/s; 0: it is not.
    """

    speed_mps: float
    short_mps: float
    thrust: float
    short_thrust: float
    rate: float
    fall_mps: float


@lean_kernel
def angle_to_go(heading_deg: float, target_deg: float, rudder: float) -> float:
    """Return the turn, deg in [0, 360), to a heading, going clockwise (rudder > 0) or the other way (< 0)."""
    return ((target_deg - heading_deg) * math.copysign(1.0, rudder)) % 360.0


@lean_kernel
def sail(params: Array, row: Array, rudder: float, togo_deg: float, speed_mps: float, dt_s: float) -> float:
    """Make one model step of a backup manoeuvre on ``row``, in place; return the turn left, deg."""
    before, sign = row[L.HEADING], math.copysign(1.0, rudder)
    turn = togo_deg
    if togo_deg > 0.0 and abs(rudder) < 1.0:
        turn = min(togo_deg, abs(rudder) * full_turn(params, row, speed_mps, dt_s))
    actuate(params, row, speed_mps, sign * turn, dt_s)
    if togo_deg <= 0.0:
        return 0.0
    turned = (row[L.HEADING] - before) * sign
    if turned < -180.0:
        turned += 360.0
    togo_deg -= turned
    return togo_deg if togo_deg > 1e-9 else 0.0


@lean_kernel
def _note_sample(
    k: int, at: Straight, speed_mps: float, thrust: float, span: Span, path: Array, full_thrust: Array
) -> None:
    """Write sample k; note if it is the first, from the earliest that counts, at which thrust is full."""
    path[k, 0], path[k, 1] = at.x, at.y
    if full_thrust[FULL_THRUST_SAMPLE] < 0.0 and k >= span.earliest and thrust >= span.full_thrust_percent:
        full_thrust[0], full_thrust[1], full_thrust[2] = k, math.atan2(at.ux, at.uy), speed_mps


@lean_kernel
def _note_state(k: int, span: Span, row: Array, path: Array, full_thrust: Array) -> None:
    """Write sample k from a state."""
    path[k, 0], path[k, 1] = row[L.X], row[L.Y]
    if full_thrust[FULL_THRUST_SAMPLE] < 0.0 and k >= span.earliest and row[L.THRUST] >= span.full_thrust_percent:
        full_thrust[0], full_thrust[1], full_thrust[2] = k, math.radians(row[L.HEADING]), row[L.SPEED]


@lean_kernel
def _note_done(ahead: int, span: Span, row: Array, path: Array, full_thrust: Array) -> tuple[int, int]:
    """Write the sample of the state ``ahead`` steps from now, if one is due; return the next sample and the step."""
    step = ahead - 1
    k = step // span.stride
    if step % span.stride == 0:
        _note_state(k, span, row, path, full_thrust)
    return k + 1, step


@lean_kernel
def _last_sample(span: Span, full_thrust: Array) -> int:
    """Return the last sample of a path, as far as it is known."""
    if full_thrust[FULL_THRUST_SAMPLE] < 0.0:
        return span.samples
    return min(span.samples, max(span.least, int(full_thrust[FULL_THRUST_SAMPLE]) + span.beyond))


@lean_kernel
def trace_path(params: Array, row: Array, manoeuvre: Manoeuvre, span: Span, path: Array, full_thrust: Array) -> None:
    """Write positions, m, along a manoeuvre to ``path[: span.samples + 1]``, or fewer, see ``least`` and ``beyond``.

    Args:
        params: platform row of the boat.
        row: state to start from; used up.
        manoeuvre: the manoeuvre.
        span: what is written.
        path: shape (>= samples + 1, 2), float64.
        full_thrust: shape (3,), notes on the path, see `FULL_THRUST_SAMPLE`.
    """
    full_thrust[FULL_THRUST_SAMPLE] = -1.0
    if params[L.KIND] == L.KIND_USV and params[L.ROTATE_SPEED] == 0.0 and params[L.FULL_TURN_SPEED] == 0.0:
        _trace_usv(params, row, manoeuvre, span, path, full_thrust)
        return
    rudder, togo_deg, speed_mps, dt_s = manoeuvre.rudder, manoeuvre.togo_deg, manoeuvre.speed_mps, span.dt_s
    if span.ahead == 0:
        togo_deg = sail(params, row, rudder, togo_deg, speed_mps, dt_s)
    k, step = _note_done(max(1, span.ahead), span, row, path, full_thrust)
    while k <= _last_sample(span, full_thrust):
        togo_deg = sail(params, row, rudder, togo_deg, speed_mps, dt_s)
        step += 1
        if step % span.stride == 0:
            _note_state(k, span, row, path, full_thrust)
            k += 1


@lean_kernel
def _at_thrust(params: Array, thrust: float, most: float, dt_s: float) -> AtThrust:
    """Return what depends on thrust alone in a step with the rudder at ``most``, percent."""
    turn, straight_mps = turn_of_rudder(params, thrust, most, dt_s), speed_of_thrust(params, thrust)
    rudder = most * turn / turn if turn != 0.0 else most  # at no thrust nothing turns
    return AtThrust(thrust, turn, straight_mps, straight_mps * kept_share(params, rudder))


@lean_kernel
def _turn_of_step(at: AtThrust, togo_deg: float, most: float, params: Array) -> tuple[float, float]:
    """Return the turn of a step, deg, with ``togo_deg`` left, and the speed, m/s, that the boat tends to in it."""
    if not (togo_deg > 0.0 and at.thrust > 0.0):
        return 0.0, at.straight_mps
    if togo_deg < at.turn_deg:
        return togo_deg, at.straight_mps * kept_share(params, most * togo_deg / at.turn_deg)
    return at.turn_deg, at.turning_mps


@lean_kernel
def _trace_usv(params: Array, row: Array, manoeuvre: Manoeuvre, span: Span, path: Array, full_thrust: Array) -> None:
    """Do the work of `trace_path` for boats that turn by thrust and rudder alone: in local variables, a unit vector.

    The turn of a step combines rudder, thrust and sign. The rudder is held until less than a step's turn is left; the
    last step ends on the mark. The boat moves along the mean heading of a step, half its turn from the old one. With
    `sail` alone, decisions take 1.4 times as long (42 scenes of 50 decisions), and differ by rounding.
    """
    rudder, togo_deg, speed_mps, dt_s = manoeuvre.rudder, manoeuvre.togo_deg, manoeuvre.speed_mps, span.dt_s
    x, y, v, heading = row[L.X], row[L.Y], row[L.SPEED], math.radians(row[L.HEADING])
    thrust, error, integral = row[L.THRUST], row[L.SPEED_ERROR], row[L.SPEED_INTEGRAL]
    ux, uy, top = math.sin(heading), math.cos(heading), params[L.MAX_SPEED]
    most, sign = held_rudder(params) * abs(rudder), math.copysign(1.0, rudder)
    at, half, gains = AtThrust(math.nan, 0.0, 0.0, 0.0), HalfTurn(0.0, 1.0, 0.0), (0.0, 0.0, 0.0)
    k, step = _note_done(span.ahead, span, row, path, full_thrust) if span.ahead > 0 else (0, -1)
    while k <= _last_sample(span, full_thrust):
        last = thrust
        thrust, error, integral = next_thrust(params, v, thrust, error, integral, speed_mps, dt_s)
        if thrust != at.thrust:
            at = _at_thrust(params, thrust, most, dt_s)
        turn, aim_mps = _turn_of_step(at, togo_deg, most, params)
        new_speed = speed_towards(params, v, aim_mps, dt_s)
        turn, mean, mx, my = turn if new_speed != 0.0 else 0.0, 0.5 * (new_speed + v), ux, uy
        if turn > 0.0:
            togo_deg = togo_deg - turn if togo_deg - turn > 1e-9 else 0.0
            if turn != half.turn_deg:
                half = _half_turn(turn, sign)
            mx, my = _turned(ux, uy, half)
            ux, uy = _turned(mx, my, half)
        x += mx * mean * dt_s
        y += my * mean * dt_s
        gains = mean - v, gains[0], gains[1]
        v = min(max(mean, 0.0), top)
        step += 1
        if step % span.stride != 0:
            continue
        pose = Straight(x, y, ux, uy)
        _note_sample(k, pose, v, thrust, span, path, full_thrust)
        k += 1
        if togo_deg <= 0.0 and turn == 0.0:
            end = _settling(v, min(speed_mps, top), gains, thrust, thrust - last, params)
            if end.short_mps >= 0.0:
                _run_on(pose, end, k, span, path, full_thrust)
                return


@lean_kernel
def _half_turn(turn_deg: float, sign: float) -> HalfTurn:
    """Return a turn with cosine and sine of its half."""
    angle = math.radians(0.5 * turn_deg) * sign
    return HalfTurn(turn_deg, math.cos(angle), math.sin(angle))


@lean_kernel
def _turned(ux: float, uy: float, half: HalfTurn) -> tuple[float, float]:
    """Return a heading turned by half of a turn."""
    return ux * half.cosine + uy * half.sine, uy * half.cosine - ux * half.sine


@lean_kernel
def _share_left(gained: float, before: float, earlier: float) -> float:
    """Return the ratio of the last two gains if it equals the ratio before; 0: it does not, or nothing was gained."""
    if not min(gained, before, earlier) > 0.0:
        return 0.0
    rate = gained / before
    return rate if abs(rate - before / earlier) <= ALIKE * (1.0 - rate) else 0.0


@lean_kernel
def _settling(
    speed_mps: float,
    commanded_mps: float,
    gains: tuple[float, float, float],
    thrust: float,
    more_thrust: float,
    params: Array,
) -> Settling:
    """Return how a straight run settles at the commanded speed, by its last three gains, m/s, and its last thrust."""
    gained, before, earlier = gains
    if abs(gained) + abs(more_thrust) < STEADY_SPEED:
        return Settling(speed_mps, 0.0, thrust, 0.0, 0.0, 0.0)
    evenly = more_thrust == 0.0 and gained > 0.0 and abs(gained - before) <= ALIKE * gained
    if evenly and speed_mps < commanded_mps:  # all that a boat accelerates by; at its top speed it is held back
        end = Settling(commanded_mps, commanded_mps - speed_mps, thrust, 0.0, 1.0, gained)
    else:
        rate = _share_left(gained, before, earlier)
        left = rate / (1.0 - rate) if 0.0 < rate < 1.0 else math.nan
        short_mps, short_thrust = gained * left, more_thrust * left
        end = Settling(speed_mps + short_mps, short_mps, thrust + short_thrust, short_thrust, rate, 0.0)
    off_mps = max(abs(end.speed_mps - commanded_mps), abs(speed_of_thrust(params, end.thrust) - commanded_mps))
    if end.short_mps > 0.0 and off_mps < SETTLED_MPS < commanded_mps and end.thrust <= params[L.MAX_THRUST]:
        return end
    return Settling(math.nan, math.nan, math.nan, math.nan, 0.0, 0.0)  # else it only seems to settle


@lean_kernel
def _run_on(run: Straight, end: Settling, k: int, span: Span, path: Array, full_thrust: Array) -> None:
    """Fill the rest of a path, from sample k, with a straight run as its speed settles: this needs no model."""
    left, missed_s = 1.0, 0.0  # share of the shortfall left after a sample; and its integral over one, s
    for _ in range(span.stride):
        left *= end.rate
        missed_s += left * span.dt_s
    way_m, most_m = 0.0, end.speed_mps * span.stride * span.dt_s
    short_mps, short_thrust = end.short_mps, end.short_thrust
    last = _last_sample(span, full_thrust)
    while k <= last:
        if end.fall_mps == 0.0:
            way_m += most_m - short_mps * missed_s
            short_mps *= left
        else:  # by a constant gain, until half of the shortfall is less
            for _ in range(span.stride):
                short_mps = max(0.5 * short_mps, short_mps - end.fall_mps)
                way_m += (end.speed_mps - short_mps) * span.dt_s
        short_thrust *= left
        pose = Straight(run.x + way_m * run.ux, run.y + way_m * run.uy, run.ux, run.uy)
        _note_sample(k, pose, end.speed_mps - short_mps, end.thrust - short_thrust, span, path, full_thrust)
        last = _last_sample(span, full_thrust)
        k += 1
