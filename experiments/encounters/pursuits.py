"""Families in a field in which pursuers that never let go drive a boat along its edge, into its corner, and about.

They are at 0.5, 0.7, 0.9 or all of their top speed. One that is slower never needs to drive a boat out of a field; one
as fast as the boat does in the end. How far boats go beyond the edge is ``outside_m`` of the run.
"""

from __future__ import annotations

from . import script as S
from .cast import Cast, ahead
from .duels import bearing
from .field import field_of, within

SPEED_SHARES = (0.5, 0.7, 0.9, 1.0)
LASTS = 2.7
"""Times as long as other encounters: 120 s for herons."""


def _add_pursuer(cast: Cast, x: float, y: float, heading_deg: float) -> None:
    """A pursuer that steers for the meeting point, at one of the shares of its top speed."""
    share = SPEED_SHARES[int(cast.uniform(0.0, len(SPEED_SHARES)))]
    attack = S.phase(S.AIM_TARGET, share * cast.top(cast.other), lead=1.0)
    cast.add_other(x, y, heading_deg, share * cast.uniform(0.3, 1.0), S.script(attack))


def pursued_along_edge(cast: Cast) -> None:
    """A boat goes along an edge of its field, a pursuer behind it."""
    _, _, width, height = field_of(cast)
    side, low = cast.side(), cast.side()
    y, x = 0.5 * height - low * (0.5 * height - cast.uniform(2.0, 6.0) * cast.scale), cast.uniform(0.4, 0.6) * width
    goals = [((0.5 + side * 0.45) * width, y), ((0.5 - side * 0.45) * width, y), (0.5 * width, 0.5 * height)]
    cast.add_own(x, y, side * 90.0, cast.uniform(0.5, 1.0), *goals)
    behind = x - side * cast.uniform(1.0, 2.0) * cast.nearest_m, y + low * cast.uniform(0.0, 6.0) * cast.scale
    _add_pursuer(cast, *behind, bearing(behind, (x, y)))


def pursued_into_corner(cast: Cast) -> None:
    """A boat is on its way into a corner of its field, a pursuer behind it."""
    _, _, width, height = field_of(cast)
    corner, middle = (0.0, 0.0), (0.5 * width, 0.5 * height)
    inwards = bearing(corner, middle) + cast.uniform(-10.0, 10.0)
    place = ahead(*corner, inwards, cast.uniform(10.0, 18.0) * cast.scale)
    goal = ahead(*corner, bearing(corner, middle), 3.0 * cast.scale)
    cast.add_own(*place, inwards + 180.0, cast.uniform(0.5, 1.0), goal, middle)
    behind = ahead(*place, inwards + cast.uniform(-20.0, 20.0), cast.uniform(1.0, 1.6) * cast.nearest_m)
    _add_pursuer(cast, *behind, bearing(behind, place))


def chased(cast: Cast, pursuers: int) -> None:
    """A boat goes about its field, so many pursuers after it."""
    box = within(field_of(cast), 5.0 * cast.scale)
    place = cast.place_in(box)
    goals = [cast.place_in(box) for _ in range(6)]
    cast.add_own(*place, bearing(place, goals[0]), cast.uniform(0.5, 1.0), *goals)
    for _ in range(pursuers):
        spot = cast.free_place(box, 1.1 * cast.nearest_m)
        _add_pursuer(cast, *spot, cast.uniform(-180.0, 180.0))


def chased_in_box(cast: Cast) -> None:
    """One pursuer chases a boat about its field."""
    chased(cast, 1)


def chased_in_box_2(cast: Cast) -> None:
    """Two pursuers chase a boat about its field."""
    chased(cast, 2)


def chased_in_box_3(cast: Cast) -> None:
    """Three pursuers chase a boat about its field."""
    chased(cast, 3)
