"""Families of team-mates, of boats lying still, of rammers, and crowds."""

from __future__ import annotations

import math

from . import script as S
from .cast import FAR_M, Cast, ahead
from .duels import bearing, onwards
from .field import field_of, within

CLUSTER = 5
CIRCLE_OFF_DEG = 10.0
"""How far boats round a circle are off even angles at most, deg."""


def converging(cast: Cast, boats: int) -> None:
    """Team-mates whose straight ways cross at one place at about the same time; mixed fleets alternate platforms."""
    first, names = cast.uniform(-180.0, 180.0), (cast.own, cast.other)
    lead_s = cast.meeting_s()
    spread = cast.uniform(20.0, 180.0) if boats == 2 else 360.0 / boats
    for k in range(boats):
        heading = first + k * spread + cast.uniform(-15.0, 15.0)
        name = names[k % 2]
        back = cast.top(name) * (lead_s + cast.uniform(-1.0, 1.0))
        x, y = ahead(cast.uniform(-1.0, 1.0), cast.uniform(-1.0, 1.0), heading + 180.0, back)
        goal = ahead(x, y, heading, back + cast.uniform(8.0, 15.0) * cast.scale)
        cast.add_own(x, y, heading, 1.0, goal, ahead(x, y, heading, FAR_M), name=name)


def converging_2(cast: Cast) -> None:
    """Two team-mates."""
    converging(cast, 2)


def converging_3(cast: Cast) -> None:
    """Three team-mates."""
    converging(cast, 3)


def circle(cast: Cast, boats: int) -> None:
    """Team-mates all round a circle, each with its goal at the opposite point: they all come to the middle at once.

    Two that turned away there may end up side by side, each wanting to turn to where the other is. In mixed fleets
    platforms alternate, and each starts as far out as its speed calls for.
    """
    crossing_s, names = cast.uniform(15.0, 25.0), (cast.own, cast.other)
    for k in range(boats):
        heading, name = k * 360.0 / boats + cast.uniform(-CIRCLE_OFF_DEG, CIRCLE_OFF_DEG), names[k % 2]
        across_m = cast.top(name) * crossing_s
        x, y = ahead(0.0, 0.0, heading + 180.0, 0.5 * across_m)
        cast.add_own(x, y, heading, 1.0, ahead(x, y, heading, across_m), ahead(x, y, heading, FAR_M), name=name)


def circle_3(cast: Cast) -> None:
    """Three team-mates all round a circle, each on its way to the opposite point."""
    circle(cast, 3)


def circle_6(cast: Cast) -> None:
    """Six team-mates all round a circle, each on its way to the opposite point."""
    circle(cast, 6)


def doorway(cast: Cast) -> None:
    """Two others lie before the flag; one own boat goes in between them, one comes out."""
    _, _, width, height = field_of(cast)
    flag, door_x = (7.0 / 8.0 * width, height / 2.0), 7.0 / 8.0 * width - 12.0 * cast.scale
    opening = cast.uniform(2.6, 4.0) * cast.radius_m + cast.scale
    middle = height / 2.0 + cast.uniform(-4.0, 4.0)
    inside = (flag[0] + cast.uniform(0.0, 3.0), flag[1] + cast.uniform(-6.0, 6.0))
    outside = (door_x - cast.uniform(15.0, 25.0) * cast.scale, middle + cast.uniform(-10.0, 10.0) * cast.scale)
    home = (0.25 * width, middle + cast.uniform(-6.0, 6.0))
    cast.add_own(*outside, bearing(outside, (door_x, middle)), cast.uniform(0.5, 1.0), flag, home)
    cast.add_own(*inside, bearing(inside, (door_x, middle)), cast.uniform(0.0, 0.7), home, flag)
    for side in (-1.0, 1.0):
        cast.add_other(door_x, middle + side * opening / 2.0, 90.0, 0.0, S.script(S.phase(S.AIM_NOWHERE)))


def cluster(cast: Cast) -> None:
    """Others lie still in the way, some of them too close together to pass between."""
    room = 2.2 * cast.radius_m * math.sqrt(CLUSTER)
    far = cast.range_m() + room
    cast.add_own(0.0, 0.0, cast.uniform(-10.0, 10.0), cast.uniform(0.5, 1.0), *onwards(cast, far + room + 10.0))
    still = S.script(S.phase(S.AIM_NOWHERE))
    for _ in range(CLUSTER):
        x, y = cast.free_place((-room, far - room, room, far + room), 1.2 * cast.radius_m)
        cast.add_other(x, y, cast.uniform(-180.0, 180.0), 0.0, still)


