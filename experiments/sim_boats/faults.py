"""Faults of one boat that can be switched on and off while it runs."""

from __future__ import annotations

import dataclasses
import difflib
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError

from .autopilot import Autopilot
from .hull import Order, Steer
from .sensing import Bend, Radio, Snapshot

Change = Callable[[Snapshot, float], Snapshot]
"""A fault of what the autopilot knows of itself: the truth and the time in, what it believes out."""


@dataclasses.dataclass
class Fault:
    """One that acts now; which parts it has depends on its kind.

    Attributes:
        ends_s: when it ends by itself; inf: when it is cleared.
        down, up: what becomes of packets to and from the commander.
        change: what becomes of the autopilot's knowledge.
        dark: the autopilot is off.
        hidden: the position feed leaves the boat out.
        feed_late_s: age of what the position feed says of the boat.
        compass_off_rad: error of the compass, clockwise.
    """

    ends_s: float = math.inf
    down: Bend | None = None
    up: Bend | None = None
    change: Change | None = None
    dark: bool = False
    hidden: bool = False
    feed_late_s: float = 0.0
    compass_off_rad: float = 0.0


def _drop(packet: bytes) -> list[tuple[float, bytes]]:
    return []


class Faults:
    """The faults of one boat.

    Args:
        autopilot: the boat's.
        down, up: its radio, to and from the commander.
        frame: where the field is.
        random: random numbers of the faults.
    """

    def __init__(
        self, autopilot: Autopilot, down: Radio, up: Radio, frame: FieldFrame, random: np.random.Generator
    ) -> None:
        self._autopilot = autopilot
        self._down, self._up = down, up
        self._frame = frame
        self._random = random
        self._active: dict[str, Fault] = {}

    @property
    def is_dark(self) -> bool:
        """Whether the autopilot is off."""
        return any(fault.dark for fault in self._active.values())

    @property
    def is_hidden(self) -> bool:
        """Whether the position feed leaves the boat out."""
        return any(fault.hidden for fault in self._active.values())

    @property
    def feed_late_s(self) -> float:
        """Age of what the position feed says of the boat, s."""
        return max((fault.feed_late_s for fault in self._active.values()), default=0.0)

    def misled(self, order: Order) -> Order:
        """What the hull does under an order, the compass being what it is."""
        off = sum(fault.compass_off_rad for fault in self._active.values())
        if off == 0.0 or not isinstance(order, Steer):
            return order
        return Steer((order.heading_rad - off) % (2.0 * math.pi), order.speed_mps)

    @property
    def active(self) -> tuple[str, ...]:
        """Kinds that act now."""
        return tuple(self._active)

    def start(self, kind: str, now_s: float, duration_s: float = math.inf, **options: Any) -> None:
        """Begin a fault, see `KINDS`.

        Raises:
            ConfigError: an unknown kind or option, or an option that cannot be used.
        """
        make = KINDS.get(kind)
        if make is None:
            near = difflib.get_close_matches(kind, KINDS, n=1)
            hint = f"did you mean {near[0]!r}?" if near else f"faults are {', '.join(KINDS)}"
            raise ConfigError(f"unknown fault {kind!r}; {hint}")
        try:
            fault = make(self, now_s, **options)
        except TypeError as error:
            raise ConfigError(f"fault {kind!r}: {error}") from None
        if fault is None:
            return
        fault.ends_s = now_s + duration_s
        self._active[kind] = fault
        self._bend()

    def stop(self, kind: str | None = None) -> None:
        """End a fault, or all."""
        for name in list(self._active) if kind is None else [kind]:
            self._active.pop(name, None)
        self._bend()

    def tick(self, now_s: float) -> None:
        """End those whose time is over."""
        for name in [name for name, fault in self._active.items() if now_s >= fault.ends_s]:
            self.stop(name)

    def sensed(self, truth: Snapshot, now_s: float) -> Snapshot:
        """What the autopilot believes."""
        for fault in self._active.values():
            if fault.change is not None:
                truth = fault.change(truth, now_s)
        return truth

    def _bend(self) -> None:
        self._down.bends = [fault.down for fault in self._active.values() if fault.down is not None]
        self._up.bends = [fault.up for fault in self._active.values() if fault.up is not None]

    def _telemetry_stop(self, now_s: float) -> Fault:
        return Fault(down=_drop, hidden=True)

    def _commands_lost(self, now_s: float) -> Fault:
        return Fault(up=_drop)

    def _link_loss(self, now_s: float) -> Fault:
        return Fault(down=_drop, up=_drop, hidden=True)

    def _freeze(self, now_s: float) -> Fault:
        kept = self._autopilot.snapshot
        return Fault(change=lambda truth, time_s: dataclasses.replace(kept, time_s=time_s))

    def _jump(self, now_s: float, distance_m: float = 30.0, course_deg: float = 90.0) -> Fault:
        course = math.radians(course_deg)
        dx, dy = distance_m * math.sin(course), distance_m * math.cos(course)

        def moved(truth: Snapshot, time_s: float) -> Snapshot:
            x, y = truth.x_m + dx, truth.y_m + dy
            latitude, longitude = self._frame.to_geodetic_deg(x, y)
            return dataclasses.replace(truth, x_m=x, y_m=y, latitude_deg=latitude, longitude_deg=longitude)

        return Fault(change=moved)

    def _gps_lost(self, now_s: float) -> Fault:
        """From now on it reckons: the last velocity, from the last place."""
        kept = self._autopilot.snapshot

        def reckoned(truth: Snapshot, time_s: float) -> Snapshot:
            (vx, vy), past_s = kept.velocity_mps, time_s - kept.time_s
            x, y = kept.x_m + vx * past_s, kept.y_m + vy * past_s
            latitude, longitude = self._frame.to_geodetic_deg(x, y)
            place = {"x_m": x, "y_m": y, "latitude_deg": latitude, "longitude_deg": longitude}
            return dataclasses.replace(truth, **place, velocity_mps=(vx, vy), speed_mps=kept.speed_mps, has_fix=False)

        return Fault(change=reckoned, hidden=True)

    def _compass(self, now_s: float, offset_deg: float = 30.0) -> Fault:
        offset = math.radians(offset_deg)

        def turned(truth: Snapshot, time_s: float) -> Snapshot:
            return dataclasses.replace(truth, heading_rad=truth.heading_rad + offset)

        return Fault(change=turned, compass_off_rad=offset)

    def _late(self, now_s: float, delay_s: float = 1.0) -> Fault:
        return Fault(down=lambda packet: [(delay_s, packet)], feed_late_s=delay_s)

    def _out_of_order(self, now_s: float, spread_s: float = 0.3) -> Fault:
        return Fault(down=lambda packet: [(spread_s * self._random.random(), packet)])

    def _duplicate(self, now_s: float, copies: int = 2, spread_s: float = 0.2) -> Fault:
        def copied(packet: bytes) -> list[tuple[float, bytes]]:
            late = [spread_s * self._random.random() for _ in range(copies - 1)]
            return [(0.0, packet), *((delay, packet) for delay in late)]

        return Fault(down=copied)

    def _corrupt(self, now_s: float, share: float = 0.5) -> Fault:
        def damaged(packet: bytes) -> list[tuple[float, bytes]]:
            if self._random.random() >= share:
                return [(0.0, packet)]
            data = bytearray(packet)
            for _ in range(self._random.integers(1, 4)):
                data[self._random.integers(len(data))] ^= 1 << int(self._random.integers(8))
            return [(0.0, bytes(data))]

        return Fault(down=damaged)

    def _restart(self, now_s: float) -> None:
        self._autopilot.reboot_wanted = True

    def _power_off(self, now_s: float) -> Fault:
        self._autopilot.reboot_wanted = True
        return Fault(down=_drop, up=_drop, dark=True, hidden=True)

    def _mode(self, now_s: float, number: int = 4) -> None:
        self._autopilot.vehicle.set_mode(number, now_s)

    def _disarm(self, now_s: float) -> None:
        self._autopilot.vehicle.disarm()


KINDS: dict[str, Callable[..., Fault | None]] = {
    "telemetry_stop": Faults._telemetry_stop,
    "commands_lost": Faults._commands_lost,
    "link_loss": Faults._link_loss,
    "freeze": Faults._freeze,
    "jump": Faults._jump,
    "gps_lost": Faults._gps_lost,
    "compass": Faults._compass,
    "late": Faults._late,
    "out_of_order": Faults._out_of_order,
    "duplicate": Faults._duplicate,
    "corrupt": Faults._corrupt,
    "restart": Faults._restart,
    "power_off": Faults._power_off,
    "mode": Faults._mode,
    "disarm": Faults._disarm,
}
"""Makers of faults by kind; `mode` and `disarm` are a pilot's hand on the boat and last until undone."""
