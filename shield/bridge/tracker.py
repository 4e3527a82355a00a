"""`Tracker`: current states of all boats of the fleet file; own ones from telemetry and model, others from contacts.

Sources that agree about a boat form one group. Its most precise fix counts, with an error that covers the others.
Sources that contradict each other form several groups, and any of them may be right, whatever their ages.
The shield keeps clear of all positions so reported.
"""

from __future__ import annotations

import logging
import math
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from ..fleet import Fleet
from ..jit import Array
from ..platforms import fresh_state
from ..platforms import layout as L
from .estimator import Estimator
from .fleet_file import FleetFile
from .messages import NEVER_S, Alarm, BoatReading, Contact, Sent

LOG = logging.getLogger(__name__)
TALK_EVERY_S, MOST_LOGGED = 5.0, 256
"""Interval between logs of the same fault of a boat, s; faults remembered (a feed may send any number of names)."""
_NUMBER = re.compile(r"-?\d[\d.e+-]*")
"""What differs between two texts of the same fault."""
GHOST = "~"  # a ghost is named after its boat, plus this and a number; no boat name in a fleet file contains it
FARTHEST_M = 1e5  # positions farther from the field's corner are faults
SPEED_SHARE, SPEED_MORE_MPS = 2.0, 1.0
"""Speeds beyond this share of the platform's top speed plus this are faults: current and wind add less."""
JUMP_M = 3.0  # deviation from the expected position that receiver noise does not explain, m
ACCEPTED_AFTER_S = 2.0
"""A new position reported consistently for this long is accepted, s, unless another source sees the boat elsewhere."""
MOVED_M, FROZEN_M = 0.05, 0.6
"""A position is frozen if it moved less than the first while the speed integrates to more than the second, m."""
UNDER_WAY_MPS = 0.2  # lower speeds are not integrated: they may be noise of a boat at rest
EARLY_S = 0.1  # contacts dated farther in the future than this are clock faults
MOST_SOURCES, MOST_GROUPS = 32, 3
"""Sources remembered per boat; positions of it that the shield keeps clear of. With more, its position is unknown."""
VAGUE_M = 10.0
"""A position with a larger error does not widen that of a more precise one. As a rival it makes `View.crowded` true."""


def _apart(one: Contact, other: Contact) -> tuple[float, float]:
    """Return the distance of two contacts, m, the older extrapolated straight on, and their age difference, s."""
    older, newer = sorted((one, other), key=lambda contact: contact.fixed_s)
    seconds = newer.fixed_s - older.fixed_s
    way = older.speed_mps * seconds
    x_m = older.position_m[0] + way * math.sin(older.heading_rad)
    y_m = older.position_m[1] + way * math.cos(older.heading_rad)
    return math.hypot(newer.position_m[0] - x_m, newer.position_m[1] - y_m), seconds


