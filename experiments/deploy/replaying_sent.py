"""What the links sent, beside what was decided: nothing may change a command after the shield."""

from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass

from steerclear.shield.bridge.blackbox import LogHeader
from steerclear.shield.bridge.mavlink.commands import CREEP_MPS, VelocityRoute
from steerclear.shield.bridge.messages import Sent, Tick

ROUNDED_MPS, ROUNDED_RAD = 1e-5, 1e-5
"""Messages hold numbers of 32 bits: 1e-7 of a speed and of a turn; a little more is granted."""
OWN_STOP = "send"
"""Condition of the action that declares that a link used its own stop for a boat that was decided for."""


@dataclass(frozen=True)
class Strayed:
    """A command that does not rest on what was decided.

    Attributes:
        boat: whose.
        what: which value.
        decided, sent: the two, m/s or rad; None: there is none.
    """

    boat: str
    what: str
    decided: float | None
    sent: float | None

    @property
    def is_unfounded(self) -> bool:
        """Whether the log holds no decision for it: then nothing is proved, but nothing contradicts itself."""
        return self.decided is None


class SentCheck:
    """Compares tick by tick, for the boats this process commanded or sent something.

    Different, and right: rounding of messages, the autopilot's limit, a link that cannot go astern and creeps instead,
    a link's own stop where the tick declares it or nothing was decided for the boat, and nothing sent to a boat that
    a person steers.

    Attributes:
        cut: how many commands an autopilot's limit cut, by boat and limit, m/s.

    Args:
        header: of the log.
    """

    def __init__(self, header: LogHeader) -> None:
        self.cut: Counter[tuple[str, float]] = Counter()
        self._ours = [boat.name for boat in header.boats if boat.ours]
        self._is_team = header.config.coordination == "team"  # then nobody else steers a boat the shield decides for
        self._tells_limits = header.version > 1
        self._limits: dict[str, float] = {}

    def strayed(self, tick: Tick) -> list[Strayed]:
        """What does not fit in a tick."""
        decided = _decided(tick)
        names = dict.fromkeys((*self._ours, *tick.sent, *(decided if self._is_team else ())))
        found = [self._one(name, tick, decided.get(name)) for name in names]
        return [entry for entry in found if entry is not None]

    def _one(self, name: str, tick: Tick, decided: tuple[float, float] | None) -> Strayed | None:
        sent = tick.sent.get(name)
        if sent is None:
            return Strayed(name, "command", None if decided is None else decided[0], None)
        if decided is None:
            return None if _stops(sent) else Strayed(name, "sent without a decision", None, sent.speed_mps)
        if _stops(sent) and _declares_stop(tick, name):
            return None
        speed_mps, heading_rad = decided
        if not _are_alike(sent.heading_rad, heading_rad):
            return Strayed(name, "heading", heading_rad, sent.heading_rad)
        if not self._is_speed(sent, speed_mps):
            return Strayed(name, "speed", speed_mps, sent.speed_mps)
        return None

    def _is_speed(self, sent: Sent, decided_mps: float) -> bool:
        if sent.route == VelocityRoute.name:
            decided_mps = max(CREEP_MPS, decided_mps)
        limit_mps = sent.limit_mps if self._tells_limits else self._limit_seen(sent, decided_mps)
        allowed_mps = min(limit_mps, max(-limit_mps, decided_mps))
        if abs(allowed_mps - decided_mps) > ROUNDED_MPS:
            self.cut[sent.boat, limit_mps] += 1
        return abs(sent.speed_mps - allowed_mps) <= ROUNDED_MPS

    def _limit_seen(self, sent: Sent, decided_mps: float) -> float:
        """The limit of logs that do not tell it: the first speed that was cut; it never changes."""
        if abs(sent.speed_mps) < abs(decided_mps) - ROUNDED_MPS:
            self._limits.setdefault(sent.boat, abs(sent.speed_mps))
        return self._limits.get(sent.boat, math.inf)


def _decided(tick: Tick) -> dict[str, tuple[float, float]]:
    """Speed m/s and heading rad decided for each boat that the shield steered."""
    if tick.decisions is None:
        return {}
    fleet, commands = tick.decisions.fleet, tick.decisions.sent
    return {
        name: commands.absolute(i, float(fleet.heading_rad[i]))
        for i, name in enumerate(fleet.names)
        if fleet.controlled[i]
    }


def _are_alike(first_rad: float, second_rad: float) -> bool:
    """Whether two headings are one, but for rounding; those that are not finite never are."""
    apart_rad = first_rad - second_rad
    return math.isfinite(apart_rad) and abs(math.remainder(apart_rad, 2.0 * math.pi)) <= ROUNDED_RAD


def _stops(sent: Sent) -> bool:
    """Whether it is a link's own stop, or nothing left at all."""
    if math.isnan(sent.speed_mps):
        return not sent.delivered
    return abs(sent.speed_mps) <= CREEP_MPS + ROUNDED_MPS


def _declares_stop(tick: Tick, name: str) -> bool:
    return any((action.subject, action.condition) == (name, OWN_STOP) for action in tick.actions)
