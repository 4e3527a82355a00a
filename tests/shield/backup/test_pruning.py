"""Pairs too far apart to matter are left out; nothing changes when they are not."""

import math

import numpy as np
import pytest
from shield_loops import packed, scattered, step_all
from shield_scenes import bits, fleet_of, relative
from stages import decided, screened, screened_with_all_pairs, stages_of
from steerclear.shield import Reason, Shield, ShieldConfig, Surroundings
from steerclear.shield.platforms import PLATFORMS, get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import cruise


@pytest.mark.parametrize("name", sorted(PLATFORMS))
def test_no_boat_goes_faster_over_ground_than_the_proof_says(name):
    platform = get_platform(name)
    params, row = cruise(platform)
    random = np.random.default_rng(5)
    farthest = 0.0
    for _ in range(200):
        command = np.array([[[random.uniform(0.0, 2.0) * platform.max_speed_mps, random.uniform(-180.0, 180.0)]]])
        if random.random() < 0.5:
            command[..., 1] = 0.0
        for _ in range(random.integers(1, 30)):
            before = row[: L.Y + 1].copy()
            step_all(params[None], row[None, None], command, 0.1)
            farthest = max(farthest, math.dist(before, row[: L.Y + 1]))
    assert farthest <= platform.fastest_mps(0.1) * 0.1 * (1.0 + 1e-12)
    assert platform.fastest_mps(0.1) <= 1.1 * platform.max_speed_mps


@pytest.mark.parametrize("certificate", ["turning_circle", "value_table"])
@pytest.mark.parametrize("adversary_horizon_s", [0.0, 4.0, np.inf])
def test_decisions_are_the_same_when_no_pair_is_left_out(certificate, adversary_horizon_s):
    """Clusters of boats, far from one another: some pairs matter, some do not."""
    random = np.random.default_rng(11)
    config = ShieldConfig(opponent_model=certificate, adversary_horizon_s=adversary_horizon_s)
    platforms, team = ["heron"] * 4 + ["surveyor"] * 3, [0, 0, 1, 1, 0, 1, 1]
    skipped = changed = 0
    for _ in range(60):
        state = scattered(random, 1, platforms, 14.0, gap_m=2.6)[0]
        state[4:, L.X] += random.uniform(60.0, 200.0)
        state[2, L.Y] += random.choice([0.0, 90.0])
        wanted = np.column_stack([random.uniform(0.0, 2.0, 7), random.uniform(-90.0, 90.0, 7)])
        some, every = stages_of(config, state, platforms, team), stages_of(config, state, platforms, team)
        screened(some, wanted)
        few_commands, few_reasons = decided(some)
        _, left_out = screened_with_all_pairs(every, wanted)
        all_commands, all_reasons = decided(every)
        assert few_reasons.tolist() == all_reasons.tolist()
        np.testing.assert_allclose(few_commands, all_commands, rtol=0, atol=1e-9)
        skipped, changed = skipped + left_out, changed + int((few_reasons[some.ours] != 0).any())
    assert skipped > 100
    assert changed > 10


@pytest.mark.parametrize("away_m", [200.0, 300.0, 1e4, 1e8])
@pytest.mark.parametrize("team", [0, 1])
def test_a_boat_far_away_never_changes_a_decision(away_m, team):
    random = np.random.default_rng(3)
    for _ in range(20):
        rows = [(0.0, 0.0, 0.0, 2.0), (*random.uniform(-8.0, 8.0, 2), random.uniform(-180.0, 180.0), 2.0)]
        wanted = [(random.uniform(0.0, 2.0), random.uniform(-180.0, 180.0)) for _ in range(3)]
        bearing = random.uniform(0.0, 2.0 * np.pi)
        far = (away_m * np.sin(bearing), away_m * np.cos(bearing), random.uniform(-180.0, 180.0), 2.0)
        alone = Shield().decide(fleet_of(rows, [0, 1]), relative(*wanted[:2]))
        crowd = Shield().decide(fleet_of([*rows, far], [0, 1, team]), relative(*wanted))
        assert bits(alone.filtered.values) == bits(crowd.filtered.values[:2])
        assert alone.reason.tolist() == crowd.reason[:2].tolist()
        assert alone.safety_margin_m[0] == crowd.safety_margin_m[0]


def test_a_boat_just_within_reach_is_looked_at():
    """So that the test above does not pass because nobody ever is."""
    rows = [(0.0, 0.0, 0.0, 2.0), (0.0, 8.0, 180.0, 2.0)]
    near = Shield().decide(fleet_of(rows, [0, 1]), relative((2.0, 0.0), (2.0, 0.0)))
    assert near[0].active_constraints == ("boat_1",)
    assert packed(["heron"]).shape == (1, L.N_PARAM)


def test_hundreds_of_boats_that_all_have_to_move_are_decided_for():
    """More rows than a program may have: the ladder takes over, and says so for every boat."""
    n = 620
    rows = [(200.0 * (i % 25), 200.0 * (i // 25), 0.0, 5.0) for i in range(n)]
    shield = Shield(surroundings=Surroundings(keep_out=[(2500.0, 2500.0, 1e5)]))
    decisions = shield.decide(fleet_of(rows, [0] * n, "si"), relative(*[(10.0, 0.0)] * n))
    assert np.isfinite(decisions.filtered.values).all()
    assert (decisions.reason != Reason.PASSED).all()
