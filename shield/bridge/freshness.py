"""How old things are against the limits of the file, and what is declared for it."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from .contact import Alarm
from .fleet_file import FleetFile
from .link import BoatReading
from .operator import Override
from .responses import strongest
from .roster import Roster
from .tick import Action

RIVAL_S = 2.0
"""A second commander counts as there for this long after its last command was noticed, s."""

WHOLE_S = 99.0
"""Ages beyond this are shown as "never" or in whole seconds."""


@dataclass(frozen=True)
class Seen:
    """What the limits are held against at one tick.

    Attributes:
        readings: of own boats.
        usable: own boats for which the policy's answer can be used now.
        policy_age_s: age of the last usable answer of each own boat, s; inf: none yet.
        rivals: own boats that somebody else commands too.
        policy_fault: what the policy's process says is wrong; empty: nothing.
        game_age_s: age of the state of the game, s; inf: none yet.
        game_expected: whether there is to be a game at all.
        game_over: whether the game has ended.
        log_fault: why ticks can no longer be recorded; empty: they are.
        overrides: in force.
        alarms: what is wrong with those who tell where boats are.
        outside_s: how long each own boat has been far outside its model, s.
    """

    readings: Mapping[str, BoatReading]
    usable: Collection[str]
    policy_age_s: Mapping[str, float]
    rivals: Collection[str] = ()
    policy_fault: str = ""
    game_age_s: float = math.inf
    game_expected: bool = False
    game_over: bool = False
    log_fault: str = ""
    overrides: tuple[Override, ...] = ()
    alarms: tuple[Alarm, ...] = ()
    outside_s: Mapping[str, float] = field(default_factory=dict)

    def overridden(self, condition: str, subject: str) -> bool:
        """Whether the operator switched this response off."""
        return any(entry.covers(condition, subject) for entry in self.overrides)


@dataclass
class Verdict:
    """What is due now.

    Attributes:
        actions: everything that took effect.
        responses: strongest response due for each own boat; boats that have none are not in it.
        unknown: own boats whose state is not known: told to stop by their links.
        idle: own boats that do not obey us now (another mode, disarmed): nothing is sent to them.
        dropped: contacts the operator had left out.
    """

    actions: list[Action] = field(default_factory=list)
    responses: dict[str, str] = field(default_factory=dict)
    unknown: set[str] = field(default_factory=set)
    idle: set[str] = field(default_factory=set)
    dropped: set[str] = field(default_factory=set)

    def due(self, action: Action, boats: Collection[str]) -> None:
        """Note an action whose response concerns some boats."""
        self.actions.append(action)
        for boat in boats:
            self.responses[boat] = strongest([action.response, self.responses.get(boat, "go_on")])


def judge(fleet: FleetFile, roster: Roster, seen: Seen) -> Verdict:
    """Hold everything against its limit.

    Args:
        fleet: the file with the limits.
        roster: ages of navigation and contacts.
        seen: the rest.
    """
    verdict = Verdict()
    for boat in roster.commanded:
        _judge_own(fleet, roster, seen, boat, verdict)
        _judge_policy(fleet, seen, boat, verdict)
    for boat in fleet.names:
        if boat not in roster.commanded:
            _judge_contact(fleet, roster, seen, boat, verdict)
    for alarm in seen.alarms:
        _judge_alarm(fleet, roster, seen, alarm, verdict)
    _judge_game(fleet, roster, seen, verdict)
    log = fleet.limits.log.then
    if seen.log_fault and not seen.overridden("log", ""):
        verdict.due(Action("log", "log", log, f"black box: {seen.log_fault}"), roster.commanded)
    return verdict


def _judge_own(fleet: FleetFile, roster: Roster, seen: Seen, boat: str, verdict: Verdict) -> None:
    limits, reading = fleet.limits, seen.readings[boat]
    if reading.released:  # it stays his who took it, heard or not
        verdict.idle.add(boat)
        verdict.actions.append(Action(boat, "mode", "none", f"{boat} does not obey: {reading.why_not or reading.mode}"))
        return
    age, known = roster.navigation_age_s(boat), roster.known_age_s(boat)
    silent = link_age_s(reading)
    why = f" ({roster.faults[boat]})" if boat in roster.faults else ""
    if known > limits.navigation.lost_after_s or silent > limits.navigation.lost_after_s:
        verdict.unknown.add(boat)
        what = "position unknown" if known > limits.navigation.lost_after_s else "no longer reached"
        text = f"{boat}: {what}, {words(age)}{why}; told to stop"
        verdict.due(Action(boat, "navigation", "stop", text), (boat,))
    elif age > limits.navigation.max_age_s:
        feed = ", known from the feed" if known < age else ""
        text = f"{boat}: own navigation {words(age)}{why}{feed}"
        verdict.due(Action(boat, "navigation", limits.navigation.then, text), (boat,))
    if silent > limits.link.max_age_s:
        text = f"{boat}: link silent, {words(silent)}"
        verdict.due(Action(boat, "link", limits.link.then, text), (boat,))
    elif not reading.ready:
        verdict.idle.add(boat)
        verdict.actions.append(Action(boat, "mode", "none", f"{boat} does not obey: {reading.why_not or reading.mode}"))
    if boat in seen.rivals and not seen.overridden("commander", boat):
        text = f"{boat}: somebody else commands it too, or its steering fails"
        verdict.due(Action(boat, "commander", limits.link.then, text), (boat,))
    _judge_model(fleet, seen, boat, verdict)
    track = roster.track(boat)
    outside = track is not None and not fleet.geofence.holds(float(track.row[0]), float(track.row[1]))
    if outside and not seen.overridden("geofence", boat):
        verdict.due(Action(boat, "geofence", limits.geofence.then, f"{boat} is outside the geofence"), (boat,))


def _judge_model(fleet: FleetFile, seen: Seen, boat: str, verdict: Verdict) -> None:
    limit, lasts_s = fleet.limits.model, seen.outside_s.get(boat, 0.0)
    if lasts_s < limit.after_s or seen.overridden("model", boat):
        return
    text = f"{boat} is more than {limit.outside_m:g} m from where its platform says, for {lasts_s:.0f} s"
    if lasts_s < limit.give_up_after_s:
        verdict.due(Action(boat, "model", limit.then, text), (boat,))
        return
    text += ": handed over, take it by hand, and fit its platform anew"
    verdict.due(Action(boat, "model", limit.give_up_then, text), (boat,))


def _judge_policy(fleet: FleetFile, seen: Seen, boat: str, verdict: Verdict) -> None:
    limit, age = fleet.limits.policy, seen.policy_age_s.get(boat, math.inf)
    if boat in seen.usable and age <= limit.max_age_s:
        return
    response = limit.give_up_then if age > limit.give_up_after_s else limit.then
    if seen.overridden("policy", boat):
        response = "stop"
    fault = f" ({seen.policy_fault})" if seen.policy_fault else ""
    if math.isfinite(age):
        text = f"{boat}: no usable command of the policy, last {words(age)}{fault}"
    else:
        text = f"{boat}: no answer of the policy yet{fault}"
    verdict.due(Action(boat, "policy", response, text), (boat,))


def _judge_contact(fleet: FleetFile, roster: Roster, seen: Seen, boat: str, verdict: Verdict) -> None:
    limit, age = fleet.limits.contact, roster.contact_age_s(boat)
    if age <= limit.max_age_s:
        return
    if seen.overridden("contact", boat):
        if age > limit.lost_after_s:
            verdict.dropped.add(boat)
        return
    lost = age > limit.lost_after_s
    why = f" ({roster.faults[boat]})" if boat in roster.faults else ""
    text = f"contact {boat} {'lost' if lost else 'old'}: {words(age)}{why}"
    verdict.due(Action(boat, "contact", limit.lost_then if lost else limit.then, text), roster.commanded)


def _judge_alarm(fleet: FleetFile, roster: Roster, seen: Seen, alarm: Alarm, verdict: Verdict) -> None:
    """Sources that contradict each other: all stories are kept clear of, or boats stop where there are too many.

    Of an own boat its own link tells: there it is only said.
    """
    limit, subject = fleet.limits.contact, alarm.boat or "feed"
    if alarm.boat in roster.commanded or seen.overridden("contact", alarm.boat):
        verdict.actions.append(Action(subject, "contact", "none", f"{subject}: {alarm.text}"))
        return
    what = ", so nobody knows where it is" if alarm.lost else ""
    text = f"contact {subject} in doubt{what}: {alarm.text}"
    verdict.due(Action(subject, "contact", limit.lost_then if alarm.lost else limit.then, text), roster.commanded)


def _judge_game(fleet: FleetFile, roster: Roster, seen: Seen, verdict: Verdict) -> None:
    """A game that never spoke is missed only where one is expected."""
    if seen.game_over:
        verdict.due(Action("game", "game", "hold_station", "the game is over"), roster.commanded)
        return
    heard = seen.game_expected or math.isfinite(seen.game_age_s)
    silent = heard and seen.game_age_s > fleet.limits.game.max_age_s
    if silent and not seen.overridden("game", ""):
        text = f"state of the game: {words(seen.game_age_s)}"
        verdict.due(Action("game", "game", fleet.limits.game.then, text), roster.commanded)


def link_age_s(reading: BoatReading) -> float:
    """Time since anything came from the boat, s: heartbeats alone are too rare to tell."""
    ages = (reading.position_age_s, reading.heading_age_s, reading.velocity_age_s, reading.turn_rate_age_s)
    return min(reading.heartbeat_age_s, *ages)


def words(age_s: float) -> str:
    """An age as a person says it."""
    if not math.isfinite(age_s):
        return "never heard"
    return f"{age_s:.1f} s old" if age_s < WHOLE_S else f"{age_s:.0f} s old"
