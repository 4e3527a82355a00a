"""Environments of Pyquaticus: settings as meant or refused by name; policies of every kind play there."""

from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from steerclear import policies
from steerclear.shield import Reason, Shield
from steerclear.shield.exceptions import ConfigError, PolicyError, SteerclearError
from steerclear.shield.wrappers import ShieldedParallelEnv
from steerclear.shield.wrappers.pyquaticus import PyquaticusReader
from wrapped_games import STRAIGHT, Quaticus


def game(**settings):
    env = Quaticus(gap_m=30.0)
    for player in env.players.values():
        player.get_max_speed = lambda: 2.0
    vars(env).update(settings)
    return env


class Straight:
    """A team policy of the user's own."""

    def reset(self, env, agent_ids, seed):
        self.agent_ids = agent_ids

    def act(self, observations, infos):
        return dict.fromkeys(self.agent_ids, STRAIGHT)


def wrap_env(env):
    return ShieldedParallelEnv(env, Shield())


def wrap_policy(env):
    team = Shield().wrap(Straight())
    team.reset(env, ["agent_0"], 0)
    return team


REFUSED = [
    ({"gps_env": True}, "gps_env = True is not supported: .* web-Mercator .*; use gps_env=False"),
    ({"sim_speedup_factor": 2.5}, "sim_speedup_factor = 2.5 is not supported; give a whole number of steps, 1 or more"),
    ({"sim_speedup_factor": 0}, "sim_speedup_factor = 0 is not supported; give a whole number"),
    ({"dt": 0.5}, "for steps of 0.1 s .* by 0.5 s for each command; build it by Shield.for_game"),
    ({"dt": None}, "move by unknown s a step; give one with one step for all"),
    ({"dynamics": ["heron", "drone"]}, "unknown platform 'drone'; .*known platforms: "),
    ({"dynamics": ["heron"]}, "dynamics names 1 boats of 2; give one for each"),
    ({"config_dict": {"agent_radus": 1.0}}, "setting 'agent_radus' is not known here.*; did you mean agent_radius"),
    ({"config_dict": {"wind": 3.0}}, "setting 'wind' is not known here, so neither is what it does; remove it"),
]


@pytest.mark.parametrize("wrap", [wrap_env, wrap_policy])
@pytest.mark.parametrize(("settings", "words"), REFUSED)
def test_settings_that_would_be_misread_are_refused_by_name(wrap, settings, words):
    with pytest.raises(SteerclearError, match=words):
        wrap(game(**settings))
    wrap(game(gps_env=False, sim_speedup_factor=1, dt=0.1, config_dict={"tau": 0.1, "agent_radius": 2.0}))


@pytest.mark.parametrize(("settings", "words"), REFUSED[:4])
def test_settings_changed_after_wrapping_are_refused_at_the_next_reset(settings, words):
    env = wrap_env(game())
    vars(env.unwrapped).update(settings)
    with pytest.raises(ConfigError, match=words):
        env.reset(seed=0)


@pytest.mark.parametrize(
    ("changed", "words"),
    [
        ({"max_speed": 5.0}, "agent_1 is a heron with max_speed = 5.0, where the shield predicts one with 2.0; leave"),
        ({"turn_rate": 70}, "agent_1 is a heron with turn_rate = 70"),
        ({"thrust_map": np.array([[0, 100], [0, 5]])}, "agent_1 is a heron with thrust_map ="),
        ({"_pid_controllers": {"heading": SimpleNamespace(_kp=0.35)}}, "kp of its heading controller = 0.35"),
        ({"dt": 0.05}, r"move by \[0.05, 0.1\] s a step"),
    ],
)
def test_a_boat_that_is_not_as_foreseen_is_refused(changed, words):
    env = game()
    vars(env.players["agent_1"]).update(changed)
    with pytest.raises(ConfigError, match=words):
        wrap_env(env)


def test_boats_drawn_while_they_move_are_shielded_at_each_of_their_own_steps():
    env = game()
    for player in env.players.values():
        player.dt = 1 / 30
    with pytest.raises(ConfigError, match=r"by 0\.0333333 s for each command"):
        wrap_env(env)
    wrapped = ShieldedParallelEnv(env, Shield.for_game(env))
    wrapped.reset(seed=0)
    assert wrapped.shield.config.dt_s == pytest.approx(1 / 30)


