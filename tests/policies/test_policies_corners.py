"""Under rules with corners the scripted teams bring the flag to a corner, and capture."""

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv

TEAMS = (("agent_0", "agent_1", "agent_2"), ("agent_3", "agent_4", "agent_5"))


@pytest.mark.parametrize("name", ["medium", "hard"])  # easy does not get past boats that lie on its way
def test_a_team_against_boats_that_hold_captures_at_corners(name):
    core = BatchedMctf(GameConfig.preset("mctf2026", max_time_s=400.0, power_play_share=0.0), 2, seed=1)
    teams = [policies.make_batch(name), policies.make_batch("hold")]
    for team, policy in enumerate(teams):
        policy.reset(core, team, 0)
    for _ in range(400):
        core.step(np.concatenate([policy.act(core, team) for team, policy in enumerate(teams)], axis=1))
    assert (core.captures[:, 0] >= 1).all()


def test_a_carrier_steers_for_the_nearer_corner_of_its_own_side():
    env = MctfEnv(GameConfig.preset("mctf2026"), seed=0)
    places = {"agent_0": (120.0, 60.0), "agent_5": (40.0, 20.0)}
    for team, carrier, corner in ((0, "agent_0", (10.0, 70.0)), (1, "agent_5", (150.0, 10.0))):
        policy = policies.make("easy", roles="attack")
        env.reset(options={"init_dict": {"agent_position": places, "agent_has_flag": {carrier: True}}})
        policy.reset(env, TEAMS[team], 0)
        medium = policies.make("medium", roles="attack", reach_m=1.0)
        medium.reset(env, TEAMS[team], 0)
        _, bearing = medium.act({}, {})[carrier]
        player = env.players[carrier]
        towards = np.degrees(np.arctan2(corner[0] - player.pos[0], corner[1] - player.pos[1])) - player.heading
        assert (bearing - towards + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=1e-6)
