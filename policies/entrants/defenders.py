"""Three teams that defend their base: Alamer-EJUST and Ohto-Indep hold stations, Meo-Indep marks attackers.

Each class states what the paper says of its team, and what we added.
"""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np

from .catalogue import entrant
from .observation import Boat, Observation, Point
from .plane import GAP_M, STOP_MPS, Order, ahead, assign, clip, cross, distance, heading_to, meeting_point, row, wrap
from .plane import go as go_to
from .play import EntrantTeam

REACHES = 1.3
ANEW_S = 3.0
ALAMER_ARRIVED_M, ALAMER_LEFT_M = 2.0, 6.0
FACING_RAD = math.radians(45.0)
TURNING_SHARE = 0.1
"""Share of top speed at which a boat of Alamer turns on the spot."""
MEO_ARRIVED_M, MARGIN_M = 3.0, 2.0
"""Distances, m: from its point at which a boat of Meo stops; of such points from the dividing line and the edges."""
OHTO_ARRIVED_M, COAST_S = 2.0, 3.0
"""A boat has arrived this near to its post, or within its coasting distance, about its speed times `COAST_S`."""
DRIVEN_OFF = 0.6
"""Share of the distance between two posts from which a holding boat returns to its post."""
SLOWING_S, SLOWEST = 20.0, 0.1
"""Time from its post at which a boat slows down, and the least share of its top speed: it has no brakes."""
ABEAM_RAD, CRAWL = math.radians(80.0), 0.3
"""If its post is further off its heading than this, a boat turns at this share of top speed; at full speed it would
circle the post.
"""


@entrant(
    "alamer", "stationary defence: holds at the point of interception and faces the foe (Alamer-EJUST)", "Alamer-EJUST"
)
class Alamer(EntrantTeam):
    """Holds near the base at the closest points of interception and turns to face the opponent.

    Our additions: an opponent's point of interception is on its straight way to the flag, `REACHES` grab radii before
    the flag (nearer if the opponent is). Points too near to each other are moved round the flag. Boats take points by
    least total distance, anew every `ANEW_S`, and move when theirs is further off than `ALAMER_LEFT_M`. A boat turns to
    face at low speed, since these boats turn only under thrust.
    """

    name = "alamer"

    def begin(self, obs: Observation) -> None:
        """Begin a game without points."""
        self._moving = [True] * len(obs.own)
        self._points: list[Point] = []
        self._until_s = -math.inf

    def decide(self, obs: Observation) -> list[Order]:
        """Steer to the points, hold there and face the nearest opponents."""
        if obs.time >= self._until_s:
            self._until_s = obs.time + ANEW_S
            points = _apart(obs, [_interception(obs, foe) for foe in obs.foes])
            chosen = assign([boat.at for boat in obs.own], points)
            self._points = [points[n] if n >= 0 else boat.at for boat, n in zip(obs.own, chosen, strict=True)]
        return [self._order(obs, number, boat) for number, boat in enumerate(obs.own)]

    def _order(self, obs: Observation, number: int, boat: Boat) -> Order:
        point = self._points[number]
        self._moving[number] = distance(boat.at, point) > (ALAMER_ARRIVED_M if self._moving[number] else ALAMER_LEFT_M)
        if self._moving[number]:
            return go_to(boat, point)
        foe = min(obs.foes, key=lambda foe: distance(boat.at, foe.at))
        facing = heading_to(boat.at, foe.at)
        return (TURNING_SHARE * boat.top if abs(wrap(facing - boat.heading)) > FACING_RAD else STOP_MPS), facing


def _interception(obs: Observation, foe: Boat) -> Point:
    """Return the point of an opponent's way to the flag at which a boat waits for it."""
    inner, outer = obs.keepout + foe.radius + 1.0, REACHES * obs.reach
    x, y = ahead(obs.home, heading_to(obs.home, foe.at), clip(distance(obs.home, foe.at), inner, outer))
    return clip(x, 2.0, obs.line - 2.0), clip(y, 2.0, obs.size[1] - 2.0)


