import logging

import numpy as np
import pytest
from steerclear.env import MctfEnv, mctf_v0
from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import ConfigError, GameError

SMALL = GameConfig.preset("aamas2024", team_size=1, max_time_s=1.0)


def test_a_game_from_reset_to_the_end():
    env = mctf_v0.parallel_env(SMALL)
    assert env.agents == []
    observations, infos = env.reset(seed=1)
    assert set(observations) == set(infos) == {"agent_0", "agent_1"} == set(env.agents)
    for step in range(10):
        assert env.agents, step
        observations, rewards, terminated, truncated, infos = env.step(dict.fromkeys(env.agents, 4))
    assert truncated == {"agent_0": True, "agent_1": True}
    assert terminated == {"agent_0": False, "agent_1": False}
    assert rewards == {"agent_0": 0.0, "agent_1": 0.0}
    assert env.agents == []
    assert env.possible_agents == ["agent_0", "agent_1"]
    with pytest.raises(GameError, match="call reset"):
        env.step({})


def test_the_env_is_the_batched_core_with_one_game():
    env = MctfEnv(SMALL)
    env.reset(seed=0)
    assert env.core.n_games == 1
    observations, *_ = env.step({"agent_0": 2, "agent_1": (1.0, 30.0)})
    np.testing.assert_array_equal(observations["agent_1"], env.core.observations[0, 1])
    np.testing.assert_array_equal(env.view().state, env.core.state[0])


def test_observations_of_a_step_are_not_overwritten_by_the_next():
    env = MctfEnv(SMALL)
    first, _ = env.reset(seed=0)
    kept = first["agent_0"].copy()
    env.step({"agent_0": 2})
    np.testing.assert_array_equal(first["agent_0"], kept)


def test_boats_without_an_action_stop():
    env = MctfEnv(SMALL.replace(platforms="si"))
    env.reset(seed=0)
    before = env.view().position
    env.step({"agent_0": 4})
    moved = np.abs(env.view().position - before).sum(axis=1)
    assert moved[0] > 0.1
    assert moved[1] == 0.0


def test_a_filter_set_on_the_env_is_used():
    env = MctfEnv(SMALL)
    env.reset(seed=0)
    env.command_filter = lambda core, commands: commands * 0.0
    before = env.view().position
    env.step(dict.fromkeys(env.agents, 4))
    np.testing.assert_array_equal(env.view().position, before)


def test_a_reward_of_ones_own_sees_both_moments():
    def progress(agent_id, before, after):
        i = after.config.agent_ids.index(agent_id)
        return float(abs(after.position[i, 0] - before.position[i, 0]))

    env = MctfEnv(SMALL.replace(platforms="si"), reward=progress)
    env.reset(seed=0)
    _, rewards, *_ = env.step({"agent_0": 4})
    assert rewards["agent_0"] == pytest.approx(0.5)
    assert rewards["agent_1"] == 0.0


def test_unknown_reset_options_are_reported_and_near_misses_refused(caplog):
    env = MctfEnv(SMALL)
    with caplog.at_level(logging.WARNING):
        env.reset(options={"colour": "red"})
    assert "'colour' is not known" in caplog.text
    with pytest.raises(GameError, match="'init_dic'; did you mean 'init_dict'"):
        env.reset(options={"init_dic": {}})
    with pytest.raises(GameError, match="options is list"):
        env.reset(options=[1])


def test_bad_arguments_are_refused():
    with pytest.raises(ConfigError, match="unknown render_mode 'ascii'; choose one of human, rgb_array"):
        MctfEnv(SMALL, render_mode="ascii")
    with pytest.raises(ConfigError, match="unknown preset"):
        MctfEnv("aamas2042")


def test_rendering_without_a_mode_says_so(caplog):
    env = MctfEnv(SMALL)
    env.reset(seed=0)
    with caplog.at_level(logging.WARNING):
        assert env.render() is None
    assert "without a render_mode" in caplog.text


def test_filters_of_a_step_come_after_the_own_one_last_entered_first_and_are_gone_after_it():
    env, asked = MctfEnv("aamas2024"), []

    def named(name):
        return lambda core, commands: asked.append(name) or commands * 0.5

    env.command_filter = named("own")
    env.reset(seed=0)
    with env.filtered(named("outer")):
        with pytest.raises(GameError), env.filtered(named("inner")):
            env.step({"agent_99": 4})
        with env.filtered(named("inner")):
            env.step({})
        env.step({})
    env.step({})
    assert asked == ["own", "inner", "outer", "own", "outer", "own"]
