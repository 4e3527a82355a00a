"""Replays the shield on a log: are its decisions the same, bit for bit, and were they sent?"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield import Decisions, Shield, SteerclearError
from steerclear.shield.bridge.blackbox import LogHeader
from steerclear.shield.bridge.mavlink.commands import CREEP_MPS, VelocityRoute
from steerclear.shield.bridge.messages import Sent, Tick
from steerclear.shield.decision import Reason

ROUNDED = 1e-5
"""Tolerance for rounding, m/s or rad. Messages hold 32-bit numbers: relative error 1e-7 of speeds and turns."""
OWN_STOP = "send"
"""Condition of an action that declares a link's own stop for a boat with a decision. For `Reason.STOPPED` the shield
itself requests that stop."""
FIELDS = ("intervened", "reason", "safety_margin_m", "slack_m", "active_constraint")
"""Arrays of a decision that are compared besides the filtered commands; its computing time is not."""


class Strayed(NamedTuple):
    """A sent command that does not match the decision: m/s or rad; None: nothing was decided, or nothing sent."""

    boat: str
    what: str
    decided: float | None
    sent: float | None


class SentCheck:
    """Compares sent commands with decisions, tick by tick, for boats that this process commanded or sent something to.

    Allowed differences: rounding of messages, the autopilot's limit, a link that cannot go astern and creeps instead,
    a link's own stop if the tick declares it or nothing was decided, and nothing sent to a boat that a person steers.

    Attributes:
        cut: number of commands that an autopilot's limit cut, by boat and limit, m/s.
    """

    def __init__(self, header: LogHeader) -> None:
        self.cut: Counter[tuple[str, float]] = Counter()
        self._ours = [boat.name for boat in header.boats if boat.ours]
        self._is_team = header.config.coordination == "team"  # then only this process steers the shield's boats

    def strayed(self, tick: Tick) -> list[Strayed]:
        """Return the mismatches in a tick."""
        decided = {}
        if tick.decisions is not None:
            fleet, filtered = tick.decisions.fleet, tick.decisions.filtered
            for i in np.flatnonzero(fleet.controlled):
                decided[fleet.names[i]] = filtered.absolute(int(i), float(fleet.heading_rad[i]))
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
        off_rad = sent.heading_rad - heading_rad
        if not (math.isfinite(off_rad) and abs(math.remainder(off_rad, 2.0 * math.pi)) <= ROUNDED):
            return Strayed(name, "heading", heading_rad, sent.heading_rad)
        asked_mps = max(CREEP_MPS, speed_mps) if sent.route == VelocityRoute.name else speed_mps
        allowed_mps = min(sent.limit_mps, max(-sent.limit_mps, asked_mps))
        self.cut.update([(sent.boat, sent.limit_mps)] if abs(allowed_mps - asked_mps) > ROUNDED else [])
        is_it = abs(sent.speed_mps - allowed_mps) <= ROUNDED
        return None if is_it else Strayed(name, "speed", speed_mps, sent.speed_mps)


def _stops(sent: Sent) -> bool:
    """Whether it is a link's own stop, or nothing was sent."""
    if math.isnan(sent.speed_mps):
        return not sent.delivered
    return abs(sent.speed_mps) <= CREEP_MPS + ROUNDED


def _declares_stop(tick: Tick, name: str) -> bool:
    decisions = tick.decisions  # compared as numbers: in a damaged log they need not be valid reasons
    pairs = () if decisions is None else zip(decisions.fleet.names, decisions.reason.tolist(), strict=False)
    declared = ((action.subject, action.condition) for action in tick.actions)
    return (name, Reason.STOPPED) in pairs or (name, OWN_STOP) in declared


class Difference(NamedTuple):
    """A decision, or a sent command, that differs from the recorded one; values are exact.

    ``time_s`` counts from the start of the log; ``boat`` is "" if it concerns all.
    """

    tick: int
    time_s: float
    boat: str
    what: str
    recorded: str
    replayed: str


