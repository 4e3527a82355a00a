"""Evolving one boat's plan, compiled: rolling-horizon evolution by rollouts in the simulator."""

from __future__ import annotations

import math

import numpy as np
from steerclear.env.arrays import Games, Rules
from steerclear.shield.jit import Array, IntArray, kernel, lean_kernel
from steerclear.shield.platforms import layout as L

from .rollout import (
    CAPTURES,
    FOE_HITS,
    GRABS,
    MATE_HITS_BLUE,
    N_COUNTED,
    N_MOVES,
    NEAR_BLUE,
    OUT_BLUE,
    TAGS,
    Desk,
    copy_game,
    roll_out,
)

MUTATED = 3.0
"""Macro-actions of a plan that a mutation changes, on average, beside the first."""


@kernel
def evolve(
    rules: Rules,
    games: Games,
    b: int,
    plans: IntArray,
    boat: int,
    hints: IntArray,
    home: Array,
    rng: np.random.Generator,
    desk: Desk,
) -> float:
    """Improve one boat's plan while all others keep theirs; return what the best found is worth to its team.

    Args:
        rules: of the forward model.
        games: the live games.
        b: the one that is searched in.
        plans: (n, H) macro-actions of all boats, 0..8; the boat's row is replaced by the best found.
        boat: whose plan.
        hints: (k,) macro-actions to try held throughout, such as straight to the flag.
        home: (2,) where the boat takes the flag, m.
        rng: of mutations.
        desk: where to work.
    """
    copy_game(desk.marks, 0, games, b)
    for k in range(N_COUNTED):
        desk.marked[0, k] = 0.0
    own, brood = plans[boat], desk.brood
    population, horizon = brood.shape
    roll_out(rules, desk, plans, boat, 0, True)
    worth = _worth(rules, desk, boat, home)
    for generation in range(desk.generations):
        _mutate(rng, own, brood)
        if generation == 0:
            for k in range(min(hints.size, population - 1)):
                brood[1 + k, :] = hints[k]
        best, first = 0, horizon
        for k in range(1, population):
            begin = _first_difference(brood[k], own)
            if begin == horizon:
                continue
            _copy_plan(own, brood[k])
            roll_out(rules, desk, plans, boat, begin, False)
            _copy_plan(own, brood[0])
            found = _worth(rules, desk, boat, home)
            if found > worth:
                worth, best, first = found, k, begin
        if best > 0:
            _copy_plan(own, brood[best])
            if generation + 1 < desk.generations:
                roll_out(rules, desk, plans, boat, first, True)
    return worth


@kernel
def _mutate(rng: np.random.Generator, parent: IntArray, brood: IntArray) -> None:
    """Fill a brood (P, H) with the parent, and mutants of it: a stretch of a plan is replaced by one macro-action."""
    horizon = parent.size
    for k in range(brood.shape[0]):
        _copy_plan(brood[k], parent)
        if k > 0:
            begin = int(rng.integers(0, horizon))
            end = begin + 1 + int(rng.poisson(MUTATED))
            move = int(rng.integers(0, N_MOVES))
            for m in range(begin, min(end, horizon)):
                brood[k, m] = move


@lean_kernel
def _copy_plan(to: IntArray, source: IntArray) -> None:
    """Copy a plan's macro-actions."""
    for m in range(source.shape[0]):
        to[m] = source[m]


@lean_kernel
def _first_difference(plan: IntArray, other: IntArray) -> int:
    """The first macro-action in which plans differ; their length where none does."""
    m = 0
    while m < plan.shape[0] and plan[m] == other[m]:
        m += 1
    return m


@lean_kernel
def _worth(rules: Rules, desk: Desk, boat: int, home: Array) -> float:
    """What the plans just rolled out are worth to a boat's team."""
    w, c, team = desk.weights, desk.counted, rules.team[boat]
    sign = 1.0 if team == 0 else -1.0
    events = sign * (w.capture * c[CAPTURES] + w.grab * c[GRABS] + w.tag * c[TAGS])
    costs = w.mate_hit * c[MATE_HITS_BLUE + team] + w.near_mate * c[NEAR_BLUE + team]
    costs = costs + w.foe_hit * c[FOE_HITS] + w.out * c[OUT_BLUE + team]
    return events - costs + w.progress * _progress(rules, desk.bench, boat, home)


@lean_kernel
def _progress(rules: Rules, games: Games, boat: int, home: Array) -> float:
    """How near a boat of the bench is to what it is after, 1 at it: the flag, or with it (or tagged) its home."""
    place = games.state[0, boat]
    aim = home if games.has_flag[0, boat] or games.is_tagged[0, boat] else games.flag_position[0, 1 - rules.team[boat]]
    dx, dy = place[L.X] - aim[0], place[L.Y] - aim[1]
    return 1.0 - math.sqrt(dx * dx + dy * dy) / rules.size[0]
