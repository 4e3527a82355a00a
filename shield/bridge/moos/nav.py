"""`Navigation`: what one boat's NAV_* say, each value with the time it was true, in the field's frame.

Whether they move as the boat does is watched where boats of all links are, see `estimator` and `contact_fusion`.
"""

from __future__ import annotations

import math
from collections import Counter

from ..frame import TWO_PI, FieldFrame
from .wire import DOUBLE, Message

VARIABLES = ("NAV_X", "NAV_Y", "NAV_HEADING", "NAV_SPEED")
PLACE = ("NAV_LAT", "NAV_LONG")  # only compared with the others, before a start

MATCHED_S = 0.05  # NAV_X and NAV_Y stamped no further apart than this, MOOS s, are of one moment
EARLY_S = 0.5  # stamps later than now by more than this, MOOS s, are of a clock that is wrong
BACK_S = 2.0  # stamps that go back by more than this are of a source that started anew
FARTHEST = {"NAV_SPEED": 30.0, "NAV_HEADING": 2.0 * 360.0, "NAV_X": 50_000.0, "NAV_Y": 50_000.0}
"""Values beyond are no boat's: m/s, deg, m."""
REFUSED = {
    "type_clash": "it is a string in this MOOSDB, so somebody wrote it as one first; restart the MOOSDB",
    "not_finite": "its value is no number; restart the simulator or PID that posts it, it does not recover by itself",
    "clock": "it is stamped in the future; set the clocks, or give all the same MOOSTimeWarp",
    "impossible": "no boat is there, or goes that fast",
}
"""Kinds of what is wrong with a mail, and the remedy."""


class Navigation:
    """Not thread-safe: its owner holds a lock. ``corner_m``: the field's corner on the local grid, east and north, m.

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
        self._values: dict[str, tuple[float, float]] = {}

    def hear(self, message: Message, true_s: float, received_s: float) -> str:
        """Take one NAV_* in, stamped ``true_s`` on the loop's clock; a text for the operator, mostly empty."""
        if fault := _fault(message, true_s, received_s):
            self.faults[fault] += 1
            return f"{message.key} of {message.source} is refused: {REFUSED[fault]}"
        before_s, text = self._values.get(message.key, (0.0, -math.inf))[1], ""
        if true_s <= before_s:
            if before_s - true_s < BACK_S:
                return ""  # the same again, as after a registration, or one that came late
            self.forget()
            text = f"{message.source} started anew, or its clock was set: its {message.key} went back in time"
        self.source = message.source
        self._values[message.key] = message.value, min(true_s, received_s)
        if message.key == "NAV_SPEED":
            self.speed_mps, self.speed_s = self._values[message.key]
        elif message.key == "NAV_HEADING":
            self._take_heading(*self._values[message.key])
        elif message.key in VARIABLES:
            self._take_place()
        return text

    def place_deg(self) -> tuple[float, float] | None:
        """Latitude and longitude told beside NAV_X and NAV_Y, deg; None: none."""
        found = [self._values[key][0] for key in PLACE if key in self._values]
        return (found[0], found[1]) if len(found) == len(PLACE) else None

    def _take_heading(self, heading_deg: float, true_s: float) -> None:
        heading, seconds = self._frame.heading_to_field_rad(math.radians(heading_deg)), true_s - self.heading_s
        turned = (heading - self.heading_rad + math.pi) % TWO_PI - math.pi
        self.turn_rate_rads = turned / seconds if 0.01 < seconds < 1.0 else math.nan
        self.heading_rad, self.heading_s = heading, true_s

    def _take_place(self) -> None:
        (x, x_s), (y, y_s) = (self._values.get(key, (math.nan, math.nan)) for key in VARIABLES[:2])
        if abs(x_s - y_s) <= MATCHED_S:
            self.position_m = self._frame.turn_to_field(x - self._corner_m[0], y - self._corner_m[1])
            self.position_s = min(x_s, y_s)


def _fault(message: Message, true_s: float, received_s: float) -> str:
    """Kind of what is wrong with a mail; written so that NaN is refused."""
    if message.data != DOUBLE:
        return "type_clash"
    if not (math.isfinite(message.value) and math.isfinite(true_s)):
        return "not_finite"
    if not true_s <= received_s + EARLY_S:
        return "clock"
    return "" if abs(message.value) <= FARTHEST.get(message.key, 360.0) else "impossible"
