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
from .standings import Totals, limits, ranks_of


def agreement(totals: Totals, penalty: float, free: bool, seed: int) -> dict[str, Any] | None:
    """Compare a ranking with the paper's, over the teams that are in both.

    Args:
        totals: the games of one state.
        penalty: weight that ranks ours.
        free: compare with Table 4 (no penalty) instead of Table 3.
        seed: of the bootstrap.

    Returns:
        ``teams``, ``kendall`` and ``spearman`` (value, low, high), ``disagree`` (pairs that the paper ranks the other
        way), ``spearman_scripted``; None with fewer than three teams of the paper.
    """
    rows = [(k, paper_row(name)) for k, name in enumerate(totals.teams)]
    known = [(k, row.rank_free if free else row.rank) for k, row in rows if row is not None]
    if len(known) < 3:
        return None
    places, theirs = np.array([k for k, _ in known]), np.array([rank for _, rank in known], dtype=np.float64)
    ours = ranks_of(totals.sums(), penalty)[places]
    drawn = ranks_of(totals.resampled(seed), penalty)[:, places] if totals.repetitions > 1 else None
    names = [totals.teams[k] for k in places]
    return {
        "teams": names,
        "kendall": _interval(tau_b, ours, theirs, drawn),
        "spearman": _interval(rho, ours, theirs, drawn),
        "spearman_scripted": _of_scripted(names, ours, theirs),
        "disagree": [f"{a} before {b}" for a, b in _discordant(names, ours, theirs)],
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


def _of_scripted(names: Sequence[str], ours: Any, theirs: Any) -> float | None:
    chosen = [k for k, name in enumerate(names) if name in SCRIPTED]
    value = rho(ours[chosen], theirs[chosen]) if len(chosen) > 2 else float("nan")
    return None if np.isnan(value) else value


def _discordant(names: Sequence[str], ours: Any, theirs: Any) -> list[tuple[str, str]]:
    """Pairs in our order that the paper has the other way round."""
    found = []
    for i, j in combinations(range(len(names)), 2):
        if (ours[i] - ours[j]) * (theirs[i] - theirs[j]) < 0:
            found.append((names[i], names[j]) if ours[i] < ours[j] else (names[j], names[i]))
    return found
