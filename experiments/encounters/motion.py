"""What the own team sees, and how all boats move: noise, delay, current. Compiled."""

from __future__ import annotations

import math

from steerclear.env.randomness import next_uniform
from steerclear.shield.jit import Array, IntArray, copy_row
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat
from steerclear.shield.platforms.usv import wrap_degrees

from ..jit import kernel
from . import script as S

NOISE_MEMORY_S = 2.0
"""Time over which a position error is forgotten, s."""


@kernel
def uniform(seeds: Array, b: int) -> float:
    """Next number of game b's own stream in (0, 1): never 0, whose logarithm is asked for."""
    return next_uniform(seeds, b) + 0.5 / 9007199254740992.0


@kernel
def observe(state: Array, error: Array, seeds: Array, bound_m: float, first: bool, dt_s: float, seen: Array) -> None:
    """States as the own team knows them: positions off by a slowly changing error within ``bound_m``.

    The error is a Gauss-Markov process, half the bound per axis, drawn back onto the circle where it leaves it.
    """
    keep = 0.0 if first else math.exp(-dt_s / NOISE_MEMORY_S)
    fresh = 0.5 * bound_m * math.sqrt(1.0 - keep * keep)
    for b in range(state.shape[0]):
        for i in range(state.shape[1]):
            copy_row(seen[b, i], state[b, i])
            if bound_m <= 0.0:
                continue
            size = fresh * math.sqrt(-2.0 * math.log(uniform(seeds, b)))
            angle = 2.0 * math.pi * uniform(seeds, b)
            error[b, i, 0] = keep * error[b, i, 0] + size * math.cos(angle)
            error[b, i, 1] = keep * error[b, i, 1] + size * math.sin(angle)
            length = math.hypot(error[b, i, 0], error[b, i, 1])
            if length > bound_m:
                error[b, i, 0] *= bound_m / length
                error[b, i, 1] *= bound_m / length
            seen[b, i, L.X] += error[b, i, 0]
            seen[b, i, L.Y] += error[b, i, 1]


@kernel
def move(
    state: Array,
    seen: Array,
    params: Array,
    team: IntArray,
    sent: Array,
    queue: Array,
    slot: int,
    current_mps: Array,
    dt_s: float,
) -> None:
    """One step of all boats, in place.

    Commands of own boats wait in ``queue`` (D, B, n, 2) as absolute headings for D steps; with D = 0 they are obeyed
    at once, bit for bit. A command is relative to the heading seen when it was given. The current carries all boats.
    """
    delayed = queue.shape[0]
    for b in range(state.shape[0]):
        for i in range(state.shape[1]):
            speed, error = sent[b, i, 0], sent[b, i, 1]
            if delayed > 0 and team[i] == 0:
                place = queue[slot, b, i]
                speed, error, given = place[0], wrap_degrees(place[1] - state[b, i, L.HEADING]), error
                place[0], place[1] = sent[b, i, 0], seen[b, i, L.HEADING] + given
            step_boat(params[i], state[b, i], speed, error, dt_s)
            state[b, i, L.X] += current_mps[b, 0] * dt_s
            state[b, i, L.Y] += current_mps[b, 1] * dt_s


@kernel
def reach_goals(
    state: Array, scripts: Array, goals: Array, time_s: float, goal_at: IntArray, first_goal_s: Array
) -> None:
    """Move boats on to their next goal where they reached one, and note when they reached the first."""
    for b in range(state.shape[0]):
        for i in range(state.shape[1]):
            goal = goals[b, i, goal_at[b, i]]
            gap = math.hypot(goal[0] - state[b, i, L.X], goal[1] - state[b, i, L.Y])
            if gap <= scripts[b, i, S.REACHED_M]:
                goal_at[b, i] = (goal_at[b, i] + 1) % goals.shape[2]
                if math.isnan(first_goal_s[b, i]):
                    first_goal_s[b, i] = time_s
