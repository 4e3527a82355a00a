"""Check of every turn against the limits in `failsafe_table`, and the nominal commands of the responses due."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import numpy as np

from ..decision import Decisions
from ..jit import Array
from ..platforms import Platform
from ..platforms import layout as L
from .failsafe_table import CONDITIONS, setting
from .fleet_file import FleetFile
from .fleet_settings import Geofence
from .frame import TWO_PI
from .messages import FAILSAFE, NEVER_S, Action, Alarm, Answer, BoatReading
from .operator import Override
from .tracker import Track, Tracker

STRENGTH = {"none": 0, "go_on": 0, "hold_course": 1, "slow": 2, "hold_station": 3, "return": 4, "stop": 5}
"""Of several responses due at once, the strongest applies."""

RIVAL_S = 2.0  # a second commander counts as present for this long after its last command, s
WHOLE_S = 99.0  # ages from this on are shown in whole seconds
SPEED_SHARE, SPEED_MORE_MPS, MOST_TURNS_RAD = 1.5, 0.5, 100.0
"""Commands are unusable beyond this share of the platform's top speed plus this, or beyond this heading."""

STATION_M, STATION_SHARE = 3.0, 0.5
"""A boat farther than this from its station, m, steers back at this share of its top speed."""
INSIDE_M = 3.0  # distance inside the geofence that boats return to, m
REST_MPS = 0.2  # slower boats count as at rest, m/s


@dataclass(frozen=True)
class Seen:
    """Inputs of the check of one turn, besides the tracker's."""

    now_s: float
    readings: Mapping[str, BoatReading]  # of own boats
    answer: Answer  # of the policy
    game_age_s: float = NEVER_S  # age of the state of the game, s; inf: none yet
    game_expected: bool = False  # whether a referee is expected
    game_over: bool = False
    log_fault: str = ""  # why ticks cannot be recorded; empty if they are
    overrides: tuple[Override, ...] = ()  # in force
    alarms: tuple[Alarm, ...] = ()  # faults of the sources of positions
    outside_model_s: Mapping[str, float] = field(default_factory=dict)  # see `ModelErrorMonitor.outside_s`
    decided: Decisions | None = None  # the last decisions; None if there were none


@dataclass
class Verdict:
    """Outcome of the check of one turn."""

    actions: list[Action] = field(default_factory=list)  # everything that took effect
    responses: dict[str, str] = field(default_factory=dict)  # strongest response by own boat; only where one is due
    # own boats that their links stop, bypassing the shield: in unknown state, or handed over beyond the hard line
    unknown: set[str] = field(default_factory=set)
    idle: set[str] = field(default_factory=set)  # own boats that do not obey (mode, disarmed): nothing is sent to them
    dropped: set[str] = field(default_factory=set)  # lost contacts that the operator's override leaves out
    retake: set[str] = field(default_factory=set)  # boats to take back: the fail-safe that took them is over


