"""PettingZoo's, Gymnasium's and Stable-Baselines3's own checks of every wrapper we offer."""

import warnings

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_space_limit, data_equivalence
from gymnasium.vector import VectorEnv
from gymnasium.wrappers.vector import RecordEpisodeStatistics
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield
from steerclear.shield.wrappers import MctfVectorEnv, ShieldedParallelEnv
from wrapped_games import SMALL, Batch, sb3_front

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # pettingzoo.test imports games of its own the old way
    from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test
from pettingzoo.utils.conversions import parallel_to_aec

SHORT = GameConfig.preset("aamas2024", max_time_s=3.0, default_start=False)


def one(config=SHORT):
    return ShieldedParallelEnv(MctfEnv(config), Shield())


def both(config=SHORT):
    return ShieldedParallelEnv(one(config), Shield(), "red")


@pytest.mark.parametrize("build", [one, both])
def test_pettingzoo(build):
    parallel_api_test(build(), num_cycles=40)
    parallel_seed_test(lambda: build(SMALL), num_cycles=5)


def test_pettingzoo_in_turns():
    api_test(parallel_to_aec(one()), num_cycles=40)
    seed_test(lambda: parallel_to_aec(one(SMALL)), num_cycles=5)


def test_gymnasium_spaces_and_seeds_of_the_vector_environment():
    envs = [Batch(MctfVectorEnv).front for _ in range(2)]
    assert isinstance(envs[0], VectorEnv)
    check_space_limit(envs[0].single_observation_space, "observation")
    seen = []
    for env in envs:
        assert env.observation_space.shape == (env.num_envs, *env.single_observation_space.shape)
        seen.append([env.reset(seed=3)])
        env.action_space.seed(0)
        for _ in range(10):
            outcome = env.step(env.action_space.sample())
            assert env.observation_space.contains(outcome[0])
            seen[-1].append(outcome)
    assert data_equivalence(*seen)


def test_gymnasium_wrappers_count_episodes_of_the_vector_environment():
    env = RecordEpisodeStatistics(Batch(MctfVectorEnv).front)
    env.reset(seed=0)
    for _ in range(300):
        *_, infos = env.step(np.full(env.num_envs, 16))
    assert (infos["episode"]["l"] == 300).all()


def test_stable_baselines_learns_in_its_environment():
    pytest.importorskip("stable_baselines3")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # its own, of its own dependencies
        from stable_baselines3 import PPO
        from stable_baselines3.common.vec_env import VecMonitor

        env = VecMonitor(Batch(sb3_front).front)
        model = PPO("MlpPolicy", env, n_steps=8, batch_size=16, n_epochs=1, seed=0, device="cpu")
        model.learn(2 * 8 * env.num_envs)
    assert model.num_timesteps == 2 * 8 * env.num_envs
    observations = env.reset()
    actions, _ = model.predict(observations)
    assert env.action_space.contains(actions[0])
    assert env.step(actions)[0].shape == observations.shape
