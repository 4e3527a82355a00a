"""What one boat's messages say, each with the time it was true: its clock, its fix, position, heading and speed."""

from __future__ import annotations

import math
import time
from collections import Counter, deque
from collections.abc import Mapping
from typing import Any, NamedTuple

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from ..frame import TWO_PI, FieldFrame

DRIFT = 1e-4  # the boat's clock may run this much faster or slower than ours, s per s
AHEAD_S = 0.5  # a time since boot this much later than can be is doubted
SYNCED_AHEAD_S = 0.1  # the same once a round trip says what can be
BEHIND_S = 2.0  # so is one this much earlier than the latest: a restart, or a packet that was long under way
BELIEVED_AFTER = 5  # so many doubted times in a row that agree are believed: the boat restarted, or its clock was set
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


FASTEST_MPS, FARTHEST_M, FASTEST_TURN_RADS = 30.0, 50_000.0, 10.0
"""Beyond these, the second from the field's corner, nothing is believed."""
NO_HEADING = 36_000
SETTLING_S = 1.0  # ATTITUDE is not believed so soon after boot
COURSE_MPS = 0.1
_HEADING_LAG_S, _UNIX_2020_S = 0.2, 1_577_836_800

ENOUGH_FIX = int(mavlink.GPS_FIX_TYPE_3D_FIX)
FIX_SILENT_S = 3.0
"""A receiver that was heard and then said nothing for so long has lost its fix as far as anybody can tell."""
GAP_S = 1.0  # a gap in the positions themselves is the link's: what is silent with them is counted from their return
WORST_HDOP, WORST_ACCURACY_M = 5.0, 5.0  # fixes as poor as this are of the right harbour, not of the right place
_HDOP_UNKNOWN = 65_535
_RECEIVERS = {"GPS_RAW_INT": 1, "GPS2_RAW": 2}
_ABSOLUTE = int(mavlink.EKF_POS_HORIZ_ABS)
_NO_PLACE = int(mavlink.EKF_CONST_POS_MODE) | int(mavlink.EKF_UNINITIALIZED)
_GLITCH = 1 << 15  # EKF_GPS_GLITCHING, which not every dialect knows

