"""The quadratic program, linearised about candidate commands: its rows, and commands made of its answer."""

from __future__ import annotations

import math

from ..backup.effort import ROW_COST
from ..jit import Array, copy_row, lean_kernel
from ..plan import Plan
from ..platforms import layout as L
from ..platforms.actuator import command_for_turn
from ..scene import Scene
from .active_set import OPTIMAL, project
from .rows import build_rows, inputs_of

SAME = 1e-6
"""Scaled input change below which a command counts as unchanged and the wanted one is sent."""


@lean_kernel
def build(count: int, scene: Scene) -> int:
    """Linearise about the candidate commands; returns the number of rows, -1 when there are too many."""
    work, plan = scene.work, scene.plan
    for m in range(count):
        work.spent[0] += work.cost[plan.movers[m]]
    inputs_of(count, scene)
    rows = build_rows(count, scene)
    work.spent[0] += ROW_COST * rows * count
    return rows


@lean_kernel
def solve_compiled(count: int, rows: int, plan: Plan) -> bool:
    """Solve the program by projection; False when it has no solution."""
    n = 2 * count
    return project(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n], plan.z[:n]) == OPTIMAL


@lean_kernel
def take_answer(z: Array, count: int, scene: Scene) -> bool:
    """Turn scaled inputs into the commands whose autopilot yields them; False when any of them is not finite.

    A boat whose inputs are unchanged keeps its wanted command, bit for bit.
    """
    state, boats, tuning, plan = scene.state, scene.boats, scene.tuning, scene.plan
    root = math.sqrt(tuning.speed_weight)
    for m in range(2 * count):
        if not math.isfinite(z[m]):
            return False
    for m in range(count):
        i = plan.movers[m]
        wanted = plan.screened[i]
        same_speed = abs(z[2 * m + 1] - plan.z0[2 * m + 1]) <= SAME
        if same_speed and abs(z[2 * m] - plan.z0[2 * m]) <= SAME:
            copy_row(plan.commands[i], wanted)
            continue
        speed = z[2 * m + 1] / root * boats.params[i, L.MAX_SPEED]
        speed = wanted[0] if same_speed else max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
        plan.commands[i, 0] = speed
        plan.commands[i, 1] = command_for_turn(
            boats.params[i], state[i], speed, z[2 * m] * plan.gain[i, 2], tuning.dt_s
        )
    return True