class Gate:
    """Plausibility check of one source's fixes of one boat.

    A jump is refused at first. A new position that the source keeps reporting is accepted in the end: receivers do
    settle on a better fix, and losing the track for good would be worse.
    """

    def __init__(self, fastest_mps: float) -> None:
        self._fastest = SPEED_SHARE * fastest_mps + SPEED_MORE_MPS
        self._last: Contact | None = None
        self._still: Contact | None = None
        self._newest_s, self._run_m = -math.inf, 0.0
        self._doubted: Contact | None = None
        self._doubted_since_s = 0.0

    def refuse(self, fix: Contact, witness: Contact | None = None) -> str:
        """Return why this fix is refused; empty if it is accepted.

        ``witness`` is a recent contact by other sources, or None. A fix that continues from the last accepted one is
        never refused because of the witness: the witness may be wrong.
        """
        (x_m, y_m), speed_mps, last = fix.position_m, abs(fix.speed_mps), self._last
        if not np.isfinite((x_m, y_m, fix.heading_rad, speed_mps, fix.fixed_s)).all():
            return "a value is not finite"
        if math.hypot(x_m, y_m) > FARTHEST_M:
            return f"position ({x_m:.0f}, {y_m:.0f}) m is nowhere near the field"
        if speed_mps > self._fastest:
            return f"speed {fix.speed_mps:.1f} m/s is beyond the boat"
        if self._is_frozen(fix):
            return f"position frozen while it runs {speed_mps:.1f} m/s"
        if witness is not None and self._doubted is not None:
            room_m = JUMP_M + witness.error_m
            if _apart(witness, fix)[0] > room_m and (last is None or _apart(last, fix)[0] > room_m):
                self._doubted, self._doubted_since_s = fix, fix.fixed_s
                return "position jumped, and the feed sees it elsewhere"
        if last is not None and not self._is_near(last, fix):
            if self._doubted is None or not self._is_near(self._doubted, fix):
                self._doubted_since_s = fix.fixed_s
            self._doubted = fix
            if fix.fixed_s - self._doubted_since_s < ACCEPTED_AFTER_S:
                return f"position jumped {_apart(last, fix)[0]:.0f} m"
        self._last, self._doubted = fix, None
        return ""

    def _is_frozen(self, fix: Contact) -> bool:
        """Whether the position stays although the boat reports speed, even with fresh time stamps."""
        still = self._still
        if still is None or math.dist(fix.position_m, still.position_m) > MOVED_M:
            self._still, self._run_m = fix, 0.0
        elif fix.fixed_s > self._newest_s and abs(fix.speed_mps) > UNDER_WAY_MPS:
            self._run_m += abs(fix.speed_mps) * min(fix.fixed_s - self._newest_s, 1.0)
        self._newest_s = max(self._newest_s, fix.fixed_s)
        return self._run_m > FROZEN_M

    def _is_near(self, before: Contact, fix: Contact) -> bool:
        """Whether the boat can have moved from one fix to the other, by any manoeuvre."""
        apart_m, seconds = _apart(before, fix)
        return apart_m <= JUMP_M + 2.0 * self._fastest * min(seconds, ACCEPTED_AFTER_S)


@dataclass(frozen=True)
class View:
    """Where one boat may be, by all its sources."""

    contact: Contact  # of the first group; sources still heard come first, in the order they were first heard
    rivals: tuple[Contact, ...] = ()  # of the groups that contradict it
    text: str = ""  # which sources contradict each other, in words; empty: none
    crowded: bool = False  # whether there are positions that the shield cannot keep clear of


class ContactFusion:
    """Latest contact of one boat by source, and their fusion.

    A source is silent if its contact is older than ``max_age_s``. A contact older than ``lost_after_s`` counts only if
    no source has a newer one.
    """

    def __init__(self, fastest_mps: float, max_age_s: float, lost_after_s: float) -> None:
        self._fastest_mps, self._max_age_s, self._lost_after_s = fastest_mps, max_age_s, lost_after_s
        self._gates: dict[str, Gate] = {}
        self._latest: dict[str, Contact] = {}

    def take(self, contact: Contact, now_s: float) -> str:
        """Take in a contact; return why it is refused, or empty if it is accepted or not new."""
        source, known = contact.source, self._latest.get(contact.source)
        if known is not None and contact.fixed_s <= known.fixed_s:
            return ""  # the same fix, or one received late
        if not 0.0 <= contact.error_m < math.inf:
            return f"error {contact.error_m} m is no bound"
        if contact.fixed_s > now_s + EARLY_S:
            return f"fixed {contact.fixed_s - now_s:.1f} s in the future"
        if source not in self._gates:
            if len(self._gates) >= MOST_SOURCES:  # forget the source with the oldest contact
                heard_s = {name: -math.inf for name in self._gates}
                heard_s |= {name: latest.fixed_s for name, latest in self._latest.items()}
                oldest = min(heard_s, key=heard_s.__getitem__)
                del self._gates[oldest]
                self._latest.pop(oldest, None)
            self._gates[source] = Gate(self._fastest_mps)
        text = self._gates[source].refuse(contact)
        if not text:
            self._latest[source] = replace(contact, fixed_s=min(contact.fixed_s, now_s))
        return text

    def view(self, now_s: float) -> View | None:
        """Fuse the contacts; None if there never was one."""
        ages = {source: now_s - contact.fixed_s for source, contact in self._latest.items()}
        lately = [source for source, age in ages.items() if age <= self._lost_after_s]
        lately = lately or sorted(ages, key=ages.__getitem__)[:1]
        if not lately:
            return None
        lately.sort(key=lambda source: ages[source] > self._max_age_s)  # sources still heard first
        groups: list[list[Contact]] = []
        for contact in (self._latest[source] for source in lately):
            agreeing = [group for group in groups if self._agree(group[0], contact)]
            agreeing[0].append(contact) if agreeing else groups.append([contact])
        contact, *others = (self._surest(group, now_s) for group in groups)
        rivals = tuple(other for other in others if other.error_m <= VAGUE_M)[: MOST_GROUPS - 1]
        return View(contact, rivals, _contradiction(contact, others), crowded=len(rivals) < len(others))

    def _agree(self, one: Contact, other: Contact) -> bool:
        apart_m, between_s = _apart(one, other)
        room_m = JUMP_M + one.error_m + other.error_m
        return apart_m <= room_m + self._fastest_mps * min(between_s, ACCEPTED_AFTER_S)

    def _surest(self, group: list[Contact], now_s: float) -> Contact:
        """Return the most precise contact of a group; its error grows to cover contacts its bound excludes."""
        surest = min(group, key=lambda contact: contact.error_m + self._fastest_mps * (now_s - contact.fixed_s))
        error_m = surest.error_m
        for other in group:
            apart_m, between_s = _apart(surest, other)
            apart_m -= self._fastest_mps * between_s
            is_sure = between_s <= self._max_age_s and other.error_m <= VAGUE_M
            if is_sure and apart_m > surest.error_m + other.error_m:
                error_m = max(error_m, apart_m + other.error_m)
        return replace(surest, error_m=error_m)


