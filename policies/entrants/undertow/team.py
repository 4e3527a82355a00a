"""The team: the point that each boat steers for, in the phases of a raid and between raids."""

from __future__ import annotations

import math
from dataclasses import dataclass

from steerclear.shield.exceptions import PolicyError

from ..catalogue import entrant
from ..observation import Boat, Observation, Point
from ..plane import STOP_MPS, Order, ahead, arc, assign, clip, distance, dock, go, heading_to, meeting_point
from ..play import EntrantTeam
from .raid import BAIT, DRAG, RUN, Chart, Phase, Raid

REACHED_M = 2.0
"""Distance at which a bend of a way counts as reached."""
COMING_M = 5.0
"""Distance before the dividing line from which opponents count as intruders."""


@dataclass(frozen=True)
class Aim:
    """The point that a boat steers for.

    Attributes:
        point: in the own-end frame, m.
        near_m: the boat slows down near the point and stops at this distance, m; None: full speed all the way.
    """

    point: Point
    near_m: float | None = None

    def order(self, boat: Boat) -> Order:
        """Return the order that steers a boat to the point."""
        if self.near_m is None:
            return boat.top, heading_to(boat.at, self.point)
        return go(boat, self.point, self.near_m)


def aim_of(raid: Raid, obs: Observation, chart: Chart, number: int) -> Aim:
    """Return an own boat's aim: home with the flag, its part in the raid, or else intruders and its post."""
    boat = obs.own[number]
    sails = number == RUN and raid.passage is not None
    if boat.carries:
        at = dock(boat, obs) if boat.on_side else None
        if at is not None:
            return Aim(at)
        return Aim(_next_of(raid, boat) if sails else chart.home(boat.at, up=number == RUN))
    if sails:
        return Aim(_next_of(raid, boat))
    if raid.unguarded:
        return _alone(raid, obs, chart, number)
    part = _part(raid, obs, chart, number) if raid.phase > Phase.GATHER else None
    return _guarding(obs, chart, number) if part is None else part


def _part(raid: Raid, obs: Observation, chart: Chart, number: int) -> Aim | None:
    """Return a boat's part in the raid; None if it has none at present."""
    at, phase = obs.own[number].at, raid.phase
    if number == BAIT:
        return None if raid.bait_taken else Aim(chart.bait, 0.5)
    if number == DRAG:
        return Aim(chart.posts[DRAG], 2.0) if phase < Phase.DRAG else Aim(chart.drag(at))
    if number != RUN or any(mate.carries for mate in obs.own):
        return None
    if phase == Phase.RUN:
        return Aim(chart.run(at))
    return None if obs.taken else Aim(chart.door if phase == Phase.DRAG else chart.posts[RUN], 2.0)


def _alone(raid: Raid, obs: Observation, chart: Chart, number: int) -> Aim:
    """Return a boat's aim while no opponent stays at home: the third waits and sails alone, the others guard."""
    boat = obs.own[number]
    if number != RUN or (obs.taken and boat.on_side):
        return _before_flag(raid, obs, chart)[number]
    if raid.watch.timed:
        return Aim(chart.wait(raid.place), 1.5)
    return Aim(chart.dash(boat)[0]) if raid.phase == Phase.RUN else Aim(chart.edge, 1.5)


def _before_flag(raid: Raid, obs: Observation, chart: Chart) -> dict[int, Aim]:
    """Return the guards' aims: the carrier of the flag; else stand between the flag and an intruder, or steer at it."""
    run, radius = obs.own[RUN], chart.shape.guard_m
    if obs.taken:
        foe = min(obs.foes, key=lambda one: distance(one.at, obs.flag))
        return {n: Aim(_inside(meeting_point(boat, foe), obs), 2.0) for n, boat in enumerate(obs.own)}
    guards = [n for n, boat in enumerate(obs.own) if n != RUN and not boat.tagged]
    comers = [foe.at for foe in obs.foes if not foe.tagged and foe.x < obs.line + COMING_M]
    comers = sorted(comers, key=lambda at: distance(at, obs.home))[: len(guards)]
    near_m = distance(run.at, obs.base) - obs.reach
    at_them = raid.phase == Phase.RUN and (run.carries or near_m < chart.shape.charge_m)
    places = [_inside(at, obs) if at_them else _towards(obs.home, at, radius) for at in comers]
    angles = [math.pi * (k + 1) / (len(guards) + 1) for k in range(len(comers), len(guards))]
    places += [ahead(obs.home, angle, radius) for angle in angles]
    chosen = assign([obs.own[n].at for n in guards], places)
    return {n: Aim(places[k], 2.0) for n, k in zip(guards, chosen, strict=True)}


def _next_of(raid: Raid, boat: Boat) -> Point:
    """Return the first bend of the raid's passage that the boat has not reached yet."""
    assert raid.passage is not None
    points = raid.passage.points
    return next((point for point in points if distance(boat.at, point) > REACHED_M), points[-1])


def _towards(a: Point, b: Point, far_m: float) -> Point:
    """Return the point ``far_m`` from a towards b, m; b itself if that is nearer."""
    return ahead(a, heading_to(a, b), min(far_m, distance(a, b)))


def _inside(point: Point, obs: Observation) -> Point:
    """Return the nearest point well on the own side."""
    return clip(point[0], 3.0, obs.line - 1.5), clip(point[1], 3.0, obs.size[1] - 3.0)


def _guarding(obs: Observation, chart: Chart, number: int) -> Aim:
    """Return the nearest intruder if no teammate is nearer to it; otherwise the post."""
    boat = obs.own[number]
    intruders = [foe for foe in obs.foes if not foe.on_side and not foe.tagged]
    foe = min(intruders, key=lambda one: distance(one.at, boat.at), default=None)
    met = obs.taken or (foe is not None and distance(boat.at, foe.at) < chart.shape.chase_m)
    if foe is not None and boat.recharged and boat.on_side and met:
        nearest = min((mate for mate in obs.own if not mate.tagged), key=lambda mate: distance(mate.at, foe.at))
        if nearest is boat:
            return Aim((min(foe.x, obs.line - 2.0), foe.y), 2.0)
    return Aim(chart.posts[number] if number <= RUN else arc(obs)[number], 2.0)


@entrant(
    "undertow", "two boats draw the guard to the far corner, the third brings the flag home: for play with a shield"
)
class Undertow(EntrantTeam):
    """Raids in three parts, and tags between them."""

    name = "undertow"

    def begin(self, obs: Observation) -> None:
        """Begin a game without a raid."""
        if len(obs.own) < 3:
            raise PolicyError(f"entrant {self.name!r} needs three boats, the team has {len(obs.own)}; give it three")
        self._raid = Raid(obs)

    def decide(self, obs: Observation) -> list[Order]:
        """Return each boat's order in the raid."""
        chart = self._raid.advance(obs)
        return [
            (STOP_MPS, boat.heading) if boat.tagged else aim_of(self._raid, obs, chart, number).order(boat)
            for number, boat in enumerate(obs.own)
        ]
