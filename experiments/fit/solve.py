"""Least squares: the numbers of a model whose predicted runs lie nearest to those seen (scipy's trust region)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from steerclear.shield.jit import Array

from .models import Model
from .rollout import errors_of
from .runs import Run

EVERY, AHEAD, PICKED = 10, 60, 6
"""Windows begin every so many steps and reach so far ahead; each so many steps one is looked at."""
WEIGHTS = np.array([1.0, 1.0, 0.02, 0.5])
"""Of x, y (1/m), heading (1/deg) and speed (s/m)."""
SOFT = 0.5
"""Residuals beyond this count less: one bad stretch must not bend the whole."""
DELAYS_S = np.arange(0.025, 0.8, 0.05)
BEGUN = 8
"""Evaluations (each with its derivatives) that every first guess gets."""


@dataclass(frozen=True)
class Fit:
    """A fitted model.

    Attributes:
        model: which.
        vector: its numbers.
        cost: mean square of the weighted residuals.
    """

    model: Model
    vector: Array
    cost: float

    @property
    def delay_s(self) -> float:
        """From command to effect, s."""
        return float(self.vector[-1])


def residuals(model: Model, vector: Array, runs: Sequence[Run], top_mps: float) -> Array:
    """Weighted differences of all runs, flat."""
    params = model.platform(vector, "fitted", top_mps).pack()
    parts = [
        (errors_of(params, run, float(vector[-1]), EVERY, AHEAD)[:, PICKED - 1 :: PICKED] * WEIGHTS).ravel()
        for run in runs
    ]
    return np.nan_to_num(np.concatenate(parts), nan=1e3, posinf=1e3, neginf=-1e3)


def fit_model(model: Model, runs: Sequence[Run], top_mps: float, starts: Sequence[Array], most: int = 50) -> Fit:
    """The best of the fits from several first guesses: each is begun, the best is gone on with."""
    begun = [_least(model, runs, top_mps, start, BEGUN) for start in starts] if len(starts) > 1 else []
    best = min(begun, key=lambda fit: fit.cost) if begun else Fit(model, starts[0], np.inf)
    if len(starts) > 1:
        best = _scan_delay(model, runs, top_mps, best)
    return _least(model, runs, top_mps, best.vector, most)


def _scan_delay(model: Model, runs: Sequence[Run], top_mps: float, fit: Fit) -> Fit:
    """The same numbers with the delay that suits them best: a descent gets stuck where commands come in steps."""
    best = fit
    for delay_s in DELAYS_S:
        vector = np.append(fit.vector[:-1], delay_s)
        cost = float(np.mean(residuals(model, vector, runs, top_mps) ** 2))
        if cost < best.cost:
            best = Fit(model, vector, cost)
    return best


def _least(model: Model, runs: Sequence[Run], top_mps: float, start: Array, most: int) -> Fit:
    room = 1e-6 * (model.high - model.low)
    found = least_squares(
        lambda vector: residuals(model, vector, runs, top_mps),
        np.clip(start, model.low + room, model.high - room),
        bounds=(model.low, model.high),
        x_scale=np.maximum(np.abs(start), 0.02 * (model.high - model.low)),
        loss="soft_l1",
        f_scale=SOFT,
        diff_step=1e-3,
        max_nfev=most,
    )
    return Fit(model, found.x, float(np.mean(found.fun**2)))