def _contradiction(contact: Contact, others: list[Contact]) -> str:
    if not others:
        return ""
    names = [other.source if len(other.source) <= 20 else f"{other.source[:19]}…" for other in (contact, *others)]
    apart_m = [_apart(contact, other)[0] for other in others]
    texts = [f"{name} {off_m:.0f} m from there" for name, off_m in zip(names[1:], apart_m, strict=True)]
    more = ", and others elsewhere" if len(texts) >= MOST_GROUPS else ""
    named = ", ".join(texts[: MOST_GROUPS - 1])
    return f"{names[0]} has it at one place, {named}{more}: find out who is wrong and end it"


@dataclass(frozen=True)
class Track:
    """Estimate of one boat."""

    row: Array  # (N_STATE,) state; NaN memory where unknown
    ahead_s: float  # age of ``row``, s: 0 for own boats, whose model is rolled out to the present
    age_s: float  # age of the oldest measurement used, s
    error_m: float  # bound on the position error without the part that grows with age, m

    @property
    def velocity_mps(self) -> Array:
        """Over ground along x and y, m/s."""
        heading = np.radians(self.row[L.HEADING])
        return np.asarray(self.row[L.SPEED] * np.array([np.sin(heading), np.cos(heading)]))

    def position_m(self, longest_s: float = math.inf) -> Array:
        """Return the position, m, extrapolated straight on for at most ``longest_s``."""
        return np.asarray(self.row[: L.Y + 1] + min(self.ahead_s, longest_s) * self.velocity_mps)


