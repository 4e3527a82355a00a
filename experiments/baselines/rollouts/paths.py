"""Where boats will be, and how near: plans rolled out by the full model, predictions of others. Compiled.

A plan of a boat is one row: steps left of its first command, speed m/s and heading deg of that command, speed and
heading of the command after it. Headings are absolute, so that a plan means the same trajectory one step on.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import wrap_degrees

from ...jit import kernel
from .settings import HOLD_SPEED

N_PLAN = 5
NO_PLAN = -1.0
"""Steps left of a boat that has not decided yet."""


class Setup(NamedTuple):
    """Constants of a fleet of n boats.

    ``params`` (n, N_PARAM), ``limits`` (n, 3) of `textbook.inputs`, ``team`` (n,), ``library`` (M, 2), ``switches``
    in steps, ``steps`` of the horizon, ``worst``: opponents fill the disc they can reach, else they hold course.
    """

    params: Array
    limits: Array
    team: IntArray
    library: Array
    switches: IntArray
    steps: int
    radius_m: float
    dt_s: float
    worst: bool
    alpha_per_s: float
    pick: int


class Around(NamedTuple):
    """The other boats: who is ``near`` (n,), everybody's ``path`` (n, K, 2), and how discs ``grow`` (n,), m/s."""

    near: BoolArray
    path: Array
    grow: Array


@kernel
def advance(setup: Setup, i: int, row: Array, speed_mps: float, heading_deg: float) -> None:
    """One step of boat i under an absolute command, by hull and autopilot model, in place."""
    step_boat(setup.params[i], row, speed_mps, wrap_degrees(heading_deg - row[L.HEADING]), setup.dt_s)


@kernel
def command_of(setup: Setup, i: int, m: int, state: Array) -> tuple[float, float]:
    """Speed, m/s, and absolute heading, deg, of manoeuvre m begun now."""
    share = setup.library[m, 1]
    speed = state[L.SPEED] if share == HOLD_SPEED else share * setup.limits[i, 0]
    return speed, wrap_degrees(state[L.HEADING] + setup.library[m, 0])


@kernel
def roll_plan(setup: Setup, j: int, state: Array, plan: Array, path: Array) -> None:
    """Write the places (K, 2) of boat j under its plan; a boat without one holds course."""
    row = state.copy()
    path[0, 0], path[0, 1] = row[L.X], row[L.Y]
    for k in range(1, path.shape[0]):
        speed, heading = (plan[1], plan[2]) if k <= plan[0] else (plan[3], plan[4])
        if plan[0] == NO_PLAN:
            speed, heading = state[L.SPEED], state[L.HEADING]
        advance(setup, j, row, speed, heading)
        path[k, 0], path[k, 1] = row[L.X], row[L.Y]


@kernel
def predict_other(setup: Setup, state: Array, path: Array) -> None:
    """Write the places (K, 2) of an opponent: on its course, or at the centre of the disc it can reach."""
    course = math.radians(state[L.HEADING])
    speed = 0.0 if setup.worst else state[L.SPEED]
    for k in range(path.shape[0]):
        path[k, 0] = state[L.X] + k * setup.dt_s * speed * math.sin(course)
        path[k, 1] = state[L.Y] + k * setup.dt_s * speed * math.cos(course)


@kernel
def predict_all(setup: Setup, state: Array, ours: BoolArray, plan: Array, path: Array, grow: Array) -> None:
    """Places (n, K, 2) of all boats and growth (n,), m/s, of the discs around them."""
    for j in range(state.shape[0]):
        grow[j] = 0.0
        if ours[j]:
            roll_plan(setup, j, state[j], plan[j], path[j])
            continue
        predict_other(setup, state[j], path[j])
        if setup.worst:
            grow[j] = setup.limits[j, 0]


@kernel
def mark_near(setup: Setup, i: int, state: Array, steps: int, near: BoolArray) -> bool:
    """Mark (n,) whom boat i could touch within so many steps, both at top speed; whether there is anybody."""
    found = False
    for j in range(state.shape[0]):
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]) - setup.radius_m
        fast = setup.limits[i, 0] + max(setup.limits[j, 0], state[j, L.SPEED])
        near[j] = j != i and gap <= fast * steps * setup.dt_s
        found = found or near[j]
    return found


@kernel
def gap_at(setup: Setup, around: Around, k: int, x: float, y: float) -> float:
    """Least clearance of a place at step k from all who are near, m; 0 is the radius to keep."""
    path, least = around.path, math.inf
    for j in range(path.shape[0]):
        if around.near[j]:
            gap = math.hypot(path[j, k, 0] - x, path[j, k, 1] - y) - around.grow[j] * k * setup.dt_s
            least = min(least, gap)
    return least - setup.radius_m


@kernel
def gap_after(setup: Setup, around: Around, k: int, row: Array) -> float:
    """Least clearance for ever after step k if every boat then holds its course, m."""
    near, path, course = around.near, around.path, math.radians(row[L.HEADING])
    least = math.inf
    for j in range(near.shape[0]):
        if not near[j]:
            continue
        px, py = path[j, k, 0] - row[L.X], path[j, k, 1] - row[L.Y]
        vx = (path[j, k, 0] - path[j, k - 1, 0]) / setup.dt_s - row[L.SPEED] * math.sin(course)
        vy = (path[j, k, 1] - path[j, k - 1, 1]) / setup.dt_s - row[L.SPEED] * math.cos(course)
        square = vx * vx + vy * vy
        ahead_s = max(0.0, -(px * vx + py * vy) / square) if square > 1e-12 else 0.0
        least = min(least, math.hypot(px + ahead_s * vx, py + ahead_s * vy))
    return least - setup.radius_m
