"""Wrapping changes nothing outside: what is wrapped stays as it was, and wrappers do not get in each other's way."""

import numpy as np
import pytest
from pettingzoo.utils.conversions import aec_to_parallel, parallel_to_aec
from pettingzoo.utils.wrappers import AssertOutOfBoundsWrapper, BaseParallelWrapper, OrderEnforcingWrapper
from steerclear import policies
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Commands, Fleet, Shield, ShieldConfig
from steerclear.shield.batch import BatchedShield
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.wrappers import ShieldedParallelEnv
from wrapped_games import SMALL, STRAIGHT, Quaticus

STEPS = 40


def play(env, steps=STEPS, turns=None):
    """States after every step of a game of random actions, held for a second each."""
    env.reset(seed=3)
    random, track = np.random.default_rng(7), []
    for step in range(steps):
        if step % 10 == 0:
            actions = {agent: int(random.integers(0, 16)) for agent in env.possible_agents}
        env.step(actions if turns is None else {agent: turns(action) for agent, action in actions.items()})
        track.append(env.unwrapped.core.state[0].copy())
    return np.array(track)


def same(one, other):
    return np.array_equal(one, other, equal_nan=True)


@pytest.fixture(scope="module")
def off():
    return play(MctfEnv(SMALL))


@pytest.fixture(scope="module")
def on():
    return play(ShieldedParallelEnv(MctfEnv(SMALL), Shield()))


def test_the_bare_game_stays_bare_before_between_and_after_shielded_steps(off, on):
    game = MctfEnv(SMALL)
    wrapped = ShieldedParallelEnv(game, Shield())
    assert not same(off, on)
    assert same(play(game), off)
    assert same(play(wrapped), on)
    assert same(play(game), off)
    del wrapped
    assert same(play(game), off)
    assert game.command_filter is None


def test_a_second_wrapper_round_the_first_is_refused_for_the_same_team():
    inner = ShieldedParallelEnv(MctfEnv(SMALL), Shield())
    words = "the blue team of this environment has a shield already; wrap env.unwrapped, or shield the other team"
    for env in (inner, BaseParallelWrapper(inner), aec_to_parallel(parallel_to_aec(inner))):
        with pytest.raises(ConfigError, match=words):
            ShieldedParallelEnv(env, Shield(), "blue")
        ShieldedParallelEnv(env, Shield(), "red")
    team = Shield().wrap(policies.make("medium"))
    with pytest.raises(ConfigError, match=r"has a shield already; wrap its \.policy instead"):
        Shield().wrap(team)


def test_a_step_that_fails_leaves_no_shield_behind(off):
    game = MctfEnv(SMALL)
    wrapped = ShieldedParallelEnv(game, Shield())
    wrapped.reset(seed=3)
    with pytest.raises(Exception, match="agent_99"):
        wrapped.step({"agent_99": 4})
    assert same(play(game), off)


def test_a_filter_of_the_users_own_is_asked_first_and_stays():
    seen = []

    def half(core, commands):
        seen.append(commands.copy())
        return commands * [0.5, 1.0]

    game = MctfEnv(SMALL, command_filter=half)
    wrapped = ShieldedParallelEnv(game, Shield())
    wrapped.reset(seed=3)
    wrapped.step(dict.fromkeys(game.possible_agents, STRAIGHT))
    np.testing.assert_array_equal(wrapped.decisions.nominal.values[:, 0], 0.5 * seen[0][0, :, 0])
    assert game.command_filter is half


class Mirrored(BaseParallelWrapper):
    """As SuperSuit's action lambdas: what is played is not what is given."""

    def step(self, actions):
        return super().step({agent: 15 - action for agent, action in actions.items()})


class Twice(BaseParallelWrapper):
    """As SuperSuit's frame skip."""

    def step(self, actions):
        super().step(actions)
        return super().step(actions)


def between(env):
    """What PettingZoo puts round its own environments."""
    return aec_to_parallel(OrderEnforcingWrapper(AssertOutOfBoundsWrapper(parallel_to_aec(env))))


def test_other_wrappers_may_stand_in_between(on):
    assert same(play(ShieldedParallelEnv(between(MctfEnv(SMALL)), Shield())), on)
    assert same(play(between(ShieldedParallelEnv(MctfEnv(SMALL), Shield()))), on)
    assert same(play(ShieldedParallelEnv(Mirrored(MctfEnv(SMALL)), Shield()), turns=lambda action: 15 - action), on)
    twice = ShieldedParallelEnv(Twice(MctfEnv(SMALL)), Shield())
    twice.reset(seed=3)
    twice.step(dict.fromkeys(twice.possible_agents, STRAIGHT))
    core = twice.unwrapped.core
    assert core.time_s[0] == pytest.approx(0.2)
    np.testing.assert_array_equal(twice.decisions.fleet.state[:, :2], core.previous_position[0])


def test_both_teams_are_shielded_in_either_order_and_through_other_wrappers():
    def both(first, second, wrap=lambda env: env):
        return play(ShieldedParallelEnv(wrap(ShieldedParallelEnv(MctfEnv(SMALL), Shield(), first)), Shield(), second))

    expected = both("blue", "red")
    assert same(both("red", "blue"), expected)
    assert same(both("blue", "red", between), expected)


def attributes(game):
    return {name: value for name, value in vars(game).items() if name not in ("stepped", "moved")}


def test_a_pyquaticus_environment_is_as_it_was_after_wrapping_and_after_a_step():
    game = Quaticus(gap_m=6.0)
    before = dict(attributes(game))
    env = ShieldedParallelEnv(ShieldedParallelEnv(game, Shield(), "red"), Shield(), "blue")
    env.reset(seed=0)
    assert attributes(game) == before
    env.step({"agent_0": STRAIGHT, "agent_1": STRAIGHT})
    assert attributes(game) == before
    assert game.act_space_checked == game.act_space_match == {}
    assert env.decisions.intervened[0]
    assert env.env.decisions.intervened[1]
    assert [tuple(game.moved[0][agent]) for agent in game.agents] == [
        tuple(env.decisions.filtered.values[0]),
        tuple(env.env.decisions.filtered.values[1]),
    ]
    game.step({"agent_0": STRAIGHT, "agent_1": STRAIGHT})
    assert game.moved[1]["agent_0"].tolist() == [1.5, 0.0], "stepped itself it is bare"


def test_a_pyquaticus_step_that_fails_leaves_no_shield_behind():
    game = Quaticus(gap_m=6.0)
    env = ShieldedParallelEnv(game, Shield())
    before = dict(attributes(game))
    game.players["agent_0"].heading = np.nan
    with pytest.raises(Exception, match="heading of boat 'agent_0' is nan"):
        env.step({"agent_0": STRAIGHT})
    assert attributes(game) == before


def test_one_shield_for_both_teams_is_refused():
    shield = Shield()
    with pytest.raises(ConfigError, match="give each team a Shield of its own"):
        ShieldedParallelEnv(ShieldedParallelEnv(MctfEnv(SMALL), shield), shield, team="red")


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
