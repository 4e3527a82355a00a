"""Faults of simulated boats: a table of kinds, started and ended at run time or planned.

A planned fault is written ``BOAT:KIND@TIME[+DURATION][,OPTION=VALUE...]``.
"""

from __future__ import annotations

import difflib
import inspect
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from steerclear.shield.bridge.frame import FieldFrame
from steerclear.shield.exceptions import ConfigError

from .autopilot import Autopilot
from .hull import Order, Steer
from .sensing import Bend, Radio, Snapshot
from .vehicle import NOT_OFFERED, Mode

if TYPE_CHECKING:
    from .fleet import SimFleet

Change = Callable[[Snapshot, float], Snapshot]
"""A sensor fault: maps the true state and the time to what the autopilot measures."""


@dataclass(frozen=True)
class Fault:
    """An active fault; its kind determines which parts it has."""

    ends_s: float = math.inf  # when it ends by itself; inf: when it is cleared
    down: Bend | None = None  # effect on packets to and from the commander
    up: Bend | None = None  # effect on packets to and from the commander
    change: Change | None = None  # effect on the autopilot's measurements
    dark: bool = False  # the autopilot is off
    hidden: bool = False  # the position feed leaves the boat out
    feed_late_s: float = 0.0  # delay of the boat's positions in the feed
    compass_off_rad: float = 0.0  # compass error, clockwise


class Faults:
    """Faults of one boat: of its autopilot and of its radio to (down) and from (up) the commander.

    Attributes:
        active: active faults by kind.
        is_dark: whether the autopilot is off.
        is_hidden: whether the position feed leaves the boat out.
        feed_late_s: delay of the boat's positions in the feed, s.
    """

    def __init__(
        self, autopilot: Autopilot, down: Radio, up: Radio, frame: FieldFrame, random: np.random.Generator
    ) -> None:
        self.autopilot, self.frame, self.random = autopilot, frame, random
        self._down, self._up = down, up
        self.active: dict[str, Fault] = {}
        self._combine()

    def start(self, kind: str, now_s: float, duration_s: float = math.inf, **options: Any) -> None:
        """Begin a fault, see `KINDS`; `ConfigError` for an unknown kind or option, or one that cannot be used."""
        check_fault(kind, duration_s, options)
        fault = KINDS[kind](self, **options)
        if fault is not None:
            self.active[kind] = replace(fault, ends_s=now_s + duration_s)
            self._combine()

    def stop(self, kind: str | None = None) -> None:
        """End one fault, or all."""
        for name in list(self.active) if kind is None else [kind]:
            self.active.pop(name, None)
        self._combine()

    def tick(self, now_s: float) -> None:
        """End faults whose time is over."""
        for name in [name for name, fault in self.active.items() if now_s >= fault.ends_s]:
            self.stop(name)

    def misled(self, order: Order) -> Order:
        """Return the order that the hull follows, given the compass error."""
        off = sum(fault.compass_off_rad for fault in self.active.values())
        if off == 0.0 or not isinstance(order, Steer):
            return order
        return Steer((order.heading_rad - off) % (2.0 * math.pi), order.speed_mps)

    def sensed(self, truth: Snapshot, now_s: float) -> Snapshot:
        """Return what the autopilot measures."""
        for fault in self.active.values():
            truth = truth if fault.change is None else fault.change(truth, now_s)
        return truth

    def _combine(self) -> None:
        faults = self.active.values()
        self._down.bends = [fault.down for fault in faults if fault.down is not None]
        self._up.bends = [fault.up for fault in faults if fault.up is not None]
        self.is_dark, self.is_hidden = any(fault.dark for fault in faults), any(fault.hidden for fault in faults)
        self.feed_late_s = max((fault.feed_late_s for fault in faults), default=0.0)


def check_kind(kind: str) -> None:
    """Raise `ConfigError` unless a fault kind exists."""
    if kind not in KINDS:
        near = difflib.get_close_matches(kind, KINDS, n=1)
        hint = f"did you mean {near[0]!r}?" if near else f"faults are {', '.join(KINDS)}"
        raise ConfigError(f"unknown fault {kind!r}; {hint}")


