"""What happened in each encounter, as numbers: counts, distances, changes, verdicts.

*Filter-inactive share*: of sampled states that are safe, how many a filter leaves alone. States are sampled along the
scenes played *without* a filter, every `EVERY_S` from the first decision on, of the variant that is the worst without:
the same states for every filter. A sample is an own boat in such a state, with the command it wants there. It is
*safe* when the value table of each pair it is in says that the separation can still be kept: from an opponent that does
its worst for ever, with the help of a teammate. No filter has a say in that. The filter is asked about every state
afresh, with nothing remembered; the boat is left alone when its command passes bit for bit.
"""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.env.record import find_violations
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import layout as L

from .. import oracle
from ..baselines.own_filters import check_answer
from ..baselines.reach import ReachFilter, mark_safe
from ..baselines.registry import NONE, SHIELD, FilterMaker, build_filter
from ..game_metrics import DEADLOCK_S, count_reversals, deadlocks
from ..verdicts import own_side
from .scenarios import draw
from .scene import DT_S, Conditions, Scenes
from .simulate import Trajectory, play

Columns = dict[str, NDArray[np.float64]]
EVERY_S = 2.0
"""Time between samples of a scene, s."""
CHUNK_MIB = 96.0
"""Memory of a chunk's trajectories, MiB."""
MOST_PER_CHUNK = 100
"""Encounters of a chunk: what an interrupted run may lose."""
BARE_SAME = ("goal_s", "reversals_per_min")
"""Columns kept of the same variant without a filter, with ``unshielded_`` before the name."""
BARE_WORST = ("closest_m", "violations_teammate", "violations_opponent")
"""Columns kept of the variant that is worst without a filter."""
MOST_JUDGED = 5
"""Violations of one game that are judged; a crowd without a filter has hundreds."""
MOST_VARIANTS = 3
"""Variants of one encounter that are judged while none of their violations is avoidable."""
COUNTS = ("avoidable", "unavoidable", "started_inside", "not_judged")
SIDES = ("own", "opponent", "both", "neither", "start")
"""Whose command let the last chance pass; the column ``responsible`` holds the index, NaN without a verdict."""
NO_VERDICT: dict[str, float] = dict.fromkeys(COUNTS, 0.0) | {"last_preventable_s": np.nan, "responsible": np.nan}


def _pair_columns(played: Trajectory) -> Columns:
    """Entries into the radius (the start does not count), and least distances, of teammates and of opponents."""
    own, games = played.scenes.own, played.scenes.games
    found: Columns = {}
    for kind in ("teammate", "opponent"):
        found |= {f"violations_{kind}": np.zeros(games), f"closest_{kind}_m": np.full(games, math.inf)}
    for i, j in combinations(range(len(own)), 2):
        if own[i]:
            kind = "teammate" if own[j] else "opponent"
            dx, dy = np.moveaxis(played.state[1:, :, i, :2] - played.state[1:, :, j, :2], -1, 0)
            gap = np.sqrt(dx * dx + dy * dy)
            inside = gap <= played.conditions.radius_m
            found[f"violations_{kind}"] += inside[0] + (inside[1:] & ~inside[:-1]).sum(axis=0)
            found[f"closest_{kind}_m"] = np.minimum(found[f"closest_{kind}_m"], gap.min(axis=0))
    return found | {"closest_m": np.minimum(found["closest_teammate_m"], found["closest_opponent_m"])}


def _total(values: Array) -> Array:
    """Sums (B,) of (T, B, m), boat by boat and step by step, so that they are the same bits everywhere."""
    return np.asarray(np.moveaxis(values, 0, 2).reshape(values.shape[1], -1).cumsum(axis=1)[:, -1])


