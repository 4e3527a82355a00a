"""Opponents with numbers to turn: from a point of the unit cube to scenes.

Each attacker has `N_GENES` numbers in [0, 1]: where it starts, and three phases. In the first it pursues with some
lead, aside by an angle, at some speed, some way ahead of the bow; at a time or a distance it goes over to the second,
with another lead, angle and speed; and in the end, a while later, to plain lead pursuit at top speed. It always turns
with all the rudder its boat has, and goes for the nearest own boat.
"""

from __future__ import annotations

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array

from ..encounters import script as S
from ..encounters.cast import Cast, ahead, under_way
from ..encounters.scenes import Conditions, Scenes

N_GENES = 14
ROOM_M = 25.0
MOST_OWN, MOST_ATTACKERS = 6, 3


class Duel:
    """What is the same for all opponents of one search: own boats with their waypoints, current, noise.

    Args:
        own: platform of the own boats.
        other: platform of the attackers.
        attackers: how many.
        own_boats: how many.
        conditions: of the encounters.
        seed: of the own boats' waypoints.
        restart: number of the search, which draws its own waypoints.

    Raises:
        SteerclearError: an unknown platform or a number out of range.
    """

    def __init__(
        self, own: str, other: str, attackers: int, own_boats: int, conditions: Conditions, seed: int, restart: int
    ) -> None:
        for name, value, most in (("--attackers", attackers, MOST_ATTACKERS), ("--own", own_boats, MOST_OWN)):
            if not 1 <= value <= most:
                raise ConfigError(f"{name} must be from 1 to {most}; got {value}")
        self.attackers, self.conditions = attackers, conditions
        self.cast = Cast(own, other, conditions, seed, "attack", restart)
        self.length_s = 30.0 + 15.0 * min(self.cast.scale, 4.0)
        room = ROOM_M * self.cast.scale
        for k in range(own_boats):
            x, y = ahead(0.0, 0.0, 360.0 * k / own_boats, 0.0 if own_boats == 1 else 6.0 * self.cast.scale)
            goals = [self.cast.place_in((-room, -room, room, room)) for _ in range(4)]
            self.cast.add_own(x, y, self.cast.uniform(-180.0, 180.0), self.cast.uniform(0.5, 1.0), *goals)
        self.cast.settle()

    @property
    def genes(self) -> int:
        """How many numbers describe the attackers."""
        return N_GENES * self.attackers

    def scenes(self, points: Array) -> Scenes:
        """Scenes of (S, genes) points in [0, 1], one game each."""
        cast, games = self.cast, len(points)
        attackers = [[self._attacker(row) for row in point.reshape(-1, N_GENES)] for point in points]
        far = [cast.goals[0]] * self.attackers
        return Scenes(
            family="attack",
            platforms=(*cast.platforms, *[cast.other] * self.attackers),
            team=np.array([0] * len(cast.state) + [1] * self.attackers, dtype=np.int64),
            state=np.array([[*cast.state, *(state for state, _ in line)] for line in attackers]),
            script=np.array([[*cast.script, *(row for _, row in line)] for line in attackers]),
            goals=np.tile(np.array([*cast.goals, *far], dtype=np.float64), (games, 1, 1, 1)),
            current=np.tile(np.array(cast.current), (games, 1)),
            noise_seed=np.full(games, cast.noise_seed, dtype=np.uint64),
            number=np.arange(games, dtype=np.int64),
            field=None,
            length_s=self.length_s,
        )

    def _attacker(self, gene: Array) -> tuple[Array, Array]:
        """State and script of one attacker."""
        cast, top, u = self.cast, self.cast.top(self.cast.other), np.clip(gene, 0.0, 1.0)
        distance = cast.nearest_m + u[1] * (cast.farthest_m - cast.nearest_m) + self._spread_m
        bearing = 360.0 * u[0] - 180.0
        x, y = ahead(0.0, 0.0, bearing, distance)
        state = under_way(cast.other, x, y, bearing + 180.0 + 180.0 * (u[2] - 0.5), (0.3 + 0.7 * u[3]) * top)
        first_s = 0.6 * self.length_s * u[8]
        first = S.phase(
            S.AIM_TARGET,
            (0.3 + 0.7 * u[6]) * top,
            lead=1.5 * u[4],
            angle_deg=140.0 * (u[5] - 0.5),
            standoff_m=(25.0 * u[7] - 10.0) * cast.scale,
        )
        second = S.phase(
            S.AIM_TARGET,
            (0.3 + 0.7 * u[12]) * top,
            lead=1.5 * u[10],
            angle_deg=80.0 * (u[11] - 0.5),
            at_s=first_s,
            within_m=20.0 * cast.scale * u[9],
        )
        last = S.phase(S.AIM_TARGET, top, lead=1.0, at_s=first_s + 0.4 * self.length_s * u[13])
        return state, S.script(first, second, last, authority=True)

    @property
    def _spread_m(self) -> float:
        """Distance of the own boats from the middle, m, so that nobody starts too near one of them."""
        return 0.0 if len(self.cast.state) == 1 else 6.0 * self.cast.scale
