"""PL-CBF: rollouts of a library of fallback policies, and one constraint of a quadratic program for the chosen mode.

Source: Kim, Okamoto, Hoxha, Fainekos, Panagou, "Policy Library CBF: Finite-Horizon Safety at Runtime via Parallel
Rollouts" (arXiv 2605.16588), and its authors' code (github.com/tkkim-robot/plcbf). The value of a policy m is the
least clearance of its rollout, V_m(x) = min over t in [0, T] of h(x_m(t)). The least invasive policy with V_m > 0 is
chosen; if there is none, the policy of greatest value. The program is

    minimise |u - u_nominal|^2   subject to   dV_m/dt >= -alpha V_m,   limits of u.

If it has no answer, or the answer violates the constraint on the boat's own model, the boat follows the policy itself,
as in the authors' code. The check on the model is needed because a linear constraint says too little about a boat whose
rudder swings from side to side.

The paper leaves these choices to the user:

| left open | choice here |
| --- | --- |
| library | the nominal command held; the mode chosen last, as anchored then; `rollouts.LIBRARY` from the heading now |
| inputs u | acceleration and turn rate as shares of braking and of the largest turn now, as the textbook filters have |
| dV_m/dt | the step of the sampled boat, (V_m(x+) - V_m(x)) / dt, x+ by hull and autopilot, others one step on |
| its gradient in u | finite differences of V_m(x+) by `DIFFERENCE` of each input |
| least invasive | the constraint that leaves the largest part of the inputs, as in the authors' code |
| several agents | opponents hold course; teammates hold their last command, or this step's if already decided |
"""

from __future__ import annotations

import math
from typing import Any, ClassVar, NamedTuple

import numpy as np
from steerclear.shield.jit import Array, copy_row, kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import wrap_degrees

from . import rollouts as R
from .active_set import OPTIMAL, project
from .base import Games, game_of
from .unicycle import TOLERANCE, command_of_inputs, holds, inputs_of_command

PASSED, CHANGED, POLICY = 0, 1, 2
NOMINAL, LAST, BEFORE = 0, 1, 2
"""The first modes, and how many come before the library's.

The mode chosen last is one of them (columns 1 and 2 of a plan). The library turns with the boat, so a safe mode would
otherwise be lost in the next step.
"""
CORNERS = ((0, 0), (1, 0), (1, 1), (0, 1))
DIFFERENCE = 0.1
SLACK_M = 1e-3
"""How far an answer may miss its constraint on the boat's model, m in a step."""
SAME = 1e-9
"""Inputs this near to the nominal ones count as equal."""


class Inputs(NamedTuple):
    """Nominal inputs ``z0`` (2,), the largest turn rate, rad/s, and the least and greatest of both inputs (2, 2)."""

    z0: Array
    unit: float
    box: Array


@kernel
def share_left(row: Array, need: float, box: Array) -> float:
    """Return the share in [0, 1] of the box (2, 2; least and greatest of each input) in which ``row z >= need``.

    If one input has no width, the share is measured in the other; a single point counts as all or nothing.
    """
    if box[0, 1] <= box[0, 0] or box[1, 1] <= box[1, 0]:
        return _share_of_line(row, need, box)
    kept, count = np.empty((8, 2)), 0
    for c in range(4):
        here, there = CORNERS[c], CORNERS[(c + 1) % 4]
        x, y, u, v = box[0, here[0]], box[1, here[1]], box[0, there[0]], box[1, there[1]]
        a, b = row[0] * x + row[1] * y - need, row[0] * u + row[1] * v - need
        if a >= 0.0:
            kept[count, 0], kept[count, 1] = x, y
            count += 1
        if (a >= 0.0) != (b >= 0.0):
            part = a / (a - b)
            kept[count, 0], kept[count, 1] = x + part * (u - x), y + part * (v - y)
            count += 1
    twice = 0.0
    for k in range(count):
        after = (k + 1) % count
        twice += kept[k, 0] * kept[after, 1] - kept[after, 0] * kept[k, 1]
    return 0.5 * abs(twice) / ((box[0, 1] - box[0, 0]) * (box[1, 1] - box[1, 0]))


