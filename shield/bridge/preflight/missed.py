"""What a boat's model misses while the boat is drilled: of its own turn only, since who lies still misses nothing."""

from __future__ import annotations

import numpy as np

from ...platforms import Platform
from ..messages import Tick
from ..model_error import AHEAD_S, ENOUGH_S, SHARE, TOLD_BY, ModelErrorMonitor
from .drill import Drill
from .result import CheckResult


class Missed:
    """A `TickSink` that keeps, of the boat whose turn it is, how far it is from where it was foreseen, m.

    Args:
        drill: the drill that is driven.

    Attributes:
        foresight: the loop's; set before the loop runs.
        errors_m: by boat's name, rows of the errors of `AHEAD_S`; NaN where there is no telling.
    """

    def __init__(self, drill: Drill) -> None:
        self.model_error: ModelErrorMonitor | None = None
        self.errors_m: dict[str, list[tuple[float, ...]]] = {name: [] for name in drill.samples}
        self._drill = drill

    def take(self, tick: Tick) -> None:
        """See `TickSink`."""
        boat, _ = self._drill.turn_of(tick.began_s)
        if boat and self.model_error is not None:
            self.errors_m[boat].append(self.model_error.latest_m(boat))

    def close(self) -> None:
        """Nothing is held."""


def check_model(
    boat: str, errors_m: list[tuple[float, ...]], platform: Platform, most_m: float, dt_s: float
) -> CheckResult:
    """The boat was where its model foresaw it, near enough that it would not be slowed for it (``limits.model``).

    Args:
        boat: its name.
        errors_m: rows of `Missed.errors_m`.
        platform: of the boat.
        most_m: `ModelLimit.outside_m`.
        dt_s: step of the loop, s.
    """
    name = f"model:{boat}"
    errors = np.array(errors_m, dtype=float).reshape(-1, len(AHEAD_S))
    errors = errors[np.isfinite(errors).all(axis=1)]
    if len(errors) * dt_s < ENOUGH_S:
        text = (
            f"its place was known and foreseen for {len(errors) * dt_s:.1f} s of its drill, {ENOUGH_S:g} s are needed; "
            "see its rates and links, then run again"
        )
        return CheckResult(name, False, text, {"judged_s": len(errors) * dt_s})
    missed_m = np.quantile(errors, SHARE, axis=0)
    figures = {f"missed_{ahead:g}s_m": float(missed) for ahead, missed in zip(AHEAD_S, missed_m, strict=True)}
    words = f"its model misses {'/'.join(f'{missed:.1f}' for missed in missed_m)} m 1/2/3 s ahead (95 of 100)"
    if missed_m[TOLD_BY] > most_m:
        text = (
            f"{words}, and beyond {most_m:g} m it would be slowed and handed over (limits.model); drive "
            f"steerclear sea-trial, and put what steerclear fit makes of its log in place of {platform.name}"
        )
        return CheckResult(name, False, text, figures)
    return CheckResult(name, True, words, figures)
