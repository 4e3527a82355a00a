"""What a link knows of itself, and the round trips it measures."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .boat_clock import BoatClock

if TYPE_CHECKING:
    from .autopilot import Autopilot


@dataclass(frozen=True)
class LinkHealth:
    """State of one link at one moment.

    Attributes:
        boat: its name.
        address: where it is heard from.
        rates_hz: arrivals of each message asked for, by name.
        missing: needed messages that do not arrive at the rate asked for, in words; empty: all do.
        round_trips_s: of the last TIMESYNC answers, s, newest last.
        shortest_delay_s: what the quickest telemetry took, s; 0 while no round trip is known.
        clock_offset_s: our clock less the boat's, s.
        clock_starts: how often the boat's clock began anew.
        wall_ahead_s: this machine's wall clock less the boat's GPS time, s; NaN: not heard.
        fix_type: GPS_FIX_TYPE of the best receiver; -1: not heard.
        version: of the firmware; None: not heard.
        parameters: read so far.
        signs: whether signing is on.
        stations: other ground stations heard, as (system, component).
        other_commander_s: when somebody else was last seen commanding the boat, s; -inf: never.
        faults: of the whole wire since it was opened, by kind.
        fix_fault: why its positions are not believed for want of a fix, in words; empty: they may be.
    """

    boat: str
    address: str
    rates_hz: Mapping[str, float]
    missing: str
    round_trips_s: tuple[float, ...]
    shortest_delay_s: float
    clock_offset_s: float
    clock_starts: int
    wall_ahead_s: float
    fix_type: int
    version: tuple[int, int, int] | None
    parameters: Mapping[str, float]
    signs: bool
    stations: frozenset[tuple[int, int]]
    other_commander_s: float
    faults: Mapping[str, int]
    fix_fault: str = ""


def health_of(boat: Autopilot) -> LinkHealth:
    """Health of the link to one boat, now."""
    with boat.dialogue.changed:
        now_s = boat.clock.now_s()
        clock = boat.telemetry.clock
        return LinkHealth(
            boat=boat.boat,
            address=boat.endpoint.place(boat.system_id),
            rates_hz=boat.streams.rates_hz(now_s),
            missing=boat.streams.missing(now_s),
            round_trips_s=boat.trips.recent(),
            shortest_delay_s=clock.shortest_delay_s,
            clock_offset_s=clock.offset_s,
            clock_starts=clock.starts,
            wall_ahead_s=boat.telemetry.wall_ahead_s,
            fix_type=boat.telemetry.fix_type,
            version=boat.dialogue.version,
            parameters=dict(boat.dialogue.parameters),
            signs=boat.endpoint.codec.signs,
            stations=frozenset(boat.commanders.stations),
            other_commander_s=boat.commanders.heard_s,
            faults=dict(boat.endpoint.faults),
            fix_fault=boat.telemetry.fix_fault(now_s),
        )


class RoundTrips:
    """Asks the boat's clock by TIMESYNC: often at first, then now and then."""

    OFTEN_S, SELDOM_S, OFTEN = 0.2, 1.0, 10
    _KEPT = 50
    _OPEN = 16

    def __init__(self) -> None:
        self._asked: dict[int, float] = {}
        self._asked_s = -float("inf")
        self._answered = 0
        self._trips: deque[float] = deque(maxlen=self._KEPT)

    def recent(self) -> tuple[float, ...]:
        """The last round trips, s, newest last."""
        return tuple(self._trips)

    def ask(self, now_s: float) -> Any | None:
        """The question, when one is due."""
        if now_s - self._asked_s < (self.OFTEN_S if self._answered < self.OFTEN else self.SELDOM_S):
            return None
        self._asked_s = now_s
        stamp = int(now_s * 1e9)
        self._asked[stamp] = now_s
        while len(self._asked) > self._OPEN:
            del self._asked[next(iter(self._asked))]
        return mavlink.MAVLink_timesync_message(0, stamp)

    def hear(self, message: Any, received_s: float, clock: BoatClock) -> None:
        """An answer: one to a question of ours, once."""
        if message.tc1 == 0:
            return
        sent_s = self._asked.pop(message.ts1, None)
        if sent_s is not None:
            self._answered += 1
            self._trips.append(received_s - sent_s)
            clock.sync(message.tc1 * 1e-9, sent_s, received_s)
