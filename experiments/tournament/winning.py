"""Who beats whom: the win matrix, and alpha-rank, which shows cycles that a single ranking hides."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from .standings import Totals, column

POPULATION = 50
STRENGTHS = (0.1, 1.0, 10.0)
"""Selection strengths that are looked at: a ranking that holds at all of them is no artefact of one."""


def win_matrix(totals: Totals, penalty: float) -> NDArray[np.float64]:
    """(teams, teams) share of their games that the row's team won against the column's, a draw counting half.

    NaN on the diagonal and for pairs that have not met.
    """
    teams = list(totals.teams)
    wins, games = np.zeros((len(teams), len(teams))), np.zeros((len(teams), len(teams)))
    for pair, values in zip(totals.strata, totals.values, strict=True):
        i, j = (teams.index(name) for name in pair)
        lead = _margin(values, i, penalty) - _margin(values, j, penalty)
        won = float((lead > 1e-9).sum() + 0.5 * (np.abs(lead) <= 1e-9).sum())
        wins[i, j] += won
        wins[j, i] += len(lead) - won
        games[i, j] += len(lead)
        games[j, i] += len(lead)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(games > 0, wins / games, np.nan))


def alpha_rank(wins: NDArray[np.float64], strength: float, population: int = POPULATION) -> NDArray[np.float64]:
    """Share of time that evolving players spend on each team (Omidshafiei et al. 2019, arXiv 1903.01373).

    One population whose members all play one team but for a mutant; the mutant takes over with the Moran process'
    fixation probability of its payoff against the residents', and the chain's stationary distribution is the ranking.

    Args:
        wins: (n, n) payoffs of the row against the column.
        strength: of selection, per unit of payoff.
        population: members.

    Returns:
        (n,) shares that add up to 1.
    """
    n = len(wins)
    payoffs = np.where(np.isfinite(wins), wins, 0.5)
    chain = np.zeros((n, n))
    for resident in range(n):
        for mutant in range(n):
            if mutant != resident:
                gain = payoffs[mutant, resident] - payoffs[resident, mutant]
                chain[resident, mutant] = _fixation(strength * gain, population) / (n - 1)
        chain[resident, resident] = 1.0 - chain[resident].sum()
    # the stationary distribution: pi (P - I) = 0 with shares that add up to 1
    system = np.vstack([chain.T - np.eye(n), np.ones(n)])
    found = np.linalg.lstsq(system, np.r_[np.zeros(n), 1.0], rcond=None)[0]
    return np.asarray(np.clip(found, 0.0, None) / np.clip(found, 0.0, None).sum())


def cycles(wins: NDArray[np.float64], teams: Sequence[str]) -> list[str]:
    """Three teams each of which beats the next."""
    found = []
    for i in range(len(teams)):
        for j in range(len(teams)):
            for k in range(len(teams)):
                if i < j and i < k and j != k and wins[i, j] > 0.5 and wins[j, k] > 0.5 and wins[k, i] > 0.5:
                    found.append(f"{teams[i]} beats {teams[j]} beats {teams[k]} beats {teams[i]}")
    return found


def _fixation(advantage: float, population: int) -> float:
    """Probability that a mutant takes over; ``1 / population`` without an advantage."""
    if abs(advantage) < 1e-9:
        return 1.0 / population
    return float(np.expm1(-advantage) / np.expm1(-population * advantage)) if advantage > -14.0 else 0.0


def _margin(values: NDArray[np.float64], team: int, penalty: float) -> NDArray[np.float64]:
    own = values[:, team]
    return np.asarray(own[:, column("captures")] - penalty * own[:, column("collisions")])