@pytest.mark.parametrize(
    ("settings", "moves"),
    [
        ({"sim_speedup_factor": 10}, 10),
        ({"render_mode": "rgb_array", "num_renders_per_step": 3}, 3),
        ({"sim_speedup_factor": 4, "render_mode": "human", "num_renders_per_step": 3}, 12),
    ],
)
def test_a_policys_shield_is_told_of_commands_held_for_several_moves_and_that_of_an_env_decides_before_each(
    settings, moves
):
    assert wrap_policy(game(**settings)).shield.config.moves == moves
    assert wrap_policy(game(**settings)).shield.config.dt_s == pytest.approx(0.1 * moves)
    assert wrap_env(game(**settings)).shield.config.moves == 1


def test_the_distance_kept_is_the_sum_of_the_radii():
    assert wrap_env(game()).shield.config.separation_m == 4.0
    assert wrap_env(game(agent_radius=[1.0, 2.5])).shield.config.separation_m == 3.5
    assert wrap_policy(game()).shield.config.separation_m == 4.0
    assert Shield.for_game(game(agent_radius=[0.5, 0.75])).config.separation_m == 1.25


def test_obstacles_are_those_the_environment_has():
    circle, wall = (
        SimpleNamespace(radius=3, center_point=(40, 20)),
        SimpleNamespace(anchor_points=[(1, 2), (3, 4), (5, 0)]),
    )
    reader = PyquaticusReader(game(obstacles=[circle, wall]))
    around = reader.surroundings(0, keep_out=True)
    assert (around.circles, around.polygons) == (((40.0, 20.0, 3.0),), (((1.0, 2.0), (3.0, 4.0), (5.0, 0.0)),))
    assert reader.facts().distances()["obstacle_clearance_m"] == 2.0


def test_the_own_flags_circle_is_there_where_the_game_has_one():
    assert PyquaticusReader(game()).surroundings(1, keep_out=True).stops == ((140.0, 40.0, pytest.approx(5.1)),)
    assert PyquaticusReader(game()).surroundings(1, keep_out=False).stops == ()
    assert PyquaticusReader(game(flag_keepout_radius=0.0)).surroundings(1, keep_out=True).stops == ()


class Toggling(Quaticus):
    """Disables a boat in the step itself, before it moves."""

    def step(self, actions):
        self.players["agent_0"].is_disabled = True
        return super().step(actions)


def test_a_boat_disabled_within_the_step_is_not_told_to_have_passed():
    env = Toggling(gap_m=30.0)
    wrapped = ShieldedParallelEnv(env, Shield())
    wrapped.reset(seed=0)
    *_, infos = wrapped.step({"agent_0": STRAIGHT})
    assert infos["agent_0"]["shield"].reason == Reason.NOT_COVERED


def test_what_lacks_what_is_read_is_refused():
    env = game()
    del env.dynamics, env.flags
    with pytest.raises(
        ConfigError, match=r"Quaticus has no dynamics, flags; give a PyQuaticusEnv, or use Shield\.decide"
    ):
        wrap_env(env)


def test_a_wrapped_policy_answers_pairs_only_and_where_they_are_played():
    env = game(act_space_str={"agent_0": "discrete"}, act_space_checked={}, act_space_match={})
    team = wrap_policy(env)
    assert team.act({"agent_0": np.zeros(1)}, {})["agent_0"].tolist() == [2.0, 0.0]
    env.act_space_checked["agent_0"], env.act_space_match["agent_0"] = True, False
    team.act({"agent_0": np.zeros(1)}, {})
    env.act_space_match["agent_0"] = True
    words = "agent_0 has played discrete actions .*; build it with action_space='continuous', or shield the environment"
    with pytest.raises(ConfigError, match=words):
        team.act({"agent_0": np.zeros(1)}, {})
    with pytest.raises(ConfigError, match=words):
        wrap_policy(env)
    env.act_space_str["agent_0"] = "continuous"
    assert team.act({"agent_0": np.zeros(1)}, {})["agent_0"].tolist() == [2.0, 0.0]


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
