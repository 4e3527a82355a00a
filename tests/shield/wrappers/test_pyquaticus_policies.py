"""Team policies of every kind that steerclear builds play behind a shield in a game of Pyquaticus' interface."""

import gymnasium
import numpy as np
import pytest
from steerclear import policies
from steerclear.shield import Shield
from steerclear.shield.exceptions import PolicyError
from test_wrappers_parallel import Quaticus

N_OBS = 4


class Game(Quaticus):
    """Observations and infos as that env gives them."""

    def __init__(self):
        super().__init__(gap_m=30.0)
        for player in self.players.values():
            player.get_max_speed = lambda: 2.0

    def observation_space(self, agent):
        return gymnasium.spaces.Box(-1.0, 1.0, (N_OBS,), np.float32)

    def seen(self):
        observations = {agent: np.zeros(N_OBS, np.float32) for agent in self.players}
        state = {(agent, "pos"): np.array(player.pos) for agent, player in self.players.items()}
        return observations, {agent: {"global_state": state, "unnorm_obs": {"x": 0.0}} for agent in self.players}


class Agent:
    def __init__(self, agent_id, env):
        self.agent_id = agent_id

    def compute_action(self, obs, info):
        return (1.0, 10.0) if (self.agent_id, "pos") in info[self.agent_id]["global_state"] else None


ENTRY = """
class solution:
    def compute_action(self, agent_id, full_obs_normalized, full_obs, global_state):
        assert full_obs[agent_id] == {"x": 0.0} and len(global_state[agent_id, "pos"]) == 2
        return 1.0, 10.0
"""


def model(path):
    """A Stable-Baselines3 model that was never trained."""
    sb3 = pytest.importorskip("stable_baselines3")

    class Toy(gymnasium.Env):
        observation_space = gymnasium.spaces.Box(-1.0, 1.0, (N_OBS,), np.float32)
        action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    sb3.PPO("MlpPolicy", Toy(), n_steps=8, batch_size=8, device="cpu").save(path)
    return f"sb3:{path}"


def entry(folder):
    folder.mkdir()
    (folder / "solution.py").write_text(ENTRY)
    return str(folder)


KINDS = {
    "callable": lambda place: policies.from_callable(lambda observation: (1.0, 10.0)),
    "agents": lambda place: policies.from_agents(Agent),
    "entry": lambda place: policies.make(entry(place / "team")),
    "sb3": lambda place: policies.make(model(place / "model.zip")),
}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.filterwarnings("default")  # of stable-baselines3 and torch
def test_it_plays_behind_a_shield(kind, tmp_path):
    game = Game()
    ids = [agent for agent, player in game.players.items() if int(getattr(player.team, "value", player.team)) == 0]
    team = Shield.for_game(game).wrap(KINDS[kind](tmp_path))
    team.reset(game, ids, 1)
    actions = team.act(*game.seen())
    assert set(actions) == set(ids)
    assert all(np.shape(action) == (2,) and np.isfinite(action).all() for action in actions.values())
    if kind != "sb3":
        assert [tuple(action) for action in actions.values()] == [(1.0, 10.0)] * len(ids)
    assert team.report().failures == ()


def test_a_scripted_policy_says_that_it_reads_our_own_game():
    team = Shield().wrap(policies.make("medium"))
    with pytest.raises(PolicyError, match="scripted policies need an MctfEnv, not Game"):
        team.reset(Game(), ["agent_0"], 1)
