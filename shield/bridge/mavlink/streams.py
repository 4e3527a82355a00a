"""`Streams`: asks the autopilot for messages at a rate, and believes only what arrives."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

POSITION = int(mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT)
ATTITUDE = int(mavlink.MAVLINK_MSG_ID_ATTITUDE)
HEARTBEAT = int(mavlink.MAVLINK_MSG_ID_HEARTBEAT)
GPS = int(mavlink.MAVLINK_MSG_ID_GPS_RAW_INT)
SECOND_GPS = int(mavlink.MAVLINK_MSG_ID_GPS2_RAW)
ESTIMATE = int(mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT)
TIME = int(mavlink.MAVLINK_MSG_ID_SYSTEM_TIME)

WINDOW_S = 1.0
WINDOW_MESSAGES = 10
"""Rates are counted over the longer of a second and the time so many messages should take."""
ENOUGH = 0.8
"""Share of the rate asked for that must arrive."""
_ASK_AGAIN_S = 2.0
_EXTRA_TRIES = 3
_GONE_S = 3.0
"""An extra that came and then did not for so long is asked for again, however often it was."""
_KEPT = 256


class Streams:
    """Rates wanted and rates that arrive, of one boat.

    Args:
        rate_hz: of position and attitude; at most 40, which is what autopilots give.
    """

    def __init__(self, rate_hz: float) -> None:
        self.needed: Mapping[int, float] = {POSITION: rate_hz, ATTITUDE: rate_hz}
        self._extra: Mapping[int, float] = {
            HEARTBEAT: min(4.0, rate_hz),
            **{GPS: 2.0, SECOND_GPS: 2.0, ESTIMATE: 2.0, TIME: 1.0},
        }
        self._wanted_hz = {**self.needed, **self._extra}
        self._arrivals: dict[int, deque[float]] = {key: deque(maxlen=_KEPT) for key in self._wanted_hz}
        self._asked_s: dict[int, float] = {}
        self._tries: dict[int, int] = dict.fromkeys(self._extra, 0)

    def hear(self, message_id: int, received_s: float) -> None:
        """A message arrived."""
        arrivals = self._arrivals.get(message_id)
        if arrivals is not None:
            arrivals.append(received_s)

    def rate_hz(self, message_id: int, now_s: float) -> float:
        """How often a message came lately, Hz."""
        window_s = max(WINDOW_S, WINDOW_MESSAGES / self._wanted_hz[message_id])
        return sum(1 for at in self._arrivals[message_id] if 0.0 <= now_s - at < window_s) / window_s

    def rates_hz(self, now_s: float) -> dict[str, float]:
        """The same of all messages asked for, by name."""
        return {mavlink.mavlink_map[key].msgname: self.rate_hz(key, now_s) for key in self._arrivals}

    def missing(self, now_s: float) -> str:
        """What of the needed does not arrive at the rate asked for, in words; empty when all does."""
        return ", ".join(
            f"{mavlink.mavlink_map[key].msgname} at {self.rate_hz(key, now_s):.1f} of {hz:g} Hz"
            for key, hz in self.needed.items()
            if self.rate_hz(key, now_s) < ENOUGH * hz
        )

    def requests(self, now_s: float) -> list[tuple[int, float]]:
        """Messages to ask for now and their intervals, us: those that do not arrive as they should."""
        wanted = [(key, hz) for key, hz in self.needed.items() if self._is_due(key, hz, now_s)]
        for key, hz in self._extra.items():
            if (self._tries[key] < _EXTRA_TRIES or self._is_gone(key, now_s)) and self._is_due(key, hz, now_s):
                self._tries[key] += 1
                wanted.append((key, hz))
        self._asked_s.update({key: now_s for key, _ in wanted})
        return [(key, 1e6 / hz) for key, hz in wanted]

    def restart(self) -> None:
        """The autopilot restarted: it has forgotten what was asked."""
        self._asked_s.clear()
        self._tries = dict.fromkeys(self._extra, 0)

    def _is_gone(self, key: int, now_s: float) -> bool:
        arrivals = self._arrivals[key]
        return bool(arrivals) and now_s - arrivals[-1] > _GONE_S

    def _is_due(self, key: int, hz: float, now_s: float) -> bool:
        asked = self._asked_s.get(key)
        if asked is None:
            return True
        return now_s - asked >= _ASK_AGAIN_S and self.rate_hz(key, now_s) < ENOUGH * hz


def interval_request(system_id: int, component: int, message_id: int, interval_us: float) -> Any:
    """The command that asks for a message at an interval."""
    return mavlink.MAVLink_command_long_message(
        system_id, component, mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, 0, message_id, interval_us, 0, 0, 0, 0, 0
    )