def ram(cast: Cast, reach: float = 1.0) -> None:
    """Add a rammer: pure pursuit, lead pursuit, something between, a feint to one side, or a wait ahead of the bow.

    It starts up to ``reach`` times as far away as others do.
    """
    kind, top = float(cast.rng.random()), cast.top(cast.other)
    attack = {"aim": S.AIM_TARGET, "speed_mps": top}
    close = cast.uniform(4.0, 12.0) * cast.scale + cast.radius_m - 2.5
    if kind < 0.2:
        phases = [S.phase(**attack)]
    elif kind < 0.55:
        phases = [S.phase(**attack, lead=1.0)]
    elif kind < 0.7:
        phases = [S.phase(**attack, lead=cast.uniform(0.3, 1.4))]
    elif kind < 0.85:
        feint = S.phase(**attack, lead=1.0, angle_deg=cast.side() * cast.uniform(15.0, 60.0))
        phases = [feint, S.phase(**attack, lead=1.0, within_m=close, at_s=cast.uniform(5.0, 30.0))]
    else:
        wait = S.phase(**attack, lead=0.5, standoff_m=cast.uniform(0.5, 1.5) * close)
        phases = [wait, S.phase(**attack, lead=1.0, within_m=close, at_s=cast.uniform(5.0, 30.0))]
    gap = cast.uniform(cast.nearest_m, reach * cast.farthest_m)
    x, y = ahead(0.0, 0.0, cast.uniform(-180.0, 180.0), gap)
    while not cast.is_clear(x, y, cast.radius_m + 1.0):
        x, y = ahead(0.0, 0.0, cast.uniform(-180.0, 180.0), gap)
    heading = bearing((x, y), (0.0, 0.0)) + cast.uniform(-90.0, 90.0)
    row = S.script(*phases, authority=cast.chance(0.5))
    cast.add_other(x, y, heading, cast.uniform(0.3, 1.0), row)


def rammers(cast: Cast, own: int, others: int) -> None:
    """Own boats go round waypoints, rammers go for the nearest of them."""
    room = 25.0 * cast.scale
    for k in range(own):
        x, y = ahead(0.0, 0.0, 360.0 * k / own, 0.0 if own == 1 else 6.0 * cast.scale)
        goals = [(cast.uniform(-room, room), cast.uniform(-room, room)) for _ in range(4)]
        cast.add_own(x, y, bearing((x, y), goals[0]), cast.uniform(0.5, 1.0), *goals)
    for _ in range(others):
        ram(cast)


def rammer_1(cast: Cast) -> None:
    """One rammer against one boat."""
    rammers(cast, 1, 1)


def at_rest(cast: Cast) -> None:
    """One rammer, at times from far away, against a boat that lies still and wants to stay for a while."""
    waits_s, room = cast.uniform(10.0, 60.0), 25.0 * cast.scale
    goal = (cast.uniform(-room, room), cast.uniform(-room, room))
    go = S.phase(S.AIM_GOALS, cast.top(cast.own), at_s=waits_s)
    boat = cast.add_own(0.0, 0.0, cast.uniform(-180.0, 180.0), 0.0, goal, (0.0, 0.0))
    cast.script[boat] = S.script(S.phase(S.AIM_NOWHERE), go, reached_m=cast.reached_m(cast.own))
    ram(cast, reach=2.0)


def rammer_2(cast: Cast) -> None:
    """Two rammers against one boat."""
    rammers(cast, 1, 2)


def rammer_3(cast: Cast) -> None:
    """Three rammers against one boat."""
    rammers(cast, 1, 3)


def rammer_3v3(cast: Cast) -> None:
    """Three rammers against three boats."""
    rammers(cast, 3, 3)


def crowd(cast: Cast, own: int, others: int) -> None:
    """Boats all over the field, each going round its own waypoints; the others give way to nobody."""
    box = within(field_of(cast, own + others), 3.0 * cast.scale)
    for k in range(own + others):
        x, y = cast.free_place(box, 0.75 * cast.nearest_m)
        goals = [cast.place_in(box) for _ in range(6)]
        heading, speed = bearing((x, y), goals[0]) + cast.uniform(-30.0, 30.0), cast.uniform(0.1, 0.5)
        if k < own:
            cast.add_own(x, y, heading, speed, *goals)
        else:
            row = S.to_goals(cast.uniform(0.6, 1.0) * cast.top(cast.other), cast.reached_m(cast.other))
            cast.add_other(x, y, heading, speed, row, *goals)


def crowd_6(cast: Cast) -> None:
    """Three against three."""
    crowd(cast, 3, 3)


def crowd_12(cast: Cast) -> None:
    """Six against six."""
    crowd(cast, 6, 6)


def crowd_40(cast: Cast) -> None:
    """Twenty against twenty."""
    crowd(cast, 20, 20)


def crowd_40_own(cast: Cast) -> None:
    """Forty team-mates."""
    crowd(cast, 40, 0)
