"""What is known of every boat of the file now: own boats from telemetry and model, others from contacts."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..jit import Array
from ..platforms import fresh_state
from ..platforms import layout as L
from .contact import Alarm, Contact
from .estimator import Estimator
from .fleet_file import FleetFile
from .link import NEVER_S, BoatReading, Sent
from .plausible import Fix, Gate
from .sightings import Sightings, View

LOG = logging.getLogger(__name__)

TALK_EVERY_S = 5.0
"""The same fault of the same boat is logged again after this long."""

MOST_TOLD = 256
"""Faults remembered for that, at most: names on the feed are anybody's."""


@dataclass(frozen=True)
class Track:
    """One boat now.

    Attributes:
        row: (N_STATE,) state; NaN memory where unknown.
        ahead_s: time since the row was true, s: 0 for own boats, whose model is run on to now.
        age_s: time since the oldest measurement it rests on, s.
        error_m: bound on its position, without what age adds, m.
    """

    row: Array
    ahead_s: float
    age_s: float
    error_m: float


class Roster:
    """Keeps the tracks of all boats of a file.

    Args:
        fleet: the file.
        commanded: names of the boats this process commands.
    """

    def __init__(self, fleet: FleetFile, commanded: Iterable[str]) -> None:
        config = fleet.shield_config
        self.fleet = fleet
        self.commanded = tuple(commanded)
        self._estimators = {
            name: Estimator(fleet.platform_of[name], config.dt_s, config.delay_s) for name in self.commanded
        }
        self._own_gates = {name: Gate(fleet.platform_of[name].max_speed_mps) for name in self.commanded}
        self._sightings = {
            name: Sightings(fleet.platform_of[name].max_speed_mps, fleet.limits.contact) for name in fleet.names
        }
        self._views: dict[str, View] = {}
        self._telemetry_s: dict[str, float] = {}
        self._fed_m: dict[str, float] = {}
        self._faults: dict[str, str] = {}
        self._told_s: dict[tuple[str, str], float] = {}
        self._now_s = -math.inf
        self.margin_m: Mapping[str, float] = {}
        """Margins of own boats for what their models miss, m, see `foresight`."""

    @property
    def faults(self) -> Mapping[str, str]:
        """Why the latest fix of a boat was refused, by name."""
        return self._faults

    def update(self, now_s: float, readings: Mapping[str, BoatReading], contacts: Iterable[Contact]) -> None:
        """Take what came in, and run own boats on to now."""
        self._now_s = now_s
        self._faults = {}
        for name, estimator in self._estimators.items():
            estimator.advance(now_s)
            if name in readings:
                self._take_reading(name, readings[name], estimator)
        for contact in contacts:
            self._take_contact(contact)
        self._look()
        for name, estimator in self._estimators.items():
            if self.navigation_age_s(name) > self.fleet.limits.navigation.max_age_s:
                self._take_feed(name, estimator)

    def sent(self, tick_s: float, sent: Mapping[str, Sent]) -> None:
        """Note what left at the tick of that time."""
        for name, message in sent.items():
            if message.delivered and math.isfinite(message.speed_mps):
                self._estimators[name].sent(tick_s, message.heading_rad, message.speed_mps)

    def track(self, name: str) -> Track | None:
        """The boat now; None: never seen."""
        own = self._own_track(name)
        if own is None or own.age_s > self.fleet.limits.navigation.lost_after_s:
            seen = self._contact_track(name)
            if own is None or (seen is not None and seen.age_s < own.age_s):
                return seen
        return own

    def own_rows(self) -> dict[str, Array | None]:
        """State of each own boat as its model and telemetry have it; None: not known, or its telemetry is old."""
        found: dict[str, Array | None] = {}
        for name, estimator in self._estimators.items():
            estimate = estimator.estimate(self._now_s)
            old = self.navigation_age_s(name) > self.fleet.limits.navigation.max_age_s
            found[name] = None if estimate is None or old or name in self._faults else estimate.row
        return found

    def navigation_age_s(self, name: str) -> float:
        """Age of an own boat's telemetry, s; inf: nothing yet."""
        return self._now_s - self._telemetry_s.get(name, -NEVER_S)

    def known_age_s(self, name: str) -> float:
        """Age of what is known of an own boat, by its telemetry or by the feed in its place, s; inf: nothing yet."""
        own = self._own_track(name)
        return NEVER_S if own is None else own.age_s

    def contact_age_s(self, name: str) -> float:
        """Age of what is known of another boat, s; inf: nothing yet."""
        seen = self._contact_track(name)
        return NEVER_S if seen is None else seen.age_s

    def contradicted(self, name: str) -> str:
        """Who contradicts whom about where a boat is, in words; empty: nobody."""
        view = self._views.get(name)
        return "" if view is None else view.text

    def alarms(self) -> tuple[Alarm, ...]:
        """Boats whose sources contradict each other."""
        views = ((name, self._views.get(name)) for name in self.fleet.names)
        return tuple(Alarm(view.text, name, view.crowded) for name, view in views if view is not None and view.text)

    def ghosts(self, name: str) -> tuple[Track, ...]:
        """Where else a boat may be, by those who contradict the source of its track; none while its own link tells."""
        own, view = self._own_track(name), self._views.get(name)
        if view is None or (own is not None and own.age_s <= self.fleet.limits.navigation.lost_after_s):
            return ()
        return tuple(self._track_of(contact) for contact in view.rivals)

    def _own_track(self, name: str) -> Track | None:
        estimator = self._estimators.get(name)
        estimate = None if estimator is None else estimator.estimate(self._now_s)
        if estimate is None:
            return None
        declared_m = max(self.fleet.shield_config.position_error_m, self.margin_m.get(name, 0.0))
        error = max(declared_m, self._fed_m.get(name, 0.0))
        stale = estimate.age_s > self.fleet.limits.navigation.max_age_s
        return Track(estimate.row, 0.0, estimate.age_s, error + estimate.spread_m * stale)

    def _contact_track(self, name: str) -> Track | None:
        view = self._views.get(name)
        return None if view is None else self._track_of(view.contact)

    def _track_of(self, contact: Contact) -> Track:
        row = fresh_state(*contact.position_m, math.degrees(contact.heading_rad), contact.speed_mps)
        row[L.HEADING] = (row[L.HEADING] + 180.0) % 360.0 - 180.0
        row[L.THRUST] = math.nan
        age = max(0.0, self._now_s - contact.fixed_s)
        return Track(row, age, age, max(contact.error_m, self.fleet.shield_config.position_error_m))

    def _take_reading(self, name: str, reading: BoatReading, estimator: Estimator) -> None:
        if not math.isfinite(reading.age_s):
            return  # something was never received: no fix
        fix = Fix(*reading.position_m, reading.heading_rad, reading.speed_mps, reading.read_s - reading.position_age_s)
        text = self._own_gates[name].refuse(fix, self._witness(name))
        if text:
            self._note(name, text)
        else:
            estimator.correct(reading)
            self._telemetry_s[name] = reading.read_s - reading.age_s
            self._fed_m.pop(name, None)

    def _witness(self, name: str) -> Fix | None:
        """Where the feed lately saw an own boat, if all who tell of it agree."""
        seen = self._agreed(name)
        if seen is None or self._now_s - seen.fixed_s > self.fleet.limits.contact.max_age_s:
            return None
        return Fix(*seen.position_m, seen.heading_rad, seen.speed_mps, seen.fixed_s, seen.error_m)

    def _take_feed(self, name: str, estimator: Estimator) -> None:
        """Let the feed say where an own boat is when its own telemetry does not: what is left is used."""
        contact = self._agreed(name)
        if contact is None or self._now_s - contact.fixed_s > self.fleet.limits.contact.max_age_s:
            return
        estimator.correct(_reading_of(contact, self._now_s))
        self._fed_m[name] = contact.error_m

    def _take_contact(self, contact: Contact) -> None:
        name = contact.boat
        if name not in self._sightings:
            self._note(name, "is not in the fleet file: add it, so that boats keep clear of it")
            return
        text = self._sightings[name].take(contact, self._now_s)
        if text:
            self._note(name, text)

    def _look(self) -> None:
        """What must be believed of every boat now, whoever told of it."""
        for name, sightings in self._sightings.items():
            view = sightings.view(self._now_s)
            if view is not None:
                self._views[name] = view
                if view.text:
                    self._tell(name, "contradicted", f"contradicted: {view.text}")

    def _agreed(self, name: str) -> Contact | None:
        view = self._views.get(name)
        return None if view is None or view.text else view.contact

    def _note(self, name: str, text: str) -> None:
        self._faults[name] = text
        self._tell(name, text.split()[0], f"fix refused: {text}")

    def _tell(self, name: str, what: str, text: str) -> None:
        kind = (name, what)
        if len(self._told_s) > MOST_TOLD:
            self._told_s.clear()
        if self._now_s - self._told_s.get(kind, -math.inf) >= TALK_EVERY_S:
            self._told_s[kind] = self._now_s
            LOG.warning("%s: %s", name, text)


def _reading_of(contact: Contact, now_s: float) -> BoatReading:
    age = now_s - contact.fixed_s
    return BoatReading(
        contact.boat,
        now_s,
        position_m=contact.position_m,
        position_age_s=age,
        heading_rad=contact.heading_rad,
        heading_age_s=age,
        speed_mps=contact.speed_mps,
        velocity_age_s=age,
    )