class Tracker:
    """Tracks of all boats of a fleet file; ``commanded`` names the own boats, those of this process.

    Attributes:
        faults: why a fix was refused in the last `update`, by boat name.
        margin_m: model-error margins of own boats, m, see `model_error`.
    """

    def __init__(self, fleet: FleetFile, commanded: Iterable[str]) -> None:
        config, limit = fleet.shield_config, fleet.limits.contact
        fastest = {name: fleet.platform_of[name].max_speed_mps for name in fleet.names}
        self.fleet, self.commanded = fleet, tuple(commanded)
        self.faults: dict[str, str] = {}
        self.margin_m: Mapping[str, float] = {}
        self._estimators = {
            name: Estimator(fleet.platform_of[name], config.dt_s, config.delay_s) for name in self.commanded
        }
        self._own_gates = {name: Gate(fastest[name]) for name in self.commanded}
        self._fusion = {name: ContactFusion(fastest[name], limit.max_age_s, limit.lost_after_s) for name in fleet.names}
        self._views: dict[str, View] = {}
        self._telemetry_s: dict[str, float] = {}
        self._fed_m: dict[str, float] = {}
        self._logged_s: dict[tuple[str, str], float] = {}
        self._now_s = -math.inf

    def update(self, now_s: float, readings: Mapping[str, BoatReading], contacts: Iterable[Contact]) -> None:
        """Take in readings and contacts, and roll own boats out to ``now_s``."""
        self._now_s, self.faults = now_s, {}
        for name, estimator in self._estimators.items():
            estimator.advance(now_s)
            if name in readings and math.isfinite(readings[name].age_s):  # an infinite age: a field was never received
                self._take_reading(name, readings[name], estimator)
        for contact in contacts:
            fusion = self._fusion.get(contact.boat)
            text = "is not in the fleet file: add it, so that boats keep clear of it"
            if text := text if fusion is None else fusion.take(contact, now_s):
                self._note(contact.boat, text)
        for name, fusion in self._fusion.items():
            view = fusion.view(now_s)
            if view is not None:
                self._views[name] = view
                if view.text:
                    self._log(name, "contradicted", f"contradicted: {view.text}")
        for name, estimator in self._estimators.items():
            seen = self._agreed(name)  # the feed replaces telemetry of an own boat that is too old
            if seen is not None and self.navigation_age_s(name) > self.fleet.limits.navigation.max_age_s:
                estimator.correct(_reading_of(seen, now_s))
                self._fed_m[name] = seen.error_m

    def sent(self, tick_s: float, sent: Mapping[str, Sent]) -> None:
        """Record the commands sent at the tick of that time."""
        for name, message in sent.items():
            if message.delivered and math.isfinite(message.speed_mps):
                self._estimators[name].sent(tick_s, message.heading_rad, message.speed_mps)

    def track(self, name: str) -> Track | None:
        """Return the boat's track; None if it was never seen."""
        own = self._own_track(name)
        if own is None or own.age_s > self.fleet.limits.navigation.lost_after_s:
            view = self._views.get(name)
            seen = None if view is None else self._track_of(view.contact)
            if own is None or (seen is not None and seen.age_s < own.age_s):
                return seen
        return own

    def ghosts(self, name: str) -> tuple[Track, ...]:
        """Return other possible tracks of a boat, from contradicting sources; none while its own link is heard."""
        own, view = self._own_track(name), self._views.get(name)
        if view is None or (own is not None and own.age_s <= self.fleet.limits.navigation.lost_after_s):
            return ()
        return tuple(self._track_of(contact) for contact in view.rivals)

    def own_rows(self) -> dict[str, Array | None]:
        """Return the estimate of each own boat; None if unknown, refused in this turn, or with old telemetry."""
        found: dict[str, Array | None] = {}
        for name, estimator in self._estimators.items():
            estimate = estimator.estimate(self._now_s)
            old = self.navigation_age_s(name) > self.fleet.limits.navigation.max_age_s
            found[name] = None if estimate is None or old or name in self.faults else estimate.row
        return found

    def navigation_age_s(self, name: str) -> float:
        """Return the age of an own boat's telemetry, s; inf if there is none."""
        return self._now_s - self._telemetry_s.get(name, -NEVER_S)

    def known_age_s(self, name: str) -> float:
        """Return the age of an own boat's state, from telemetry or the feed, s; inf if there is none."""
        own = self._own_track(name)
        return NEVER_S if own is None else own.age_s

    def contact_age_s(self, name: str) -> float:
        """Return the age of another boat's contact, s; inf if there is none."""
        view = self._views.get(name)
        return NEVER_S if view is None else max(0.0, self._now_s - view.contact.fixed_s)

    def contradicted(self, name: str) -> str:
        """Return which sources contradict each other about a boat, in words; empty if none."""
        view = self._views.get(name)
        return "" if view is None else view.text

    def alarms(self) -> tuple[Alarm, ...]:
        """Return an alarm for each boat whose sources contradict each other."""
        views = ((name, self._views.get(name)) for name in self.fleet.names)
        return tuple(Alarm(view.text, name, view.crowded) for name, view in views if view is not None and view.text)

    def seen_now(self) -> Array:
        """Return (n, 4) of all boats of the file, extrapolated: x m, y m, heading deg, speed m/s; NaN if never seen."""
        seen = np.full((len(self.fleet.names), 4), np.nan)
        for i, name in enumerate(self.fleet.names):
            track = self.track(name)
            if track is not None:
                seen[i] = *track.position_m(self.fleet.limits.contact.lost_after_s), *track.row[[L.HEADING, L.SPEED]]
        return seen

    def assemble(self, controlled: Collection[str], without: Collection[str] = ()) -> Fleet | None:
        """Return the shield's input: every boat ever seen, with ages and errors; None if no boat is known.

        The boats are in the file's order, so that the shield's memory survives boats that appear and vanish. Tracks are
        extrapolated, and their errors grow, up to ``contact.lost_after_s``: without that limit the growing region would
        in the end drive own boats off the water.

        The shield decides for the boats ``controlled``; those in ``without`` are left out.

        Raises:
            FleetError: the tracks make no valid fleet.
        """
        file = self.fleet
        tracks = {name: self.track(name) for name in file.names if name not in without}
        known = {name: track for name, track in tracks.items() if track is not None}
        if not known:
            return None
        known |= {f"{name}{GHOST}{k}": track for name in known for k, track in enumerate(self.ghosts(name), start=2)}
        boats = [name.partition(GHOST)[0] for name in known]
        longest, growth = file.limits.contact.lost_after_s, file.shield_config.track_error_mps
        ahead = [min(track.ahead_s, longest) for track in known.values()]
        errors = [t.error_m + growth * (min(t.age_s, longest) - a) for t, a in zip(known.values(), ahead, strict=True)]
        fleet = Fleet(
            state=np.array([track.row for track in known.values()]),
            team=np.array([file.team_of[boat] for boat in boats], dtype=np.int64),
            platforms=tuple(file.kind_of[boat] for boat in boats),
            controlled=np.array([name in controlled for name in known], dtype=np.bool_),
            names=tuple(known),
            age_s=np.array(ahead),
            position_error_m=np.array(errors),
        )
        fleet.check()
        return fleet

    def _own_track(self, name: str) -> Track | None:
        estimator = self._estimators.get(name)
        estimate = None if estimator is None else estimator.estimate(self._now_s)
        if estimator is None or estimate is None:
            return None
        declared_m = max(self.fleet.shield_config.position_error_m, self.margin_m.get(name, 0.0))
        error = max(declared_m, self._fed_m.get(name, 0.0)) + estimator.unseen_m
        stale = estimate.age_s > self.fleet.limits.navigation.max_age_s
        return Track(estimate.row, 0.0, estimate.age_s, error + estimate.spread_m * stale)

    def _track_of(self, contact: Contact) -> Track:
        row = fresh_state(*contact.position_m, math.degrees(contact.heading_rad), contact.speed_mps)
        row[L.HEADING] = (row[L.HEADING] + 180.0) % 360.0 - 180.0
        row[L.THRUST] = math.nan
        age = max(0.0, self._now_s - contact.fixed_s)
        return Track(row, age, age, max(contact.error_m, self.fleet.shield_config.position_error_m))

    def _take_reading(self, name: str, reading: BoatReading, estimator: Estimator) -> None:
        fixed_s = reading.read_s - reading.position_age_s
        fix = Contact(name, reading.position_m, reading.heading_rad, reading.speed_mps, fixed_s, 0.0, "")
        still = estimator.stands_still(reading)
        text = self._own_gates[name].refuse(fix, self._agreed(name))
        if still:
            text = "says the same to the last digit, and must have moved by its commands: its source is frozen"
            self._telemetry_s[name] = min(self._telemetry_s.get(name, -NEVER_S), estimator.still_since_s)
        if text:
            self._note(name, text)
            return
        estimator.correct(reading)
        self._telemetry_s[name] = reading.read_s - reading.age_s
        self._fed_m.pop(name, None)

    def _agreed(self, name: str) -> Contact | None:
        """Return a recent contact of an own boat, if all its sources agree."""
        view = self._views.get(name)
        if view is None or view.text or self._now_s - view.contact.fixed_s > self.fleet.limits.contact.max_age_s:
            return None
        return view.contact

    def _note(self, name: str, text: str) -> None:
        self.faults[name] = text
        self._log(name, _NUMBER.sub("", text), f"fix refused: {text}")

    def _log(self, name: str, what: str, text: str) -> None:
        if len(self._logged_s) > MOST_LOGGED:
            self._logged_s.clear()
        if self._now_s - self._logged_s.get((name, what), -math.inf) >= TALK_EVERY_S:
            self._logged_s[name, what] = self._now_s
            LOG.warning("%s: %s", name, text)


def _reading_of(contact: Contact, now_s: float) -> BoatReading:
    age, speed = now_s - contact.fixed_s, contact.speed_mps
    return BoatReading(
        contact.boat, now_s, contact.position_m, age, contact.heading_rad, age, speed, velocity_age_s=age
    )
