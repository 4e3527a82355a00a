"""The rank of a manoeuvre beside obstacles and opponents is what its path says, told by numpy."""

import math

import numpy as np
import pytest
from stages import screened, stages_of
from steerclear.shield import ShieldConfig, Surroundings
from steerclear.shield.backup.rank import (
    ALL,
    BOATS,
    LATER_WORTH_M,
    NOTHING,
    OBSTACLES,
    SAME_M,
    WORST,
    Rank,
    better,
    rank_path,
)
from steerclear.shield.backup.rollout import lay_path
from steerclear.shield.platforms.usv import fresh_state

MANOEUVRES = [(side, turn, 1.5) for side in (1.0, -1.0) for turn in (0.0, 45.0, 90.0, 180.0)] + [(1.0, 0.0, 0.0)]


def beside(circles, others=()):
    """Screened: a heron at the origin on its way north, among circles and opponents (x, y, heading)."""
    rows = [fresh_state(0.0, 0.0, 0.0, 1.5)] + [fresh_state(x, y, heading, 2.0) for x, y, heading in others]
    n = len(rows)
    at = stages_of(ShieldConfig(), np.array(rows), ["heron"] * n, [0] + [1] * (n - 1), Surroundings(circles=circles))
    screened(at, np.array([[1.5, 0.0]] * n))
    return at


def ranked(at, manoeuvre, best=WORST):
    """Rank of a manoeuvre of boat 0 one step on, and its path, (samples, 2), until a half turn could be over."""
    lay_path(0, 0, *manoeuvre, 1, at.scene)
    rank = Rank(*rank_path(0, 0, best, at.scene))
    return rank, at.path[0, : at.boats.static_samples[0] + 1].copy()


def depth_of(at, path):
    """Least clearance of a path from the circles as they are kept, what is short now excused, and its first sample."""
    margins = []
    for x, y, radius in at.static.circles:
        margins.append(np.hypot(path[:, 0] - x, path[:, 1] - y) - radius - min(0.0, math.hypot(x, y) - radius))
    least = np.min(margins, axis=0)
    return least.min(), int(np.argmin(least))


@pytest.mark.parametrize(
    "circles", [[(0.0, 6.0, 4.0)], [(2.0, 5.0, 4.0), (-6.0, 3.0, 3.5)], [(0.0, 30.0, 27.0)], [(0.0, 4.0, 4.5)]]
)
def test_a_path_into_an_obstacle_is_worth_its_depth_and_a_trifle_for_its_time(circles):
    at, found = beside(circles), set()
    for manoeuvre in MANOEUVRES:
        rank, path = ranked(at, manoeuvre)
        depth_m, sample = depth_of(at, path)
        found.add(rank.kept == BOATS)
        if depth_m < -1e-9:
            assert rank.kept == BOATS
            assert rank.worth_m == pytest.approx(depth_m + LATER_WORTH_M * sample, abs=LATER_WORTH_M)
        else:
            assert rank.kept > BOATS
    assert True in found


def test_what_matters_more_comes_first():
    """Into a boat that holds its course, into a circle, before a pursuer: in this order, however deep."""
    into_boat, _ = ranked(beside([], [(0.0, 3.0, 180.0)]), (1.0, 0.0, 1.5))
    into_circle, _ = ranked(beside([(0.0, 40.0, 37.0)]), (1.0, 0.0, 1.5))
    pursued, _ = ranked(beside([], [(7.0, 2.0, 0.0)]), (1.0, 90.0, 1.5))
    free, _ = ranked(beside([]), (1.0, 0.0, 1.5))
    assert [rank.kept for rank in (into_boat, into_circle, pursued, free)] == [NOTHING, BOATS, OBSTACLES, ALL]
    order = [WORST, into_boat, into_circle, pursued, free]
    assert all(better(order[k + 1], order[k]) and not better(order[k], order[k + 1]) for k in range(4))


def test_rounding_is_no_better():
    for kept in (NOTHING, BOATS, OBSTACLES, ALL):
        assert not better(Rank(kept, 1.0 + 0.5 * SAME_M), Rank(kept, 1.0))
        assert better(Rank(kept, 1.0 + 2.0 * SAME_M), Rank(kept, 1.0))


@pytest.mark.parametrize("kept", [NOTHING, BOATS, OBSTACLES, ALL])
def test_no_number_is_never_better(kept):
    assert not better(Rank(kept, math.nan), Rank(kept, -1e9))
