"""What is feared of opponents is kept by a condition of its own: beside a teammate, and of each opponent."""

import math

import numpy as np
import pytest
from shield_loops import packed, step_all
from shield_scenes import fleet_of, relative
from steerclear.shield import Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.filter.nominal import set_required_margins
from steerclear.shield.platforms import layout as L
from steerclear.shield.workspace import N_MEMORY

CAP_M = ShieldConfig().margin_cap_m


def remembered(rows, team, platform):
    """Margins kept after one decision of boats that want to go straight on, and the next decision's targets."""
    fleet = fleet_of(rows, team, platform)
    fleet.state[:, L.THRUST] = 100.0
    shield = Shield(profile="ramming")
    decisions = shield.decide(fleet, relative(*[(row[3], 0.0) for row in rows]))
    scene = shield._deciders.scene
    set_required_margins(scene)
    return decisions, scene.memory[:, N_MEMORY:], scene


@pytest.mark.parametrize(("platform", "top", "ahead_m"), [("surveyor", 3.0, 33.0), ("heron", 2.0, 11.0)])
def test_a_team_mate_close_by_does_not_hide_the_fear(platform, top, ahead_m):
    rows = [(0, 0, 0, top), (2.7, 0, 0, top), (0, ahead_m, 180, top)]
    decisions, memory, scene = remembered(rows, [0, 0, 1], platform)
    assert decisions.safety_margin_m[0] < 0.2  # of the teammate
    assert memory[0, 2] > decisions.safety_margin_m[0] + 0.1
    decay = math.exp(-0.1 * (0.3 if platform == "surveyor" else 1.0))
    assert scene.threat_target_m[0, 2] == pytest.approx(decay * min(memory[0, 2], CAP_M))
    assert scene.target[0] == pytest.approx(decay * decisions.safety_margin_m[0])


@pytest.mark.parametrize("platform", ["surveyor", "heron"])
def test_after_a_breach_nothing_is_asked_that_was_not_there(platform):
    rows = [(0, 0, 0, 1.0), (0, 2.3, 180, 1.0), (12.0, 12.0, 225.0, 1.0)]
    _, memory, scene = remembered(rows, [0, 1, 1], platform)
    assert (memory[0] <= 0.0).all()
    np.testing.assert_array_equal(scene.threat_target_m[0], 0.0)


def test_two_side_by_side_do_not_let_a_line_of_opponents_come_up():
    """Boats of ours abeam of each other, told to hold on, and three opponents abreast that steer for them."""
    games, team = 8, (0, 0, 1, 1, 1)
    random, state = np.random.default_rng(3), np.zeros((8, 5, L.N_STATE))
    for game in state:
        aside = random.uniform(-6.0, 6.0)
        game[:, L.X] = [0.0, 2.9, aside - 6.0, aside, aside + 6.0]
        game[2:, L.Y], game[2:, L.HEADING] = random.uniform(42.0, 55.0), -180.0
        game[:2, L.SPEED], game[2:, L.SPEED] = random.uniform(1.6, 3.0), 2.0
        game[:, L.THRUST] = 100.0
    shield = BatchedShield(ShieldConfig(), games, ("surveyor",) * 5, team)
    ours, closest = np.tile(np.array(team) == 0, (games, 1)), np.full(games, math.inf)
    for _ in range(350):
        wanted = np.full((games, 5, 2), [3.0, 0.0])
        way = state[:, :1, :2] - state[:, 2:, :2]
        bearing = np.degrees(np.arctan2(way[..., 0], way[..., 1]))
        wanted[:, 2:, 1] = (bearing - state[:, 2:, L.HEADING] + 180.0) % 360.0 - 180.0
        step_all(packed(["surveyor"] * 5), state, shield.decide(state, wanted, ours), 0.1)
        gaps = np.linalg.norm(state[:, :2, None, :2] - state[:, None, 2:, :2], axis=-1)
        closest = np.minimum(closest, gaps.min(axis=(1, 2)))
    assert (closest >= 2.5).all()
