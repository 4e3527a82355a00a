"""`Drivers`: who drives a boat that runs MOOS: our gate, a hand, the helm's all-stop, or somebody else.

A MOOSDB does not arbitrate: the last writer of DESIRED_* wins. So everybody else who writes what our gate writes is
noticed here and named.
"""

from __future__ import annotations

import math
from collections import Counter

from .wire import DOUBLE, Message

OVERRIDES = ("MOOS_MANUAL_OVERRIDE", "MOOS_MANUAL_OVERIDE")
ALLSTOP, STATE = "IVPHELM_ALLSTOP", "IVPHELM_STATE"
VARIABLES = (*OVERRIDES, ALLSTOP, STATE)
HARMLESS_STOPS = ("clear", "nothingtodo", "manualoverride", "")
"""All-stops that do not concern commands of somebody else than the helm; the override is looked at by itself."""
ECHO_S = 1.0  # our own posts come back this soon, MOOS s; if not, the MOOSDB drops them


class Drivers:
    """Not thread-safe: its owner holds a lock. ``outputs``: variables that our gate alone may write.

    Attributes:
        faults: what somebody else did, by kind; the owner empties it.
        other_s: when somebody else was last seen commanding, s; -inf: never.
        other: who that was.
        helm: name of the helm; empty: none heard.
        state: of the helm, such as DRIVE.
        allstop: why the helm stopped all; "clear", or empty: not heard.
    """

    def __init__(self, ours: str, outputs: tuple[str, ...], prefix: str) -> None:
        self._ours, self._outputs, self._prefix = ours, outputs, prefix
        self.faults: Counter[str] = Counter()
        self.other, self.other_s = "", -math.inf
        self._override: dict[str, tuple[bool, str]] = {}
        self.forget()

    def forget(self) -> None:
        """The connection was lost: what is known of the helm is old; a hand stays on the boat until it lets go."""
        self.helm = self.state = self.allstop = ""
        self._posted_s = self._echoed_s = -math.inf
        self._known: set[str] = set()

    @property
    def overridden(self) -> str:
        """Who drives by hand; empty: nobody."""
        return next((source or "somebody" for on, source in self._override.values() if on), "")

    def why_not(self) -> str:
        """Why commands would not be obeyed now, in words; empty: they would."""
        if self.overridden:
            return f"MOOS_MANUAL_OVERRIDE is true, by {self.overridden}: it is driven by hand; set it to false to go on"
        if self.allstop.lower() not in HARMLESS_STOPS:
            return f"the helm stopped all: {self.allstop}; mend the mission, its DESIRED_* are zero"
        return ""

    def posted(self, now_s: float) -> None:
        """Our commands left."""
        if self._echoed_s >= self._posted_s:
            self._posted_s = now_s

    def dropped(self, now_s: float) -> str:
        """Whether the MOOSDB drops our commands, in words; mostly empty."""
        if self._echoed_s >= self._posted_s or now_s - self._posted_s < ECHO_S:
            return ""
        self.faults["type_clash"] += 1
        return (
            f"our posts do not come back: somebody wrote {' or '.join(self._outputs)} as a string first, so the MOOSDB "
            "drops our numbers; restart it"
        )

    def hear(self, message: Message, now_s: float, age_s: float) -> str:
        """Take mail in; a text for the operator, mostly empty.

        Its age tells what was posted before us: the first mail of a variable may be what stood there.
        """
        live = message.key in self._known or not age_s > ECHO_S
        self._known.add(message.key)
        if message.key in OVERRIDES:
            return self._hear_override(message)
        if message.key == ALLSTOP:
            self.helm, before, self.allstop = message.source, self.allstop.lower(), message.text
            is_stop = self.allstop.lower() != "clear" or before not in ("", "clear")
            return f"the helm says all-stop: {self.allstop}" if is_stop else ""
        if message.key == STATE:
            self.helm, self.state = message.source, message.text
        elif message.key in self._outputs and (live or message.data != DOUBLE):
            return self._hear_output(message, now_s, live)
        return ""

    def _hear_override(self, message: Message) -> str:
        on = message.text.strip().lower() == "true" if message.data != DOUBLE else message.value != 0.0
        was, self._override[message.key] = self.overridden, (on, message.source)
        if bool(was) == bool(self.overridden):
            return ""
        if self.overridden:
            return f"{message.source or 'somebody'} took it by hand ({message.key}=true); nothing is sent"
        return f"given back by {message.source or 'somebody'} ({message.key}=false); commands go on"

    def _hear_output(self, message: Message, now_s: float, live: bool) -> str:
        who = message.source or "somebody"
        if not live:  # what stood there when we came: its type is what every later write must have
            self.faults["type_clash"] += 1
            return (
                f"{message.key} is a string here, first written by {who}, so the MOOSDB drops our numbers; restart it, "
                "and end who writes strings"
            )
        if message.source == self._ours:
            self._echoed_s = now_s
            return ""
        if message.value == 0.0 and message.data == DOUBLE and (message.source == self.helm or self.overridden):
            return ""  # a helm that stops all writes zeros past its prefix, once; so does a PID under override
        self.other, self.other_s = who, now_s
        self.faults["second_commander"] += 1
        value = message.text[:20] if message.data != DOUBLE else f"{message.value:g}"
        remedy = f"set helm_prefix = {self._prefix} there" if message.source == self.helm else "end it"
        return (
            f"a second commander, {who}, posts {message.key}={value}: {remedy}, two commanders undo each other's safety"
        )
