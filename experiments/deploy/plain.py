"""Counts of a run, and regular status lines."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable

import numpy as np
from steerclear.shield.bridge.failsafe_table import CONDITIONS
from steerclear.shield.bridge.messages import Action, Tick
from steerclear.shield.decision import Reason
from steerclear.shield.fleet import Fleet
from steerclear.shield.platforms import layout as L

EVERY_S = 5.0  # time between two lines, s
MOST_TICKS = 5000  # kept for the next line where a terminal takes none
LINES = {
    "time": ("{:6.0f} s", f"seconds since the first turn; a line every {EVERY_S:g} s"),
    "alone": ("no other boat", "nobody else is known: nothing to keep clear of"),
    "closest": (
        "closest {:5.1f} m",
        "how near our boats came to any other since the last line, as believed; too near: Ctrl-C, or by hand",
    ),
    "changed": (
        "{} of {} commands changed",
        "of our boats' commands since the last line, those the shield changed",
    ),
    "policy": ("policy {:.0f} ms old", "since the policy's answer was right; beyond `limits.policy` a response is due"),
    "undecided": ("no decision", "no boat of ours is ready: each one's line or the checks say why"),
    "effect": (
        "  {}",
        "why a response is due, which, how control returns; once, and of a boat outside the operating area every time",
    ),
}
"""Text of the lines, and what they mean and what to do; the operator's page is made from it."""


class Tally:
    """Counts decisions and records the own boats' closest approach to any other; a `TickSink`.

    Attributes:
        ticks, decided: turns of the loop, and those with a decision.
        commands, changed, best_effort: decided commands of own boats; of these, changed, and best effort.
        responses: turns in which a declared response had an effect.
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
        """Do nothing."""

    def figures(self) -> dict[str, float]:
        """Return the figures by their keys in `keys.FIGURES`."""
        return {
            "ticks": float(self.ticks),
            "decided": float(self.decided),
            "changed_share": self.changed / max(1, self.commands),
            "best_effort_commands": float(self.best_effort),
            "ticks_with_actions": float(self.responses),
            "closest_m": self.closest_m,
            "least_safety_margin_m": self.least_m,
        }


def closest_m(fleet: Fleet) -> float:
    """Return the smallest distance of a controlled boat to any other, by believed positions, m."""
    at = fleet.state[:, [L.X, L.Y]]
    apart = np.hypot(*np.moveaxis(at[:, None] - at[None], -1, 0))
    np.fill_diagonal(apart, np.inf)
    return float(apart[fleet.controlled].min(initial=math.inf))


class PlainLines:
    """A sink that prints a status line every few seconds, from its own thread.

    A declared response is printed once, and again when it changes or returns; one for a boat outside the geofence every
    time, since the distance matters.
    """

    def __init__(self, say: Callable[[str], None], every_s: float = EVERY_S) -> None:
        self._say, self._every_s = say, every_s
        self._ticks: deque[Tick] = deque(maxlen=MOST_TICKS)
        self._shown: set[tuple[str, str, str]] = set()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="plain lines", daemon=True)
        self._thread.start()

    def take(self, tick: Tick) -> None:
        """Keep this tick for the next line; the loop never waits for the thread that prints."""
        self._ticks.append(tick)

    def close(self) -> None:
        """Stop the thread."""
        self._closing.set()
        self._thread.join(2.0)

    def _run(self) -> None:
        began_s = math.nan
        while not self._closing.wait(self._every_s):
            if not self._ticks:
                continue
            since = Tally()
            while self._ticks:
                since.take(tick := self._ticks.popleft())
                began_s = tick.began_s if math.isnan(began_s) else began_s
            said = [_say("undecided")]
            if tick.fleet is not None and tick.decisions is not None:
                near = _say("alone") if math.isinf(since.closest_m) else _say("closest", since.closest_m)
                changed = _say("changed", since.changed, since.commands)
                said = [near, changed, _say("policy", 1e3 * tick.policy_age_s)]
            self._say(f"{_say('time', tick.began_s - began_s)}  {', '.join(said)}")
            new = {(one.subject, one.condition, one.response): effect_words(one) for one in tick.actions}
            for key, text in new.items():
                if key not in self._shown or key[1] == "geofence":
                    self._say(_say("effect", text))
            self._shown = set(new)


def effect_words(action: Action) -> str:
    """Why a response is in effect, of whom, what is done, and how control returns, where the condition alone tells."""
    named = "" if action.subject in action.text else f"{action.subject}: "
    returns = {row.returns for row in CONDITIONS.values() if row.name.partition(".")[0] == action.condition}
    done = "" if action.response == "none" else f" -> {action.response}"
    return named + action.text + done + (f"; control returns: {returns.pop()}" if done and len(returns) == 1 else "")


def _say(name: str, *values: object) -> str:
    return LINES[name][0].format(*values)
