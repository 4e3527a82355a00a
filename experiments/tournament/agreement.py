"""How far two rankings agree: Kendall's tau-b, Spearman's rho, and the pairs that do not."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from .paper import SCRIPTED, paper_row
from .standings import Totals, limits, ranks_of, score_of


def agreement(totals: Totals, penalty: float, free: bool, seed: int) -> dict[str, Any] | None:
    """Compare a ranking with the paper's, over the teams that are in both.

    Args:
        totals: the games of one state.
        penalty: weight that ranks ours.
        free: compare with Table 4 (no penalty) instead of Table 3.
        seed: of the bootstrap.

    Returns:
        What `compared` gives over all of them and, under ``scripted``, over the scripted, searching and planning ones:
        ``all_games``, and ``among`` from the games among these alone (None with fewer than three); None with fewer than
        three teams of the paper.
    """
    known = [(k, _rank(name, free)) for k, name in enumerate(totals.teams) if paper_row(name) is not None]
    if len(known) < 3:
        return None
    chosen = [(k, rank) for k, rank in known if totals.teams[k] in SCRIPTED]
    scripted = None
    if len(chosen) > 2:
        among = totals.among([totals.teams[k] for k, _ in chosen])
        scripted = {
            "all_games": compared(totals, chosen, penalty, seed),
            "among": compared(among, chosen, penalty, seed),
        }
    return {**compared(totals, known, penalty, seed), "scripted": scripted}


def compared(totals: Totals, known: Sequence[tuple[int, int]], penalty: float, seed: int) -> dict[str, Any]:
    """Compare our ranks with given ones.

    Args:
        totals: games that rank ours.
        known: place of each team in ``totals.teams``, and its given rank.
        penalty: weight that ranks ours.
        seed: of the bootstrap.

    Returns:
        ``teams``, ``kendall`` and ``spearman`` (value, low, high), ``disagree`` (pairs that are given the other way
        round, ours first) and ``sure``, the share of resamples that have each of them so (None: one repetition).
    """
    places, theirs = [k for k, _ in known], np.array([rank for _, rank in known], dtype=np.float64)
    ours = ranks_of(totals.sums(), penalty)[places]
    scores = score_of(totals.resampled(seed), penalty)[:, places] if totals.repetitions > 1 else None
    drawn = None if scores is None else stats.rankdata(-np.round(scores, 9), method="min", axis=-1)
    pairs = _discordant(ours, theirs)
    names = [totals.teams[k] for k in places]
    return {
        "teams": names,
        "kendall": _interval(tau_b, ours, theirs, drawn),
        "spearman": _interval(rho, ours, theirs, drawn),
        "disagree": [f"{names[i]} before {names[j]}" for i, j in pairs],
        "sure": [None if scores is None else float(np.mean(scores[:, i] > scores[:, j] + 1e-9)) for i, j in pairs],
    }


def tau_b(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> float:
    """Kendall's tau-b; NaN where one ranking is all ties."""
    return float(stats.kendalltau(ours, theirs).statistic)


def rho(ours: NDArray[np.float64], theirs: NDArray[np.float64]) -> float:
    """Spearman's rho; NaN where one ranking is all ties."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", stats.ConstantInputWarning)
        return float(stats.spearmanr(ours, theirs).statistic)


def _interval(measure: Any, ours: Any, theirs: Any, drawn: Any) -> dict[str, float | None]:
    values = None if drawn is None else np.array([measure(one, theirs) for one in drawn[:500]])
    low, high = limits(values)
    value = measure(ours, theirs)
    return {"value": None if np.isnan(value) else value, "low": low, "high": high}


def _discordant(ours: Any, theirs: Any) -> list[tuple[int, int]]:
    """Pairs in our order that are given the other way round."""
    found = []
    for i, j in combinations(range(len(ours)), 2):
        if (ours[i] - ours[j]) * (theirs[i] - theirs[j]) < 0:
            found.append((i, j) if ours[i] < ours[j] else (j, i))
    return found


def _rank(team: str, free: bool) -> int:
    row = paper_row(team)
    assert row is not None  # its caller asked
    return row.rank_free if free else row.rank
