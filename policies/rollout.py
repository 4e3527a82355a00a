"""Rolling plans out in the batched simulator, compiled: every game of the batch plays its own plans."""

from __future__ import annotations

import math

from steerclear.env.advance import advance_games, begin_decision
from steerclear.env.angles import wrap_bearing
from steerclear.env.arrays import CAPTURE, GRAB, TAG, Games, Rules
from steerclear.env.drive_home import decide_commands
from steerclear.shield.jit import Array, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L

HEADINGS = 8
STOP = HEADINGS
N_MOVES = HEADINGS + 1
"""Macro-actions: full speed along one of eight absolute headings (45 deg apart, from north), and a stop."""

# columns of what a rollout counts, blue's minus red's where two teams can have it
CAPTURES, GRABS, TAGS, MATE_HITS_BLUE, MATE_HITS_RED, FOE_HITS, NEAR_BLUE, NEAR_RED = 0, 1, 2, 3, 4, 5, 6, 7
OUT_BLUE, OUT_RED = 8, 9
N_COUNTED = 10
NEAR_MATES_M = 6.0
"""Closer than this, team-mates are counted as near, step by step."""


@lean_kernel
def roll_out(
    rules: Rules,
    games: Games,
    plans: IntArray,
    repeats: int,
    wanted: Array,
    commands: Array,
    touching: Array,
    counted: Array,
) -> None:
    """Play every game's plans to their end.

    Args:
        rules: of the games.
        games: B games; they are moved on.
        plans: (B, n, H) macro-actions of every boat, 0..8.
        repeats: steps that a macro-action is held for.
        wanted: (B, n, 2) scratch.
        commands: (B, n, 2) scratch.
        touching: (B, n, n) scratch: pairs of one team that touched in the step before, 1 or 0.
        counted: (B, N_COUNTED), written: what happened, a later event counting less than an early one.
    """
    n_games, n_boats, horizon = plans.shape
    for b in range(n_games):
        for k in range(N_COUNTED):
            counted[b, k] = 0.0
        for i in range(n_boats):
            for j in range(n_boats):
                touching[b, i, j] = 1.0 if games.touching[b, i, j] else 0.0
    for move in range(horizon):
        worth = 1.0 - 0.5 * move / horizon
        for _ in range(repeats):
            for b in range(n_games):
                for i in range(n_boats):
                    action = plans[b, i, move]
                    wanted[b, i, 0] = 0.0 if action == STOP else rules.max_speed[i]
                    absolute = 45.0 * action if action != STOP else games.state[b, i, L.HEADING]
                    wanted[b, i, 1] = wrap_bearing(absolute - games.state[b, i, L.HEADING])
            decide_commands(rules, games, wanted, commands)
            begin_decision(rules, games)
            advance_games(rules, games, wanted, commands)
            for b in range(n_games):
                _count(rules, games, b, worth, touching[b], counted[b])


@lean_kernel
def _count(rules: Rules, games: Games, b: int, worth: float, touching: Array, counted: Array) -> None:
    events = games.events[b]
    counted[CAPTURES] += worth * (events[0, CAPTURE] - events[1, CAPTURE])
    counted[GRABS] += worth * (events[0, GRAB] - events[1, GRAB])
    counted[TAGS] += worth * (events[0, TAG] - events[1, TAG])
    counted[OUT_BLUE] += events[0, 3]
    counted[OUT_RED] += events[1, 3]
    state = games.state[b]
    for i in range(rules.n_boats):
        for j in range(i + 1, rules.n_boats):
            dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
            gap = math.sqrt(dx * dx + dy * dy)
            mates = rules.team[i] == rules.team[j]
            touch = 1.0 if gap <= rules.agent_radius[i] + rules.agent_radius[j] else 0.0
            fresh = touch * (1.0 - touching[i, j])
            touching[i, j] = touch
            if mates:
                counted[MATE_HITS_BLUE + rules.team[i]] += fresh
                if gap < NEAR_MATES_M:
                    counted[NEAR_BLUE + rules.team[i]] += (NEAR_MATES_M - gap) / NEAR_MATES_M
            else:
                counted[FOE_HITS] += fresh
