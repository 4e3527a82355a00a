"""Pursuers that cannot come near, wherever they steer, are not rolled out; those that are say the same."""

import math

import numpy as np
import pytest
from stages import stages_of
from steerclear.shield import ShieldConfig
from steerclear.shield.backup.paths import READY_SAMPLE
from steerclear.shield.backup.rollout import lay_path
from steerclear.shield.barriers import pursuit
from steerclear.shield.barriers.neighbours import find_neighbours
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import fresh_state

CAP_M, NO_FLOOR = 2.0, -1e6
PAIRS = pytest.mark.parametrize(("own", "other"), [("heron", "heron"), ("heron", "surveyor"), ("surveyor", "heron")])


def scene(own, other, random):
    """A boat on a backup, rolled out into slot 0, and an opponent somewhere about it."""
    angle, far = random.uniform(-math.pi, math.pi), random.uniform(4.0, 90.0)
    state = np.zeros((2, L.N_STATE))
    for row, name, x, y in ((0, own, 0.0, 0.0), (1, other, far * math.sin(angle), far * math.cos(angle))):
        top = get_platform(name).max_speed_mps
        state[row] = fresh_state(x, y, random.uniform(-180.0, 180.0), random.uniform(0.0, 1.0) * top)
        state[row, [L.THRUST, L.SPEED_ERROR, L.HEADING_ERROR]] = random.uniform(0.0, 100.0), 0.0, 0.0
    at = stages_of(ShieldConfig(profile="ramming", opponent_model="turning_circle"), state, (own, other), (0, 1))
    find_neighbours(at.scene)
    side, turn = random.choice([-1.0, 1.0]), random.choice([0.0, 45.0, 120.0, 180.0])
    lay_path(0, 0, side, turn, get_platform(own).max_speed_mps, 0, at.scene)
    return at


def lasting(at):
    """Samples the boat is followed closely for, and those the pursuit lasts."""
    ready, closely = int(at.ready[0, READY_SAMPLE]), int(at.boats.pursuit_samples[0] + at.boats.thrust_samples[0])
    if ready >= 0:
        closely = min(closely, ready + int(at.boats.pursuit_samples[0]))
    return closely, closely + int(at.boats.chase_samples[0, 1])


def margins_of_all_runs(at):
    """Margins of all manners of pursuing that count, each rolled out."""
    closely, lasts = lasting(at)
    run, rudders = pursuit._pursuit_of(0, 1, 0, lasts, closely, False, at.scene), len(pursuit.RUDDERS) - 1
    for manner in range(2 * (rudders if at.boats.granted_loss[1] > pursuit.FORGOTTEN_LOSS else 1)):
        yield pursuit._run_pursuer(0, 1, 0, manner, run, NO_FLOOR, at.scene)


def meetings(own, other, seed):
    """Those of 300 scenes in which the two can matter to each other."""
    random = np.random.default_rng(seed)
    scenes = (scene(own, other, random) for _ in range(300))
    return (at for at in scenes if at.near[0, 1])


@PAIRS
def test_the_clearance_from_a_pursuer_is_the_least_of_all_runs(own, other):
    """Also where no run is made, which is so of most that none comes near in; and it does come near in some."""
    pruned, away, short = 0, 0, 0
    for at in meetings(own, other, seed=9):
        least = min(margins_of_all_runs(at))
        assert pursuit.clear_of_pursuer(0, 1, 0, NO_FLOOR, at.scene) == least
        pruned += pursuit._never_near(0, 1, 0, lasting(at)[1], at.scene)
        away += least == CAP_M
        short += least < CAP_M
    assert pruned > 0.6 * away > 20
    assert short > 20


def test_a_path_that_is_no_number_is_not_away():
    at = scene("heron", "heron", np.random.default_rng(1))
    at.path[0] = math.nan
    assert not pursuit._never_near(0, 1, 0, 19, at.scene)
