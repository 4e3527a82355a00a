"""gatekeeper: the nominal command for as long as possible, then a backup that is known to be safe. Compiled.

Source: Agrawal, Chen, Panagou, "gatekeeper: Online Safety Verification and Control for Nonlinear Systems in Dynamic
Environments" (T-RO 2024, arXiv 2211.14361), and the search over switching times of several agents of arXiv 2604.02401.
In their words: a *candidate* trajectory follows the nominal one for T_S and the backup controller for T_B after it; it
is *valid* when it stays in the safe set all the way and ends in the backup set; the valid one with the greatest T_S is
*committed*, and where there is none the committed one goes on. An agent holds the others' committed trajectories for
what they will do, and plans while they do not.

What the papers leave to the user, and what stands here:

| left open | here |
| --- | --- |
| nominal trajectory | the nominal command held, speed and absolute heading: a filter is not told a policy's plans |
| backup controller | the manoeuvre of the library with the greatest least clearance |
| model | the boat's hull and autopilot, step by step: what is committed is what the boat does |
| backup set | nobody comes within the radius, ever, if from the end on every boat holds its course |
| others | opponents hold course and speed; or fill the disc they can reach (then the backup set is not asked for) |
| the first committed trajectory | to stop on the present heading |
| who plans when | teammates one after the other within a step, in the order of their numbers |
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from ..jit import kernel
from . import rollouts as R
from .base import Games, game_of

PASSED, BACKUP, GOES_ON = 0, 1, 2


@kernel
def backup_value(setup: R.Setup, i: int, start: Array, k: int, m: int, around: R.Around, floor_m: float) -> float:
    """Least clearance, m, of manoeuvre m begun at step k in the state ``start``; -inf once it is below ``floor_m``."""
    speed, heading = R.command_of(setup, i, m, start)
    row, least = start.copy(), math.inf
    for t in range(1, setup.steps + 1):
        R.advance(setup, i, row, speed, heading)
        least = min(least, R.gap_at(setup, around, k + t, row[L.X], row[L.Y]))
        if not least >= floor_m:
            return -math.inf
    if not setup.worst:
        least = min(least, R.gap_after(setup, around, k + setup.steps, row))
    return least if least >= floor_m else -math.inf


@kernel
def follow_wanted(
    setup: R.Setup, i: int, state: Array, speed: float, heading: float, around: R.Around,
    trail: Array, least_m: Array,
) -> None:  # fmt: skip
    """Write the states (S+1, N_STATE) under the nominal command, and the least clearance (S+1,) up to each, m."""
    trail[0] = state
    least_m[0] = R.gap_at(setup, around, 0, state[L.X], state[L.Y])
    for k in range(1, trail.shape[0]):
        trail[k] = trail[k - 1]
        R.advance(setup, i, trail[k], speed, heading)
        least_m[k] = min(least_m[k - 1], R.gap_at(setup, around, k, trail[k, L.X], trail[k, L.Y]))


@kernel
def find_candidate(setup: R.Setup, i: int, around: R.Around, trail: Array, least_m: Array) -> tuple[int, int, float]:
    """The greatest switching time with a valid candidate, in steps (-1: none), its manoeuvre and least clearance, m."""
    for s in setup.switches:
        best, best_m = -math.inf, -1
        if least_m[s] >= 0.0:
            for m in range(setup.library.shape[0]):
                value = backup_value(setup, i, trail[s], s, m, around, max(0.0, best))
                if value > best:
                    best, best_m = value, m
        if best_m >= 0:
            return s, best_m, min(best, least_m[s])
    return -1, -1, least_m[0]


@kernel
def _go_on(state: Array, plan: Array, sent: Array) -> None:
    """The committed trajectory's command of this step."""
    first = 1 if plan[0] >= 1.0 else 3
    sent[0], sent[1] = plan[first], wrap_degrees(plan[first + 1] - state[L.HEADING])


@kernel
def _decide_boat(setup: R.Setup, i: int, state: Array, around: R.Around, plan: Array, sent: Array) -> tuple[int, float]:
    """Commit anew or go on; returns why, and the least clearance of what is committed, m."""
    speed, heading = sent[0], wrap_degrees(state[L.HEADING] + sent[1])
    trail, least_m = np.empty((setup.switches[0] + 1, L.N_STATE)), np.empty(setup.switches[0] + 1)
    follow_wanted(setup, i, state, speed, heading, around, trail, least_m)
    s, m, value = find_candidate(setup, i, around, trail, least_m)
    if s < 0:
        _go_on(state, plan, sent)
        return GOES_ON, value
    plan[0], plan[1], plan[2] = s, speed, heading
    plan[3], plan[4] = R.command_of(setup, i, m, trail[s])
    if s > 0:
        return PASSED, value
    _go_on(state, plan, sent)
    return BACKUP, value


@kernel
def decide_game(setup: R.Setup, game: Games) -> None:
    """Decide for the boats of ours, one after the other; ``sent`` starts as the nominal commands."""
    state, _, ours, plan, sent, reason, clear_m = game
    n, steps = state.shape[0], setup.switches[0] + setup.steps
    path, grow, near = np.empty((n, steps + 1, 2)), np.empty(n), np.empty(n, np.bool_)
    around = R.Around(near, path, grow)
    for i in range(n):
        if ours[i] and plan[i, 0] == R.NO_PLAN:
            plan[i, 0], plan[i, 1], plan[i, 2] = 0.0, 0.0, state[i, L.HEADING]
            plan[i, 3], plan[i, 4] = 0.0, state[i, L.HEADING]
    R.predict_all(setup, state, ours, plan, path, grow)
    for i in range(n):
        if not ours[i]:
            continue
        R.mark_near(setup, i, state, steps, near)
        reason[i], clear_m[i] = _decide_boat(setup, i, state[i], around, plan[i], sent[i])
        R.roll_plan(setup, i, state[i], plan[i], path[i])
    for i in range(n):
        if ours[i] and plan[i, 0] >= 1.0:
            plan[i, 0] -= 1.0


@kernel
def decide_games(setup: R.Setup, games: Games) -> None:
    """`decide_game` for every game; arrays carry a leading games axis, and the memory is the boats' plans."""
    for b in range(len(games.state)):
        decide_game(setup, game_of(games, b))


class Gatekeeper(R.RolloutGuard):
    """gatekeeper; ``gatekeeper-worst`` takes opponents to fill the disc they can reach at top speed."""

    kind = R.GatekeeperSettings

    def _decide(self, games: Games) -> None:
        decide_games(self._setup, games)
