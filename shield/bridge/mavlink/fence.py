"""An autopilot's own fence, read over MAVLink: zones uploaded as a mission of their own, and home."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from itertools import islice
from typing import Any

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from .commands import command

MISSION = int(mavlink.MAV_MISSION_TYPE_FENCE)
ZONES = {
    int(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_INCLUSION): (True, False),
    int(mavlink.MAV_CMD_NAV_FENCE_POLYGON_VERTEX_EXCLUSION): (False, False),
    int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_INCLUSION): (True, True),
    int(mavlink.MAV_CMD_NAV_FENCE_CIRCLE_EXCLUSION): (False, True),
}
"""Whether boats must stay inside, and whether it is a circle, by the command of an item."""
MOST_ITEMS = 500

Point = tuple[float, float]


@dataclass(frozen=True)
class FenceZone:
    """One zone of a fence."""

    inside: bool  # whether boats must stay inside of it, else outside
    places: tuple[Point, ...]  # latitude and longitude, deg, of its corners, or of its middle alone
    radius_m: float = 0.0  # of a circle; 0: it is a polygon


class FenceReader:
    """Downloads an autopilot's fence and its home; messages come in on the link's thread."""

    def __init__(self, target: tuple[int, int], send: Callable[[Any], bool]) -> None:
        self._target, self._send = target, send
        self._lock = threading.Lock()
        self._count: int | None = None
        self._items: dict[int, Any] = {}
        self.home_deg: Point | None = None

    def hear(self, message: Any) -> None:
        """Take an answer in."""
        kind = message.get_type()
        with self._lock:
            if kind == "HOME_POSITION":
                self.home_deg = message.latitude / 1e7, message.longitude / 1e7
            elif kind == "MISSION_COUNT" and message.mission_type == MISSION:
                self._count, self._items = min(int(message.count), MOST_ITEMS + 1), {}
            elif kind == "MISSION_ITEM_INT" and message.mission_type == MISSION and message.seq < (self._count or 0):
                self._items[message.seq] = message

    def ask(self) -> None:
        """Ask for what is not known yet; to be repeated."""
        with self._lock:
            count, known = self._count, set(self._items)
        if self.home_deg is None:
            home = mavlink.MAVLINK_MSG_ID_HOME_POSITION
            self._send(command(self._target, mavlink.MAV_CMD_REQUEST_MESSAGE, home))
        if count is None:
            self._send(mavlink.MAVLink_mission_request_list_message(*self._target, mission_type=MISSION))
            return
        for number in [number for number in range(count) if number not in known][:20]:
            self._send(mavlink.MAVLink_mission_request_int_message(*self._target, number, mission_type=MISSION))

    @property
    def is_known(self) -> bool:
        """Whether all of it was heard."""
        with self._lock:
            return self.home_deg is not None and self._count is not None and len(self._items) == self._count

    @property
    def zones(self) -> tuple[FenceZone, ...] | None:
        """Its zones; None: not all heard, or more than `MOST_ITEMS`."""
        with self._lock:
            if self._count is None or len(self._items) != self._count or self._count > MOST_ITEMS:
                return None
            items = iter([self._items[number] for number in range(self._count)])
        zones = []
        for item in items:
            inside, is_circle = ZONES.get(item.command, (False, None))
            if is_circle is None:
                continue
            corners = [item] if is_circle else [item, *islice(items, max(0, int(item.param1) - 1))]
            places = tuple((corner.x / 1e7, corner.y / 1e7) for corner in corners)
            zones.append(FenceZone(inside, places, float(item.param1) if is_circle else 0.0))
        return tuple(zones)
