"""`Navigation`: what one boat's NAV_* say, each value with the time it was true, in the field's frame."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

from ..frame import TWO_PI, FieldFrame
from .wire import DOUBLE, Message

VARIABLES = ("NAV_X", "NAV_Y", "NAV_HEADING", "NAV_SPEED")
PLACE = ("NAV_LAT", "NAV_LONG")
"""Only compared with the others, before a start."""

MATCHED_S = 0.05
"""NAV_X and NAV_Y stamped no further apart than this, MOOS s, are of one moment."""
EARLY_S = 0.5
"""Stamps later than now by more than this, MOOS s, are of a clock that is wrong."""
BACK_S = 2.0
"""Stamps that go back by more than this are of a source that started anew."""
FASTEST_MPS, FARTHEST_M = 30.0, 50_000.0
RUN_M = 0.25
"""A position the same to the last digit while NAV_SPEED says the boat ran this far is frozen, whatever its stamp."""
STILL_S = 1.5
"""All four values the same to the last digit for so long, while the boat is told to move: the source is frozen."""
TOLD_MPS = 0.3


@dataclass(frozen=True)
class _Value:
    value: float
    true_s: float


class Navigation:
    """Not thread-safe: its owner holds a lock.

    Args:
        frame: of the field.
        corner_m: the field's corner on the boat's local grid, x east and y north, m.

    Attributes:
        faults: what was refused, by kind; the owner empties it.
        source: who posts it; empty: nothing heard.
    """

    def __init__(self, frame: FieldFrame, corner_m: tuple[float, float] = (0.0, 0.0)) -> None:
        self._frame, self._corner_m = frame, corner_m
        self.faults: Counter[str] = Counter()
        self.forget()

    def forget(self) -> None:
        """Begin anew, as after a lost connection: nothing is known."""
        self.position_m, self.position_s = (math.nan, math.nan), -math.inf
        self.heading_rad, self.heading_s = math.nan, -math.inf
        self.speed_mps, self.speed_s = math.nan, -math.inf
        self.turn_rate_rads = math.nan
        self.source = ""
        self._values: dict[str, _Value] = {}
        self._place_s, self._run_m = -math.inf, 0.0
        self._same_since_s, self._told_since_s, self._still = math.inf, math.inf, False

    def told(self, speed_mps: float, now_s: float) -> None:
        """The boat is told to go that fast."""
        moving = abs(speed_mps) >= TOLD_MPS
        self._told_since_s = min(self._told_since_s, now_s) if moving else math.inf

    def hear(self, message: Message, true_s: float, received_s: float) -> str:
        """Take one NAV_* in.

        Args:
            message: the mail.
            true_s: its stamp on the loop's clock, s.
            received_s: when it came, s.

        Returns:
            A text for the operator, mostly empty.
        """
        if fault := self._refused(message, true_s, received_s):
            self.faults[fault] += 1
            return f"{message.key} of {message.source} is refused: {_WORDS[fault]}"
        before = self._values.get(message.key)
        text = ""
        if before is not None and true_s <= before.true_s:
            if before.true_s - true_s < BACK_S:
                return ""  # the same again, as after a registration, or one that came late
            self.forget()
            text = f"{message.source} started anew, or its clock was set: its {message.key} went back in time"
        self.source = message.source
        self._note_same(message, before, true_s)
        self._values[message.key] = _Value(message.value, min(true_s, received_s))
        if message.key in VARIABLES and not self._is_still(true_s):
            self._take(message.key)
        return text

    def place_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude told beside NAV_X and NAV_Y, deg; None: none."""
        found = [self._values[key].value for key in PLACE if key in self._values]
        return (found[0], found[1]) if len(found) == len(PLACE) else None

    def _refused(self, message: Message, true_s: float, received_s: float) -> str:
        """Kind of what is wrong with a mail; written so that NaN is refused."""
        if message.data != DOUBLE:
            return "type_clash"
        if not (math.isfinite(message.value) and math.isfinite(true_s)):
            return "not_finite"
        if not true_s <= received_s + EARLY_S:
            return "clock"
        limit = {"NAV_SPEED": FASTEST_MPS, "NAV_HEADING": 2.0 * 360.0}.get(message.key, FARTHEST_M)
        return "" if abs(message.value) <= limit else "impossible"

    def _take(self, key: str) -> None:
        value = self._values[key]
        if key == "NAV_SPEED":
            self.speed_mps, self.speed_s = value.value, value.true_s
        elif key == "NAV_HEADING":
            heading = self._frame.heading_to_field_rad(math.radians(value.value))
            seconds = value.true_s - self.heading_s
            turned = (heading - self.heading_rad + math.pi) % TWO_PI - math.pi
            self.turn_rate_rads = turned / seconds if 0.01 < seconds < 1.0 else math.nan
            self.heading_rad, self.heading_s = heading, value.true_s
        else:
            x, y = self._values.get("NAV_X"), self._values.get("NAV_Y")
            if x is not None and y is not None and abs(x.true_s - y.true_s) <= MATCHED_S:
                east, north = x.value - self._corner_m[0], y.value - self._corner_m[1]
                self._take_place(self._frame.turn_to_field(east, north), min(x.true_s, y.true_s))

    def _take_place(self, position_m: tuple[float, float], true_s: float) -> None:
        """Take a position, unless it stays while the boat is under way."""
        since_s, self._place_s = true_s - self._place_s, true_s
        ran_m = abs(self.speed_mps) * min(since_s, 1.0) if math.isfinite(self.speed_mps) else 0.0
        self._run_m = self._run_m + ran_m if position_m == self.position_m else 0.0
        if self._run_m > RUN_M:
            self.faults["frozen"] += 1
        else:
            self.position_m, self.position_s = position_m, true_s

    def _note_same(self, message: Message, before: _Value | None, true_s: float) -> None:
        if message.key in VARIABLES and (before is None or before.value != message.value):
            self._same_since_s, self._still = true_s, False

    def _is_still(self, true_s: float) -> bool:
        """Once found frozen it stays so until something changes: told to stop for that very reason, it is no better."""
        self._still = self._still or true_s - max(self._same_since_s, self._told_since_s) > STILL_S
        self.faults["frozen"] += int(self._still)
        return self._still


_WORDS = {
    "type_clash": "it is a string in this MOOSDB, so somebody wrote it as one first; restart the MOOSDB",
    "not_finite": "its value is no number; restart the simulator or PID that posts it, it does not recover by itself",
    "clock": "it is stamped in the future; set the clocks, or give all the same MOOSTimeWarp",
    "impossible": "no boat is there, or goes that fast",
}
