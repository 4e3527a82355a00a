"""Which messages a boat sends how often."""

from __future__ import annotations

import math

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .hull import STEP_S

HEARTBEAT_S = 1.0
_PHASE_S = STEP_S
"""A stream begins at a multiple of this, so that it tells each new state of the hull as soon as there is one."""

GROUPS: dict[int, tuple[int, ...]] = {
    mavlink.MAV_DATA_STREAM_RAW_SENSORS: (),
    mavlink.MAV_DATA_STREAM_EXTENDED_STATUS: (mavlink.MAVLINK_MSG_ID_SYS_STATUS, mavlink.MAVLINK_MSG_ID_GPS_RAW_INT),
    mavlink.MAV_DATA_STREAM_POSITION: (
        mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT,
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED,
    ),
    mavlink.MAV_DATA_STREAM_EXTRA1: (mavlink.MAVLINK_MSG_ID_ATTITUDE,),
    mavlink.MAV_DATA_STREAM_EXTRA2: (mavlink.MAVLINK_MSG_ID_VFR_HUD,),
    mavlink.MAV_DATA_STREAM_EXTRA3: (mavlink.MAVLINK_MSG_ID_SYSTEM_TIME, mavlink.MAVLINK_MSG_ID_EKF_STATUS_REPORT),
}
"""Messages of REQUEST_DATA_STREAM's groups."""


class Streams:
    """Intervals of one boat's messages.

    Args:
        top_rate_hz: highest rate of one message; faster requests are slowed to it.
        known: ids of the messages it can send.
    """

    def __init__(self, top_rate_hz: float, known: frozenset[int]) -> None:
        self._shortest_s = 1.0 / top_rate_hz
        self._known = known
        self.reset()

    def reset(self) -> None:
        """As after power on: heartbeats only."""
        self._interval_s = {mavlink.MAVLINK_MSG_ID_HEARTBEAT: HEARTBEAT_S}
        self._next_s: dict[int, float] = {}

    def set_interval(self, message: int, interval_us: float) -> bool:
        """SET_MESSAGE_INTERVAL: -1 never, 0 the default; False for a message it cannot send."""
        if message not in self._known:
            return False
        if interval_us > 0.0:
            self._interval_s[message] = max(interval_us * 1e-6, self._shortest_s)
        elif message == mavlink.MAVLINK_MSG_ID_HEARTBEAT:
            self._interval_s[message] = HEARTBEAT_S
        else:
            self._interval_s.pop(message, None)
        self._next_s.pop(message, None)
        return True

    def set_group(self, group: int, rate_hz: int) -> None:
        """REQUEST_DATA_STREAM: all messages of a group, 0 Hz stops them."""
        groups = GROUPS if group == mavlink.MAV_DATA_STREAM_ALL else {group: GROUPS.get(group, ())}
        for messages in groups.values():
            for message in messages:
                self.set_interval(message, 1e6 / rate_hz if rate_hz > 0 else -1.0)

    def interval_us(self, message: int) -> int:
        """Present interval, us; -1: not sent, 0: unknown."""
        if message not in self._known:
            return 0
        return round(self._interval_s[message] * 1e6) if message in self._interval_s else -1

    def due(self, now_s: float) -> list[int]:
        """Messages to send now; one that fell behind is sent once."""
        due = []
        for message, interval in self._interval_s.items():
            at = self._next_s.setdefault(message, math.ceil(now_s / _PHASE_S - 1e-6) * _PHASE_S)
            if at <= now_s + 1e-9:
                due.append(message)
                self._next_s[message] = at + interval if at + interval > now_s else now_s + interval
        return due
