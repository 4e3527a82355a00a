"""What happened in each game of a film, as numbers. Compiled where every step is looked at."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from ..game_metrics import DEAD_BAND_DEG, DEADLOCK_S, deadlocks
from ..jit import kernel
from .play import Film
from .scenes import DT_S

Columns = dict[str, NDArray[np.float64]]


@kernel
def pair_columns(state: Array, team: IntArray, radius_m: float, out: Array) -> None:
    """Entries into the radius and least distance, of team-mates and of own boats with others.

    Args:
        state: (T+1, B, n, N_STATE).
        team: (n,).
        radius_m: at exactly this distance is inside; the start does not count.
        out: (B, 4) entries and least distance m of team-mates, then of opponents; written.
    """
    for b in range(state.shape[1]):
        out[b, 0] = out[b, 2] = 0.0
        out[b, 1] = out[b, 3] = math.inf
        for i in range(state.shape[2]):
            for j in range(i + 1, state.shape[2]):
                if team[i] != 0 and team[j] != 0:
                    continue
                kind, inside = 0 if team[i] == team[j] else 2, False
                for t in range(1, state.shape[0]):
                    dx = state[t, b, i, L.X] - state[t, b, j, L.X]
                    dy = state[t, b, i, L.Y] - state[t, b, j, L.Y]
                    gap = math.sqrt(dx * dx + dy * dy)
                    out[b, kind + 1] = min(out[b, kind + 1], gap)
                    if gap <= radius_m and not inside:
                        out[b, kind] += 1.0
                    inside = gap <= radius_m


@kernel
def command_columns(state: Array, wanted: Array, sent: Array, team: IntArray, out: Array) -> None:
    """Of the own boats: steps changed, sums of their changes, flips of the commanded side.

    Args:
        state: (T+1, B, n, N_STATE).
        wanted: (T, B, n, 2).
        sent: (T, B, n, 2).
        team: (n,).
        out: (B, 4) steps changed, sum of heading changes deg, of speed changes m/s, flips; written.
    """
    out[:] = 0.0
    for b in range(state.shape[1]):
        for i in range(state.shape[2]):
            if team[i] != 0:
                continue
            side = 0.0
            for t in range(wanted.shape[0]):
                turn, speed = sent[t, b, i, 1], sent[t, b, i, 0]
                if turn != wanted[t, b, i, 1] or speed != wanted[t, b, i, 0]:
                    out[b, 0] += 1.0
                    out[b, 1] += abs(wrap_degrees(turn - wanted[t, b, i, 1]))
                    out[b, 2] += abs(speed - wanted[t, b, i, 0])
                error = wrap_degrees(turn)
                if abs(error) > DEAD_BAND_DEG:
                    now = 1.0 if error > 0.0 else -1.0
                    if side != 0.0 and now != side:
                        out[b, 3] += 1.0
                    side = now


def tally(film: Film) -> Columns:
    """Count for every game of a film.

    Returns:
        Arrays (B,): ``breaches_teammate``, ``breaches_opponent``, ``closest_teammate_m``, ``closest_opponent_m``,
        ``closest_m``, ``changed_share``, ``heading_change_deg`` and ``speed_change_mps`` (means over changed steps,
        NaN without), ``reversals_per_min`` (per own boat), ``deadlocks``, ``goal_s`` (mean over own boats of the time
        to the first goal, a boat that never reaches it counting with the whole length), ``reached`` (share of own
        boats that did), ``outside_m`` (how far an own boat left the field at most).
    """
    scenes = film.scenes
    pairs, commands, stuck = np.empty((scenes.games, 4)), np.empty((scenes.games, 4)), np.empty(scenes.games)
    pair_columns(film.state, scenes.team, film.conditions.radius_m, pairs)
    command_columns(film.state, film.wanted, film.sent, scenes.team, commands)
    speeds_mps = np.ascontiguousarray(film.state[1:, ..., L.SPEED]), np.ascontiguousarray(film.wanted[..., 0])
    deadlocks(*speeds_mps, scenes.own, round(DEADLOCK_S / DT_S), stuck)
    boats, changed = scenes.own.sum(), np.where(commands[:, 0] > 0.0, commands[:, 0], np.nan)
    goal_s = film.first_goal_s[:, scenes.own]
    return {
        "breaches_teammate": pairs[:, 0],
        "breaches_opponent": pairs[:, 2],
        "closest_teammate_m": pairs[:, 1],
        "closest_opponent_m": pairs[:, 3],
        "closest_m": np.minimum(pairs[:, 1], pairs[:, 3]),
        "changed_share": commands[:, 0] / (scenes.steps * boats),
        "heading_change_deg": commands[:, 1] / changed,
        "speed_change_mps": commands[:, 2] / changed,
        "reversals_per_min": commands[:, 3] / (scenes.steps * DT_S / 60.0 * boats),
        "deadlocks": stuck,
        "goal_s": np.where(np.isnan(goal_s), scenes.length_s, goal_s).mean(axis=1),
        "reached": (~np.isnan(goal_s)).mean(axis=1),
        "outside_m": _outside_m(film),
    }


def _outside_m(film: Film) -> Array:
    """How far own boats left the field, m; 0 in open water."""
    field = film.scenes.field
    if field is None:
        return np.zeros(film.scenes.games)
    places = film.state[:, :, film.scenes.own, :2]
    past = np.maximum(np.array(field[:2]) - places, places - np.array(field[2:]))
    return np.asarray(np.maximum(past, 0.0).max(axis=(0, 2, 3)))
