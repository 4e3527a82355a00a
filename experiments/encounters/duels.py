"""Families of one own boat and one other on courses: head-on, crossing, overtaking, field corner, sudden turn."""

from __future__ import annotations

import math

from steerclear.shield.jit import Array

from . import script as S
from .cast import FAR_M, Cast, Point, ahead
from .field import field_of

TURN_MOMENTS = (0.0, 0.3, 0.5, 0.65, 0.78, 0.9)
"""Moments of a sudden turn that are tried, as shares of the time until the boats would be closest."""
TURN_SIDES = (-1.0, 1.0)
MOST_TRIES = 200


def hold(cast: Cast, heading_deg: float, share: float) -> Array:
    """Script of an opponent that holds course and speed."""
    return S.script(S.phase(S.AIM_HEADING, share * cast.top(cast.other), angle_deg=heading_deg))


def onwards(cast: Cast, way_m: float) -> tuple[Point, Point]:
    """Goals of an own boat that starts at the origin towards north: one so far ahead, then on for ever."""
    return (0.0, way_m), (0.0, FAR_M)


def head_on(cast: Cast) -> None:
    """The two meet on nearly opposite courses, some widths to the side."""
    gap, share = cast.range_m(), cast.uniform(0.6, 1.0)
    cast.add_own(0.0, 0.0, cast.uniform(-5.0, 5.0), cast.uniform(0.6, 1.0), *onwards(cast, gap + 10.0 * cast.scale))
    heading = 180.0 + cast.uniform(-8.0, 8.0)
    cast.add_other(cast.uniform(-1.5, 1.5) * cast.radius_m, gap, heading, share, hold(cast, heading, share))


def crossing_left(cast: Cast) -> None:
    """The other comes from the left to the place where the own boat will be, give or take a second or two."""
    _crossing(cast, 1.0)


def crossing_right(cast: Cast) -> None:
    """The other comes from the right."""
    _crossing(cast, -1.0)


def _crossing(cast: Cast, sign: float) -> None:
    own_mps, heading = cast.top(cast.own), sign * cast.uniform(40.0, 140.0)
    share, other_mps = cast.uniform(0.6, 1.0), cast.top(cast.other)
    gap, meet_s = 0.0, 0.0
    while not cast.nearest_m < gap < 1.5 * cast.farthest_m:
        meet_s = cast.uniform(4.0, 15.0) * (1.0 if cast.scale < 1.5 else 1.4)
        back = share * other_mps * (meet_s + cast.uniform(-1.5, 1.5))
        x, y = ahead(0.0, own_mps * meet_s, heading + 180.0, back)
        gap = math.hypot(x, y)
    cast.add_own(0.0, 0.0, 0.0, 1.0, *onwards(cast, own_mps * meet_s + 10.0 * cast.scale))
    cast.add_other(x, y, heading, share, hold(cast, heading, share))


def overtaking(cast: Cast) -> None:
    """The own boat comes up behind a slower one."""
    gap = cast.uniform(cast.nearest_m, 0.7 * cast.farthest_m)
    share = cast.uniform(0.15, 0.55) * min(1.0, cast.top(cast.own) / cast.top(cast.other))
    run_m = gap / (1.0 - share * cast.top(cast.other) / cast.top(cast.own))
    cast.add_own(0.0, 0.0, 0.0, 1.0, *onwards(cast, run_m + 10.0 * cast.scale))
    heading = cast.uniform(-10.0, 10.0)
    cast.add_other(cast.uniform(-1.2, 1.2) * cast.radius_m, gap, heading, share, hold(cast, heading, share))


def corner(cast: Cast) -> None:
    """The own boat goes into a corner of the field and out again; the other comes to the same place, straight."""
    _, _, width, height = field_of(cast)
    inset = cast.uniform(2.0, 5.0) * cast.scale
    place = (width - inset, height - inset)
    start = (width - cast.uniform(10.0, 30.0) * cast.scale, height - cast.uniform(5.0, 30.0) * cast.scale)
    cast.add_own(*start, bearing(start, place), cast.uniform(0.5, 1.0), place, (0.4 * width, 0.4 * height))
    share, offset = cast.uniform(0.6, 1.0), cast.radius_m
    aim = (place[0] + cast.uniform(-offset, offset), place[1] + cast.uniform(-offset, offset))
    arrives_s = math.dist(start, place) / cast.top(cast.own) + cast.uniform(-1.0, 4.0)
    way_m = max(cast.nearest_m, arrives_s * share * cast.top(cast.other))
    begin, tries = ahead(*aim, cast.uniform(180.0, 270.0), way_m), 0
    while not (cast.is_clear(*begin, cast.nearest_m) and begin[0] > 1.0 and begin[1] > 1.0) and tries < MOST_TRIES:
        begin, tries = ahead(*aim, cast.uniform(180.0, 270.0), cast.uniform(0.8, 1.2) * way_m), tries + 1
    row = S.to_goals(share * cast.top(cast.other), 2.0 * cast.scale)
    cast.add_other(*begin, bearing(begin, aim), share, row, aim, (0.3 * width, aim[1]))


def sudden_turn(cast: Cast) -> None:
    """The other passes at a few radii and turns hard at some moment, to some side: every one tried is a game."""
    own_mps, gap = cast.top(cast.own), 0.0
    while not cast.nearest_m < gap < 1.5 * cast.farthest_m:
        share, heading = cast.uniform(0.7, 1.0), float(cast.rng.choice((180.0, 180.0, 0.0, 90.0, -90.0)))
        heading, other_mps = heading + cast.uniform(-15.0, 15.0), share * cast.top(cast.other)
        pass_s = cast.uniform(3.0, 12.0) * (1.0 if cast.scale < 1.5 else 1.5)
        x, y = ahead(0.0, own_mps * pass_s, heading + 180.0, other_mps * pass_s)
        x, y = ahead(x, y, heading + 90.0, cast.side() * cast.uniform(1.5, 4.0) * cast.radius_m)
        gap = math.hypot(x, y)
    cast.add_own(0.0, 0.0, 0.0, 1.0, *onwards(cast, own_mps * pass_s + 12.0 * cast.scale))
    other = cast.add_other(x, y, heading, share, hold(cast, heading, share))
    angle, hard = cast.uniform(60.0, 150.0), cast.chance(0.5)
    for moment in TURN_MOMENTS:
        for side in TURN_SIDES:
            row = S.script(
                S.phase(S.AIM_HEADING, other_mps, angle_deg=heading),
                S.phase(S.AIM_HEADING, cast.top(cast.other), angle_deg=heading + side * angle, at_s=moment * pass_s),
                authority=hard,
            )
            cast.variants.append((other, row))


def bearing(start: Point, end: Point) -> float:
    """Direction from one place to another, deg clockwise from north."""
    return math.degrees(math.atan2(end[0] - start[0], end[1] - start[1]))
