"""Pursuers that cannot come near, wherever they steer, are not run through; those that are say the same."""

import math

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.laying import lay_path
from steerclear.shield.backup.paths import READY_SAMPLE
from steerclear.shield.barriers.clearance import Search
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.barriers.opponents import (
    FORGOTTEN_LOSS,
    RUDDERS,
    _run_pursuer,
    clear_of_pursuer,
    closing,
    pursuit_of,
)
from steerclear.shield.barriers.pursuit import CHASE_STRIDE, Pursuer, Pursuit, roll_out_pursuer, stays_away
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

CAP_M = 2.0


def scene(own, other, random):
    """A boat on a backup, laid into slot 0, and an opponent somewhere about it."""
    angle, far = random.uniform(-math.pi, math.pi), random.uniform(4.0, 90.0)
    state = np.zeros((2, L.N_STATE))
    for row, name, x, y in ((0, own, 0.0, 0.0), (1, other, far * math.sin(angle), far * math.cos(angle))):
        top = get_platform(name).max_speed_mps
        state[row] = fresh_state(x, y, random.uniform(-180.0, 180.0), random.uniform(0.0, 1.0) * top)
        state[row, [L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = random.uniform(0.0, 100.0), 0.0, 0.0
    at = stages_of(ShieldConfig(profile="rammers", certificate="turning_circle"), state, (own, other), (0, 1))
    find_neighbours(at.scene)
    side, turn = random.choice([-1.0, 1.0]), random.choice([0.0, 45.0, 120.0, 180.0])
    lay_path(0, 0, side, turn, get_platform(own).max_speed_mps, 0, at.scene)
    return at


def followed(at):
    """Samples the boat is followed closely for, and those the pursuit lasts."""
    ready, closely = int(at.work.ready[0, READY_SAMPLE]), int(at.boats.pursuit_samples[0] + at.boats.thrust_samples[0])
    if ready >= 0:
        closely = min(closely, ready + int(at.boats.pursuit_samples[0]))
    return closely, closely + int(at.boats.chase_samples[0, 1])


def margins_of_all_runs(at):
    """Margins of all manners of pursuing that count, each run through."""
    closely, lasts = followed(at)
    pursuit, rudders = pursuit_of(0, 1, 0, lasts, closely, False, at.scene), len(RUDDERS) - 1
    for manner in range(2 * (rudders if at.boats.granted_loss[1] > FORGOTTEN_LOSS else 1)):
        yield _run_pursuer(0, 1, 0, manner, pursuit, at.scene, -1e6, CAP_M)[0]


def meetings(own, other, seed):
    """Those of 300 scenes in which the two can matter to each other."""
    random = np.random.default_rng(seed)
    for _ in range(300):
        at = scene(own, other, random)
        if at.work.near[0, 1]:
            yield at


def is_away(at, lasts):
    way = max(at.boats.params[1, L.MAX_SPEED], at.state[1, L.SPEED]) * at.boats.sample_s
    closing_m, radius_m = closing(0, 1, at.scene), at.work.radius[0, 1]
    return stays_away(at.work.path[0], *at.work.course[1, :2], way, lasts, closing_m, radius_m, CAP_M)


@pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("heron", "surveyor"), ("surveyor", "heron")])
def test_no_run_comes_near_who_stays_away(own, other):
    away, pruned = 0, 0
    for at in meetings(own, other, seed=8):
        capped = all(margin == CAP_M for margin in margins_of_all_runs(at))
        away += capped
        if is_away(at, followed(at)[1]):
            assert capped
            pruned += 1
    assert pruned > 0.6 * away > 20, "most of what can be told without a run is"


@pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("heron", "surveyor"), ("surveyor", "heron")])
def test_the_clearance_from_a_pursuer_is_the_least_of_all_runs(own, other):
    """Also where no run is made: over the whole pursuit, not a part of it."""
    short, late = 0, 0
    for at in meetings(own, other, seed=9):
        told = clear_of_pursuer(0, 1, 0, at.scene, -1e6, CAP_M)
        least = min(margins_of_all_runs(at))
        assert told == least
        short += least < CAP_M
        late += least < CAP_M and is_away(at, int(at.boats.pursuit_samples[0]) // 2)
    assert short > 20
    assert late > 5, "some come near in the second half of the pursuit only"


def test_a_stride_that_cuts_off_a_way_round_the_pursuer_counts():
    """Four samples round one that lies still, all far off: a pursuit in strides of four sees the chord, which is
    near."""
    closing_m, radius_m, far_m = 10.0, 2.5, 14.6
    angles = np.linspace(math.asin(4.45 / far_m), math.pi - math.asin(4.45 / far_m), CHASE_STRIDE + 1)
    own = far_m * np.column_stack([np.cos(angles), np.sin(angles)])
    assert (np.linalg.norm(np.diff(own, axis=0), axis=1) < closing_m).all()
    assert (np.linalg.norm(own, axis=1) > radius_m + CAP_M + closing_m).all()
    at_rest, end = Pursuer(0.0, 0.0, 0.0, 1.0, *(0.0,) * 6, False), np.zeros(5)
    pursuit = Pursuit(0.2, CHASE_STRIDE, CHASE_STRIDE, 0, 1.0, 1.0, False)
    margin_m, _ = roll_out_pursuer(own, at_rest, pursuit, Search(closing_m, radius_m, -1e6, CAP_M), end)
    assert margin_m < CAP_M
    assert not stays_away(own, 0.0, 0.0, 0.0, CHASE_STRIDE, closing_m, radius_m, CAP_M)


def test_who_may_come_near_is_run_through():
    """Close by: the answer is that of the runs, below the cap."""
    at = scene("heron", "surveyor", np.random.default_rng(1))
    at.state[1, [L.X, L.Y]] = at.state[0, [L.X, L.Y]] + [0.0, 4.0]
    find_neighbours(at.scene)
    assert clear_of_pursuer(0, 1, 0, at.scene, -1e6, CAP_M) < CAP_M
    assert not is_away(at, int(at.boats.pursuit_samples[0]))


def test_a_path_that_is_no_number_is_not_away():
    assert not stays_away(np.full((20, 2), math.nan), 0.0, 0.0, 0.1, 19, 0.3, 2.5, CAP_M)
