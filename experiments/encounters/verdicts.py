"""What the oracle says about the breaches of a game."""

from __future__ import annotations

import importlib
from collections.abc import Sequence
from typing import Any

import numpy as np
from steerclear.env.record import find_breaches
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform

from .play import Film, delay_steps
from .scenes import DT_S
from .tally import Columns

MOST_JUDGED = 5
"""Breaches of one game that are judged; a crowd without a guard has hundreds."""
MOST_VARIANTS = 3
"""Breached variants of one encounter that are judged while none of them is avoidable."""
COUNTS = ("avoidable", "unavoidable", "started_inside", "not_judged")
VERDICT_COLUMNS = (*COUNTS, "last_preventable_s", "responsible")
SIDES = ("own", "opponent", "both", "neither", "start")
"""Whose command let the last chance pass; the column ``responsible`` holds the index, NaN without a verdict."""
NO_VERDICT: dict[str, float] = dict.fromkeys(COUNTS, 0.0) | {"last_preventable_s": np.nan, "responsible": np.nan}


def judge_game(film: Film, game: int) -> dict[str, float]:
    """Judge the breaches of the own boats in a game, the first `MOST_JUDGED` of them.

    A breach is avoidable when any own boat in it could have avoided it; of team-mates either may.

    Returns:
        How many are ``avoidable``, ``unavoidable``, ``started_inside`` and ``not_judged``; and of the breach that
        counts (the first avoidable one, else the first) ``last_preventable_s``, how long before it an own boat could
        still avoid it (NaN: never), and ``responsible``, the index in `SIDES`.
    """
    states, team = film.state[:, game], film.scenes.team
    found = find_breaches(states[:, :, :2], film.conditions.radius_m)
    ours = [row for row in found if team[int(row[1])] == 0 or team[int(row[2])] == 0]
    params = np.array([get_platform(name).pack() for name in film.scenes.platforms])
    oracle = _oracle()
    current = film.scenes.current[game] * film.conditions.current_mps
    delays = np.where(team == 0, delay_steps(film.conditions), 0)
    motion = oracle.Motion(tuple(current.tolist()), tuple(delays.tolist()))
    first = ours[:MOST_JUDGED]
    judged = oracle.judge_breaches(states, params, first, film.conditions.radius_m, DT_S, motion=motion)
    entries = [_entry(verdict, team) for verdict in judged]
    counts = NO_VERDICT | {name: float(sum(entry[0] == name for entry in entries)) for name in COUNTS}
    counts["not_judged"] = float(len(ours) - len(judged))
    chosen = next((entry for entry in entries if entry[0] == "avoidable"), entries[0] if entries else None)
    if chosen is not None:
        counts["last_preventable_s"], counts["responsible"] = chosen[1], float(SIDES.index(chosen[2]))
    return counts


def side_name(responsible: float) -> str | None:
    """Name of a side, given the number in the column ``responsible``; None without a verdict."""
    return None if np.isnan(responsible) else SIDES[int(responsible)]


def judge_worst(film: Film, counted: Columns, worst: np.ndarray) -> tuple[np.ndarray, list[dict[str, float]]]:
    """Judge encounters: the variant that came closest, or another breached one that is avoidable.

    Args:
        film: what was played.
        counted: its columns, see `tally.tally`.
        worst: the game of each encounter that came closest.

    Returns:
        The game of each encounter that counts, and what `judge_game` says about it.
    """
    hits = counted["breaches_teammate"] + counted["breaches_opponent"]
    chosen, verdicts = worst.copy(), []
    for k, first in enumerate(worst):
        same = np.flatnonzero((film.scenes.number == film.scenes.number[first]) & (hits > 0))
        order = same[np.argsort(counted["closest_m"][same], kind="stable")][:MOST_VARIANTS]
        chosen[k], verdict = _first_avoidable(film, [int(game) for game in order], int(first))
        verdicts.append(verdict)
    return chosen, verdicts


def _first_avoidable(film: Film, games: Sequence[int], otherwise: int) -> tuple[int, dict[str, float]]:
    """The first of the games with an avoidable breach, else the first of all, and its verdict."""
    kept: tuple[int, dict[str, float]] | None = None
    for game in games:
        verdict = judge_game(film, game)
        if verdict["avoidable"]:
            return game, verdict
        kept = kept or (game, verdict)
    return kept or (otherwise, dict(NO_VERDICT))


def _entry(verdict: Any, team: np.ndarray) -> tuple[str, float, str]:
    """Outcome for the own side of a breach, how long before it that side could avoid it, s, and who is responsible."""
    ours = [side for side in (verdict.first, verdict.second) if team[side.own] == 0]
    best = max(ours, key=lambda side: -1 if side.last_step is None else side.last_step)
    late = float("nan") if best.last_preventable_s is None else float(best.last_preventable_s)
    inside = [team[boat] == 0 for boat in verdict.responsible_boats()]
    name = "own" if all(inside) else "both" if any(inside) else "opponent"
    return str(best.outcome), late, name if inside else str(verdict.responsible)


def _oracle() -> Any:
    try:
        return importlib.import_module("steerclear.experiments.oracle")
    except ImportError as error:
        raise ConfigError(f"the oracle cannot be imported ({error}); reinstall steerclear or add --no-judge") from error