@dataclass
class Proof:
    """Result of a replay: counts and the first of each, see `docs.KEYS`; ``covered``: decisions for an own boat."""

    ticks: int = 0
    decisions: int = 0
    covered: int = 0
    same: int = 0
    unproven: int = 0
    different: int = 0
    first: Difference | None = None
    missing: list[tuple[int, int]] = field(default_factory=list)
    strayed: int = 0
    unfounded: int = 0
    first_sent: Difference | None = None
    cut: Counter[tuple[str, float]] = field(default_factory=Counter)

    @property
    def holds(self) -> bool:
        """Whether nothing contradicts: no provable decision differs, and no sent command differs from its decision."""
        return self.different == 0 and self.strayed == 0

    @property
    def proved(self) -> bool:
        """Whether all turns are proved: own boats had decisions, all equal, none missing, and all commands match."""
        return self.holds and self.covered > 0 and not (self.unproven or self.missing or self.unfounded)


class Prover:
    """Decides again tick by tick.

    The shield stores backups from tick to tick. After missing ticks its answers are therefore unknown until the next
    reset, or until the fleet's boats change, which also resets it.
    """

    def __init__(self, header: LogHeader) -> None:
        self._header = header
        self._shield = Shield(header.config, header.surroundings)
        self._sent = SentCheck(header)
        self.proof = Proof(cut=self._sent.cut)
        self._known = True
        self._last = -1
        self._boats: Any = None

    def add(self, tick: Tick) -> None:
        """Decide a tick again and compare; also compare sent commands with the decision."""
        proof = self.proof
        proof.ticks += 1
        if tick.number != self._last + 1:
            proof.missing.append((self._last, tick.number))
            self._known, self._boats = False, None
        self._last = tick.number
        for one in self._sent.strayed(tick):
            proof.strayed += one.decided is not None
            proof.unfounded += one.decided is None
            values = ["none" if value is None else exact(value) for value in (one.decided, one.sent)]
            proof.first_sent = proof.first_sent or self._difference(tick, one.boat, one.what, *values)
        if tick.fleet is None or tick.nominal is None or tick.decisions is None:
            return
        boats = (tick.fleet.platforms, tick.fleet.names, tick.fleet.team.tobytes())
        self._known |= tick.shield_reset or (self._boats is not None and boats != self._boats)
        self._boats = boats
        if tick.shield_reset:
            self._shield.reset()
        difference = self._compare(tick, tick.decisions)
        proof.decisions += 1
        proof.covered += bool(tick.decisions.fleet.controlled.any())
        proof.same += difference is None
        proof.unproven += difference is not None and not self._known
        if difference is not None and self._known:
            proof.different += 1
            proof.first = proof.first or difference

    def _compare(self, tick: Tick, recorded: Decisions) -> Difference | None:
        try:
            replayed = self._shield.decide(recorded.fleet, recorded.nominal, tick.surroundings)
        except SteerclearError as error:
            return self._difference(tick, "", "decision", "decided", f"refused: {error}")
        for boat, what, a, b in _differing(recorded, replayed):
            return self._difference(tick, boat, what, exact(a), exact(b))
        return None

    def _difference(self, tick: Tick, *said: str) -> Difference:
        return Difference(tick.number, tick.began_s - self._header.clock_s, *said)


def prove(header: LogHeader, ticks: Iterable[Tick]) -> Proof:
    """Decide all ticks of a log again."""
    prover = Prover(header)
    for tick in ticks:
        prover.add(tick)
    return prover.proof


def exact(value: Any) -> str:
    """Format a value such that values differing in a bit read differently."""
    return f"{value!r} ({value.hex()})" if isinstance(value, float) else repr(value)


def _differing(recorded: Decisions, replayed: Decisions) -> Iterator[tuple[str, str, Any, Any]]:
    """Yield boat, name of the value and both values, for every value that differs in a bit."""
    one, other = recorded.filtered, replayed.filtered
    if one.relative != other.relative:
        yield "", "frame of the command", one.relative, other.relative
    pairs = [(f"sent {what}", one.values[:, k], other.values[:, k]) for k, what in enumerate(("speed, m/s", "heading"))]
    pairs += [(name, getattr(recorded, name), getattr(replayed, name)) for name in FIELDS]
    for name, a, b in pairs:
        for i in np.flatnonzero(_bits(a) != _bits(b)):
            yield recorded.fleet.names[i], name, a[i].item(), b[i].item()


def _bits(values: Any) -> Any:
    array = np.ascontiguousarray(values)
    return array.view(np.uint64) if array.dtype == np.float64 else array
