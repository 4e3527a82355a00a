"""`Telemetry`: what one boat's messages say, each field with the time it was true; impossible values are refused."""

from __future__ import annotations

import math
import time
from collections import Counter
from typing import Any

from ..frame import TWO_PI, FieldFrame
from .boat_clock import BoatClock
from .fix import FixWatch
from .position_guard import PositionGuard

FASTEST_MPS = 30.0
FARTHEST_M = 50_000.0
"""From the field's corner."""
FASTEST_TURN_RADS = 10.0
NO_HEADING = 65_535
SETTLING_S = 1.0
"""ATTITUDE is not believed so soon after boot."""
FROZEN_TURN_RAD = math.radians(3.0)
"""A heading that stays the same to the last digit while the boat's own turn rate takes it this far is frozen."""
STILL_S = 1.5
"""All of position, velocity and heading the same to the last digit for so long, while the boat is told to move."""
COURSE_MPS = 0.1
_HEADING_LAG_S = 0.2
_FIX_BACK = "its fix is back; its position is believed again"
_UNIX_2020_S = 1_577_836_800


class Telemetry:
    """Not thread-safe: its owner holds a lock.

    Args:
        frame: of the field.

    Attributes:
        clock: of the boat.
        faults: what was refused, by kind; the owner empties it.
        wall_ahead_s: this machine's wall clock less the boat's GPS time, s; NaN when not heard.
    """

    def __init__(self, frame: FieldFrame) -> None:
        self.clock = BoatClock()
        self.faults: Counter[str] = Counter()
        self.wall_ahead_s = math.nan
        self._frame = frame
        self._starts = 0
        self._heard_s = -math.inf
        self.forget()

    def forget(self) -> None:
        """Begin anew, as after a restart of the autopilot."""
        self.position_m = (math.nan, math.nan)
        self.position_s = -math.inf
        self.velocity_mps = (math.nan, math.nan)
        self.velocity_s = -math.inf
        self.turn_rate_rads = math.nan
        self.turn_rate_s = -math.inf
        self._attitude_rad, self._attitude_s = math.nan, -math.inf
        self._compass_rad, self._compass_s = math.nan, -math.inf
        self._latest_boot: dict[str, tuple[float, int]] = {}
        self._guard = PositionGuard()
        self._turned_rad, self._turned_s = 0.0, 0.0
        self._same: tuple[Any, ...] = ()
        self._same_since_s = math.inf
        self._told_since_s = math.inf
        self._still = False
        self._fix = FixWatch()
        self._fix_lost = False

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the best receiver; -1: not heard."""
        return self._fix.fix_type

    def fix_fault(self, now_s: float) -> str:
        """Why positions are not believed for want of a fix, in words; empty when they may be."""
        return self._fix.fault(now_s)[1]

    def told_speed(self, speed_mps: float, now_s: float) -> None:
        """The boat is told to go that fast and obeys: one that then stays still to the last digit is frozen."""
        if abs(speed_mps) < 0.3:
            self._told_since_s = math.inf
        else:
            self._told_since_s = min(self._told_since_s, now_s)

    @property
    def heading(self) -> tuple[float, float]:
        """Heading, rad clockwise from true north, and when it was true, s: ATTITUDE's, unless that lags."""
        if self._attitude_s >= self._compass_s - _HEADING_LAG_S:
            return self._attitude_rad, self._attitude_s
        return self._compass_rad, self._compass_s

    @property
    def speed_mps(self) -> float:
        """Over ground along the heading, m/s, negative astern."""
        (north, east), heading = self.velocity_mps, self.heading[0]
        return north * math.cos(heading) + east * math.sin(heading)

    @property
    def course_rad(self) -> float:
        """Of the velocity over ground, rad clockwise from true north; NaN when hardly moving."""
        north, east = self.velocity_mps
        return math.atan2(east, north) % TWO_PI if math.hypot(north, east) >= COURSE_MPS else math.nan

    def hear(self, message: Any, received_s: float) -> str:
        """Take a message of the autopilot in.

        Returns:
            A text for the operator, mostly empty.
        """
        name = message.get_type()
        self._fix.hear(message, received_s)
        if name == "GLOBAL_POSITION_INT":
            return self._timed(message, received_s, self._hear_position)
        if name == "ATTITUDE":
            return self._timed(message, received_s, self._hear_attitude)
        if name == "SYSTEM_TIME" and message.time_unix_usec * 1e-6 > _UNIX_2020_S:
            self.wall_ahead_s = time.time() - message.time_unix_usec * 1e-6
        return ""

    def _timed(self, message: Any, received_s: float, take: Any) -> str:
        boot_s = message.time_boot_ms * 1e-3
        self._heard_s = received_s
        true_s = self.clock.hear(boot_s, received_s)
        if true_s is None:
            self.faults["clock"] += 1
            return ""
        text = ""
        if self.clock.starts != self._starts:
            text = "" if self._starts == 0 else "the autopilot restarted, or its clock was set"
            self.forget()
            self._starts = self.clock.starts
        return text or (str(take(message, true_s)) if self._is_new(message, boot_s) else "")

    def _is_new(self, message: Any, boot_s: float) -> bool:
        """Newer than the latest of its kind; the same again under a new number is no fault, only nothing new."""
        name, number = message.get_type(), message.get_seq()
        latest_s, latest_number = self._latest_boot.get(name, (-math.inf, -1))
        if boot_s > latest_s:
            self._latest_boot[name] = (boot_s, number)
            return True
        if boot_s < latest_s:
            self.faults["out_of_order"] += 1
        elif number == latest_number:
            self.faults["duplicate"] += 1
        return False

    def _hear_position(self, message: Any, true_s: float) -> str:
        velocity = (message.vx * 0.01, message.vy * 0.01)
        if math.hypot(*velocity) > FASTEST_MPS:
            self.faults["impossible_speed"] += 1
            return ""
        if message.lat == 0 and message.lon == 0:
            self.faults["no_position"] += 1
            return ""
        position = self._place(message)
        if position is None:
            self.faults["impossible_position"] += 1
            return ""
        kind, words = self._fix.fault(self._heard_s)
        if kind:
            self.faults[kind] += 1
            return self._lose_fix(words)
        back, self._fix_lost = self._fix_lost, False
        return self._take_position(message, position, velocity, true_s) or (_FIX_BACK if back else "")

    def _lose_fix(self, words: str) -> str:
        """Position and velocity are dead reckoning from now on: they grow old, and it is said once."""
        first, self._fix_lost = not self._fix_lost, True
        return f"{words}; what it tells of its place is dead reckoning and not believed" if first else ""

    def _take_position(
        self, message: Any, position: tuple[float, float], velocity: tuple[float, float], true_s: float
    ) -> str:
        east_north = self._frame.turn_to_field(velocity[1], velocity[0])
        refused = self._guard.refuse(position, east_north, true_s)
        self._note_same((message.lat, message.lon, message.vx, message.vy, message.hdg, self._attitude_rad), true_s)
        if refused == "frozen" or self._is_still(true_s):
            self.faults["frozen"] += 1
            return ""
        self.velocity_mps, self.velocity_s = velocity, true_s
        if message.hdg < 36_000:
            self._compass_rad, self._compass_s = math.radians(message.hdg * 0.01), true_s
        if refused == "jump":
            self.faults["jump"] += 1
            return f"position jumped {self._guard.jumped_m:.0f} m; not believed until it holds for 2 s"
        self.position_m, self.position_s = position, true_s
        return "position jumped and holds; believed again" if refused == "moved" else ""

    def _place(self, message: Any) -> tuple[float, float] | None:
        if abs(message.lat) > 890_000_000 or abs(message.lon) > 1_800_000_000:
            return None
        position = self._frame.to_field_m(message.lat * 1e-7, message.lon * 1e-7)
        return position if math.hypot(*position) <= FARTHEST_M else None  # written so that NaN is refused

    def _hear_attitude(self, message: Any, true_s: float) -> str:
        yaw, rate = message.yaw, message.yawspeed
        if not (abs(yaw) <= TWO_PI and abs(rate) <= FASTEST_TURN_RADS):  # written so that NaN is refused
            self.faults["impossible_attitude"] += 1
            return ""
        if message.time_boot_ms < SETTLING_S * 1000.0:
            self.faults["settling"] += 1
            return ""
        same = yaw % TWO_PI == self._attitude_rad
        self._turned_rad = self._turned_rad + abs(rate) * (true_s - self._turned_s) if same else 0.0
        self._turned_s = true_s
        if self._turned_rad > FROZEN_TURN_RAD:
            self.faults["frozen"] += 1
            return ""
        self.turn_rate_rads, self.turn_rate_s = rate, true_s
        if not (same and self._is_still(true_s)):
            self._attitude_rad, self._attitude_s = yaw % TWO_PI, true_s
        return ""

    def _note_same(self, values: tuple[Any, ...], true_s: float) -> None:
        if values != self._same:
            self._same, self._same_since_s, self._still = values, true_s, False

    def _is_still(self, true_s: float) -> bool:
        """Once found frozen it stays so until something changes: told to stop for that very reason, it is no better."""
        self._still = self._still or true_s - max(self._same_since_s, self._told_since_s) > STILL_S
        return self._still