def check_fault(kind: str, duration_s: float, options: Mapping[str, Any]) -> None:
    """Raise `ConfigError` unless there is such a kind, it takes these options, and can last that long, s."""
    check_kind(kind)
    known = list(inspect.signature(KINDS[kind]).parameters)[1:]
    for name, value in options.items():
        if name not in known:
            raise ConfigError(f"fault {kind!r} has no option {name!r}; it has {', '.join(known) or 'none'}")
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise ConfigError(f"fault {kind!r}: {name} is {value!r}; give a number")
    if kind in AT_ONCE and duration_s != math.inf:
        what = f"fault {kind!r} happens at once and has no duration ({duration_s:g} s were given)"
        raise ConfigError(f"{what}; leave it out{AT_ONCE[kind]}")
    if kind == "mode" and options.get("number", Mode.HOLD) not in OFFERED:
        offered = ", ".join(f"{int(mode)} {mode.name}" for mode in OFFERED)
        raise ConfigError(f"fault 'mode': a simulated boat has no mode {options['number']}; it has {offered}")


def _drop(packet: bytes) -> list[tuple[float, bytes]]:
    return []


def _telemetry_stop(boat: Faults) -> Fault:
    """Nothing comes from the boat; it still obeys."""
    return Fault(down=_drop, hidden=True)


def _commands_lost(boat: Faults) -> Fault:
    """Nothing reaches the boat; it still tells."""
    return Fault(up=_drop)


def _link_loss(boat: Faults) -> Fault:
    """Nothing comes from the boat, and nothing reaches it."""
    return Fault(down=_drop, up=_drop, hidden=True)


def _freeze(boat: Faults) -> Fault:
    """Position, speed and heading stay, time stamps go on."""
    kept = boat.autopilot.snapshot
    return Fault(change=lambda truth, time_s: replace(kept, time_s=time_s))


def _jump(boat: Faults, distance_m: float = 30.0, course_deg: float = 90.0) -> Fault:
    """The position it tells is `distance_m` (30) off along `course_deg` (90) of the field."""
    course = math.radians(course_deg)
    dx, dy = distance_m * math.sin(course), distance_m * math.cos(course)
    return Fault(change=lambda truth, time_s: truth.moved_to(boat.frame, truth.x_m + dx, truth.y_m + dy))


def _gps_lost(boat: Faults) -> Fault:
    """The fix is lost, and the autopilot says so; the position it tells goes on, reckoned from the last speed."""
    kept = boat.autopilot.snapshot

    def reckoned(truth: Snapshot, time_s: float) -> Snapshot:
        (vx, vy), past_s = kept.velocity_mps, time_s - kept.time_s
        place = truth.moved_to(boat.frame, kept.x_m + vx * past_s, kept.y_m + vy * past_s)
        return replace(place, velocity_mps=(vx, vy), speed_mps=kept.speed_mps, has_fix=False)

    return Fault(change=reckoned, hidden=True)


def _compass(boat: Faults, offset_deg: float = 30.0) -> Fault:
    """The heading it tells and steers by is `offset_deg` (30) off: it runs that much to the other side."""
    off = math.radians(offset_deg)
    return Fault(change=lambda truth, _: replace(truth, heading_rad=truth.heading_rad + off), compass_off_rad=off)


def _late(boat: Faults, delay_s: float = 1.0) -> Fault:
    """Every packet comes `delay_s` (1.0) later."""
    return Fault(down=lambda packet: [(delay_s, packet)], feed_late_s=delay_s)


def _out_of_order(boat: Faults, spread_s: float = 0.3) -> Fault:
    """Every packet comes up to `spread_s` (0.3) later, each its own."""
    return Fault(down=lambda packet: [(spread_s * boat.random.random(), packet)])


def _duplicate(boat: Faults, copies: int = 2, spread_s: float = 0.2) -> Fault:
    """Every packet comes `copies` (2) times within `spread_s` (0.2)."""
    return Fault(
        down=lambda packet: [
            (spread_s * boat.random.random() if k else 0.0, packet) for k in range(max(int(copies), 1))
        ]
    )


def _corrupt(boat: Faults, share: float = 0.5) -> Fault:
    """1 to 3 bits of a `share` (0.5) of packets are turned."""

    def damaged(packet: bytes) -> list[tuple[float, bytes]]:
        data = bytearray(packet)
        for _ in range(boat.random.integers(1, 4) if boat.random.random() < share else 0):
            data[boat.random.integers(len(data))] ^= 1 << int(boat.random.integers(8))
        return [(0.0, bytes(data))]

    return Fault(down=damaged)


def _restart(boat: Faults) -> None:
    """The autopilot boots again, once; parameters stay, modes and streams do not."""
    boat.autopilot.reboot_wanted = True