def tally(played: Trajectory) -> Columns:
    """Count for every game.

    Returns:
        Arrays (B,): ``violations_teammate``, ``violations_opponent``, ``closest_teammate_m``, ``closest_opponent_m``,
        ``closest_m``, ``changed_share``, ``heading_change_deg`` and ``speed_change_mps`` (means over changed steps,
        NaN without), ``reversals_per_min`` (per own boat), ``deadlocks``, ``goal_s`` (mean over own boats of the time
        to the first goal, a boat that never reaches it counting with the whole length), ``reached`` (share of own
        boats that did), ``outside_m`` (how far an own boat left the field at most).
    """
    scenes, own = played.scenes, played.scenes.own
    boats, stuck, outside_m = own.sum(), np.empty(scenes.games), np.zeros(scenes.games)
    nominal, filtered = played.nominal[:, :, own], played.filtered[:, :, own]
    changed = (filtered != nominal).any(axis=-1)
    steps = changed.sum(axis=(0, 2))
    speed_change, turn_change = np.moveaxis(np.abs(filtered - nominal), -1, 0)
    turn_change = np.where(turn_change > 180.0, np.abs(turn_change - 360.0), turn_change)
    flips = [count_reversals(filtered[:, b, :, 1], np.zeros_like(filtered[:, b, :, 1])) for b in range(scenes.games)]
    speeds_mps = np.ascontiguousarray(played.state[1:, ..., L.SPEED]), np.ascontiguousarray(played.nominal[..., 0])
    deadlocks(*speeds_mps, own, round(DEADLOCK_S / DT_S), stuck)
    if scenes.field is not None:
        low, high = np.array(scenes.field[:2]), np.array(scenes.field[2:])
        places = played.state[:, :, own, :2]
        outside_m = np.maximum(np.maximum(low - places, places - high), 0.0).max(axis=(0, 2, 3))
    goal_s, of_changed = played.first_goal_s[:, own], np.where(steps > 0, steps, np.nan)
    return {
        **_pair_columns(played),
        "changed_share": steps / (scenes.steps * boats),
        "heading_change_deg": _total(np.where(changed, turn_change, 0.0)) / of_changed,
        "speed_change_mps": _total(np.where(changed, speed_change, 0.0)) / of_changed,
        "reversals_per_min": np.array(flips) / (scenes.steps * DT_S / 60.0 * boats),
        "deadlocks": stuck,
        "goal_s": np.where(np.isnan(goal_s), scenes.length_s, goal_s).mean(axis=1),
        "reached": (~np.isnan(goal_s)).mean(axis=1),
        "outside_m": outside_m,
    }


def never_arrived(played: Trajectory, bare: Trajectory) -> Array:
    """Share (B,) of own boats that had not reached their first goal by the end, and did without a filter.

    A livelock of teammates is safe, and nobody stands still in it: this shows it. A boat that cannot get there in time
    even alone says nothing about the filter: it counts as one that arrived.
    """
    own = played.scenes.own
    lost = np.isnan(played.first_goal_s[:, own]) & ~np.isnan(bare.first_goal_s[:, own])
    return np.asarray(lost.mean(axis=1))


def start_safety_margin_m(played: Trajectory) -> Array:
    """The default shield's safety margin (B,) at the first decision, m, least of the own boats, whatever was played.

    It is asked about the true start, with the margins that the conditions call for, so that filters are compared on the
    same encounters. At least 0: outside the set from which the shield cannot promise to keep the radius.
    """
    scenes = played.scenes
    shield = build_filter(SHIELD, scenes, played.conditions)
    shield.decide(scenes.state, played.nominal[0], np.broadcast_to(scenes.own, scenes.state.shape[:2]).copy())
    return np.asarray(shield.safety_margin_m[:, scenes.own].min(axis=1))


def safe_boats(scenes: Scenes, state: Array, conditions: Conditions) -> BoolArray:
    """Own boats (B, n) in states (B, n, N_STATE) from which the separation can be kept; none without tables."""
    safe = np.zeros(state.shape[:2], np.bool_)
    config = ShieldConfig.of(
        separation_m=conditions.radius_m, position_error_m=conditions.noise_m, dt_s=DT_S, adversary_horizon_s=math.inf
    )
    try:
        judge = ReachFilter(config, 1, scenes.platforms, tuple(scenes.team.tolist()))
    except ConfigError:  # boats without tables, or a radius beyond what they tell
        return safe
    mark_safe(judge.setup, np.ascontiguousarray(state), scenes.own, safe)
    return safe