def _apart(obs: Observation, points: list[Point]) -> list[Point]:
    """Return the points, with those too near to an earlier one moved round the flag."""
    kept: list[Point] = []
    for point in points:
        radius, heading = distance(obs.home, point), heading_to(obs.home, point)
        step = GAP_M / max(radius, 1.0)
        tries = [ahead(obs.home, heading + sign * k * step, radius) for k in range(4) for sign in (1.0, -1.0)]
        inside = [p for p in tries if 1.0 < p[0] < obs.line and 1.0 < p[1] < obs.size[1] - 1.0]
        fits = [p for p in inside if all(distance(p, other) >= 0.9 * GAP_M for other in kept)]
        kept.append(fits[0] if fits else point)
    return kept


@entrant("meo", "man-to-man defence: intercept points, pairs of least total distance (Meo-Indep)", "Meo-Indep")
class Meo(EntrantTeam):
    """Sends one boat to each attacker's intercept point, in pairs of least total distance.

    Each boat steers to its point at full speed and stops there. If paths of teammates cross, one heading is reversed.
    Our additions: an intercept point is where the defender at full speed meets the attacker on a straight course, moved
    into the own half. Of two boats with crossing paths the later one is reversed.
    """

    name = "meo"

    def decide(self, obs: Observation) -> list[Order]:
        """Steer to the intercept points at full speed; reverse one of two crossing boats."""
        ways = [(boat.at, point) for boat, point in zip(obs.own, _marked(obs), strict=True)]
        crossing = {j for i, j in combinations(range(len(ways)), 2) if cross(*ways[i], *ways[j])}
        headings = [heading_to(*way) + (math.pi if number in crossing else 0.0) for number, way in enumerate(ways)]
        return [
            (STOP_MPS if distance(*way) <= MEO_ARRIVED_M else boat.top, heading)
            for boat, way, heading in zip(obs.own, ways, headings, strict=True)
        ]


def _marked(obs: Observation) -> list[Point]:
    """Return where each own boat meets the attacker it marks; its own place if there are fewer attackers."""

    def met(boat: Boat, foe: Boat) -> Point:
        x, y = meeting_point(boat, foe)
        return clip(x, MARGIN_M, obs.line - MARGIN_M), clip(y, MARGIN_M, obs.size[1] - MARGIN_M)

    points = [[met(boat, foe) for foe in obs.foes] for boat in obs.own]
    costs = np.array([[distance(boat.at, p) for p in some] for boat, some in zip(obs.own, points, strict=True)])
    found = [boat.at for boat in obs.own]
    from scipy.optimize import linear_sum_assignment  # importing it takes a while

    for boat, foe in zip(*linear_sum_assignment(costs), strict=True):
        found[int(boat)] = points[int(boat)][int(foe)]
    return found


@entrant("ohto", "stationary defence: holds before its base (Ohto-Indep)", "Ohto-Indep")
class Ohto(EntrantTeam):
    """Holds its start places near the base: in the paper and in the presets a row across the own half.

    Our additions: if a game starts boats elsewhere, they first steer to the places of that row, by least total
    distance. There they hold for the rest of the game.
    """

    name = "ohto"

    def begin(self, obs: Observation) -> None:
        """Choose each boat's station."""
        posts = row(obs)
        self._posts: list[Point] = [posts[number] for number in assign([boat.at for boat in obs.own], posts)]
        self._far_m = DRIVEN_OFF * obs.size[1] / (len(posts) + 1)
        self._moving = [True] * len(obs.own)

    def decide(self, obs: Observation) -> list[Order]:
        """Hold; return to the post if the game moved a boat away."""
        return [self._order(boat, number) for number, boat in enumerate(obs.own)]

    def _order(self, boat: Boat, number: int) -> Order:
        post = self._posts[number]
        way_m, arrived_m = distance(boat.at, post), max(OHTO_ARRIVED_M, COAST_S * math.hypot(*boat.velocity))
        self._moving[number] = way_m > (arrived_m if self._moving[number] else self._far_m)
        if not self._moving[number]:
            return STOP_MPS, boat.heading
        heading = heading_to(boat.at, post)
        if abs(wrap(heading - boat.heading)) > ABEAM_RAD:
            return CRAWL * boat.top, heading
        return clip(way_m / SLOWING_S, SLOWEST * boat.top, boat.top), heading
