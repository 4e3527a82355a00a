"""`Run`: a stretch of a log in which a boat was told where to go, on a grid of equal steps."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from steerclear.shield.jit import Array

from .errors import FitError

STEP_S = 0.1
"""Step of the grid and of the model, s."""
LONGEST_GAP_S = 1.0
"""Between two of a log's rows a run ends."""
SHORTEST_S = 3.0
"""Shorter runs tell nothing."""
RATE_OVER_S = 0.2
"""Turn rates are taken over this time, s."""
FASTEST_MPS = 40.0
SAME_S = 1e-4
"""Times closer together are the same."""


@dataclass(frozen=True)
class Run:
    """One run of k steps.

    Attributes:
        name: of the log it is from.
        seen: (k, 5) x m, y m, heading deg (unwrapped, clockwise from the y axis), speed m/s, turn rate deg/s.
        told: (k, 2) speed m/s and heading deg (unwrapped) commanded at each step.
    """

    name: str
    seen: Array = field(repr=False)
    told: Array = field(repr=False)

    @property
    def seconds(self) -> float:
        """How long it is, s."""
        return len(self.seen) * STEP_S

    @property
    def kind(self) -> str:
        """What it shows most of: "turn", "faster", "slower" or "steady"."""
        turned = float(np.ptp(self.told[:, 1])) + float(np.abs(self.told[0, 1] - self.seen[0, 2]))
        if turned > 10.0:
            return "turn"
        gain = float(self.seen[-1, 3] - self.seen[0, 3])
        if abs(gain) < 0.3:
            return "steady"
        return "faster" if gain > 0.0 else "slower"


def runs_of(name: str, time_s: Array, seen: Array, told: Array) -> list[Run]:
    """Runs of a log's rows: cut where commands or rows are missing, on equal steps.

    Args:
        name: of the log.
        time_s: (m,) times, s.
        seen: (m, 4) x m, y m, heading deg, speed m/s.
        told: (m, 2) speed m/s, heading deg; NaN where nothing was commanded.

    Raises:
        FitError: values no boat can have.
    """
    order = np.argsort(time_s, kind="stable")
    time_s, seen, told = time_s[order], seen[order], told[order]
    fine = np.isfinite(time_s) & np.isfinite(seen).all(axis=1) & np.isfinite(told).all(axis=1)
    _check_values(name, seen[fine])
    pieces = np.flatnonzero(~fine[1:] | ~fine[:-1] | (np.diff(time_s) > LONGEST_GAP_S)) + 1
    bounds = [0, *pieces.tolist(), len(time_s)]
    runs = [_grid(name, time_s[a:b], seen[a:b], told[a:b]) for a, b in pairwise(bounds)]
    return [run for run in runs if run is not None]


def _check_values(name: str, seen: Array) -> None:
    if len(seen) and float(np.abs(seen[:, 3]).max()) > FASTEST_MPS:
        raise FitError(f"{name}: a speed of {np.abs(seen[:, 3]).max():.0f} m/s is no boat's; give speeds in m/s")


def _grid(name: str, time_s: Array, seen: Array, told: Array) -> Run | None:
    keep = np.concatenate([[True], np.diff(time_s) > 1e-6]) if len(time_s) else np.zeros(0, bool)
    time_s, seen, told = time_s[keep], seen[keep], told[keep]
    if len(time_s) < 4 or time_s[-1] - time_s[0] < SHORTEST_S:
        return None
    time_s = time_s - time_s[0]  # seconds since 1970 leave no room for fractions
    grid = np.arange(time_s[0], time_s[-1], STEP_S)
    columns = [
        np.interp(grid, time_s, column) for column in (seen[:, 0], seen[:, 1], _unwrapped(seen[:, 2]), seen[:, 3])
    ]
    last = np.searchsorted(time_s, grid + SAME_S, side="right") - 1  # commands hold until the next one
    heading = _unwrapped(told[:, 1])
    heading = heading + 360.0 * np.round((columns[2][0] - heading[0]) / 360.0)
    commands = np.column_stack([told[last, 0], heading[last]])
    return Run(name, np.column_stack([*columns, turn_rates(columns[2])]), commands)


def _unwrapped(angle_deg: Array) -> Array:
    return np.unwrap(angle_deg, period=360.0)


def turn_rates(heading_deg: Array) -> Array:
    """Turn rates, deg/s, of unwrapped headings on the grid, over `RATE_OVER_S` back."""
    back = max(1, round(RATE_OVER_S / STEP_S))
    padded = np.concatenate([np.full(back, heading_deg[0]), heading_deg])
    return np.asarray((padded[back:] - padded[:-back]) / (back * STEP_S))