class Failsafe:
    """Check of each turn against the table; remembers since when faults last.

    Attributes:
        handed_over: boats stopped beyond the hard line, until a pilot or the operator takes them.
    """

    def __init__(self, fleet: FleetFile, tracker: Tracker) -> None:
        self.handed_over: set[str] = set()
        self._fleet, self._tracker, self._boats = fleet, tracker, tracker.commanded
        self._seen, self._verdict = Seen(-math.inf, {}, Answer()), Verdict()
        self._after_s: dict[str, float] = {}
        self._responses: dict[str, str] = {}
        for name, row in CONDITIONS.items():
            key = row.response.partition("`")[2].partition("`")[0] if row.response.startswith("`") else ""
            response = setting(key, fleet.limits, fleet.end) if key else row.response
            self._responses[name] = response if response in STRENGTH else "stop"  # other texts mean a link's own stop
            if row.within.startswith("`"):
                self._after_s[name] = setting(row.within.strip("`"), fleet.limits, fleet.end)
        self._good_s: dict[str, float] = {}
        self._rivals_s: dict[str, float] = {}
        self._outside_s: dict[str, float] = {}

    def judge(self, seen: Seen) -> Verdict:
        """Compare every input with its limit."""
        self._seen, self._verdict = seen, Verdict()
        usable, fault = self._usable_commands(seen.answer)
        for boat in self._boats:
            self._judge_own(boat, seen.readings[boat])
            self._judge_policy(boat, boat in usable, fault)
        for boat in self._fleet.names:
            if boat not in self._boats:
                self._judge_contact(boat)
        for alarm in seen.alarms:
            self._judge_alarm(alarm)
        if seen.game_over:
            self._due("game.over", "game", "the game is over")
        elif (seen.game_expected or math.isfinite(seen.game_age_s)) and seen.game_age_s > self._after_s["game.old"]:
            self._due("game.old", "game", f"state of the game: {words(seen.game_age_s)}")
        if seen.log_fault:
            self._due("log", "log", f"black box: {seen.log_fault}")
        return self._verdict

    def _overridden(self, condition: str, subject: str) -> bool:
        return any(entry.covers(condition, subject) for entry in self._seen.overrides)

    def _due(
        self, name: str, subject: str, text: str, boats: Collection[str] | None = None, response: str | None = None
    ) -> None:
        """Add a row of the table that took effect, unless it is overridden.

        ``response`` replaces the table's and cannot be overridden. ``boats`` None: all boats of this process.
        """
        condition = name.partition(".")[0]
        if response is None:
            if self._overridden(condition, subject):
                return
            response = self._responses[name]
        self._verdict.actions.append(Action(subject, condition, response, text))
        for boat in self._boats if boats is None else boats:
            before = self._verdict.responses.get(boat, "go_on")
            if STRENGTH[response] > STRENGTH[before]:
                self._verdict.responses[boat] = response

    def _judge_own(self, boat: str, reading: BoatReading) -> None:
        tracker, limits, after = self._tracker, self._fleet.limits, self._after_s
        if reading.released:  # stays released, even without telemetry
            self.handed_over.discard(boat)
            self._leave(boat, reading)
            return
        age, known, silent = tracker.navigation_age_s(boat), tracker.known_age_s(boat), reading.silent_s
        why = f" ({tracker.faults[boat]})" if boat in tracker.faults else ""
        if max(known, silent) > after["navigation.lost"]:
            self._verdict.unknown.add(boat)
            what = "position unknown" if known > limits.navigation.lost_after_s else "no longer reached"
            self._due("navigation.lost", boat, f"{boat}: {what}, {words(age)}{why}; told to stop", (boat,))
        elif age > after["navigation.old"]:
            feed = ", known from the feed" if known < age else ""
            self._due("navigation.old", boat, f"{boat}: own navigation {words(age)}{why}{feed}", (boat,))
        if silent > after["link"]:
            self._due("link", boat, f"{boat}: link silent, {words(silent)}", (boat,))
        elif not reading.ready:
            self._leave(boat, reading)
        if reading.faults.get("second_commander"):
            self._rivals_s[boat] = self._seen.now_s
        if self._seen.now_s - self._rivals_s.get(boat, -math.inf) <= RIVAL_S:
            who = f" ({reading.commander.replace('(', '').replace(')', '')})" if reading.commander else ""
            self._due("commander", boat, f"{boat}: somebody else commands it too{who}; end that program", (boat,))
        off_s = self._seen.outside_model_s.get(boat, 0.0)
        if off_s >= after["model.off"]:
            text = f"{boat} is more than {limits.model.outside_m:g} m from where its platform says, for {off_s:.0f} s"
            given_up = off_s >= after["model.given_up"]
            text += ": handed over, take it by hand, and fit its platform anew" if given_up else ""
            self._due("model.given_up" if given_up else "model.off", boat, text, (boat,))
        self._judge_place(boat)

    def _leave(self, boat: str, reading: BoatReading) -> None:
        """Send nothing to a boat that does not obey; offer or request taking it back once its own fail-safe is over."""
        self._verdict.idle.add(boat)
        text = f"{boat} does not obey: {reading.why_not or reading.mode}"
        if reading.released_by == FAILSAFE and reading.failsafe_over:
            retakes = self._fleet.limits.after_failsafe == "retake"
            text += "; it is taken back (after_failsafe)" if retakes else "; its fail-safe is over: t takes it back"
            if retakes and reading.age_s <= self._fleet.limits.navigation.max_age_s:
                self._verdict.retake.add(boat)
        elif reading.released_by == FAILSAFE:
            text += "; its own fail-safe holds it: t takes it back once that is over"
        elif reading.released:
            text += "; t takes it back, when its pilot agrees"
        self._due("mode.pilot", boat, text, (), response="none")

    def _judge_place(self, boat: str) -> None:
        """Report a boat outside the geofence: how far, for how long, and what keeps it from returning."""
        track, now_s, decided = self._tracker.track(boat), self._seen.now_s, self._seen.decided
        outside_m = 0.0 if track is None else self._fleet.geofence.outside_m(track.row[L.X], track.row[L.Y])
        if outside_m <= 0.0:
            self._outside_s.pop(boat, None)
        else:
            text = f"{boat} is {outside_m:.1f} m outside the geofence"
            text += f", for {now_s - self._outside_s.setdefault(boat, now_s):.0f} s"
            if decided is not None and boat in decided.fleet.names:
                last = decided[decided.fleet.names.index(boat)]
                if last.intervened and last.active_constraints:
                    text += f": it keeps clear of {', '.join(last.active_constraints)}"
            self._due("geofence", boat, text, (boat,))
        if boat in self.handed_over:
            self._verdict.unknown.add(boat)
            text = f"{boat} went beyond the hard line: stopped by its link, handed over; bring it in by hand, then take"
            self._due("hard_line", boat, f"{text} it back", (boat,))

    def _usable_commands(self, answer: Answer) -> tuple[set[str], str]:
        """Return the boats with a usable command of the policy, and the fault in words."""
        commands, names = answer.commands, self._fleet.names
        if commands is None or not answer.age_s >= 0.0:
            return set(), answer.fault
        if commands.relative:
            return set(), answer.fault or "its commands are relative to headings that have changed since"
        if len(commands) != len(names):
            return set(), answer.fault or f"it answers for {len(commands)} boats of {len(names)}"
        usable = set()
        for boat in self._boats:
            speed, heading = (float(value) for value in commands.values[names.index(boat)])
            fastest = SPEED_SHARE * self._fleet.platform_of[boat].max_speed_mps + SPEED_MORE_MPS
            if abs(heading) <= MOST_TURNS_RAD and abs(speed) <= fastest:  # written so that NaN is refused
                usable.add(boat)
                self._good_s[boat] = self._seen.now_s - answer.age_s
        unusable = sorted(set(self._boats) - usable)
        return usable, answer.fault or (f"no command for {', '.join(unusable)}" if unusable else "")

    def _judge_policy(self, boat: str, is_usable: bool, fault: str) -> None:
        age = self._seen.now_s - self._good_s.get(boat, -math.inf)
        if is_usable and age <= self._after_s["policy.old"]:
            return
        last = f"no usable command of the policy, last {words(age)}"
        text = f"{boat}: {last if math.isfinite(age) else 'no answer of the policy yet'}"
        name = "policy.given_up" if age > self._after_s["policy.given_up"] else "policy.old"
        response = "stop" if self._overridden("policy", boat) else None
        self._due(name, boat, f"{text} ({fault})" if fault else text, (boat,), response)

    def _judge_contact(self, boat: str) -> None:
        age = self._tracker.contact_age_s(boat)
        if age <= self._after_s["contact.old"]:
            return
        state = "lost" if age > self._after_s["contact.lost"] else "old"
        if state == "lost" and self._overridden("contact", boat):
            self._verdict.dropped.add(boat)
        why = f" ({self._tracker.faults[boat]})" if boat in self._tracker.faults else ""
        self._due(f"contact.{state}", boat, f"contact {boat} {state}: {words(age)}{why}")

    def _judge_alarm(self, alarm: Alarm) -> None:
        """Respond to contradicting sources; `contact.lost_then` applies if the boat's position is unknown.

        Alarms about own boats, which have telemetry, and overridden ones are only shown; a boat that the file does not
        have is in no doubt, but nobody keeps clear of it.
        """
        if alarm.unlisted:
            self._due("contact.unlisted", alarm.boat, alarm.text)
            return
        subject = alarm.boat or "feed"
        if alarm.boat in self._boats or self._overridden("contact", alarm.boat):
            self._due("contact.doubt", subject, f"{subject}: {alarm.text}", (), response="none")
            return
        what = ", so nobody knows where it is" if alarm.lost else ""
        response = self._fleet.limits.contact.lost_then if alarm.lost else None
        self._due("contact.doubt", subject, f"contact {subject} in doubt{what}: {alarm.text}", response=response)