def inactive_columns(
    bare: Trajectory, safety_filter: str | FilterMaker, conditions: Conditions, games: IntArray
) -> Columns:
    """Of games (k,) of what was played without a filter, samples that are safe, and how many of these it leaves."""
    steps = np.arange(0, bare.scenes.steps, round(EVERY_S / DT_S))
    scenes = bare.scenes.take(np.tile(games, len(steps)))
    state, nominal = (of[steps][:, games].reshape(scenes.games, *of.shape[2:]) for of in (bare.state, bare.nominal))
    ours = np.broadcast_to(scenes.own, state.shape[:2]).copy()
    safe = safe_boats(scenes, state, conditions)
    decider = build_filter(safety_filter, scenes, conditions)
    filtered = check_answer(decider, decider.decide(state, nominal.copy(), ours), ours.shape)
    alone = safe & (filtered == nominal).all(axis=2)
    return {
        name: marks.reshape(len(steps), len(games), -1).sum(axis=(0, 2)).astype(np.float64)
        for name, marks in (("sampled_safe", safe), ("left_alone", alone))
    }


def judge_game(played: Trajectory, game: int) -> dict[str, float]:
    """Judge the violations of the own boats in a game, the first `MOST_JUDGED` of them.

    One is avoidable when any own boat in it could have avoided it; of teammates either may.

    Returns:
        How many are ``avoidable``, ``unavoidable``, ``started_inside`` and ``not_judged``; and of the one that counts
        (the first avoidable one, else the first) ``last_preventable_s``, how long before it an own boat could still
        avoid it (NaN: never), and ``responsible``, the index in `SIDES`.
    """
    states, scenes, conditions = played.state[:, game], played.scenes, played.conditions
    found = find_violations(states[:, :, :2], conditions.radius_m)
    ours = [row for row in found if scenes.own[row[1:3].astype(int)].any()]
    current = scenes.current[game] * conditions.current_mps
    delays = np.where(scenes.own, conditions.delay_steps(DT_S), 0)
    motion = oracle.Motion(tuple(current.tolist()), tuple(delays.tolist()))
    judged = oracle.judge_violations(
        states, scenes.params, ours[:MOST_JUDGED], conditions.radius_m, DT_S, motion=motion
    )
    entries = [_entry(verdict, scenes.own) for verdict in judged]
    counts = {name: float(sum(entry["outcome"] == name for entry in entries)) for name in COUNTS}
    counts["not_judged"] = float(len(ours) - len(judged))
    chosen: list[dict[str, Any]] = (
        [entry for entry in entries if entry["outcome"] == "avoidable"] or entries or [NO_VERDICT]
    )
    return counts | {name: chosen[0][name] for name in ("last_preventable_s", "responsible")}


def _entry(verdict: oracle.ViolationVerdict, own: BoolArray) -> dict[str, Any]:
    """Outcome for the own side of a violation, how long before it that side could avoid it, s, who is responsible."""
    best, side = own_side(verdict, np.flatnonzero(own).tolist())
    late_s = math.nan if best.last_preventable_s is None else best.last_preventable_s
    return {"outcome": str(best.outcome), "last_preventable_s": late_s, "responsible": float(SIDES.index(side))}


def side_name(responsible: float) -> str | None:
    """Name of a side, given the number in the column ``responsible``; None without a verdict."""
    return None if np.isnan(responsible) else SIDES[int(responsible)]


