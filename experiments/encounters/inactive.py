"""The filter-inactive share: of sampled states that are safe, how many a guard leaves alone.

States are sampled along the scenes played *without* a guard, every `EVERY_S` from the first decision on, of the variant
that is the worst without a guard: the same states for every guard. A sample is an own boat in such a state, with the
command it wants there. It is *safe* when the value table of each pair it is in says that the separation can still be
kept: from an opponent that does its worst for ever, with the help of a team-mate. No guard has a say in that. The guard
is asked about every state afresh, with nothing remembered; the boat is left alone when its command passes bit for bit.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray

from ..baselines.reach_guard import ReachGuard
from ..baselines.reach_guard.values import Setup, ahead, least, margins, near_pairs
from ..jit import kernel
from .guards import GuardMaker, build_guard
from .play import Film
from .scenes import DT_S, Conditions, Scenes
from .tally import Columns

EVERY_S = 2.0
"""Time between samples of a scene, s."""


@kernel
def mark_safe(setup: Setup, state: Array, ours: BoolArray, safe: BoolArray) -> None:
    """Mark (B, n) own boats whose pairs all have a value of at least the radius.

    Args:
        setup: tables and radius.
        state: (B, n, N_STATE).
        ours: (n,) own boats.
        safe: (B, n) written; False for others.
    """
    for b in range(len(state)):
        pairs = near_pairs(setup, state[b], ours)
        h = margins(setup, pairs, ahead(setup, state[b], ours, np.empty((len(ours), 2)), 0))
        low = least(pairs, h, len(ours))
        for i in range(len(ours)):
            safe[b, i] = ours[i] and low[i] >= 0.0


def safe_boats(scenes: Scenes, state: Array, conditions: Conditions) -> BoolArray:
    """Own boats (B, n) in states (B, n, N_STATE) from which the separation can be kept; none without tables."""
    safe = np.zeros(state.shape[:2], np.bool_)
    config = ShieldConfig.of(
        separation_m=conditions.radius_m, position_error_m=conditions.noise_m, dt_s=DT_S, adversary_s=math.inf
    )
    try:
        judge = ReachGuard(config, 1, scenes.platforms, tuple(scenes.team.tolist()))
    except ConfigError:  # boats without tables, or a radius beyond what they tell
        return safe
    mark_safe(judge.setup, np.ascontiguousarray(state), scenes.own, safe)
    return safe


def inactive_columns(bare: Film, guard: str | GuardMaker, conditions: Conditions, games: IntArray) -> Columns:
    """Count samples of some games of a film without a guard.

    Args:
        bare: what was played without a guard.
        guard: a name, or what makes one.
        conditions: become the guard's settings.
        games: (k,) of the film.

    Returns:
        Arrays (k,): ``sampled_safe``, samples that are safe, and ``left_alone``, how many of these the guard leaves.
    """
    steps = np.arange(0, bare.scenes.steps, round(EVERY_S / DT_S))
    scenes = bare.scenes.take(np.tile(games, len(steps)))
    state = bare.state[steps][:, games].reshape(scenes.games, *bare.state.shape[2:])
    wanted = bare.wanted[steps][:, games].reshape(scenes.games, *bare.wanted.shape[2:])
    ours = np.broadcast_to(scenes.own, state.shape[:2]).copy()
    safe = safe_boats(scenes, state, conditions)
    sent = np.asarray(build_guard(guard, scenes, conditions).decide(state, wanted.copy(), ours))
    alone = safe & (sent == wanted).all(axis=2)
    shape = (len(steps), len(games), -1)
    return {
        "sampled_safe": safe.reshape(shape).sum(axis=(0, 2)).astype(np.float64),
        "left_alone": alone.reshape(shape).sum(axis=(0, 2)).astype(np.float64),
    }