class Responder:
    """Nominal commands of the responses of one boat; remembers the state in which a response began."""

    def __init__(self, platform: Platform, fence: Geofence) -> None:
        self._top_mps, self._box = platform.max_speed_mps, fence.box
        self._response = ""
        self._onset: Array | None = None

    def clear(self) -> None:
        """End the response."""
        self._onset = None

    def nominal(self, response: str, row: Array) -> tuple[float, float]:
        """Return the nominal speed, m/s, and absolute heading, rad, of a response other than "go_on"."""
        if self._onset is None or self._response != response:
            self._response, self._onset = response, row.copy()
        onset = self._onset
        heading, speed = math.radians(onset[L.HEADING]) % TWO_PI, max(0.0, float(onset[L.SPEED]))
        if response in ("hold_course", "slow"):
            return (speed if response == "hold_course" else 0.5 * speed), heading
        if response == "hold_station":
            return self._steer(row, float(onset[L.X]), float(onset[L.Y]), STATION_M, STATION_SHARE)
        if response == "return":
            x_m, y_m = (
                min(max(float(value), low + inset), high - inset)
                for value, low, high in zip(row[[L.X, L.Y]], self._box[:2], self._box[2:], strict=True)
                for inset in [min(INSIDE_M, 0.5 * (high - low))]
            )
            return self._steer(row, x_m, y_m, 0.5, 1.0)
        return _rest(row)

    def _steer(self, row: Array, x_m: float, y_m: float, near_m: float, share: float) -> tuple[float, float]:
        dx, dy = x_m - float(row[L.X]), y_m - float(row[L.Y])
        if math.hypot(dx, dy) <= near_m:
            return _rest(row)
        return share * self._top_mps, math.atan2(dx, dy) % TWO_PI


