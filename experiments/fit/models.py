"""Models to fit, each a parameter vector for least squares, and their predictions of a run."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from steerclear.shield.jit import Array, kernel
from steerclear.shield.platforms import Gains, Platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.proving import reference_models
from steerclear.shield.tracks import thrust_at

from .runs import STEP_S, Run

DELAY = ("delay_s", 0.15, 0.0, 1.0)
_RATE = (
    ("max_acc", 0.8, 0.02, 8.0),
    ("max_dec", 0.8, 0.02, 8.0),
    ("speed_lag_s", 0.3, 0.01, 6.0),
    ("max_turn_rate_dps", 40.0, 1.0, 360.0),
    ("max_angular_acc_dps2", 60.0, 1.0, 1500.0),
    ("turn_rate_at_rest_dps", 10.0, 0.01, 360.0),
    ("turn_rate_per_mps", 20.0, -60.0, 180.0),
    ("turn_lag_s", 0.1, 0.005, 3.0),
    ("turn_loss", 0.1, 0.0, 0.95),
    ("kp", 1.5, 0.05, 6.0),
    DELAY,
)
_USV = (
    ("half_speed", 0.5, 0.2, 0.85),
    ("max_acc", 0.4, 0.02, 8.0),
    ("max_dec", 0.4, 0.02, 8.0),
    ("speed_kp", 1.0, 0.02, 40.0),
    ("turn_loss", 0.5, 0.0, 0.95),
    ("turn_gain", 30.0, 1.0, 200.0),
    ("kp", 0.8, 0.05, 10.0),
    ("kd", 0.5, 0.0, 12.0),
    DELAY,
)
HELD_S, HELD_MPS, FASTER_MPS = 2.0, 0.06, 0.25
"""A boat at top speed holds it this long, s, within this range, m/s, though commanded this much faster, m/s."""

FIRST_STEPS = 60  # from which the thrust at the beginning of a run is told

SLOW_SHARE = 0.2  # share of top speed below which a boat counts as nearly at rest

Bound = tuple[str, float, float, float]


@dataclass(frozen=True)
class Seen:
    """Extremes that a boat reached in its runs, m/s, m/s2, deg/s, deg/s2; ``rest_rate_dps``: turn rate nearly at rest.

    A boat never seen turning at rest is assumed hardly able to.
    """

    top_mps: float
    acc_mps2: float
    dec_mps2: float
    turn_rate_dps: float
    angular_acc_dps2: float
    rest_rate_dps: float

    @classmethod
    def of(cls, runs: Sequence[Run]) -> Seen:
        """Return the extremes of some runs, outliers left out."""
        speed = np.concatenate([run.seen[:, 3] for run in runs])
        fastest = max(float(run.commanded[:, 0].max()) for run in runs)
        gains = np.concatenate([_slope(run.seen[:, 3], 0.5) for run in runs])
        rates = np.concatenate([np.abs(run.seen[:, 4]) for run in runs])
        top = max(0.05, min(fastest, *(_held(run) for run in runs)))
        slow = rates[np.abs(speed) < SLOW_SHARE * top]
        bends = np.concatenate([np.abs(_slope(run.seen[:, 4], 0.3)) for run in runs])
        return cls(
            top_mps=round(top, 2),
            acc_mps2=max(0.02, float(np.quantile(gains, 0.99))),
            dec_mps2=max(0.02, float(-np.quantile(gains, 0.01))),
            turn_rate_dps=max(1.0, float(np.quantile(rates, 0.998))),
            angular_acc_dps2=max(1.0, float(np.quantile(bends, 0.995))),
            rest_rate_dps=max(0.05, float(np.quantile(slow, 0.99))) if len(slow) else 0.05,
        )


def _held(run: Run) -> float:
    """Return a run's speed held although commanded faster, m/s, which is top speed; inf if there was none."""
    over = round(HELD_S / STEP_S)
    if len(run.seen) <= over:
        return np.inf
    gained = np.abs(run.seen[over:, 3] - run.seen[:-over, 3])
    commanded = np.min([run.commanded[k : len(run.commanded) - over + k, 0] for k in range(0, over + 1, 5)], axis=0)
    turned = np.abs(run.seen[over:, 2] - run.seen[:-over, 2])
    held = (
        (gained < HELD_MPS)
        & (turned < 5.0)
        & (commanded > run.seen[over:, 3] + FASTER_MPS)
        & (run.seen[over:, 3] > 0.3)
    )
    return float(np.median(run.seen[over:, 3][held])) if held.sum() >= 5 else np.inf


