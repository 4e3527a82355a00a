"""The families of encounters as a table, their geometry, and drawing encounters of them.

A seed and a number always give the same encounter. A family puts the boats of one encounter into a `SceneBuilder`; in
families in a field with pursuers, these are at 0.5, 0.7, 0.9 or all of their top speed. One that is slower never needs
to drive a boat out of a field; one as fast as the boat does in the end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from . import scene as S
from .builder import FAR_M, Point, SceneBuilder, ahead, bearing
from .scene import Box, Conditions, Scenes

TURN_MOMENTS = (0.0, 0.3, 0.5, 0.65, 0.78, 0.9)
"""Moments of a sudden turn that are tried, as shares of the time until the boats would be closest."""
CLUSTER = 5
CIRCLE_OFF_DEG = 10.0
"""How far boats round a circle are off even angles at most, deg."""
SPEED_SHARES = (0.5, 0.7, 0.9, 1.0)
MOST_TRIES = MOST_DRAWS = 200


def hold(build: SceneBuilder, heading_deg: float, share: float) -> Array:
    """Script of an opponent that holds course and speed."""
    return S.script(S.phase(S.AIM_HEADING, share * build.other_mps, angle_deg=heading_deg))


def onwards(build: SceneBuilder, way_m: float) -> tuple[Point, Point]:
    """Goals of an own boat that starts at the origin towards north: one so far ahead, then on for ever."""
    return (0.0, way_m), (0.0, FAR_M)


def head_on(build: SceneBuilder) -> None:
    """The two meet on nearly opposite courses, some widths to the side."""
    gap, share = build.uniform(build.nearest_m, build.farthest_m), build.uniform(0.6, 1.0)
    way = onwards(build, gap + 10.0 * build.scale)
    build.add_own(0.0, 0.0, build.uniform(-5.0, 5.0), build.uniform(0.6, 1.0), *way)
    heading = 180.0 + build.uniform(-8.0, 8.0)
    build.add_other(build.uniform(-1.5, 1.5) * build.radius_m, gap, heading, share, hold(build, heading, share))


def crossing(build: SceneBuilder, side: float) -> None:
    """The other comes from the left (1) or the right (-1) to where the own boat will be, give or take a second."""
    heading, share, gap, meet_s = side * build.uniform(40.0, 140.0), build.uniform(0.6, 1.0), 0.0, 0.0
    while not build.nearest_m < gap < 1.5 * build.farthest_m:
        meet_s = build.uniform(4.0, 15.0) * (1.0 if build.scale < 1.5 else 1.4)
        back = share * build.other_mps * (meet_s + build.uniform(-1.5, 1.5))
        x, y = ahead(0.0, build.own_mps * meet_s, heading + 180.0, back)
        gap = math.hypot(x, y)
    build.add_own(0.0, 0.0, 0.0, 1.0, *onwards(build, build.own_mps * meet_s + 10.0 * build.scale))
    build.add_other(x, y, heading, share, hold(build, heading, share))


def overtaking(build: SceneBuilder) -> None:
    """The own boat comes up behind a slower one."""
    gap = build.uniform(build.nearest_m, 0.7 * build.farthest_m)
    share = build.uniform(0.15, 0.55) * min(1.0, build.own_mps / build.other_mps)
    run_m = gap / (1.0 - share * build.other_mps / build.own_mps)
    build.add_own(0.0, 0.0, 0.0, 1.0, *onwards(build, run_m + 10.0 * build.scale))
    heading = build.uniform(-10.0, 10.0)
    build.add_other(build.uniform(-1.2, 1.2) * build.radius_m, gap, heading, share, hold(build, heading, share))


def corner(build: SceneBuilder) -> None:
    """The own boat goes into a corner of the field and out again; the other comes to the same place, straight."""
    _, _, width, height = build.field()
    inset = build.uniform(2.0, 5.0) * build.scale
    place = (width - inset, height - inset)
    start = (width - build.uniform(10.0, 30.0) * build.scale, height - build.uniform(5.0, 30.0) * build.scale)
    build.add_own(*start, bearing(start, place), build.uniform(0.5, 1.0), place, (0.4 * width, 0.4 * height))
    share, offset = build.uniform(0.6, 1.0), build.radius_m
    aim = (place[0] + build.uniform(-offset, offset), place[1] + build.uniform(-offset, offset))
    arrives_s = math.dist(start, place) / build.own_mps + build.uniform(-1.0, 4.0)
    way_m = max(build.nearest_m, arrives_s * share * build.other_mps)
    begin, tries = ahead(*aim, build.uniform(180.0, 270.0), way_m), 0
    while not (build.is_clear(*begin, build.nearest_m) and min(begin) > 1.0) and tries < MOST_TRIES:
        begin, tries = ahead(*aim, build.uniform(180.0, 270.0), build.uniform(0.8, 1.2) * way_m), tries + 1
    row = S.to_goals(share * build.other_mps, 2.0 * build.scale)
    build.add_other(*begin, bearing(begin, aim), share, row, aim, (0.3 * width, aim[1]))


def sudden_turn(build: SceneBuilder) -> None:
    """The other passes at a few radii and turns hard at some moment, to some side: every one tried is a game."""
    gap = 0.0
    while not build.nearest_m < gap < 1.5 * build.farthest_m:
        share, heading = build.uniform(0.7, 1.0), float(build.rng.choice((180.0, 180.0, 0.0, 90.0, -90.0)))
        heading, other_mps = heading + build.uniform(-15.0, 15.0), share * build.other_mps
        pass_s = build.uniform(3.0, 12.0) * (1.0 if build.scale < 1.5 else 1.5)
        x, y = ahead(0.0, build.own_mps * pass_s, heading + 180.0, other_mps * pass_s)
        x, y = ahead(x, y, heading + 90.0, build.side() * build.uniform(1.5, 4.0) * build.radius_m)
        gap = math.hypot(x, y)
    build.add_own(0.0, 0.0, 0.0, 1.0, *onwards(build, build.own_mps * pass_s + 12.0 * build.scale))
    other = build.add_other(x, y, heading, share, hold(build, heading, share))
    angle, hard = build.uniform(60.0, 150.0), build.chance(0.5)
    for moment in TURN_MOMENTS:
        for side in (-1.0, 1.0):
            steady = S.phase(S.AIM_HEADING, other_mps, angle_deg=heading)
            turn = {"angle_deg": heading + side * angle, "at_s": moment * pass_s}
            turned = S.phase(S.AIM_HEADING, build.other_mps, **turn)
            build.variants.append((other, S.script(steady, turned, authority=hard)))


def converging(build: SceneBuilder, boats: int) -> None:
    """Teammates whose straight ways cross at one place at about the same time; mixed fleets alternate platforms."""
    first = build.uniform(-180.0, 180.0)
    lead_s = build.uniform(5.0, 12.0) * (1.0 if build.scale < 1.5 else 1.4)
    spread = build.uniform(20.0, 180.0) if boats == 2 else 360.0 / boats
    for k in range(boats):
        heading, name = first + k * spread + build.uniform(-15.0, 15.0), build.names[k % 2]
        back = build.top(name) * (lead_s + build.uniform(-1.0, 1.0))
        x, y = ahead(build.uniform(-1.0, 1.0), build.uniform(-1.0, 1.0), heading + 180.0, back)
        goal = ahead(x, y, heading, back + build.uniform(8.0, 15.0) * build.scale)
        build.add_own(x, y, heading, 1.0, goal, ahead(x, y, heading, FAR_M), name=name)


def circle(build: SceneBuilder, boats: int) -> None:
    """Teammates all round a circle, each with its goal at the opposite point: they all come to the middle at once.

    Two that turned away there may end up side by side, each wanting to turn to where the other is. In mixed fleets
    platforms alternate, and each starts as far out as its speed calls for.
    """
    crossing_s = build.uniform(15.0, 25.0)
    for k in range(boats):
        heading, name = k * 360.0 / boats + build.uniform(-CIRCLE_OFF_DEG, CIRCLE_OFF_DEG), build.names[k % 2]
        across_m = build.top(name) * crossing_s
        x, y = ahead(0.0, 0.0, heading + 180.0, 0.5 * across_m)
        build.add_own(x, y, heading, 1.0, ahead(x, y, heading, across_m), ahead(x, y, heading, FAR_M), name=name)


def doorway(build: SceneBuilder) -> None:
    """Two others lie before the flag; one own boat goes in between them, one comes out."""
    _, _, width, height = build.field()
    flag, door_x = (7.0 / 8.0 * width, height / 2.0), 7.0 / 8.0 * width - 12.0 * build.scale
    opening = build.uniform(2.6, 4.0) * build.radius_m + build.scale
    middle = height / 2.0 + build.uniform(-4.0, 4.0)
    inside = (flag[0] + build.uniform(0.0, 3.0), flag[1] + build.uniform(-6.0, 6.0))
    outside = (door_x - build.uniform(15.0, 25.0) * build.scale, middle + build.uniform(-10.0, 10.0) * build.scale)
    home = (0.25 * width, middle + build.uniform(-6.0, 6.0))
    build.add_own(*outside, bearing(outside, (door_x, middle)), build.uniform(0.5, 1.0), flag, home)
    build.add_own(*inside, bearing(inside, (door_x, middle)), build.uniform(0.0, 0.7), home, flag)
    for side in (-1.0, 1.0):
        build.add_other(door_x, middle + side * opening / 2.0, 90.0, 0.0, S.script(S.phase(S.AIM_NOWHERE)))


def cluster(build: SceneBuilder) -> None:
    """Others lie still in the way, some of them too close together to pass between."""
    room = 2.2 * build.radius_m * math.sqrt(CLUSTER)
    far = build.uniform(build.nearest_m, build.farthest_m) + room
    way = onwards(build, far + room + 10.0)
    build.add_own(0.0, 0.0, build.uniform(-10.0, 10.0), build.uniform(0.5, 1.0), *way)
    for _ in range(CLUSTER):
        x, y = build.free_place((-room, far - room, room, far + room), 1.2 * build.radius_m)
        build.add_other(x, y, build.uniform(-180.0, 180.0), 0.0, S.script(S.phase(S.AIM_NOWHERE)))


def ram(build: SceneBuilder, reach: float = 1.0) -> None:
    """Add a rammer: pure pursuit, lead pursuit, something between, a feint to one side, or a wait ahead of the bow.

    It starts up to ``reach`` times as far away as others do.
    """
    kind = float(build.rng.random())
    attack: dict[str, Any] = {"aim": S.AIM_TARGET, "speed_mps": build.other_mps}
    close = build.uniform(4.0, 12.0) * build.scale + build.radius_m - 2.5
    if kind < 0.2:
        phases = [S.phase(**attack)]
    elif kind < 0.55:
        phases = [S.phase(**attack, lead=1.0)]
    elif kind < 0.7:
        phases = [S.phase(**attack, lead=build.uniform(0.3, 1.4))]
    else:
        if kind < 0.85:
            begin = S.phase(**attack, lead=1.0, angle_deg=build.side() * build.uniform(15.0, 60.0))
        else:
            begin = S.phase(**attack, lead=0.5, standoff_m=build.uniform(0.5, 1.5) * close)
        phases = [begin, S.phase(**attack, lead=1.0, within_m=close, at_s=build.uniform(5.0, 30.0))]
    gap = build.uniform(build.nearest_m, reach * build.farthest_m)
    x, y = ahead(0.0, 0.0, build.uniform(-180.0, 180.0), gap)
    while not build.is_clear(x, y, build.radius_m + 1.0):
        x, y = ahead(0.0, 0.0, build.uniform(-180.0, 180.0), gap)
    heading = bearing((x, y), (0.0, 0.0)) + build.uniform(-90.0, 90.0)
    row = S.script(*phases, authority=build.chance(0.5))
    build.add_other(x, y, heading, build.uniform(0.3, 1.0), row)


def rammers(build: SceneBuilder, own: int, others: int) -> None:
    """Own boats go round waypoints, rammers go for the nearest of them."""
    room = 25.0 * build.scale
    for k in range(own):
        x, y = ahead(0.0, 0.0, 360.0 * k / own, 0.0 if own == 1 else 6.0 * build.scale)
        goals = build.places_in((-room, -room, room, room), 4)
        build.add_own(x, y, bearing((x, y), goals[0]), build.uniform(0.5, 1.0), *goals)
    for _ in range(others):
        ram(build)


def at_rest(build: SceneBuilder) -> None:
    """One rammer, at times from far away, against a boat that lies still and wants to stay for a while."""
    waits_s, room = build.uniform(10.0, 60.0), 25.0 * build.scale
    goal = build.place_in((-room, -room, room, room))
    go = S.phase(S.AIM_GOALS, build.own_mps, at_s=waits_s)
    boat = build.add_own(0.0, 0.0, build.uniform(-180.0, 180.0), 0.0, goal, (0.0, 0.0))
    build.script[boat] = S.script(S.phase(S.AIM_NOWHERE), go, reached_m=build.reached_m(build.own))
    ram(build, reach=2.0)


def _within(box: Box, margin_m: float) -> Box:
    """The box so much smaller on all sides."""
    return box[0] + margin_m, box[1] + margin_m, box[2] - margin_m, box[3] - margin_m


def crowd(build: SceneBuilder, own: int, others: int) -> None:
    """Boats all over the field, each going round its own waypoints; the others give way to nobody."""
    box = _within(build.field(own + others), 3.0 * build.scale)
    for k in range(own + others):
        x, y = build.free_place(box, 0.75 * build.nearest_m)
        goals = build.places_in(box, 6)
        heading, speed = bearing((x, y), goals[0]) + build.uniform(-30.0, 30.0), build.uniform(0.1, 0.5)
        if k < own:
            build.add_own(x, y, heading, speed, *goals)
        else:
            row = S.to_goals(build.uniform(0.6, 1.0) * build.other_mps, build.reached_m(build.other))
            build.add_other(x, y, heading, speed, row, *goals)


def pursue(build: SceneBuilder, x: float, y: float, heading_deg: float) -> None:
    """Add a pursuer that steers for the meeting point, at one of the shares of its top speed."""
    share = SPEED_SHARES[int(build.uniform(0.0, len(SPEED_SHARES)))]
    attack = S.phase(S.AIM_TARGET, share * build.other_mps, lead=1.0)
    build.add_other(x, y, heading_deg, share * build.uniform(0.3, 1.0), S.script(attack))


def pursued_along_edge(build: SceneBuilder) -> None:
    """A boat goes along an edge of its field, a pursuer behind it."""
    _, _, width, height = build.field()
    side, low = build.side(), build.side()
    y, x = 0.5 * height - low * (0.5 * height - build.uniform(2.0, 6.0) * build.scale), build.uniform(0.4, 0.6) * width
    goals = [((0.5 + side * 0.45) * width, y), ((0.5 - side * 0.45) * width, y), (0.5 * width, 0.5 * height)]
    build.add_own(x, y, side * 90.0, build.uniform(0.5, 1.0), *goals)
    behind = x - side * build.uniform(1.0, 2.0) * build.nearest_m, y + low * build.uniform(0.0, 6.0) * build.scale
    pursue(build, *behind, bearing(behind, (x, y)))


def pursued_into_corner(build: SceneBuilder) -> None:
    """A boat is on its way into a corner of its field, a pursuer behind it."""
    _, _, width, height = build.field()
    middle = (0.5 * width, 0.5 * height)
    across = bearing((0.0, 0.0), middle)
    inwards = across + build.uniform(-10.0, 10.0)
    place, goal = (
        ahead(0.0, 0.0, inwards, build.uniform(10.0, 18.0) * build.scale),
        ahead(0.0, 0.0, across, 3.0 * build.scale),
    )
    build.add_own(*place, inwards + 180.0, build.uniform(0.5, 1.0), goal, middle)
    behind = ahead(*place, inwards + build.uniform(-20.0, 20.0), build.uniform(1.0, 1.6) * build.nearest_m)
    pursue(build, *behind, bearing(behind, place))


def chased(build: SceneBuilder, pursuers: int) -> None:
    """A boat goes about its field, so many pursuers after it."""
    box = _within(build.field(), 5.0 * build.scale)
    place, goals = build.place_in(box), build.places_in(box, 6)
    build.add_own(*place, bearing(place, goals[0]), build.uniform(0.5, 1.0), *goals)
    for _ in range(pursuers):
        spot = build.free_place(box, 1.1 * build.nearest_m)
        pursue(build, *spot, build.uniform(-180.0, 180.0))


class Family(NamedTuple):
    """A kind of encounter: how many boats the own team does not command, and what puts all of them into a builder.

    ``numbers`` are what ``build`` takes beside it; ``field_for`` so many boats its field is made (0: open water);
    ``lasts`` is how many times as long as others it lasts; an empty ``sentence`` is the docstring's of ``build``.
    """

    others: int
    build: Callable[..., None]
    numbers: tuple[float, ...] = ()
    field_for: int = 0
    lasts: float = 1.0
    sentence: str = ""

    @property
    def words(self) -> str:
        """What happens in it, a sentence."""
        return self.sentence or (self.build.__doc__ or "").splitlines()[0]


_LEFT = "The other comes from the left to the place where the own boat will be, give or take a second or two."
_ROUND = "teammates all round a circle, each on its way to the opposite point."
FAMILIES: dict[str, Family] = {
    "head_on": Family(1, head_on),
    "crossing_left": Family(1, crossing, (1.0,), sentence=_LEFT),
    "crossing_right": Family(1, crossing, (-1.0,), sentence="The other comes from the right."),
    "overtaking": Family(1, overtaking),
    "converging_2": Family(0, converging, (2,), sentence="Two teammates."),
    "converging_3": Family(0, converging, (3,), sentence="Three teammates."),
    "circle_3": Family(0, circle, (3,), lasts=2.0, sentence=f"Three {_ROUND}"),
    "circle_6": Family(0, circle, (6,), lasts=2.0, sentence=f"Six {_ROUND}"),
    "doorway": Family(2, doorway, field_for=4),
    "cluster": Family(CLUSTER, cluster),
    "corner": Family(1, corner, field_for=2),
    "sudden_turn": Family(1, sudden_turn),
    "rammer_1": Family(1, rammers, (1, 1), sentence="One rammer against one boat."),
    "at_rest": Family(1, at_rest),
    "rammer_2": Family(2, rammers, (1, 2), sentence="Two rammers against one boat."),
    "rammer_3": Family(3, rammers, (1, 3), sentence="Three rammers against one boat."),
    "rammer_3v3": Family(3, rammers, (3, 3), sentence="Three rammers against three boats."),
    "crowd_6": Family(3, crowd, (3, 3), 6, sentence="Three against three."),
    "crowd_12": Family(6, crowd, (6, 6), 12, sentence="Six against six."),
    "crowd_40": Family(20, crowd, (20, 20), 40, sentence="Twenty against twenty."),
    "crowd_40_own": Family(0, crowd, (40, 0), 40, sentence="Forty teammates."),
    "pursued_along_edge": Family(1, pursued_along_edge, (), 2, 2.7),
    "pursued_into_corner": Family(1, pursued_into_corner, (), 2, 2.7),
    "chased_in_box": Family(1, chased, (1,), 2, 2.7, "One pursuer chases a boat about its field."),
    "chased_in_box_2": Family(2, chased, (2,), 3, 2.7, "Two pursuers chase a boat about its field."),
    "chased_in_box_3": Family(3, chased, (3,), 4, 2.7, "Three pursuers chase a boat about its field."),
}


def get_family(name: str) -> Family:
    """The family of that name.

    Raises:
        ConfigError: there is none; the message names the nearest, or all.
    """
    if not isinstance(name, str):
        raise ConfigError(f"the family is {name!r}; give the name of one, as 'head_on'")
    if name not in FAMILIES:
        near = get_close_matches(name, FAMILIES, 1)
        hint = f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(FAMILIES)}"
        raise ConfigError(f"unknown family {name!r}; {hint}")
    return FAMILIES[name]


def check_whole(name: str, value: Any) -> None:
    """Refuse (ConfigError) what is no whole number of at least 0, or too large to be counted in."""
    is_whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if not is_whole or value < 0 or value > np.iinfo(np.int64).max:
        raise ConfigError(f"{name} is {value!r}; give a whole number, 0 or more")


def draw(family: str, own: str, other: str, conditions: Conditions, seed: int, first: int, count: int) -> Scenes:
    """Draw the encounters ``first`` .. ``first + count - 1`` of a family between platforms ``own`` and ``other``.

    Of the conditions only the radius and the noise have a say in where boats start.

    Raises:
        SteerclearError: an unknown name, or an encounter that cannot be drawn with this radius.
    """
    kind = get_family(family)
    check_whole("first", first)
    check_whole("count", count)
    check_whole("seed", seed)
    if not isinstance(conditions, Conditions):
        raise ConfigError(f"conditions is {conditions!r}; give Conditions(radius_m=..., ...)")
    if count < 1:
        raise ConfigError(f"encounters {first} to {first + count - 1} cannot be drawn; ask for at least one, from 0 on")
    builds = [SceneBuilder(own, other, conditions, seed, family, number) for number in range(first, first + count)]
    box = builds[0].field(kind.field_for) if kind.field_for else None
    for build in builds:
        _arrange(family, build, box, 1.1 * conditions.radius_m + 2.0 * conditions.noise_m)
    return scenes_of_builds(family, builds, box, kind.lasts * builds[0].length_s)


def _arrange(family: str, build: SceneBuilder, box: Box | None, gap_m: float) -> None:
    """Draw until no two boats start too close, and none outside the field."""
    kind = FAMILIES[family]
    for _ in range(MOST_DRAWS):
        build.clear()
        kind.build(build, *kind.numbers)
        inside = box is None or all(box[0] <= x <= box[2] and box[1] <= y <= box[3] for x, y, *_ in build.state)
        if build.closest_m() > gap_m and inside:
            if box is None:
                build.turn(build.uniform(-180.0, 180.0))
            build.settle()
            return
    raise ConfigError(f"no encounter of {family} fits a radius of {build.radius_m:g} m; choose a smaller one")


def scenes_of_builds(family: str, builds: list[SceneBuilder], box: Box | None, length_s: float) -> Scenes:
    """Encounters of the same fleet as a batch, a game for every variant."""
    built = [(build, scripts) for build in builds for scripts in build.scripts()]
    return Scenes(
        family=family,
        platforms=tuple(builds[0].platforms),
        team=np.array(builds[0].team, dtype=np.int64),
        state=np.array([build.state for build, _ in built], dtype=np.float64),
        script=np.array([scripts for _, scripts in built], dtype=np.float64),
        goals=np.array([_even(build.goals) for build, _ in built], dtype=np.float64),
        current=np.array([build.current for build, _ in built]),
        noise_seed=np.array([build.noise_seed for build, _ in built], dtype=np.uint64),
        number=np.array([build.number for build, _ in built], dtype=np.int64),
        field=box,
        length_s=length_s,
    )


def _even(goals: list[list[Point]]) -> Array:
    """Goals of all boats, (n, G, 2): boats with fewer stay at their last one."""
    most = max(len(line) for line in goals)
    return np.array([[*line, *[line[-1]] * (most - len(line))] for line in goals], dtype=np.float64)
