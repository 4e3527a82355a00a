"""Counts of a run, and a line now and then about it."""

from __future__ import annotations

import math
import threading
from collections.abc import Callable

import numpy as np
from steerclear.shield.bridge.messages import Tick
from steerclear.shield.decision import Reason
from steerclear.shield.fleet import Fleet
from steerclear.shield.platforms import layout as L


class Tally:
    """Counts decisions and keeps the closest approach of own boats to any other; a `TickSink`.

    Attributes:
        ticks, decided: turns of the loop, and those with a decision.
        commands, changed, best_effort: of own boats that were decided; of these, by the shield, and as it could.
        responses: turns in which a declared response did something.
        closest_m: closest approach, as believed, m; inf: nobody else was there.
        least_m: smallest safety margin of an own boat, m.
    """

    def __init__(self) -> None:
        self.ticks = self.decided = self.commands = self.changed = self.best_effort = self.responses = 0
        self.closest_m = self.least_m = math.inf

    def take(self, tick: Tick) -> None:
        """Count one tick."""
        self.ticks += 1
        self.responses += any(action.response != "none" for action in tick.actions)
        decisions = tick.decisions
        if decisions is None or tick.fleet is None:
            return
        own = tick.fleet.controlled
        self.decided += 1
        self.commands += int(own.sum())
        self.changed += decisions.count_intervened
        self.best_effort += int((decisions.reason[own] == Reason.BEST_EFFORT).sum())
        self.least_m = min(self.least_m, float(decisions.safety_margin_m[own].min(initial=math.inf)))
        self.closest_m = min(self.closest_m, closest_m(tick.fleet))

    def close(self) -> None:
        """Nothing to finish."""

    def figures(self) -> dict[str, float]:
        """These figures, by their keys in `keys.FIGURES`."""
        return {
            "ticks": float(self.ticks),
            "decided": float(self.decided),
            "changed_share": self.changed / max(1, self.commands),
            "best_effort_commands": float(self.best_effort),
            "ticks_with_actions": float(self.responses),
            "closest_m": self.closest_m,
            "least_certificate_m": self.least_m,
        }


def closest_m(fleet: Fleet) -> float:
    """Smallest distance of a controlled boat from any other, m, where they are believed to be."""
    at = fleet.state[:, [L.X, L.Y]]
    apart = np.hypot(*np.moveaxis(at[:, None] - at[None], -1, 0))
    np.fill_diagonal(apart, np.inf)
    return float(apart[fleet.controlled].min(initial=math.inf))


class PlainLines:
    """A sink that says how it went since the last line, every few seconds, from a thread of its own.

    What is declared of a boat is said once, and again when its response changes or it comes back; of one outside the
    geofence every time, since how far matters.
    """

    def __init__(self, say: Callable[[str], None], every_s: float = 5.0) -> None:
        self._say, self._every_s = say, every_s
        self._tick: Tick | None = None
        self._began_s = math.nan
        self._tally = Tally()
        self._told: set[tuple[str, str, str]] = set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plain lines", daemon=True)
        self._thread.start()

    def take(self, tick: Tick) -> None:
        """Have this tick told next."""
        if self._tick is None:
            self._began_s = tick.began_s
        self._tick = tick
        self._tally.take(tick)

    def close(self) -> None:
        """Say the last and end."""
        self._closing.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        while not self._closing.wait(self._every_s):
            tick = self._tick
            if tick is None:
                continue
            since, self._tally = self._tally, Tally()  # no lock: the loop is never to wait for this thread
            said = "no decision"
            if tick.fleet is not None and tick.decisions is not None:
                near = "no other boat" if math.isinf(since.closest_m) else f"closest {since.closest_m:5.1f} m"
                changed = f"{since.changed} of {since.commands} commands changed"
                said = f"{near}, {changed}, policy {1e3 * tick.policy_age_s:.0f} ms old"
            self._say(f"{tick.began_s - self._began_s:6.0f} s  {said}")
            new = {(action.subject, action.condition, action.response): action.text for action in tick.actions}
            for key, text in new.items():
                if key not in self._told or key[1] == "geofence":
                    self._say(f"  {text}")
            self._told = set(new)
