"""`BoatClock`: when something was true on our clock, from the boat's milliseconds since boot.

A message that took a second longer than others is a second old on arrival, whatever its receipt says. Messages only
show how much longer they took than the quickest one; the round trip of TIMESYNC shows what the quickest one took.
"""

from __future__ import annotations

import math

DRIFT = 1e-4
"""The boat's clock may run this much faster or slower than ours, s per s."""
AHEAD_S = 0.5
"""A time since boot this much later than can be is doubted."""
SYNCED_AHEAD_S = 0.1
"""The same once a round trip says what can be."""
BEHIND_S = 2.0
"""So is one this much earlier than the latest: a restart, or a packet that was long under way."""
BELIEVED_AFTER = 5
"""So many doubted times in a row that agree are believed: the boat restarted, or its clock was set."""
_SAME_CLOCK_S = 30.0


class BoatClock:
    """Turns a boat's time since boot into our time.

    Attributes:
        starts: how often the boat's clock began anew: 1 after the first message.
        round_trip_s: the shortest lately; NaN before the first answer.
    """

    def __init__(self) -> None:
        self.starts = 0
        self.round_trip_s = math.nan
        self._quickest_s = math.inf
        self._heard_s = 0.0
        self._latest_boot_s = -math.inf
        self._doubts: list[float] = []
        self._middle_s = math.nan
        self._trip_s = math.inf
        self._synced_s = -math.inf
        self._answers_alike: bool | None = None

    def hear(self, boot_s: float, received_s: float) -> float | None:
        """A message said this time since boot; when that was on our clock, s, or None when it is not believed yet."""
        difference = received_s - boot_s
        if self.starts and self._is_odd(boot_s, difference):
            if not self._believe(difference):
                return None
            if boot_s < self._latest_boot_s - BEHIND_S:
                self._forget()
        self._doubts.clear()
        self.starts = max(self.starts, 1)
        drifted = self._quickest_s + DRIFT * max(0.0, received_s - self._heard_s)
        self._quickest_s = min(drifted, difference)
        self._heard_s = received_s
        self._latest_boot_s = max(self._latest_boot_s, boot_s)
        return min(received_s, boot_s + self.offset_s)

    def sync(self, boat_s: float, sent_s: float, received_s: float) -> None:
        """The boat answered a TIMESYNC with its clock."""
        trip = received_s - sent_s
        if not (self.starts and 0.0 <= trip < 10.0 and math.isfinite(boat_s)):
            return
        middle = 0.5 * (sent_s + received_s) - boat_s
        if self._answers_alike is None:
            self._answers_alike = abs(middle - self._quickest_s) <= _SAME_CLOCK_S
        if self._answers_alike is False:
            return  # answered from another clock than the one the telemetry is stamped with
        self._check_lost(sent_s - boat_s, received_s - boat_s, received_s)
        worn = self._trip_s + 2.0 * DRIFT * max(0.0, received_s - self._synced_s)
        if not trip > worn:
            self._middle_s, self._trip_s, self._synced_s = middle, trip, received_s
            self.round_trip_s = trip

    @property
    def offset_s(self) -> float:
        """Our clock less the boat's, s."""
        return min(self._quickest_s, self._middle_s) if self._middle_s == self._middle_s else self._quickest_s

    @property
    def shortest_delay_s(self) -> float:
        """What the quickest message took, s; 0 while no round trip is known."""
        return self._quickest_s - self.offset_s if self.starts else 0.0

    def _check_lost(self, least_s: float, most_s: float, received_s: float) -> None:
        """An answer cannot come before its question: if it seems to, the boat's clock has lost time since."""
        lost_s = least_s - (self._quickest_s + DRIFT * max(0.0, received_s - self._heard_s))
        if lost_s > AHEAD_S:
            self._forget()
            self._quickest_s, self._heard_s = most_s, received_s
        elif lost_s > 0.0:
            self._quickest_s, self._heard_s = least_s, received_s
            self._middle_s = max(self._middle_s, least_s)

    def _is_odd(self, boot_s: float, difference: float) -> bool:
        """Earlier than the latest by far, or much quicker than any before, and than the round trip allows."""
        least_s = self._quickest_s - AHEAD_S
        if math.isfinite(self._trip_s):
            least_s = self._middle_s - 0.5 * self._trip_s - SYNCED_AHEAD_S
        return difference < least_s or boot_s < self._latest_boot_s - BEHIND_S

    def _believe(self, difference: float) -> bool:
        if self._doubts and abs(difference - self._doubts[-1]) > AHEAD_S:
            self._doubts.clear()
        self._doubts.append(difference)
        return len(self._doubts) >= BELIEVED_AFTER

    def _forget(self) -> None:
        self.starts += 1
        self._quickest_s, self._latest_boot_s = math.inf, -math.inf
        self._middle_s, self._trip_s, self._answers_alike = math.nan, math.inf, None
        self.round_trip_s = math.nan
