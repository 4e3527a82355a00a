"""PettingZoo's and Gymnasium's own checks of the environment."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from gymnasium.spaces.utils import flatdim
from gymnasium.utils.env_checker import check_space_limit, data_equivalence
from pettingzoo.utils import parallel_to_aec
from steerclear.env import MctfEnv, mctf_v0
from steerclear.env.config import GameConfig

with warnings.catch_warnings():
    warnings.simplefilter("ignore", DeprecationWarning)  # pettingzoo.test imports games of its own the old way
    from pettingzoo.test import parallel_api_test, parallel_seed_test, render_test

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
    """The suite asserts and warns itself, and warnings are errors here."""
    parallel_api_test(MctfEnv(CONFIGS[name], action_kind=kind), num_cycles=120)


@pytest.mark.parametrize("name", ["mctf2025", "one_each"])
def test_pettingzoo_parallel_seed(name):
    """The suite asserts itself, but compares the first step only (``any`` of a dict is of its keys); more below."""
    parallel_seed_test(lambda: mctf_v0.parallel_env(CONFIGS[name]), num_cycles=60)


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


def test_pettingzoo_render(monkeypatch):
    """The suite asserts itself; a picture must show something, too."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")

    def make(render_mode):
        return parallel_to_aec(MctfEnv(CONFIGS["one_each"], render_mode=render_mode))

    render_test(make, {"rgb_array": lambda picture: picture.std() > 5})