POSITION = int(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
ATTITUDE = int(mavlink.MAVLINK_MSG_ID_ATTITUDE)
WINDOW_S, WINDOW_MESSAGES = 1.0, 10
"""Rates are counted over the longer of a second and the time so many messages should take."""
ENOUGH = 0.8  # share of the rate asked for that must arrive
_ASK_AGAIN_S, _EXTRA_TRIES, _KEPT = 2.0, 3, 256
_GONE_S = 3.0  # an extra that came and then did not for so long is asked for again, however often it was


class _Word(NamedTuple):
    """What one receiver said last: kind of fault and words, both empty when its fix is good."""

    fix_type: int
    kind: str
    words: str
    heard_s: float


class FixWatch:
    """Whether an autopilot's position rests on satellites now, by its own word.

    An autopilot that loses its fix goes on telling positions, with fresh time stamps: dead reckoning, which runs away
    from the boat by metres within seconds. Nothing in the position itself shows it.
    """

    def __init__(self) -> None:
        self._receivers: dict[int, _Word] = {}
        self._estimate = ""
        self._position_s = self._resumed_s = -math.inf

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of the best receiver, as last heard; -1: none was."""
        return max((word.fix_type for word in self._receivers.values()), default=-1)

    def hear(self, message: Any, now_s: float) -> None:
        """Take a message in; of positions no more than that they come."""
        name = message.get_type()
        if name == "GLOBAL_POSITION_INT":
            self._resumed_s = now_s if now_s - self._position_s > GAP_S else self._resumed_s
            self._position_s = now_s
        elif name in _RECEIVERS:
            kind, words = _fault_of(message)
            self._receivers[_RECEIVERS[name]] = _Word(int(message.fix_type), kind, words, now_s)
        elif name == "EKF_STATUS_REPORT":
            flags = int(message.flags)
            rejects = "the autopilot's filter rejects its GPS" if flags & _GLITCH else ""
            no_place = flags & _NO_PLACE or not flags & _ABSOLUTE
            self._estimate = "the autopilot's filter has no absolute position" if no_place else rejects

    def fault(self, now_s: float) -> tuple[str, str]:
        """Why a position told now is none: kind and words, both empty when it may be believed.

        One receiver with a good fix is enough. Of an autopilot that never spoke of its fix nothing is known: preflight
        refuses that.
        """
        found = []
        for number, word in sorted(self._receivers.items()):
            receiver, kind, words = "GPS" if number == 1 else f"GPS {number}", word.kind, word.words
            if now_s - max(word.heard_s, self._resumed_s) > FIX_SILENT_S:
                silent = f"nothing heard of the {receiver} fix for {now_s - word.heard_s:.0f} s"
                found.append(("fix_silent", silent))
            else:
                found.append((kind, f"{receiver} {words}"))
        if found and all(kind for kind, _ in found):
            return found[0][0], ", ".join(words for _, words in found)
        return ("no_estimate", self._estimate) if self._estimate else ("", "")


def _fault_of(message: Any) -> tuple[str, str]:
    if message.fix_type < ENOUGH_FIX:
        return "no_fix", f"has no fix (fix type {message.fix_type})"
    if message.eph != _HDOP_UNKNOWN and message.eph * 0.01 > WORST_HDOP:
        return "poor_fix", f"fix is poor (HDOP {message.eph * 0.01:.1f})"
    accuracy_m = getattr(message, "h_acc", 0) * 1e-3  # 0: not told
    if math.isfinite(accuracy_m) and accuracy_m > WORST_ACCURACY_M:
        return "poor_fix", f"fix is poor (good to {accuracy_m:.0f} m)"
    return "", ""


class Streams:
    """Asks for messages, position and attitude at ``rate_hz`` (40 at most), and believes only what arrives."""

    def __init__(self, rate_hz: float) -> None:
        self.needed: Mapping[int, float] = {POSITION: rate_hz, ATTITUDE: rate_hz}
        self._extra: Mapping[int, float] = {
            int(mavlink.MAVLINK_MSG_ID_HEARTBEAT): min(4.0, rate_hz),
            int(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT): 2.0,
            int(mavlink.MAVLINK_MSG_ID_GPS2_RAW): 2.0,
            int(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT): 2.0,
            int(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME): 1.0,
        }
        self._asked_hz = {**self.needed, **self._extra}
        self._arrivals: dict[int, deque[float]] = {key: deque(maxlen=_KEPT) for key in self._asked_hz}
        self._asked_s: dict[int, float] = {}
        self._tries: dict[int, int] = dict.fromkeys(self._extra, 0)

    def hear(self, message_id: int, received_s: float) -> None:
        """A message arrived."""
        if message_id in self._arrivals:
            self._arrivals[message_id].append(received_s)

    def rate_hz(self, message_id: int, now_s: float) -> float:
        """How often a message came lately, Hz."""
        window_s = max(WINDOW_S, WINDOW_MESSAGES / self._asked_hz[message_id])
        return sum(1 for at in self._arrivals[message_id] if 0.0 <= now_s - at < window_s) / window_s

    def rates_hz(self, now_s: float) -> dict[str, float]:
        """The same of all messages asked for, by name."""
        return {mavlink.mavlink_map[key].msgname: self.rate_hz(key, now_s) for key in self._arrivals}

    def missing(self, now_s: float) -> str:
        """What of the needed does not arrive at the rate asked for, in words; empty when all does."""
        rates = {key: self.rate_hz(key, now_s) for key in self.needed}
        return ", ".join(
            f"{mavlink.mavlink_map[key].msgname} at {rates[key]:.1f} of {hz:g} Hz"
            for key, hz in self.needed.items()
            if rates[key] < ENOUGH * hz
        )

    def requests(self, now_s: float) -> list[tuple[int, float]]:
        """Messages to ask for now and their intervals, us: those that do not arrive as they should."""
        due = []
        for key, hz in self._asked_hz.items():
            arrivals, asked_s = self._arrivals[key], self._asked_s.get(key)
            is_gone = bool(arrivals) and now_s - arrivals[-1] > _GONE_S
            if key in self._extra and self._tries[key] >= _EXTRA_TRIES and not is_gone:
                continue
            if asked_s is None or (now_s - asked_s >= _ASK_AGAIN_S and self.rate_hz(key, now_s) < ENOUGH * hz):
                due.append((key, 1e6 / hz))
                self._asked_s[key] = now_s
                self._tries[key] = self._tries.get(key, 0) + 1
        return due

    def restart(self) -> None:
        """The autopilot restarted: it has forgotten what was asked."""
        self._asked_s.clear()
        self._tries = dict.fromkeys(self._extra, 0)


class Telemetry:
    """What a boat's messages say in the field's frame. Not thread-safe: its owner holds a lock.

    Attributes:
        clock: of the boat.
        faults: what was refused, by kind; the owner empties it.
        wall_ahead_s: this machine's wall clock less the boat's GPS time, s; NaN when not heard.
        fix: whether its positions may be believed.
    """

    def __init__(self, frame: FieldFrame) -> None:
        self.clock, self.faults, self.wall_ahead_s = BoatClock(), Counter[str](), math.nan
        self._frame, self._starts, self._heard_s = frame, 0, -math.inf
        self.forget()

    def forget(self) -> None:
        """Begin anew, as after a restart of the autopilot."""
        self.position_m, self.position_s = (math.nan, math.nan), -math.inf
        self.velocity_mps, self.velocity_s = (math.nan, math.nan), -math.inf
        self.turn_rate_rads, self.turn_rate_s = math.nan, -math.inf
        self._attitude_rad, self._attitude_s = math.nan, -math.inf
        self._compass_rad, self._compass_s = math.nan, -math.inf
        self._latest_boot: dict[str, tuple[float, int]] = {}
        self.fix, self._fix_lost = FixWatch(), False

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
        self.fix.hear(message, received_s)
        if name in ("GLOBAL_POSITION_INT", "ATTITUDE"):
            return self._hear_timed(message, name, received_s)
        if name == "SYSTEM_TIME" and message.time_unix_usec * 1e-6 > _UNIX_2020_S:
            self.wall_ahead_s = time.time() - message.time_unix_usec * 1e-6
        return ""

    def _hear_timed(self, message: Any, name: str, received_s: float) -> str:
        boot_s, number = message.time_boot_ms * 1e-3, message.get_seq()
        self._heard_s = received_s
        true_s = self.clock.hear(boot_s, received_s)
        if true_s is None:
            self.faults["clock"] += 1
            return ""
        if self.clock.starts != self._starts:
            first, self._starts = self._starts == 0, self.clock.starts
            self.forget()
            if not first:
                return "the autopilot restarted, or its clock was set"
        latest_s, latest_number = self._latest_boot.get(name, (-math.inf, -1))
        if boot_s <= latest_s:  # the same again under a new number is no fault, only nothing new
            kind = "out_of_order" if boot_s < latest_s else "duplicate" if number == latest_number else ""
            self.faults.update([kind] if kind else [])
            return ""
        self._latest_boot[name] = (boot_s, number)
        if name == "ATTITUDE":
            self._hear_attitude(message, true_s)
            return ""
        return self._hear_position(message, true_s)

    def _hear_position(self, message: Any, true_s: float) -> str:
        velocity = (message.vx * 0.01, message.vy * 0.01)
        position, fault = (math.nan, math.nan), ""
        if math.hypot(*velocity) > FASTEST_MPS:
            fault = "impossible_speed"
        elif message.lat == 0 and message.lon == 0:
            fault = "no_position"
        else:
            if abs(message.lat) <= 890_000_000 and abs(message.lon) <= 1_800_000_000:
                position = self._frame.to_field_m(message.lat * 1e-7, message.lon * 1e-7)
            fault = "" if math.hypot(*position) <= FARTHEST_M else "impossible_position"  # NaN is refused
        if fault:
            self.faults[fault] += 1
            return ""
        kind, words = self.fix.fault(self._heard_s)
        was_lost, self._fix_lost = self._fix_lost, bool(kind)
        if kind:  # position and velocity are dead reckoning from now on: they grow old, and it is said once
            self.faults[kind] += 1
            return "" if was_lost else f"{words}; what it tells of its place is dead reckoning and not believed"
        self.velocity_mps, self.velocity_s = velocity, true_s
        self.position_m, self.position_s = position, true_s
        if message.hdg < NO_HEADING:
            self._compass_rad, self._compass_s = math.radians(message.hdg * 0.01), true_s
        return "its fix is back; its position is believed again" if was_lost else ""

    def _hear_attitude(self, message: Any, true_s: float) -> None:
        yaw, rate = message.yaw, message.yawspeed
        if not (abs(yaw) <= TWO_PI and abs(rate) <= FASTEST_TURN_RADS):  # written so that NaN is refused
            self.faults["impossible_attitude"] += 1
        elif message.time_boot_ms < SETTLING_S * 1000.0:
            self.faults["settling"] += 1
        else:
            self.turn_rate_rads, self.turn_rate_s = rate, true_s
            self._attitude_rad, self._attitude_s = yaw % TWO_PI, true_s
