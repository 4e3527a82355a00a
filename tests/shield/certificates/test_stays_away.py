"""Hunters that cannot come near, wherever they steer, are not run through; those that are say the same."""

import math

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.certificates.clearance import MARGIN
from steerclear.shield.certificates.hunters import RUDDERS, _run_hunter, clear_of_hunter, closing
from steerclear.shield.certificates.laying import lay_path
from steerclear.shield.certificates.manoeuvre import look_around
from steerclear.shield.certificates.pursuer import stays_away
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

CAP_M = 2.0


def scene(own, other, random):
    """A boat on an escape, laid into slot 0, and an opponent somewhere about it."""
    angle, far = random.uniform(-math.pi, math.pi), random.uniform(4.0, 90.0)
    state = np.zeros((2, L.N_STATE))
    for row, name, x, y in ((0, own, 0.0, 0.0), (1, other, far * math.sin(angle), far * math.cos(angle))):
        top = get_platform(name).max_speed_mps
        state[row] = fresh_state(x, y, random.uniform(-180.0, 180.0), random.uniform(0.0, 1.0) * top)
        state[row, [L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = random.uniform(0.0, 100.0), 0.0, 0.0
    at = stages_of(ShieldConfig(certificate="turning_circle"), state, (own, other), (0, 1))
    look_around(at.state, np.zeros(2), at.ours, at.boats, at.tuning, at.work)
    side, turn = random.choice([-1.0, 1.0]), random.choice([0.0, 45.0, 120.0, 180.0])
    lay_path(0, 0, side, turn, get_platform(own).max_speed_mps, 0, at.state, at.boats, at.tuning, at.work)
    return at


def margins_of_all_runs(at, lasts):
    """Margins of all manners of hunting, each run through."""
    closely = min(lasts, int(at.boats.hunt_samples[0] + at.boats.thrust_samples[0]))
    for manner in range(2 * (len(RUDDERS) - 1)):
        _run_hunter(0, 1, 0, manner, lasts, closely, 1.0, False, at.state, at.boats, at.tuning, at.work, -1e6, CAP_M)
        yield at.work.spare[MARGIN]


def is_away(at, lasts):
    way = max(at.boats.params[1, L.MAX_SPEED], at.state[1, L.SPEED]) * at.boats.sample_s
    closing_m, radius_m = closing(0, 1, at.state, at.boats, at.tuning), at.work.radius[0, 1]
    return stays_away(at.work.path[0], *at.work.course[1, :2], way, lasts, closing_m, radius_m, CAP_M)


@pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("heron", "surveyor"), ("surveyor", "heron")])
def test_no_run_comes_near_who_stays_away(own, other):
    random, away, pruned = np.random.default_rng(8), 0, 0
    for _ in range(300):
        at = scene(own, other, random)
        if not at.work.near[0, 1]:
            continue
        lasts = int(at.boats.hunt_samples[0] + at.boats.chase_samples[0, 1])
        capped = all(margin == CAP_M for margin in margins_of_all_runs(at, lasts))
        away += capped
        if is_away(at, lasts):
            assert capped
            pruned += 1
    assert pruned > 0.7 * away > 20, "most of what can be told without a run is"


def test_who_may_come_near_is_run_through():
    """Close by: the answer is that of the runs, below the cap."""
    at = scene("heron", "surveyor", np.random.default_rng(1))
    at.state[1, [L.X, L.Y]] = at.state[0, [L.X, L.Y]] + [0.0, 4.0]
    look_around(at.state, np.zeros(2), at.ours, at.boats, at.tuning, at.work)
    clear_of_hunter(0, 1, 0, at.state, at.ours, at.boats, at.tuning, at.work, -1e6, CAP_M)
    assert at.work.out[MARGIN] < CAP_M
    assert not is_away(at, int(at.boats.hunt_samples[0]))


def test_a_path_that_is_no_number_is_not_away():
    assert not stays_away(np.full((20, 2), math.nan), 0.0, 0.0, 0.1, 19, 0.3, 2.5, CAP_M)
