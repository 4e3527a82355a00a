"""What happened in each encounter, as numbers: counts, distances, changes, verdicts. Loops over steps are compiled.

*Filter-inactive share*: of sampled states that are safe, how many a guard leaves alone. States are sampled along the
scenes played *without* a guard, every `EVERY_S` from the first decision on, of the variant that is the worst without a
guard: the same states for every guard. A sample is an own boat in such a state, with the command it wants there. It is
*safe* when the value table of each pair it is in says that the separation can still be kept: from an opponent that does
its worst for ever, with the help of a teammate. No guard has a say in that. The guard is asked about every state
afresh, with nothing remembered; the boat is left alone when its command passes bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from steerclear.env.record import find_breaches
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from .. import oracle
from ..baselines.reach import ReachGuard, mark_safe
from ..baselines.registry import NONE, SHIELD, GuardMaker, build_guard
from ..game_metrics import DEAD_BAND_DEG, DEADLOCK_S, deadlocks
from ..jit import kernel
from .scenarios import draw
from .scene import DT_S, Conditions, Scenes
from .simulate import Trajectory, delay_steps, play

Columns = dict[str, NDArray[np.float64]]
EVERY_S = 2.0
"""Time between samples of a scene, s."""
CHUNK_MIB = 96.0
"""Memory of a chunk's trajectories, MiB."""
MOST_PER_CHUNK = 100
"""Encounters of a chunk: what an interrupted run may lose."""
BARE_SAME = ("goal_s", "reversals_per_min")
"""Columns kept of the same variant without a guard, with ``unshielded_`` before the name."""
BARE_WORST = ("closest_m", "breaches_teammate", "breaches_opponent")
"""Columns kept of the variant that is worst without a guard."""
MOST_JUDGED = 5
"""Breaches of one game that are judged; a crowd without a guard has hundreds."""
MOST_VARIANTS = 3
"""Breached variants of one encounter that are judged while none of them is avoidable."""
COUNTS = ("avoidable", "unavoidable", "started_inside", "not_judged")
SIDES = ("own", "opponent", "both", "neither", "start")
"""Whose command let the last chance pass; the column ``responsible`` holds the index, NaN without a verdict."""
NO_VERDICT: dict[str, float] = dict.fromkeys(COUNTS, 0.0) | {"last_preventable_s": np.nan, "responsible": np.nan}


