"""Clearance from one pursuer that steers for the boat as hard as it is granted."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..jit import Array, lean_kernel
from .clearance import Leg, Search, nearest_on

LONGEST_STRIDE = 6
"""Samples a pursuer far away is moved on at once."""

CHASE_STRIDE = 4
"""Samples a pursuer that is near is moved on at once when it follows a boat that has long run straight."""


class Pursuer(NamedTuple):
    """A neighbour that steers for the boat, and what is granted to it.

    Attributes:
        x: its position now, east, m.
        y: north, m.
        ux: its heading as a unit vector, east.
        uy: north.
        speed_mps: its speed, m/s.
        top_speed_mps: its top speed, m/s.
        acc_mps2: its acceleration, m/s^2.
        dec_mps2: rate at which it loses speed in a turn, m/s^2.
        loss: share of its top speed it loses in a turn of ``turn_rad`` per sample.
        turn_rad: its turn per sample, rad.
        lead: steer for the meeting point instead of the boat itself.
    """

    x: float
    y: float
    ux: float
    uy: float
    speed_mps: float
    top_speed_mps: float
    acc_mps2: float
    dec_mps2: float
    loss: float
    turn_rad: float
    lead: bool


class Pursuit(NamedTuple):
    """For how long a pursuer is followed, and what that comes to.

    Attributes:
        sample_s: time between samples, s.
        samples: last sample.
        adverse: sample from which on it holds its course and speed.
        closely: sample from which on the boat runs straight: it is followed in longer strides.
        ahead: most samples by which it leads the boat.
        fade: factor of negative margins per sample, 0 to 1.
        to_end: follow it to the last sample also when it comes near no more.
    """

    sample_s: float
    samples: int
    adverse: int
    closely: int
    ahead: float
    fade: float
    to_end: bool


@lean_kernel
def _faded(worst: float, weight: float, radius_m: float, leg: Leg) -> float:
    """Least margin over a leg, weighted when negative, where that is below ``worst``; else that."""
    limit = radius_m + (worst if worst >= 0.0 else worst / weight)
    if limit <= 0.0:
        return worst
    _, x, y = nearest_on(leg)
    square = x * x + y * y
    if square >= limit * limit:
        return worst
    margin = math.sqrt(square) - radius_m
    return margin if margin >= 0.0 else margin * weight


@lean_kernel
def _aim(rx: float, ry: float, vx: float, vy: float, way: float, ahead: float) -> tuple[float, float]:
    """Where a pursuer steers: to the point where it meets the boat if that keeps its velocity.

    Where there is none, or one far off, it steers ``ahead`` samples ahead of the boat: one about as fast as the boat
    and on its quarter comes nearest by closing in slowly on an all but parallel course.
    (rx, ry) points from pursuer to boat; (vx, vy) is the boat's and ``way`` the pursuer's movement per sample, m.
    """
    a = vx * vx + vy * vy - way * way
    b = rx * vx + ry * vy
    c = rx * rx + ry * ry
    root = b * b - a * c
    if root <= 0.0:
        return rx + ahead * vx, ry + ahead * vy
    root = math.sqrt(root)
    time = -1.0
    if abs(a) < 1e-9:
        time = -0.5 * c / b if b < 0.0 else -1.0
    else:
        early, late = (-b - root) / a, (-b + root) / a
        if early > late:
            early, late = late, early
        time = early if early > 0.0 else late
    if time <= 0.0:
        return rx + ahead * vx, ry + ahead * vy
    time = min(time, ahead)
    return rx + time * vx, ry + time * vy


@lean_kernel
def _turn_towards(ux: float, uy: float, ax: float, ay: float, c: float, s: float) -> tuple[float, float, float]:
    """Heading (ux, uy) turned towards (ax, ay) by the most there is, cosine c and sine s, and the share of it used."""
    along, across = ux * ax + uy * ay, ux * ay - uy * ax
    if along > 0.0 and abs(across) * c <= along * s:
        norm = math.sqrt(ax * ax + ay * ay)
        if norm <= 1e-12:
            return ux, uy, 1.0
        return ax / norm, ay / norm, min(1.0, abs(across) / (norm * s)) if s > 0.0 else 0.0
    if across >= 0.0:
        return c * ux - s * uy, s * ux + c * uy, 1.0
    return c * ux + s * uy, c * uy - s * ux, 1.0


@lean_kernel
def _speed_after(speed_mps: float, steady_mps: float, acc_mps2: float, dec_mps2: float, time_s: float) -> float:
    """Speed some time on of a pursuer whose speed in the present turn would settle at the steady one."""
    if speed_mps > steady_mps:
        return max(steady_mps, speed_mps - dec_mps2 * time_s)
    return min(steady_mps, speed_mps + acc_mps2 * time_s)


@lean_kernel
def stays_away(
    own: Array, x: float, y: float, way: float, samples: int, closing_m: float, radius_m: float, cap_m: float
) -> bool:
    """Whether nobody who starts at (x, y) and goes at most ``way`` per sample, m, lowers the margin from its cap.

    That is wherever it steers: the boat stays clear of all points it may have reached by then, and by so much more that
    the longest strides of `roll_out_pursuer` make no difference. False when in doubt; for the rest see there.
    """
    spare = 0.5 * CHASE_STRIDE
    root, per_m = radius_m + cap_m, 1.0 / closing_m
    k = 0
    while k <= samples:
        dx, dy = own[k, 0] - x, own[k, 1] - y
        free = (math.sqrt(dx * dx + dy * dy) - way * k - root) * per_m - spare
        if not free >= 1.0:
            return False
        k += int(min(free, samples + 1))
    return True


@lean_kernel
def roll_out_pursuer(own: Array, pursuer: Pursuer, pursuit: Pursuit, search: Search, end: Array) -> tuple[float, float]:
    """Clearance from a neighbour on a collision course: it steers for the boat with lead, as hard as it is granted.

    Negative margins fade with the time until they come about: a graze far off is less of an evil than a ramming soon,
    for pursuers rarely play as well as they are granted to.

    Args:
        own: the boat's path, m.
        pursuer: the neighbour.
        pursuit: how long it is followed.
        search: how closely it is looked at.
        end: where it is then, shape (5,): x, y, m, heading as a unit vector, speed m/s; written where the search comes
            to the end.

    Returns:
        The margin, m, and the factor that negative margins have faded by at the end.
    """
    x, y, ux, uy, speed_mps = pursuer.x, pursuer.y, pursuer.ux, pursuer.uy, pursuer.speed_mps
    closing_m, samples, adverse, turn_rad = search.closing_m, pursuit.samples, pursuit.adverse, pursuer.turn_rad
    root = search.radius_m + search.cap_m
    fastest_mps = max(pursuer.top_speed_mps, speed_mps)
    worst = search.cap_m
    worth = (root + 2.0 * closing_m) * (root + 2.0 * closing_m)
    weight = 1.0
    c1, s1 = math.cos(turn_rad), math.sin(turn_rad)
    x0, y0 = own[0, 0] - x, own[0, 1] - y
    k = 0
    while k < samples:
        stride = 1 if k < pursuit.closely else CHASE_STRIDE
        square = x0 * x0 + y0 * y0
        if square > worth:
            free = int((math.sqrt(square) - root) / closing_m)
            if free >= samples - k and not pursuit.to_end:
                break
            stride = max(stride, min(free, LONGEST_STRIDE))
        stride = min(stride, samples - k)
        if k < adverse:
            stride = min(stride, adverse - k)
        c, s = c1, s1
        for _ in range(stride - 1):
            c, s = c * c1 - s * s1, s * c1 + c * s1
        k += stride
        ax, ay = own[k, 0] - x, own[k, 1] - y
        if pursuer.lead:
            before = k - stride
            vx, vy = (own[k, 0] - own[before, 0]) / stride, (own[k, 1] - own[before, 1]) / stride
            ax, ay = _aim(x0, y0, vx, vy, speed_mps * pursuit.sample_s, pursuit.ahead)
        time_s, new_speed = stride * pursuit.sample_s, speed_mps
        if k <= adverse:
            ux, uy, rudder = _turn_towards(ux, uy, ax, ay, c, s)
            steady_mps = fastest_mps * (1.0 - pursuer.loss * rudder)
            new_speed = _speed_after(speed_mps, steady_mps, pursuer.acc_mps2, pursuer.dec_mps2, time_s)
        way = 0.5 * (speed_mps + new_speed) * time_s
        speed_mps = new_speed
        x += way * ux
        y += way * uy
        x1, y1 = own[k, 0] - x, own[k, 1] - y
        for _ in range(stride):
            weight *= pursuit.fade
        worst = _faded(worst, weight, search.radius_m, Leg(x0, y0, x1, y1))
        if worst < search.floor_m:
            return worst, weight
        x0, y0 = x1, y1
    end[0], end[1], end[2], end[3], end[4] = x, y, ux, uy, speed_mps
    return worst, weight