@kernel
def _share_of_line(row: Array, need: float, box: Array) -> float:
    low = row[0] * box[0, 0] + row[1] * box[1, 0] - need
    high = row[0] * box[0, 1] + row[1] * box[1, 1] - need
    if (low >= 0.0) == (high >= 0.0):
        return 1.0 if low >= 0.0 else 0.0
    return max(low, high) / abs(high - low)


@kernel
def value_of(setup: R.Setup, i: int, start: Array, k: int, speed: float, heading: float, around: R.Around) -> float:
    """Return V of a policy, a command held from step k on in state ``start``: least clearance over the horizon, m."""
    row = start.copy()
    least = R.gap_at(setup, around, k, row[L.X], row[L.Y])
    for t in range(1, setup.steps + 1):
        R.advance(setup, i, row, speed, heading)
        least = min(least, R.gap_at(setup, around, k + t, row[L.X], row[L.Y]))
    return least


@kernel
def answer_of(row: Array, need: float, box: Array, z0: Array, z: Array) -> bool:
    """Write the inputs nearest to ``z0`` within the box with ``row z >= need``; return whether there are any."""
    copy_row(z, z0)
    length = math.hypot(row[0], row[1])
    if row[0] * z0[0] + row[1] * z0[1] >= need:
        return True
    if not length > 1e-12:
        return False
    C, d = np.zeros((5, 2)), np.empty(5)
    for k in range(2):
        C[2 * k, k], d[2 * k] = 1.0, box[k, 0]
        C[2 * k + 1, k], d[2 * k + 1] = -1.0, -box[k, 1]
    C[4, 0], C[4, 1], d[4] = row[0] / length, row[1] / length, need / length
    return project(C, d, z0, z) == OPTIMAL and holds(C, d, z, TOLERANCE)


@kernel
def _command_of_mode(setup: R.Setup, i: int, m: int, state: Array, nominal: Array, plan: Array) -> tuple[float, float]:
    """Return speed and absolute heading of mode m: nominal command held, last mode, then the library."""
    if m == NOMINAL:
        return nominal[0], wrap_degrees(state[L.HEADING] + nominal[1])
    if m == LAST:
        return plan[1], plan[2]
    return R.command_of(setup, i, m - BEFORE, state)


@kernel
def _later_states(setup: R.Setup, i: int, state: Array, inputs: Inputs, later: Array) -> Array:
    """Write states (4, N_STATE): now, after nominal inputs, and with either input shifted; return the shifts (2,)."""
    shift = np.empty(2)
    later[0] = state
    for k in range(3):
        z = inputs.z0.copy()
        if k > 0:
            fits = z[k - 1] + DIFFERENCE <= inputs.box[k - 1, 1]
            shift[k - 1] = DIFFERENCE if fits else -DIFFERENCE
            z[k - 1] += shift[k - 1]
        speed, turn = command_of_inputs(setup.params[i], setup.limits[i], state, z, inputs.unit, setup.dt_s)
        later[k + 1] = state
        step_boat(setup.params[i], later[k + 1], speed, turn, setup.dt_s)
    return shift


@kernel
def take_mode(
    setup: R.Setup, i: int, state: Array, nominal: Array, plan: Array, inputs: Inputs, around: R.Around, row: Array
) -> tuple[int, float, float]:
    """Choose a mode: safe ones first, by the share of inputs their row leaves, then by V.

    Returns:
        The mode, the right-hand side of its row and its value; the row is written into ``row``.
    """
    z0, later, trial, values = inputs.z0, np.empty((4, L.N_STATE)), np.empty(2), np.empty(4)
    shift = _later_states(setup, i, state, inputs, later)
    best, best_need, best_value, best_score = -1, 0.0, -math.inf, -math.inf
    for m in range(setup.library.shape[0] + BEFORE):
        speed, heading = _command_of_mode(setup, i, m, state, nominal, plan)
        for k in range(4):
            values[k] = value_of(setup, i, later[k], min(k, 1), speed, heading, around)
        value, score = values[0], -math.inf
        for k in range(2):
            trial[k] = (values[k + 2] - values[1]) / (shift[k] * setup.dt_s)
        have = (values[1] - values[0]) / setup.dt_s + setup.alpha_per_s * value
        need = trial[0] * z0[0] + trial[1] * z0[1] - have
        if value > 0.0:
            score = share_left(trial, need, inputs.box)
        better = value > best_value
        if value > 0.0 and best_value > 0.0:
            better = score > best_score + SAME or (score >= best_score - SAME and better)
        if best < 0 or better:
            best, best_need, best_value, best_score = m, need, value, score
            copy_row(row, trial)
        if value > 0.0 and row[0] * z0[0] + row[1] * z0[1] >= best_need and best_score >= 1.0 - SAME:
            break  # removes no inputs: no other mode can be better
    return best, best_need, best_value


