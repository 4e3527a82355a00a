"""Predicting runs: the model follows a run as the runner does, and from many moments is run on under the commands."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms import step_boat

from ..jit import kernel
from .runs import STEP_S, Run


@kernel
def _relative(heading_deg: float, told_deg: float) -> float:
    return (told_deg - heading_deg + 180.0) % 360.0 - 180.0


@kernel
def predict(params: Array, thrust: Array, seen: Array, told: Array, every: int, ahead: int, out: Array) -> None:
    """Fill ``out`` (windows, ahead, 4): x, y, unwrapped heading, speed predicted 1, 2, ... steps on.

    Before each step the model is put where the boat was seen, its controllers' memory kept; window w begins at step
    w * every of the run.

    Args:
        params: platform row.
        thrust: (k,) thrust that holds the speed seen, percent: the memory at the start.
        seen: (k, 5), see `Run`.
        told: (k, 2) speed and heading that work in each step.
        every: steps between windows.
        ahead: steps predicted.
        out: windows, overwritten.
    """
    row, window = np.zeros(L.N_STATE), np.zeros(L.N_STATE)
    row[L.THRUST] = thrust[0]
    row[L.SPEED_ERROR] = row[L.HEADING_ERROR] = np.nan
    for k in range(seen.shape[0]):
        row[L.X], row[L.Y], row[L.HEADING] = seen[k, 0], seen[k, 1], _relative(0.0, seen[k, 2])
        row[L.SPEED], row[L.TURN_RATE] = max(seen[k, 3], 0.0), seen[k, 4]
        if k % every == 0 and k // every < out.shape[0]:
            window[:] = row
            heading = seen[k, 2]
            for step in range(ahead):
                at = min(k + step, told.shape[0] - 1)
                before = window[L.HEADING]
                step_boat(params, window, told[at, 0], _relative(before, told[at, 1]), STEP_S)
                heading += _relative(before, window[L.HEADING])
                place = out[k // every, step]
                place[0], place[1], place[2], place[3] = window[L.X], window[L.Y], heading, window[L.SPEED]
        step_boat(params, row, told[k, 0], _relative(row[L.HEADING], told[k, 1]), STEP_S)


def delayed(run: Run, delay_s: float) -> Array:
    """Commands that work in each step when they take so long; fractions of a step are mixed."""
    steps = np.arange(len(run.told))
    at = steps - delay_s / STEP_S
    return np.column_stack([np.interp(at, steps, column) for column in run.told.T])


def windows(run: Run, every: int, ahead: int) -> int:
    """Number of windows of a run whose whole time was seen."""
    return max(0, (len(run.seen) - 1 - ahead) // every + 1)


def errors_of(params: Array, run: Run, delay_s: float, every: int, ahead: int) -> Array:
    """Foretold less seen, (windows, ahead, 4): x m, y m, heading deg, speed m/s."""
    from steerclear.shield.tracking.tracks import thrust_at

    count = windows(run, every, ahead)
    out = np.zeros((count, ahead, 4))
    if count == 0:
        return out
    thrust = np.full(1, thrust_at(params, max(0.0, float(run.seen[0, 3]))))
    predict(params, thrust, run.seen, delayed(run, delay_s), every, ahead, out)
    for w in range(count):
        begin = w * every + 1
        out[w] -= run.seen[begin : begin + ahead, :4]
    return out


def distance_m(errors: Array) -> Array:
    """Distances, m, of errors (..., 4)."""
    return np.hypot(errors[..., 0], errors[..., 1])


def angle_between(one_deg: float, other_deg: float) -> float:
    """Difference of two headings, deg in [-180, 180)."""
    return math.remainder(one_deg - other_deg, 360.0)
