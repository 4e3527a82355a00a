"""`Tracker`: where every boat of the file is now: own boats by telemetry and model, others by contacts."""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from ..fleet import Fleet
from ..jit import Array
from ..platforms import fresh_state
from ..platforms import layout as L
from .contact_fusion import ContactFusion, Gate, View
from .estimator import Estimator
from .fleet_file import FleetFile
from .messages import NEVER_S, Alarm, BoatReading, Contact, Sent

LOG = logging.getLogger(__name__)

TALK_EVERY_S, MOST_TOLD = 5.0, 256
"""The same fault of a boat is logged again after so long, and so many are remembered: names on a feed are anybody's."""

GHOST = "~"
"""Names of ghosts are the boat's name, this and a number; no boat of a fleet file has it in its name."""


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

    @property
    def velocity_mps(self) -> Array:
        """Over ground along x and y, m/s."""
        heading = np.radians(self.row[L.HEADING])
        return np.asarray(self.row[L.SPEED] * np.array([np.sin(heading), np.cos(heading)]))

    def position_m(self, longest_s: float = math.inf) -> Array:
        """Position now, run straight on for at most so long, m."""
        return np.asarray(self.row[: L.Y + 1] + min(self.ahead_s, longest_s) * self.velocity_mps)


class Tracker:
    """Keeps the tracks of all boats of a file.

    Args:
        fleet: the file.
        commanded: names of the boats this process commands.

    Attributes:
        faults: why the latest fix of a boat was refused, by name.
        margin_m: margins of own boats for what their models miss, m, see `model_error`.
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
        """Take what came in, and run own boats on to now."""
        self._now_s, self.faults = now_s, {}
        for name, estimator in self._estimators.items():
            estimator.advance(now_s)
            if name in readings and math.isfinite(readings[name].age_s):  # else something was never received: no fix
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
            seen = self._agreed(name)  # the feed says where an own boat is when its own telemetry does not
            if seen is not None and self.navigation_age_s(name) > self.fleet.limits.navigation.max_age_s:
                estimator.correct(_reading_of(seen, now_s))
                self._fed_m[name] = seen.error_m

    def sent(self, tick_s: float, sent: Mapping[str, Sent]) -> None:
        """Note what left at the tick of that time."""
        for name, message in sent.items():
            if message.delivered and math.isfinite(message.speed_mps):
                self._estimators[name].sent(tick_s, message.heading_rad, message.speed_mps)

    def track(self, name: str) -> Track | None:
        """The boat now; None: never seen."""
        own = self._own_track(name)
        if own is None or own.age_s > self.fleet.limits.navigation.lost_after_s:
            view = self._views.get(name)
            seen = None if view is None else self._track_of(view.contact)
            if own is None or (seen is not None and seen.age_s < own.age_s):
                return seen
        return own

    def ghosts(self, name: str) -> tuple[Track, ...]:
        """Where else a boat may be, by those who contradict the source of its track; none while its own link tells."""
        own, view = self._own_track(name), self._views.get(name)
        if view is None or (own is not None and own.age_s <= self.fleet.limits.navigation.lost_after_s):
            return ()
        return tuple(self._track_of(contact) for contact in view.rivals)

    def own_rows(self) -> dict[str, Array | None]:
        """State of each own boat as its model and telemetry have it; None: not known, or its telemetry is old."""
        found: dict[str, Array | None] = {}
        for name, estimator in self._estimators.items():
            estimate = estimator.estimate(self._now_s)
            old = self.navigation_age_s(name) > self.fleet.limits.navigation.max_age_s
            found[name] = None if estimate is None or old or name in self.faults else estimate.row
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
        view = self._views.get(name)
        return NEVER_S if view is None else max(0.0, self._now_s - view.contact.fixed_s)

    def contradicted(self, name: str) -> str:
        """Who contradicts whom about where a boat is, in words; empty: nobody."""
        view = self._views.get(name)
        return "" if view is None else view.text

    def alarms(self) -> tuple[Alarm, ...]:
        """Boats whose sources contradict each other."""
        views = ((name, self._views.get(name)) for name in self.fleet.names)
        return tuple(Alarm(view.text, name, view.crowded) for name, view in views if view is not None and view.text)

    def seen_now(self) -> Array:
        """(n, 4) of all boats of the file: x m, y m, heading deg, speed m/s, run on to now; NaN where never seen."""
        seen = np.full((len(self.fleet.names), 4), np.nan)
        for i, name in enumerate(self.fleet.names):
            track = self.track(name)
            if track is not None:
                seen[i] = *track.position_m(self.fleet.limits.contact.lost_after_s), *track.row[[L.HEADING, L.SPEED]]
        return seen

    def assemble(self, controlled: Collection[str], without: Collection[str] = ()) -> Fleet | None:
        """The fleet the shield is given: every boat ever seen, with ages and errors; None when none is known.

        The order is the file's, so that the shield's memory survives what comes and goes. A track is run on by its age
        up to ``contact.lost_after_s`` and its error grows until then; a ghost that grew for ever would in the end drive
        our boats off the water.

        Args:
            controlled: boats to decide for.
            without: boats to leave out.

        Raises:
            FleetError: what is known makes no fleet.
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
        """Where others lately saw an own boat, if all who tell of it agree."""
        view = self._views.get(name)
        if view is None or view.text or self._now_s - view.contact.fixed_s > self.fleet.limits.contact.max_age_s:
            return None
        return view.contact

    def _note(self, name: str, text: str) -> None:
        self.faults[name] = text
        self._log(name, text.split()[0], f"fix refused: {text}")

    def _log(self, name: str, what: str, text: str) -> None:
        if len(self._logged_s) > MOST_TOLD:
            self._logged_s.clear()
        if self._now_s - self._logged_s.get((name, what), -math.inf) >= TALK_EVERY_S:
            self._logged_s[name, what] = self._now_s
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