def judge_worst(played: Trajectory, counted: Columns, worst: IntArray) -> tuple[IntArray, list[dict[str, float]]]:
    """Judge encounters: the variant that came closest (``worst``), or another one whose violation is avoidable.

    Returns:
        The game of each encounter that counts, and what `judge_game` says about it.
    """
    hits, number = counted["violations_teammate"] + counted["violations_opponent"], played.scenes.number
    chosen, verdicts = [], []
    for first in worst:
        kept, counts = int(first), dict(NO_VERDICT)
        same = np.flatnonzero((number == number[first]) & (hits > 0))
        for tried, game in enumerate(same[np.argsort(counted["closest_m"][same], kind="stable")][:MOST_VARIANTS]):
            verdict = judge_game(played, int(game))
            if tried == 0 or verdict["avoidable"]:
                kept, counts = int(game), verdict
            if verdict["avoidable"]:
                break
        chosen.append(kept)
        verdicts.append(counts)
    return np.array(chosen), verdicts


def measure_chunk(
    scenes: Scenes, safety_filter: str | FilterMaker, conditions: Conditions, judge: bool = True
) -> Columns:
    """Play a batch of scenes with a filter and without, and count.

    Returns:
        Columns (n,) over the encounters, the worst variant of each: ``number``, ``game`` (of the batch), ``variant``,
        ``start_safety_margin_m``, those of `tally`, ``never_arrived``, ``unshielded_*`` of `BARE_SAME` and
        `BARE_WORST`,
        those of `inactive_columns`, ``decision_us`` and ``decision_p999_us`` (of the chunk, per game and step), and the
        verdicts.
    """
    play(
        replace(scenes.take([0]), length_s=DT_S), safety_filter, conditions
    )  # compiles, so that what is timed is deciding
    played = play(scenes, safety_filter, conditions)
    without = played if safety_filter == NONE else play(scenes, NONE, conditions)
    counted, bare = tally(played) | {"never_arrived": never_arrived(played, without)}, tally(without)
    worst, worst_bare = worst_games(scenes, counted["closest_m"]), worst_games(scenes, bare["closest_m"])
    if judge:
        worst, verdicts = judge_worst(played, counted, worst)
    else:
        hits = (counted["violations_teammate"] + counted["violations_opponent"])[worst]
        verdicts = [NO_VERDICT | {"not_judged": float(count)} for count in hits]
    decision_us = [float(of(played.decision_us)) for of in (np.median, lambda us: np.quantile(us, 0.999))]
    return {
        "number": scenes.number[worst].astype(np.float64),
        "game": worst.astype(np.float64),
        "variant": np.array([game - np.argmax(scenes.number == scenes.number[game]) for game in worst], float),
        "start_safety_margin_m": start_safety_margin_m(played)[worst],
        **{name: values[worst] for name, values in counted.items()},
        **{f"unshielded_{name}": bare[name][worst] for name in BARE_SAME},
        **{f"unshielded_{name}": bare[name][worst_bare] for name in BARE_WORST},
        **inactive_columns(without, safety_filter, conditions, worst_bare),
        "decision_us": np.full(len(worst), decision_us[0]),
        "decision_p999_us": np.full(len(worst), decision_us[1]),
        **{name: np.array([verdict[name] for verdict in verdicts]) for name in NO_VERDICT},
    }


def worst_games(scenes: Scenes, closest_m: Array) -> IntArray:
    """Games, one per encounter, in which its boats came closest."""
    order = np.lexsort((closest_m, scenes.number))
    firsts = np.flatnonzero(np.diff(scenes.number[order], prepend=-1))
    return np.asarray(order[firsts])


def chunk_size(family: str, own: str, other: str, conditions: Conditions, seed: int, first: int = 0) -> int:
    """Encounters per chunk: their trajectories, with a filter and without, take about `CHUNK_MIB`."""
    sample = draw(family, own, other, conditions, seed, first, 1)
    per_game = 2 * 8 * sample.steps * len(sample.team) * (sample.state.shape[2] + 5)
    return max(1, min(MOST_PER_CHUNK, int(CHUNK_MIB * 2**20 / (per_game * sample.games))))
