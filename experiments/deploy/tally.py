"""What happened in a run, counted tick by tick: a sink that never grows."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.decision import Reason
from steerclear.shield.fleet import Fleet
from steerclear.shield.platforms import layout as L


class Tally:
    """Counts decisions and keeps the closest approach of own boats to any other.

    Attributes:
        commands: of own boats that were decided.
        changed: of these, by the shield.
        closest_m: closest approach, as believed, m; inf: nobody else was there.
    """

    def __init__(self) -> None:
        self._ticks = self._decided = self._best_effort = self._responses = 0
        self.commands = self.changed = 0
        self.closest_m = math.inf
        self._least_m = math.inf

    def take(self, tick: Tick) -> None:
        """Count one tick."""
        self._ticks += 1
        self._responses += any(action.response != "none" for action in tick.actions)
        decisions = tick.decisions
        if decisions is None or tick.fleet is None:
            return
        own = tick.fleet.controlled
        self._decided += 1
        self.commands += int(own.sum())
        self.changed += decisions.count_intervened
        self._best_effort += int((decisions.reason[own] == Reason.BEST_EFFORT).sum())
        self._least_m = min(self._least_m, float(decisions.certificate_m[own].min(initial=math.inf)))
        self.closest_m = min(self.closest_m, closest_m(tick.fleet))

    def close(self) -> None:
        """Nothing to finish."""

    def figures(self) -> dict[str, float]:
        """Ticks, shares of commands changed, closest approach m (as believed), least certificate m."""
        return {
            "ticks": float(self._ticks),
            "decided": float(self._decided),
            "changed_share": self.changed / max(1, self.commands),
            "best_effort_commands": float(self._best_effort),
            "ticks_with_actions": float(self._responses),
            "closest_m": self.closest_m,
            "least_certificate_m": self._least_m,
        }


def closest_m(fleet: Fleet) -> float:
    """Smallest distance of a controlled boat from any other, m, where they are believed to be."""
    at = fleet.state[:, [L.X, L.Y]]
    apart = np.hypot(*np.moveaxis(at[:, None] - at[None], -1, 0))
    np.fill_diagonal(apart, np.inf)
    return float(apart[fleet.controlled].min(initial=math.inf))


def distance_words(distance_m: float) -> str:
    """A closest approach for a person; inf: nobody else was there."""
    return f"{distance_m:.2f} m" if math.isfinite(distance_m) else "no other boat"