def _power_off(boat: Faults) -> Fault:
    """It is off until cleared."""
    boat.autopilot.reboot_wanted = True
    return Fault(down=_drop, up=_drop, dark=True, hidden=True)


def _mode(boat: Faults, number: int = 4) -> None:
    """A pilot's hand, once: mode `number` (4, HOLD). He gives the boat back by another, later: `number=15`, GUIDED."""
    boat.autopilot.vehicle.set_mode(number, boat.autopilot.now_s)


def _disarm(boat: Faults) -> None:
    """A pilot's hand, once: motors off, until somebody arms it."""
    boat.autopilot.vehicle.armed = False


KINDS: dict[str, Callable[..., Fault | None]] = {
    make.__name__.removeprefix("_"): make
    for make in (
        *(_telemetry_stop, _commands_lost, _link_loss, _freeze, _jump, _gps_lost, _compass, _late, _out_of_order),
        *(_duplicate, _corrupt, _restart, _power_off, _mode, _disarm),
    )
}
"""Fault factories by kind. Their docstrings are shown in the documentation of the boats."""

AT_ONCE = {
    "restart": "",
    "mode": ", and plan another change of mode for the end, such as BOAT:mode@SECONDS,number=15 (GUIDED)",
    "disarm": "",
}
"""Faults that happen at once, so that they have no duration, and how to end them."""
ON_LINK = ("commands_lost", "out_of_order", "duplicate", "corrupt", "restart", "mode", "disarm")
"""Faults of a link and of the autopilot behind it: on a boat without one they do nothing."""
OFFERED = tuple(mode for mode in Mode if mode not in NOT_OFFERED)


def faults_page() -> str:
    """Return the documentation's table of faults, in Markdown."""
    rows = [f"| `{kind}` | {make.__doc__} |" for kind, make in KINDS.items()]
    return "\n".join(["| kind | what happens |", "|---|---|", *rows])


_FORM = re.compile(
    r"(?P<boat>[^:@,]+):(?P<kind>\w+)@(?P<at>[\d.]+)(?:\+(?P<lasts>[\d.]+))?(?P<options>(?:,\w+=[^,]+)*)"
)


@dataclass(frozen=True)
class Incident:
    """A planned fault: boat, kind (see `KINDS`) and options, simulated start time and duration, s."""

    boat: str
    kind: str
    at_s: float
    lasts_s: float = math.inf
    options: dict[str, Any] = field(default_factory=dict)


def parse_incident(text: str) -> Incident:
    """Parse a fault such as ``blue_1:jump@60+10,distance_m=30``; `ConfigError` where it is malformed or unknown."""
    found = _FORM.fullmatch(text.strip())
    if found is None:
        raise ConfigError(f"cannot read the fault {text!r}; give BOAT:KIND@SECONDS or BOAT:KIND@SECONDS+DURATION")
    check_kind(found["kind"])
    try:
        at_s, lasts_s = float(found["at"]), float(found["lasts"] or math.inf)
        pairs = (pair.partition("=") for pair in found["options"].split(",") if pair)
        options = {name: json.loads(value) for name, _, value in pairs}
    except ValueError:
        raise ConfigError(f"the fault {text!r} holds something that is not a number") from None
    check_fault(found["kind"], lasts_s, options)
    return Incident(found["boat"], found["kind"], at_s, lasts_s, options)


class Plan:
    """Planned faults in order of time; `ConfigError` where a boat is not simulated, or the fault does nothing to it."""

    def __init__(self, incidents: Iterable[Incident], fleet: SimFleet) -> None:
        self._waiting = sorted(incidents, key=lambda incident: incident.at_s)
        self._fleet = fleet
        for incident in self._waiting:
            boat = fleet.boat(incident.boat)
            if incident.kind in ON_LINK and not boat.has_link:
                shown = ", ".join(kind for kind in KINDS if kind not in ON_LINK)
                raise ConfigError(
                    f"boat {incident.boat!r} has no link, and fault {incident.kind!r} is one of links: it would do "
                    f"nothing; name a boat with a link, or one of {shown}"
                )

    def look(self) -> list[Incident]:
        """Start the faults that are due and return them."""
        begun = []
        while self._waiting and self._waiting[0].at_s <= self._fleet.time_s:
            incident = self._waiting.pop(0)
            self._fleet.fault(incident.boat, incident.kind, duration_s=incident.lasts_s, **incident.options)
            begun.append(incident)
        return begun