@kernel
def pair_columns(state: Array, team: IntArray, radius_m: float, out: Array) -> None:
    """Entries into the radius and least distance, of teammates and of own boats with others.

    Args:
        state: (T+1, B, n, N_STATE).
        team: (n,).
        radius_m: at exactly this distance is inside; the start does not count.
        out: (B, 4) entries and least distance m of teammates, then of opponents; written.
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
def command_columns(nominal: Array, filtered: Array, team: IntArray, out: Array) -> None:
    """Of the own boats: steps changed, sums of their changes, flips of the commanded side.

    Args:
        nominal: (T, B, n, 2).
        filtered: (T, B, n, 2).
        team: (n,).
        out: (B, 4) steps changed, sum of heading changes deg, of speed changes m/s, flips; written.
    """
    out[:] = 0.0
    for b in range(nominal.shape[1]):
        for i in range(nominal.shape[2]):
            if team[i] != 0:
                continue
            side = 0.0
            for t in range(nominal.shape[0]):
                turn, speed = filtered[t, b, i, 1], filtered[t, b, i, 0]
                if turn != nominal[t, b, i, 1] or speed != nominal[t, b, i, 0]:
                    out[b, 0] += 1.0
                    out[b, 1] += abs(wrap_degrees(turn - nominal[t, b, i, 1]))
                    out[b, 2] += abs(speed - nominal[t, b, i, 0])
                error = wrap_degrees(turn)
                if abs(error) > DEAD_BAND_DEG:
                    now = 1.0 if error > 0.0 else -1.0
                    if side != 0.0 and now != side:
                        out[b, 3] += 1.0
                    side = now


def tally(played: Trajectory) -> Columns:
    """Count for every game.

    Returns:
        Arrays (B,): ``breaches_teammate``, ``breaches_opponent``, ``closest_teammate_m``, ``closest_opponent_m``,
        ``closest_m``, ``changed_share``, ``heading_change_deg`` and ``speed_change_mps`` (means over changed steps,
        NaN without), ``reversals_per_min`` (per own boat), ``deadlocks``, ``goal_s`` (mean over own boats of the time
        to the first goal, a boat that never reaches it counting with the whole length), ``reached`` (share of own
        boats that did), ``outside_m`` (how far an own boat left the field at most).
    """
    scenes, own = played.scenes, played.scenes.own
    pairs, commands, stuck = np.empty((scenes.games, 4)), np.empty((scenes.games, 4)), np.empty(scenes.games)
    pair_columns(played.state, scenes.team, played.conditions.radius_m, pairs)
    command_columns(played.nominal, played.filtered, scenes.team, commands)
    speeds_mps = np.ascontiguousarray(played.state[1:, ..., L.SPEED]), np.ascontiguousarray(played.nominal[..., 0])
    deadlocks(*speeds_mps, own, round(DEADLOCK_S / DT_S), stuck)
    boats, changed = own.sum(), np.where(commands[:, 0] > 0.0, commands[:, 0], np.nan)
    goal_s = played.first_goal_s[:, own]
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
        "outside_m": _outside_m(played),
    }


def _outside_m(played: Trajectory) -> Array:
    """How far own boats left the field, m; 0 in open water."""
    field = played.scenes.field
    if field is None:
        return np.zeros(played.scenes.games)
    places = played.state[:, :, played.scenes.own, :2]
    past = np.maximum(np.array(field[:2]) - places, places - np.array(field[2:]))
    return np.asarray(np.maximum(past, 0.0).max(axis=(0, 2, 3)))


def never_arrived(played: Trajectory, bare: Trajectory) -> Array:
    """Share (B,) of own boats that had not reached their first goal by the end, and did without a guard.

    A livelock of teammates is safe, and nobody stands still in it: this shows it. A boat that cannot get there in time
    even alone says nothing about the guard: it counts as one that arrived.
    """
    own = played.scenes.own
    lost = np.isnan(played.first_goal_s[:, own]) & ~np.isnan(bare.first_goal_s[:, own])
    return np.asarray(lost.mean(axis=1))


def start_certificate_m(played: Trajectory) -> np.ndarray:
    """The default shield's safety margin at the first decision, least of the own boats, whatever guard was played.

    It is asked about the true start, with the margins that the conditions call for; the same number for every guard,
    so that guards are compared on the same encounters.

    Returns:
        (B,) m; at least 0 outside the set from which the shield cannot promise to keep the radius, inf where nobody
        is near.
    """
    scenes = played.scenes
    shield = build_guard(SHIELD, scenes, played.conditions)
    ours = np.broadcast_to(scenes.own, played.state.shape[1:3]).copy()
    shield.decide(scenes.state, played.nominal[0], ours)
    return np.asarray(shield.safety_margin_m[:, scenes.own].min(axis=1))


def safe_boats(scenes: Scenes, state: Array, conditions: Conditions) -> BoolArray:
    """Own boats (B, n) in states (B, n, N_STATE) from which the separation can be kept; none without tables."""
    safe = np.zeros(state.shape[:2], np.bool_)
    config = ShieldConfig.of(
        separation_m=conditions.radius_m, position_error_m=conditions.noise_m, dt_s=DT_S, adversary_horizon_s=math.inf
    )
    try:
        judge = ReachGuard(config, 1, scenes.platforms, tuple(scenes.team.tolist()))
    except ConfigError:  # boats without tables, or a radius beyond what they tell
        return safe
    mark_safe(judge.setup, np.ascontiguousarray(state), scenes.own, safe)
    return safe


def inactive_columns(bare: Trajectory, guard: str | GuardMaker, conditions: Conditions, games: IntArray) -> Columns:
    """Count samples of some games of what was played without a guard.

    Args:
        bare: played without a guard.
        guard: a name, or what makes one.
        conditions: become the guard's settings.
        games: (k,) of them.

    Returns:
        Arrays (k,): ``sampled_safe``, samples that are safe, and ``left_alone``, how many of these the guard leaves.
    """
    steps = np.arange(0, bare.scenes.steps, round(EVERY_S / DT_S))
    scenes = bare.scenes.take(np.tile(games, len(steps)))
    state, nominal = (of[steps][:, games].reshape(scenes.games, *of.shape[2:]) for of in (bare.state, bare.nominal))
    ours = np.broadcast_to(scenes.own, state.shape[:2]).copy()
    safe = safe_boats(scenes, state, conditions)
    filtered = np.asarray(build_guard(guard, scenes, conditions).decide(state, nominal.copy(), ours))
    alone = safe & (filtered == nominal).all(axis=2)
    return {
        name: marks.reshape(len(steps), len(games), -1).sum(axis=(0, 2)).astype(np.float64)
        for name, marks in (("sampled_safe", safe), ("left_alone", alone))
    }


def judge_game(played: Trajectory, game: int) -> dict[str, float]:
    """Judge the breaches of the own boats in a game, the first `MOST_JUDGED` of them.

    A breach is avoidable when any own boat in it could have avoided it; of teammates either may.

    Returns:
        How many are ``avoidable``, ``unavoidable``, ``started_inside`` and ``not_judged``; and of the breach that
        counts (the first avoidable one, else the first) ``last_preventable_s``, how long before it an own boat could
        still avoid it (NaN: never), and ``responsible``, the index in `SIDES`.
    """
    states, scenes, conditions = played.state[:, game], played.scenes, played.conditions
    found = find_breaches(states[:, :, :2], conditions.radius_m)
    ours = [row for row in found if scenes.own[int(row[1])] or scenes.own[int(row[2])]]
    params = np.array([get_platform(name).pack() for name in scenes.platforms])
    current = scenes.current[game] * conditions.current_mps
    delays = np.where(scenes.own, delay_steps(conditions), 0)
    motion = oracle.Motion(tuple(current.tolist()), tuple(delays.tolist()))
    first = ours[:MOST_JUDGED]
    judged = oracle.judge_breaches(states, params, first, conditions.radius_m, DT_S, motion=motion)
    entries = [_entry(verdict, scenes.own) for verdict in judged]
    counts = NO_VERDICT | {name: float(sum(entry[0] == name for entry in entries)) for name in COUNTS}
    counts["not_judged"] = float(len(ours) - len(judged))
    chosen = next((entry for entry in entries if entry[0] == "avoidable"), entries[0] if entries else None)
    if chosen is not None:
        counts["last_preventable_s"], counts["responsible"] = chosen[1], float(SIDES.index(chosen[2]))
    return counts


def _entry(verdict: oracle.BreachVerdict, own: BoolArray) -> tuple[str, float, str]:
    """Outcome for the own side of a breach, how long before it that side could avoid it, s, and who is responsible."""
    ours = [side for side in (verdict.first, verdict.second) if own[side.own]]
    best = max(ours, key=lambda side: -1 if side.last_step is None else side.last_step)
    late = float("nan") if best.last_preventable_s is None else float(best.last_preventable_s)
    inside = [bool(own[boat]) for boat in verdict.responsible_boats()]
    name = "own" if all(inside) else "both" if any(inside) else "opponent"
    return str(best.outcome), late, name if inside else str(verdict.responsible)


def side_name(responsible: float) -> str | None:
    """Name of a side, given the number in the column ``responsible``; None without a verdict."""
    return None if np.isnan(responsible) else SIDES[int(responsible)]


def judge_worst(played: Trajectory, counted: Columns, worst: IntArray) -> tuple[IntArray, list[dict[str, float]]]:
    """Judge encounters: the variant that came closest, or another breached one that is avoidable.

    Args:
        played: what was played.
        counted: its columns, see `tally`.
        worst: the game of each encounter that came closest.

    Returns:
        The game of each encounter that counts, and what `judge_game` says about it.
    """
    hits, number = counted["breaches_teammate"] + counted["breaches_opponent"], played.scenes.number
    chosen, verdicts = worst.copy(), []
    for k, first in enumerate(worst):
        same = np.flatnonzero((number == number[first]) & (hits > 0))
        order = same[np.argsort(counted["closest_m"][same], kind="stable")][:MOST_VARIANTS]
        kept = (int(first), dict(NO_VERDICT))
        for tried, game in enumerate(order):
            verdict = judge_game(played, int(game))
            if tried == 0 or verdict["avoidable"]:
                kept = int(game), verdict
            if verdict["avoidable"]:
                break
        chosen[k] = kept[0]
        verdicts.append(kept[1])
    return chosen, verdicts


def measure_chunk(scenes: Scenes, guard: str | GuardMaker, conditions: Conditions, judge: bool = True) -> Columns:
    """Play a batch of scenes with a guard and without, and count.

    Returns:
        Columns (n,) over the encounters, the worst variant of each: ``number``, ``game`` (of the batch), ``variant``,
        ``start_certificate_m``, those of `tally`, ``never_arrived``, ``unshielded_*`` of `BARE_SAME` and `BARE_WORST`,
        those of `inactive_columns`, ``decision_us`` and ``decision_p999_us`` (of the chunk, per game and step), and the
        verdicts.
    """
    play(replace(scenes.take([0]), length_s=DT_S), guard, conditions)  # compiles, so that what is timed is deciding
    played = play(scenes, guard, conditions)
    without = played if guard == NONE else play(scenes, NONE, conditions)
    counted, bare = tally(played) | {"never_arrived": never_arrived(played, without)}, tally(without)
    worst, worst_bare = worst_games(scenes, counted["closest_m"]), worst_games(scenes, bare["closest_m"])
    if judge:
        worst, verdicts = judge_worst(played, counted, worst)
    else:
        hits = (counted["breaches_teammate"] + counted["breaches_opponent"])[worst]
        verdicts = [NO_VERDICT | {"not_judged": float(count)} for count in hits]
    decision_us = {
        "decision_us": np.median(played.decision_us),
        "decision_p999_us": np.quantile(played.decision_us, 0.999),
    }
    return {
        "number": scenes.number[worst].astype(np.float64),
        "game": worst.astype(np.float64),
        "variant": np.array([game - np.argmax(scenes.number == scenes.number[game]) for game in worst], float),
        "start_certificate_m": start_certificate_m(played)[worst],
        **{name: values[worst] for name, values in counted.items()},
        **{f"unshielded_{name}": bare[name][worst] for name in BARE_SAME},
        **{f"unshielded_{name}": bare[name][worst_bare] for name in BARE_WORST},
        **inactive_columns(without, guard, conditions, worst_bare),
        **{name: np.full(len(worst), float(value)) for name, value in decision_us.items()},
        **{name: np.array([verdict[name] for verdict in verdicts]) for name in NO_VERDICT},
    }


def worst_games(scenes: Scenes, closest_m: np.ndarray) -> IntArray:
    """Games, one per encounter, in which its boats came closest."""
    order = np.lexsort((closest_m, scenes.number))
    firsts = np.flatnonzero(np.diff(scenes.number[order], prepend=-1))
    return np.asarray(order[firsts])


def chunk_size(family: str, own: str, other: str, conditions: Conditions, seed: int, first: int = 0) -> int:
    """Encounters per chunk: their trajectories, with a guard and without, take about `CHUNK_MIB`."""
    sample = draw(family, own, other, conditions, seed, first, 1)
    per_game = 2 * 8 * sample.steps * len(sample.team) * (sample.state.shape[2] + 5)
    return max(1, min(MOST_PER_CHUNK, int(CHUNK_MIB * 2**20 / (per_game * sample.games))))
