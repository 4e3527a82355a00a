"""Fleets, commands and the Hypothesis strategies for them that the shield's tests share."""

import sys

import numpy as np
from hypothesis import settings
from hypothesis import strategies as st
from numba.core.registry import CPUDispatcher
from steerclear.shield import Commands, Fleet
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L

quick = settings(max_examples=60, deadline=None, derandomize=True)
"""Settings of property tests here: repeatable, and without a deadline since the first example compiles."""

BOATS = ("heron", "surveyor", "si", "di", "large_usv", "mctf2024_sim")
SEEN = [L.X, L.Y, L.HEADING, L.SPEED]


def fleet_of(rows, team, platforms="heron", **more):
    """Fleet of boats (x m, y m, heading deg, speed m/s); the boats of team 0 are controlled."""
    table = np.array(rows, dtype=float).reshape(-1, 4)
    return Fleet.of(
        position_m=table[:, :2],
        heading_rad=np.radians(table[:, 2]),
        speed_mps=table[:, 3],
        team=team,
        platforms=platforms,
        **more,
    )


def relative(*rows):
    """Commands of (speed m/s, relative heading deg)."""
    return Commands.relative_deg(np.array(rows, dtype=float).reshape(-1, 2))


def head_on(gap_m=12.0, platforms="heron", speed=2.0, aside_m=0.0):
    """A boat of ours heading north and an opponent coming at it."""
    return fleet_of([(0.0, 0.0, 0.0, speed), (aside_m, gap_m, 180.0, speed)], [0, 1], platforms)


def crowded_edge(random, x_m):
    """A few boats anyhow at an upper edge at 80 m, with an opponent or without: rows, teams, courses."""
    own, opponents = int(random.integers(2, 6)), int(random.integers(0, 2))
    rows = [
        (x_m + random.uniform(-9.0, 9.0), random.uniform(62.0, 79.9), random.uniform(-180, 180), random.uniform(0, 2))
        for _ in range(own + opponents)
    ]
    return rows, [0] * own + [1] * opponents, list(random.uniform(-180.0, 180.0, own + opponents))


@st.composite
def fleets(draw, most=5, spread_m=20.0, kinds=BOATS, least=1):
    """Fleets of 1 to ``most`` boats of any kinds, near one another or on one point, some of them ours."""
    n = draw(st.integers(least, most))
    names = draw(st.lists(st.sampled_from(kinds), min_size=n, max_size=n))
    place = st.one_of(st.floats(-spread_m, spread_m), st.sampled_from([0.0, 1.0]))
    rows = [
        (
            draw(place),
            draw(place),
            draw(st.one_of(st.floats(-180.0, 180.0), st.sampled_from([0.0, 90.0, 180.0, -180.0]))),
            draw(st.floats(0.0, 1.0)) * get_platform(name).max_speed_mps,
        )
        for name in names
    ]
    return fleet_of(
        rows,
        draw(st.lists(st.integers(0, 1), min_size=n, max_size=n)),
        names,
        controlled=draw(st.lists(st.booleans(), min_size=n, max_size=n)),
    )


def finite_commands(n):
    """Commands a policy may give, sensible and not so."""
    speed = st.one_of(st.floats(0.0, 3.0), st.floats(-20.0, 20.0))
    heading = st.one_of(st.floats(-180.0, 180.0), st.floats(-1000.0, 1000.0))
    return st.lists(st.tuples(speed, heading), min_size=n, max_size=n)


def any_commands(n):
    """Commands of any floats there are."""
    value = st.one_of(st.floats(), st.floats(-180.0, 180.0))
    return st.lists(st.tuples(value, value), min_size=n, max_size=n)


def distances(position):
    """Distances of all pairs, (..., n, n), m; infinite on the diagonal."""
    gap = np.linalg.norm(position[..., :, None, :] - position[..., None, :, :], axis=-1)
    n = position.shape[-2]
    gap[..., range(n), range(n)] = np.inf
    return gap


def bits(array):
    """The bytes of an array: equal only when every bit is, signs of zeros included."""
    return np.ascontiguousarray(array, dtype=np.float64).tobytes()


def signatures():
    """Number of machine codes of every function there is."""
    found = {}
    for name, module in list(sys.modules.items()):
        if name.startswith("steerclear."):
            for entry in vars(module).values():
                if isinstance(entry, CPUDispatcher):
                    found[f"{entry.__module__}.{entry.__name__}"] = len(entry.signatures)
    return found