def _slope(values: Array, over_s: float) -> Array:
    """Return the change per second over an interval."""
    apart = max(1, round(over_s / STEP_S))
    return np.asarray((values[apart:] - values[:-apart]) / (apart * STEP_S))


@dataclass(frozen=True)
class Model:
    """A boat to fit; ``kind`` is its platform's.

    ``bounds`` give each parameter's name, first guess, lowest and highest value.
    ``guesses`` are further first guesses for some parameters. ``build`` makes the platform from named values, its name
    and its top speed.
    """

    kind: str
    bounds: tuple[Bound, ...]
    guesses: tuple[dict[str, float], ...]
    build: Callable[[dict[str, float], str, float], Platform]

    @property
    def low(self) -> Array:
        """Lowest values."""
        return np.array([bound[2] for bound in self.bounds])

    @property
    def high(self) -> Array:
        """Highest values."""
        return np.array([bound[3] for bound in self.bounds])

    def around(self, seen: Seen) -> Model:
        """Return the model with first guesses and bounds from what was seen of the boat."""
        twice = 2.0 if self.kind == "usv" else 1.0  # a usv averages old and new speed: half as quick
        commanded = {
            "max_acc": (twice * seen.acc_mps2, 0.5, 4.0),
            "max_dec": (twice * seen.dec_mps2, 0.5, 4.0),
            "max_turn_rate_dps": (seen.turn_rate_dps, 0.9, 1.1),
            "max_angular_acc_dps2": (seen.angular_acc_dps2, 0.5, 8.0),
            "turn_rate_at_rest_dps": (seen.rest_rate_dps, 0.0, 1.1),
        }
        bounds, guess = [], {}
        for name, value, low, high in self.bounds:
            if name in commanded:
                middle, below, above = commanded[name]
                value = guess[name] = min(max(middle, low), high)
                low, high = max(low, below * value), min(high, above * value + 1e-3)
            bounds.append((name, value, low, high))
        guesses = tuple({**other, **guess} for other in self.guesses)
        return replace(self, bounds=tuple(bounds), guesses=guesses)

    def starts(self) -> list[Array]:
        """Return the first guesses."""
        return [np.array([guess.get(name, value) for name, value, *_ in self.bounds]) for guess in ({}, *self.guesses)]

    def values(self, vector: Array) -> dict[str, float]:
        """Return a vector's values by name."""
        return {name: float(value) for (name, *_), value in zip(self.bounds, vector, strict=True)}

    def platform(self, vector: Array, name: str, top_mps: float, proved: bool = False) -> Platform:
        """Return the platform of a vector; if ``proved``, `PlatformError` where it cannot be steered."""
        with contextlib.nullcontext() if proved else reference_models():
            return self.build(self.values(vector), name, top_mps)


def _rate(v: dict[str, float], name: str, top_mps: float) -> Platform:
    gains = Gains(kp=v["kp"])
    rest: dict[str, Any] = {key: value for key, value in v.items() if key not in ("kp", "delay_s")}
    return Platform(name=name, kind="rate", max_speed_mps=top_mps, heading_pid=gains, **rest)


def _usv(v: dict[str, float], name: str, top_mps: float, full_turn_speed_mps: float = 0.0) -> Platform:
    return Platform(
        name=name,
        kind="usv",
        max_speed_mps=top_mps,
        thrust_map=((-100.0, -top_mps), (0.0, 0.0), (50.0, v["half_speed"] * top_mps), (100.0, top_mps)),
        turn_loss=v["turn_loss"],
        turn_gain=v["turn_gain"],
        full_turn_speed_mps=full_turn_speed_mps,
        max_acc=v["max_acc"],
        max_dec=v["max_dec"],
        speed_pid=Gains(kp=v["speed_kp"]),
        heading_pid=Gains(kp=v["kp"], kd=v["kd"]),
    )


def _usv_by_speed(v: dict[str, float], name: str, top_mps: float) -> Platform:
    """Build a boat that turns in proportion to speed; one with more turn gain from a higher speed on is the same."""
    return _usv(v, name, top_mps, top_mps)


RATE = Model(
    "rate",
    _RATE,
    (
        {"max_turn_rate_dps": 90.0, "max_angular_acc_dps2": 120.0, "max_acc": 1.2, "max_dec": 1.2},
        {"max_turn_rate_dps": 12.0, "max_angular_acc_dps2": 10.0, "kp": 0.5, "turn_rate_at_rest_dps": 8.0},
    ),
    _rate,
)
USV = Model(
    "usv",
    _USV,
    (
        {"turn_gain": 10.0, "kp": 1.2, "kd": 3.0, "max_acc": 0.15, "max_dec": 0.25, "turn_loss": 0.85},
        {"turn_gain": 60.0, "kp": 0.9, "kd": 0.6, "max_dec": 0.5, "max_acc": 4.0, "turn_loss": 0.85},
    ),
    _usv,
)
USV_BY_SPEED = replace(USV, build=_usv_by_speed)
MODELS = {"rate": RATE, "usv": USV, "usv_by_speed": USV_BY_SPEED}
"""By name, for ``--kind``; `USV_BY_SPEED` is a usv that turns in proportion to its speed, too."""


