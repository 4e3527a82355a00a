"""A shield remembers the boats it decides for: serving two teams, or two games, in turn is refused, in any wrapper."""

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.wrappers import ShieldedParallelEnv
from wrapped_games import SMALL

OTHERS = "begun to serve another team or game"


def wrapped(env, shield, team):
    """A wrapped policy of one team, its game begun."""
    size = len(env.possible_agents) // 2
    policy = shield.wrap(policies.make("medium"))
    policy.reset(env, env.possible_agents[team * size : (team + 1) * size], seed=0)
    return policy


def test_one_shield_round_the_policies_of_both_teams_is_refused():
    env, shield = MctfEnv(SMALL), Shield()
    observations, infos = env.reset(seed=0)
    blue, red = wrapped(env, shield, 0), wrapped(env, shield, 1)
    red.act(observations, infos)
    with pytest.raises(ConfigError, match=OTHERS):
        blue.act(observations, infos)


def test_one_shield_round_a_game_and_a_policy_in_it_is_refused():
    shield = Shield()
    env = ShieldedParallelEnv(MctfEnv(SMALL), shield, team="red")
    observations, infos = env.reset(seed=0)
    wrapped(env.unwrapped, shield, 0).act(observations, infos)
    with pytest.raises(ConfigError, match=OTHERS):
        env.step({agent: 0 for agent in env.possible_agents})


def test_one_shield_round_two_games_in_turn_is_refused_and_one_after_the_other_is_not():
    shield = Shield()
    one, other = (ShieldedParallelEnv(MctfEnv(SMALL), shield) for _ in range(2))
    still = {agent: 16 for agent in one.possible_agents}
    one.reset(seed=0)
    one.step(still)
    other.reset(seed=0)
    other.step(still)
    with pytest.raises(ConfigError, match=OTHERS):
        one.step(still)
    one.reset(seed=0)
    one.step(still)


def test_a_reset_of_the_shield_itself_takes_nothing_from_its_wrapper():
    shield = Shield()
    env = ShieldedParallelEnv(MctfEnv(SMALL), shield)
    still = {agent: 16 for agent in env.possible_agents}
    env.reset(seed=0)
    shield.reset()
    env.step(still)
    assert env.decisions is not None
    other = ShieldedParallelEnv(MctfEnv(SMALL), shield)
    other.reset(seed=0)
    with pytest.raises(ConfigError, match=OTHERS):
        env.step(still)


def test_one_shield_round_two_functions_is_refused_until_its_reset():
    shield = Shield()
    fleets = {
        name: Fleet.of(position_m=[[0, 0]], heading_rad=[0], speed_mps=[1], team=[0], platforms="heron", names=[name])
        for name in ("one", "other")
    }
    one, other = (shield.wrap(lambda seen: Commands.relative_deg([[1.0, 0.0]]), read=fleets.get) for _ in range(2))
    np.testing.assert_array_equal(one("one").values, [[1.0, 0.0]])
    with pytest.raises(ConfigError, match=OTHERS):
        other("other")
    shield.reset()
    np.testing.assert_array_equal(other("other").values, [[1.0, 0.0]])


def test_one_shield_of_games_for_both_teams_is_refused_until_its_reset():
    core = BatchedMctf(SMALL, n_games=2, seed=0)
    team = tuple(int(one) for one in core.team)
    shield, still = BatchedShield(ShieldConfig(), 2, ("heron",) * core.n_boats, team), np.zeros((2, core.n_boats, 2))
    blue, red = (shield.filter_for(team) for team in (0, 1))
    core.step(still, blue)
    shield.reset(np.array([True, False]))
    with pytest.raises(ConfigError, match="begun to serve the other team"):
        core.step(still, red)
    core.step(still, blue)
    shield.reset()
    core.step(still, red)