@kernel
def _decide_boat(setup: R.Setup, i: int, state: Array, around: R.Around, plan: Array, out: Array) -> tuple[int, float]:
    """Choose a mode, record it in the plan and solve its program; return the reason and the value, m."""
    params, limits = setup.params[i], setup.limits[i]
    box, z0, z, row = np.empty((2, 2)), np.empty(2), np.empty(2), np.empty(2)
    unit = inputs_of_command(params, limits, state, out, setup.dt_s, z0, box)
    m, need, value = take_mode(setup, i, state, out, plan, Inputs(z0, unit, box), around, row)
    plan[1], plan[2] = _command_of_mode(setup, i, m, state, out, plan)
    if answer_of(row, need, box, z0, z):
        same = abs(z[0] - z0[0]) <= SAME and abs(z[1] - z0[1]) <= SAME
        if not same:
            out[0], out[1] = command_of_inputs(params, limits, state, z, unit, setup.dt_s)
        after = state.copy()
        step_boat(params, after, out[0], out[1], setup.dt_s)
        then = value_of(setup, i, after, 1, plan[1], plan[2], around)
        if then >= (1.0 - setup.alpha_per_s * setup.dt_s) * value - SLACK_M:
            return PASSED if same else CHANGED, value
    out[0], out[1] = plan[1], wrap_degrees(plan[2] - state[L.HEADING])
    return POLICY, value


@kernel
def decide_game(setup: R.Setup, game: Games) -> None:
    """Decide for the own boats, one after the other; ``filtered`` starts as the nominal commands."""
    state, _, ours, plan, filtered, reason, clear_m = game
    n, steps = state.shape[0], setup.steps + 1
    path, grow, near = np.empty((n, steps + 1, 2)), np.empty(n), np.empty(n, np.bool_)
    around = R.Around(near, path, grow)
    R.predict_all(setup, state, ours, plan, path, grow)
    for i in range(n):
        if not ours[i]:
            continue
        if plan[i, 0] == R.NO_PLAN:
            plan[i, 1], plan[i, 2] = state[i, L.SPEED], state[i, L.HEADING]
        if R.mark_near(setup, i, state, steps, near):
            reason[i], clear_m[i] = _decide_boat(setup, i, state[i], around, plan[i], filtered[i])
        plan[i, 0], plan[i, 3] = 0.0, filtered[i, 0]
        plan[i, 4] = wrap_degrees(state[i, L.HEADING] + filtered[i, 1])
        R.roll_plan(setup, i, state[i], plan[i], path[i])


@kernel
def decide_games(setup: R.Setup, games: Games) -> None:
    """Run `decide_game` for every game; arrays carry a leading games axis, and the memory holds the boats' plans."""
    for b in range(len(games.state)):
        decide_game(setup, game_of(games, b))


class PolicyLibrary(R.RolloutFilter):
    """PL-CBF.

    Settings: ``horizon_s``, length of a rollout (T of the paper), and ``alpha_per_s``, rate of dV/dt >= -alpha V.
    """

    defaults: ClassVar[dict[str, Any]] = {"horizon_s": 10.0, "alpha_per_s": 1.0}

    def _decide(self, games: Games) -> None:
        decide_games(self._setup, games)
