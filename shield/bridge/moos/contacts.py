"""`MoosContacts`: other boats, from the NODE_REPORTs that reach our boats' MOOSDBs."""

from __future__ import annotations

import json
import math
import re
import threading
from collections.abc import Collection

from ..frame import FieldFrame
from ..messages import Alarm, Contact

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
    its speed says is watched where contacts of all sources are, see `contact_fusion`. ``corner_m``: the field's corner
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
            return tuple(
                Alarm(f"{name!r} reports itself and is not in the fleet file: add it, so that boats keep clear of it")
                for name in sorted(self._unlisted_s)
            )

    def close(self) -> None:
        """Nothing is held."""