def _rest(row: Array) -> tuple[float, float]:
    """Return zero speed on the boat's present heading.

    The shield may have turned the boat away from an edge or another boat. A command back to the earlier heading would
    make it turn away again, which takes thrust, and the boat would never come to rest.
    """
    return 0.0, math.radians(float(row[L.HEADING])) % TWO_PI


def at_rest(readings: Mapping[str, BoatReading]) -> bool:
    """Whether every own boat that obeys is at rest."""
    return all(not reading.ready or abs(reading.speed_mps) < REST_MPS for reading in readings.values())


def nearing(fleet: FleetFile, tracker: Tracker, readings: Mapping[str, BoatReading]) -> list[str]:
    """Return a line for each boat that comes within the separation of an own boat within ``end.clear_s``.

    The shield does not protect a boat in HOLD. Both boats are extrapolated straight on, and the separation grows by
    their errors. Boats not heard of for ``contact.lost_after_s`` are left out. Own boats that do not obey, such as
    those a pilot steers, count as others too.
    """
    tracks = {name: tracker.track(name) for name in fleet.names}
    obeys = {name for name in tracker.commanded if name not in readings or readings[name].ready}
    texts = []
    for name in tracker.commanded:
        for other in fleet.names:
            if other == name or other in obeys:
                continue
            for track in (tracks[other], *tracker.ghosts(other)):
                found = _approach(fleet, tracks[name], track)
                if found is not None:
                    texts.append(f"{other} comes within {found[0]:.1f} m of {name} in {found[1]:.0f} s")
    return texts


def _approach(fleet: FleetFile, own: Track | None, other: Track | None) -> tuple[float, float] | None:
    """Return the least distance, m, and its time, s, if two tracks come too near within ``end.clear_s``."""
    if own is None or other is None or other.age_s > fleet.limits.contact.lost_after_s:
        return None
    apart, closing = other.position_m() - own.position_m(), other.velocity_mps - own.velocity_mps
    if float(np.hypot(*closing)) < REST_MPS:
        return None
    time_s = min(max(-float(apart @ closing) / float(closing @ closing), 0.0), fleet.end.clear_s)
    near_m = float(np.hypot(*(apart + time_s * closing)))
    return (near_m, time_s) if near_m <= fleet.shield_config.separation_m + own.error_m + other.error_m else None


def words(age_s: float) -> str:
    """Return an age in words."""
    if not math.isfinite(age_s):
        return "never heard"
    return f"{age_s:.1f} s old" if age_s < WHOLE_S else f"{age_s:.0f} s old"
