"""What each boat of a raid steers for, phase by phase, and between raids."""

from __future__ import annotations

from dataclasses import dataclass

from ..plane import Order, distance, dock, go, heading_to
from ..posts import arc
from ..sight import Boat, Point, Sight
from .chart import Chart
from .raid import BAIT, DRAG, RUN, Phase, Raid


@dataclass(frozen=True)
class Aim:
    """What a boat steers for.

    Attributes:
        point: in the own-end frame, m.
        near_m: it slows down on the last metres and stops so near to the point, m; None: full speed all the way.
    """

    point: Point
    near_m: float | None = None

    def order(self, boat: Boat) -> Order:
        """How a boat steers for it."""
        if self.near_m is None:
            return boat.top, heading_to(boat.at, self.point)
        return go(boat, self.point, self.near_m)


def aim_of(raid: Raid, sight: Sight, chart: Chart, number: int) -> Aim:
    """What an own boat steers for: home with the flag, its part in the raid, or else intruders and its post."""
    boat = sight.own[number]
    if boat.carries:
        at = dock(boat, sight) if boat.on_side else None
        return Aim(chart.home(boat.at, up=number == RUN) if at is None else at)
    part = _part(raid, sight, chart, number) if raid.phase > Phase.GATHER else None
    return _guarding(sight, chart, number) if part is None else part


def _part(raid: Raid, sight: Sight, chart: Chart, number: int) -> Aim | None:
    """A boat's part in the raid; None where it has none now."""
    at, phase = sight.own[number].at, raid.phase
    if number == BAIT:
        return None if raid.bait_taken else Aim(chart.bait, 0.5)
    if number == DRAG:
        return Aim(chart.posts[DRAG], 2.0) if phase < Phase.DRAG else Aim(chart.drag(at))
    if number != RUN or any(mate.carries for mate in sight.own):
        return None
    if phase == Phase.RUN:
        return Aim(chart.run(at))
    return None if sight.taken else Aim(chart.door if phase == Phase.DRAG else chart.posts[RUN], 2.0)


def _guarding(sight: Sight, chart: Chart, number: int) -> Aim:
    """The nearest intruder, if no mate is nearer to it; else the post."""
    boat = sight.own[number]
    intruders = [foe for foe in sight.foes if not foe.on_side and not foe.tagged]
    foe = min(intruders, key=lambda one: distance(one.at, boat.at), default=None)
    met = sight.taken or (foe is not None and distance(boat.at, foe.at) < chart.shape.chase_m)
    if foe is not None and boat.recharged and boat.on_side and met:
        nearest = min((mate for mate in sight.own if not mate.tagged), key=lambda mate: distance(mate.at, foe.at))
        if nearest is boat:
            return Aim((min(foe.x, sight.line - 2.0), foe.y), 2.0)
    return Aim(chart.posts[number] if number <= RUN else arc(sight)[number], 2.0)
