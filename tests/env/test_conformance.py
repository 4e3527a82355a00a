"""PettingZoo's and Gymnasium's own checks of the environment."""

import itertools
import warnings
from dataclasses import replace

import numpy as np
import pytest
from gymnasium.spaces import Discrete
from gymnasium.spaces.utils import flatdim
from gymnasium.utils.env_checker import check_space_limit, data_equivalence
from steerclear.env import MctfEnv, mctf_v0
from steerclear.env.config import GameConfig

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # pettingzoo.test imports games of its own the old way
    from pettingzoo.test import parallel_api_test, parallel_seed_test

ISLANDS = {"circle": [(2.0, (40.0, 10.0))], "polygon": [((38, 28), (42, 28), (40, 34))]}
CONFIGS = {
    "aamas2024": GameConfig.preset("aamas2024", max_time_s=5.0),
    "mctf2025": GameConfig.preset("mctf2025"),
    "one_each": GameConfig.preset("aamas2024", team_size=1, default_start=False),
    "islands": GameConfig.preset("aamas2024", obstacles=ISLANDS, tag_on_collision=True),
    "mixed": GameConfig.preset("mctf2025", team_size=2, platforms=("heron", "si", "large_usv", "di")),
}


@pytest.mark.parametrize("name", CONFIGS)
@pytest.mark.parametrize("kind", ["discrete", "continuous", "afp"])
def test_pettingzoo_parallel_api(name, kind):
    """The suite asserts and warns itself, and warnings are errors here: see the broken games below."""
    parallel_api_test(MctfEnv(CONFIGS[name], action_kind=kind), num_cycles=120)


@pytest.mark.parametrize("name", ["mctf2025", "one_each"])
def test_pettingzoo_parallel_seed(name):
    """The suite asserts itself, but compares the first step only (``any`` of a dict is of its keys); more below."""
    parallel_seed_test(lambda: mctf_v0.parallel_env(CONFIGS[name]), num_cycles=60)


class Forgetful(MctfEnv):
    """Leaves out one boat's observation."""

    def step(self, actions):
        observations, *rest = super().step(actions)
        return dict(list(observations.items())[1:]), *rest


class Copying(MctfEnv):
    """Gives out a new space each time."""

    def action_space(self, agent):
        return Discrete(17)


class Undying(MctfEnv):
    """Ends the game for one boat alone, and plays on with it."""

    def step(self, actions):
        observations, rewards, terminated, *rest = super().step(actions)
        return observations, rewards, terminated | {self.possible_agents[0]: True}, *rest


class Unseeded(MctfEnv):
    """Starts elsewhere each time, whatever the seed."""

    drawn = itertools.count()

    def reset(self, seed=None, options=None):
        return super().reset(seed=next(self.drawn), options=options)


@pytest.mark.parametrize(
    ("broken", "words"), [(Forgetful, "not given observation"), (Copying, "same space object"), (Undying, "!=")]
)
def test_the_api_suite_notices_broken_games(broken, words):
    with pytest.raises((AssertionError, UserWarning), match=words):
        parallel_api_test(broken(CONFIGS["one_each"]), num_cycles=5)


def test_the_seed_suite_notices_a_game_without_seed():
    with pytest.raises(AssertionError, match="Incorrect observations"):
        parallel_seed_test(lambda: Unseeded(CONFIGS["one_each"]), num_cycles=5)


# the space is Pyquaticus' own: m/s and deg, not [-1, 1]
@pytest.mark.filterwarnings("ignore:.*we recommend using a symmetric and normalized space.*:UserWarning")
@pytest.mark.parametrize("name", CONFIGS)
@pytest.mark.parametrize("kind", ["discrete", "continuous", "afp"])
def test_gymnasium_spaces(name, kind):
    env = MctfEnv(CONFIGS[name], action_kind=kind)
    observations, _ = env.reset(seed=0)
    for agent in env.agents:
        check_space_limit(env.observation_space(agent), "observation")
        check_space_limit(env.action_space(agent), "action")
        assert env.observation_space(agent) is env.observation_space(agent)
        assert flatdim(env.observation_space(agent)) == observations[agent].size
        assert observations[agent].dtype == env.observation_space(agent).dtype == np.float32
        assert env.observation_space(agent).contains(observations[agent])


@pytest.mark.parametrize("name", ["mctf2025", "one_each", "mixed"])
def test_the_same_seed_plays_the_same_game(name):
    def play(seed):
        env = MctfEnv(replace(CONFIGS[name], default_start=False))
        seen = [env.reset(seed=seed)]
        random = np.random.default_rng(0)
        for _ in range(60):
            seen.append(env.step({agent: int(random.integers(17)) for agent in env.agents}))
        return seen

    same, again, other = play(3), play(3), play(4)
    assert data_equivalence(same, again)
    assert not data_equivalence([step[0] for step in same], [step[0] for step in other])
