"""Where boats that run MOOS are: `Navigation` from a boat's own NAV_*, `MoosContacts` from others' NODE_REPORTs.

Values are told with the time they were true, in the field's frame. Whether they move as the boat does is watched where
boats of all links are, see `estimator` and `tracker`.
"""

from __future__ import annotations

import json
import math
import re
import threading
from collections import Counter
from collections.abc import Collection

from ..frame import TWO_PI, FieldFrame
from ..messages import Alarm, Contact
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


LONGEST_CHARACTERS = 1 << 16
MOST_CONTACTS = 256
UNLISTED_S = 5.0  # a boat that is not in the fleet file is told of for so long after its last report, s
_FIELD = re.compile(r"(?:[^,{]|\{[^}]*\}?)+")  # what stands between two commas; those within braces belong to a value


def parse_report(text: str) -> dict[str, str]:
    """The fields of a NODE_REPORT, keys in capitals; in either of its forms.

    Raises:
        ValueError: it is none.
    """
    if len(text) > LONGEST_CHARACTERS:
        raise ValueError(f"a report of {len(text)} characters")
    if text.lstrip().startswith("{"):
        content = json.loads(text)
        return {str(key).upper(): str(value) for key, value in content.items()}
    pairs = (field.partition("=") for field in _FIELD.findall(text))
    return {key.strip().upper(): value.strip() for key, equals, value in pairs if equals}


class MoosContacts:
    """Takes reports from the links' threads, gives contacts to the loop; a `ContactSource` that can raise alarms.

    TIME in a report is the reporter's clock when it posted, not the age of the position: whether the position moves as
    its speed says is watched where contacts of all sources are, see `tracker`. ``corner_m``: the field's corner
    on the local grid, m; ``error_m``: bound of the positions' errors, m.
    """

    def __init__(
        self, frame: FieldFrame, corner_m: tuple[float, float], names: Collection[str], error_m: float
    ) -> None:
        self._frame, self._corner_m, self._names, self._error_m = frame, corner_m, frozenset(names), error_m
        self._lock = threading.Lock()
        self._contacts: dict[tuple[str, str], Contact] = {}
        self._unlisted_s: dict[str, float] = {}
        self._now_s = -math.inf

    def hear(self, text: str, heard_by: str, to_clock: float, received_s: float) -> str:
        """Take a report's text in that came by ``heard_by``'s MOOSDB; ``to_clock``: the loop's clock less MOOS time, s.

        Returns:
            Why it is not believed; empty: it is.
        """
        try:
            fields = parse_report(text)
            name = fields["NAME"]
            heading_deg, speed_mps, moos_s = (float(fields[key]) for key in ("HDG", "SPD", "TIME"))
            if "X" in fields and "Y" in fields:
                east, north = float(fields["X"]) - self._corner_m[0], float(fields["Y"]) - self._corner_m[1]
                position = self._frame.turn_to_field(east, north)
            else:
                latitude_deg, longitude_deg = float(fields["LAT"]), float(fields["LON"])
                if not (abs(latitude_deg) <= 89.0 and abs(longitude_deg) <= 180.0):
                    raise ValueError(f"latitude {latitude_deg}, longitude {longitude_deg}")
                position = self._frame.to_field_m(latitude_deg, longitude_deg)
        except (KeyError, ValueError, RecursionError) as error:
            return f"a NODE_REPORT cannot be read ({error}): {text[:80]!r}"
        if not all(map(math.isfinite, (heading_deg, speed_mps, moos_s, *position))):
            return f"a NODE_REPORT of {name[:32]} holds what is no number"
        heading = self._frame.heading_to_field_rad(math.radians(heading_deg))
        fixed_s = min(received_s, moos_s + to_clock)  # a reporter whose clock is ahead gains nothing by it
        source = f"moos:{heard_by}"
        with self._lock:
            self._now_s = received_s
            if name in self._names:
                contact = Contact(name, position, heading, speed_mps, fixed_s, self._error_m, source)
                self._contacts[name, source] = contact
            elif len(self._unlisted_s) < MOST_CONTACTS:
                self._unlisted_s[name[:32]] = received_s
        return ""

    def read(self) -> tuple[Contact, ...]:
        """The latest contact of each boat by each of our boats' MOOSDBs."""
        with self._lock:
            return tuple(self._contacts.values())

    def alarms(self) -> tuple[Alarm, ...]:
        """Boats that report themselves and are not in the fleet file: nobody keeps clear of them."""
        with self._lock:
            self._unlisted_s = {n: s for n, s in self._unlisted_s.items() if self._now_s - s <= UNLISTED_S}
            return tuple(map(Alarm.of_unlisted, sorted(self._unlisted_s)))

    def close(self) -> None:
        """Nothing is held."""