@kernel
def _relative(heading_deg: float, commanded_deg: float) -> float:
    return (commanded_deg - heading_deg + 180.0) % 360.0 - 180.0


@kernel
def predict(params: Array, thrust: Array, seen: Array, commanded: Array, every: int, ahead: int, out: Array) -> None:
    """Fill ``out`` (windows, ahead, 4) with predicted x, y, unwrapped heading and speed, 1, 2, ... steps ahead.

    Before each step the model is set to the seen state (k, 5) and keeps its controllers' memory. Window w begins at
    step w * every. The memory starts with the thrust (1,), percent. ``commanded`` (k, 2) are the commands in effect.
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
                at = min(k + step, commanded.shape[0] - 1)
                before = window[L.HEADING]
                step_boat(params, window, commanded[at, 0], _relative(before, commanded[at, 1]), STEP_S)
                heading += _relative(before, window[L.HEADING])
                place = out[k // every, step]
                place[0], place[1], place[2], place[3] = window[L.X], window[L.Y], heading, window[L.SPEED]
        step_boat(params, row, commanded[k, 0], _relative(row[L.HEADING], commanded[k, 1]), STEP_S)


@kernel
def _speed_missed(params: Array, thrust: float, seen: Array, commanded: Array) -> float:
    """Return the sum of errors of the speed one step ahead, m/s, in the first steps of a run begun with a thrust."""
    row, missed = np.zeros(L.N_STATE), 0.0
    row[L.THRUST] = thrust
    row[L.SPEED_ERROR] = row[L.HEADING_ERROR] = np.nan
    for k in range(min(FIRST_STEPS, seen.shape[0] - 1)):
        row[L.HEADING], row[L.SPEED] = _relative(0.0, seen[k, 2]), max(seen[k, 3], 0.0)
        step_boat(params, row, commanded[k, 0], _relative(row[L.HEADING], commanded[k, 1]), STEP_S)
        missed += abs(row[L.SPEED] - seen[k + 1, 3])
    return missed


@kernel
def first_thrust(params: Array, seen: Array, commanded: Array) -> float:
    """Return the thrust, percent, with which a run begins, by the speeds of its first steps.

    A speed controller adds to its thrust, so one that is wrong stays so. A run may begin in a hard turn, at full thrust
    and half speed.
    """
    best = thrust_at(params, max(0.0, seen[0, 3]))
    if params[L.KIND] != L.KIND_USV or params[L.SPEED_FACTOR] != 0.0:
        return best
    least = _speed_missed(params, best, seen, commanded)
    step = 0.125 * params[L.MAX_THRUST]
    for k in range(9):
        missed = _speed_missed(params, k * step, seen, commanded)
        if missed < least:
            best, least = k * step, missed
    for _ in range(8):
        step *= 0.5
        for side in (-1.0, 1.0):
            thrust = min(max(best + side * step, 0.0), params[L.MAX_THRUST])
            missed = _speed_missed(params, thrust, seen, commanded)
            if missed < least:
                best, least = thrust, missed
                break
    return best


def delayed(run: Run, delay_s: float) -> Array:
    """Return the commands in effect in each step after a delay; fractions of a step are interpolated."""
    steps = np.arange(len(run.commanded))
    at = steps - delay_s / STEP_S
    return np.column_stack([np.interp(at, steps, column) for column in run.commanded.T])


def errors_of(params: Array, run: Run, delay_s: float, every: int, ahead: int) -> Array:
    """Return predicted minus seen, (windows, ahead, 4): x m, y m, heading deg, speed m/s."""
    count = max(0, (len(run.seen) - 1 - ahead) // every + 1)
    out = np.zeros((count, ahead, 4))
    if count:
        commanded = delayed(run, delay_s)
        thrust = np.full(1, first_thrust(params, run.seen, commanded))
        predict(params, thrust, run.seen, commanded, every, ahead, out)
    for w in range(count):
        out[w] -= run.seen[w * every + 1 :][:ahead, :4]
    return out


def distance_m(errors: Array) -> Array:
    """Return the distances, m, of errors (..., 4)."""
    return np.hypot(errors[..., 0], errors[..., 1])
