"""Kernels that count no references do what counting ones do, and leave arrays to their callers."""

import sys

import numpy as np
from numba import njit
from shield_scenes import bits, head_on, relative
from stages import screened, stages_of
from steerclear.shield import Shield, ShieldConfig, Surroundings
from steerclear.shield.backup.rank import OBSTACLES, OPPONENTS, WORST, Rank, rank_path
from steerclear.shield.platforms import layout as L


def scene(seed):
    """A boat of ours among four opponents, screened."""
    random = np.random.default_rng(seed)
    state = np.zeros((5, L.N_STATE))
    state[:, [L.X, L.Y]] = random.uniform(-12.0, 12.0, (5, 2))
    state[:, L.HEADING], state[:, L.SPEED] = random.uniform(-180.0, 180.0, 5), random.uniform(1.0, 2.0, 5)
    state[:, L.THRUST] = 100.0
    platforms = ["heron", "surveyor", "heron", "si", "heron"]
    at = stages_of(ShieldConfig(), state, platforms, [0, 1, 1, 1, 1], Surroundings(circles=[(3.0, 3.0, 1.0)]))
    screened(at, np.column_stack([np.full(5, 2.0), random.uniform(-90.0, 90.0, 5)]))
    return at


def test_counting_references_changes_no_bit():
    counted = njit(nogil=True, error_model="numpy")(rank_path.py_func)
    assert counted.targetoptions.get("_nrt", True)
    ranks = []
    for seed in range(40):
        at, same = scene(seed), scene(seed)
        for best in (WORST, Rank(OBSTACLES, -100.0), Rank(OPPONENTS, 0.0)):
            ranks.append(rank_path(0, 0, best, at.scene))
            assert bits(ranks[-1]) == bits(counted(0, 0, best, same.scene))
            assert bits(at.work.clear) == bits(same.work.clear)
    assert len(set(ranks)) > 20


def test_arrays_stay_their_callers():
    """No reference is lost or gained, in a decision that passes or in one that goes all the way down."""
    shield, wanted = Shield(), relative((2.0, 0.0), (2.0, 0.0))
    fleets = [head_on(gap_m) for gap_m in (30.0, 5.3)]
    assert [shield.decide(fleet, wanted)[0].reason.name for fleet in fleets] == ["PASSED", "BACKUP"]
    deciders = shield._deciders
    scene = deciders._desk.scene
    parts = scene.memory, scene.work, scene.plan, scene.boats, deciders.asked, deciders.decided, deciders.memory
    arrays = [array for part in parts for array in part]
    arrays += [array for fleet in fleets for array in (fleet.state, fleet.team, fleet.controlled)]
    arrays += [wanted.values, deciders.pending]
    arrays = [array for array in arrays if isinstance(array, np.ndarray)]
    before = [sys.getrefcount(array) for array in arrays]
    for k in range(100):
        shield.decide(fleets[k % 2], wanted)
    assert [sys.getrefcount(array) for array in arrays] == before
    assert len(arrays) > 50
