"""One table of odd actions: every environment and wrapper plays the same, and refuses the rest in the same words."""

import math
from enum import IntEnum

import numpy as np
import pytest
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Reason, Shield
from steerclear.shield.exceptions import ConfigError, SteerclearError
from steerclear.shield.wrappers import ShieldedParallelEnv, ShieldedTeamPolicy, TeamBatch
from wrapped_games import Quaticus

torch = pytest.importorskip("torch")
RULES = {"team_size": 1, "default_start": False}
TOP_MPS = 2.0


class Course(IntEnum):
    AHEAD = 4


class Index:
    """Indexes a list, and is no number otherwise."""

    def __index__(self):
        return 10


class Broken:
    """Raises whatever is asked of it."""

    def __array__(self, dtype=None, copy=None):
        raise RuntimeError("no array")

    def __repr__(self):
        raise RuntimeError("no text")


AHEAD, STOP, HALF_TO_STARBOARD = (1.0, 0.0), (0.0, 0.0), (0.5, 90.0)
"""Share of top speed and relative heading, deg."""

PLAYED = [
    (4, AHEAD),
    (-1, STOP),
    (np.array(10), HALF_TO_STARBOARD),
    ([10], HALF_TO_STARBOARD),
    (np.array(4, dtype=object), AHEAD),
    (torch.tensor([10]), HALF_TO_STARBOARD),
    (torch.tensor(4.0, dtype=torch.bfloat16), AHEAD),
    (Course.AHEAD, AHEAD),
    (Index(), HALF_TO_STARBOARD),
    ((1.0, 90.0), HALF_TO_STARBOARD),
    (np.array([1.0, 0.0, 90.0, 0.0])[::2], HALF_TO_STARBOARD),
    (torch.tensor([1.0, 90.0], requires_grad=True), HALF_TO_STARBOARD),
    ([torch.tensor(1.0, requires_grad=True), torch.tensor(90.0)], HALF_TO_STARBOARD),
    ((5.0, 0.0), (2.5, 0.0)),
    ((-1.0, 350.0), (-0.5, 350.0)),
]

REFUSED = [
    (17, "out of range"),
    (10**400, "not usable"),
    (math.nan, "not usable"),
    (None, "not usable"),
    ([[1.0, 2.0]], "not usable"),
    (("1.0", "2.0"), "not usable"),
    ({"speed": 1.0}, "not usable"),
    ((1.0, 2.0j), "not usable"),
    (np.ma.masked_array([1.0, 2.0], mask=[True, False]), "not usable"),
    (Broken(), "not usable"),
    ((math.nan, 0.0), "not finite"),
    (torch.tensor([math.nan, 0.0]), "not finite"),
]


def named(value):
    try:
        return repr(value).split(" at 0x")[0][:30]
    except RuntimeError:
        return "broken"


class Answer:
    """A policy that answers one action for its boats."""

    def __init__(self, action):
        self.action = action

    def reset(self, env, agent_ids, seed):
        self.ids = agent_ids

    def act(self, observations, infos):
        return dict.fromkeys(self.ids, self.action)


def in_bare_env(action):
    env = MctfEnv(GameConfig.preset("aamas2024", **RULES))
    env.reset(seed=1)
    heard = []
    env.command_filter = lambda core, commands: heard.append(commands[0, 0].copy()) or commands
    env.step({"agent_0": action})
    return heard[0]


def in_wrapped_env(action):
    env = ShieldedParallelEnv(MctfEnv(GameConfig.preset("aamas2024", **RULES)), Shield())
    env.reset(seed=1)
    env.step({"agent_0": action})
    return env.decisions.nominal.values[0]


def in_wrapped_policy(action):
    env = MctfEnv(GameConfig.preset("aamas2024", **RULES))
    observations, infos = env.reset(seed=1)
    team = ShieldedTeamPolicy(Answer(action), Shield())
    team.reset(env, ["agent_0"], 0)
    env.step(team.act(observations, infos))
    return team.decisions.nominal.values[0]


def in_foreign_code(action):
    env = MctfEnv(GameConfig.preset("aamas2024", **RULES))
    env.reset(seed=1)
    return policies.to_command(env, "agent_0", action)


def quaticus():
    game = Quaticus(gap_m=70.0)
    for player in game.players.values():
        player.get_max_speed = lambda: TOP_MPS
    return game


def in_pyquaticus(action):
    env = ShieldedParallelEnv(quaticus(), Shield())
    env.reset(seed=0)
    env.step({"agent_0": action})
    given = env.unwrapped.stepped[0]["agent_0"]
    assert type(given) in (int, str) or (isinstance(given, (list, tuple, np.ndarray)) and len(given) == 2)
    return env.decisions.nominal.values[0]


def in_a_batch(action):
    games = TeamBatch(BatchedMctf(GameConfig.preset("aamas2024", **RULES), n_games=2, seed=1))
    games.reset()
    games.step([action, 16])
    return games._commands[0, 0]


WAYS = [in_bare_env, in_wrapped_env, in_wrapped_policy, in_pyquaticus, in_foreign_code, in_a_batch]


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("action", "command"), PLAYED, ids=named)
def test_every_way_plays_the_same(way, action, command):
    assert tuple(way(action)) == (command[0] * TOP_MPS, command[1])


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize(("action", "words"), REFUSED, ids=named)
def test_every_way_refuses_the_same_in_the_same_words(way, action, words):
    kinds = r"(no answer|not finite|no action)" if way is in_foreign_code else ""
    with pytest.raises(SteerclearError, match=f"{kinds}.*{words if not kinds else ''}") as caught:
        way(action)
    if way is not in_foreign_code:
        remedy = "finite speed m/s and relative heading deg" if words == "not finite" else r"a whole number 0\.\.16"
        assert caught.match(f"of (agent_0|learner 0) is {words}; give {remedy}")
        assert len(str(caught.value)) < 300


@pytest.mark.parametrize("action", [True, np.True_, torch.tensor(True), [True], -2, [1, 2, 3]])
def test_what_only_pythons_indexing_takes_is_refused_by_our_game(action):
    for way in (in_bare_env, in_wrapped_env, in_wrapped_policy, in_foreign_code):
        with pytest.raises(SteerclearError, match=r"not usable|out of range"):
            way(action)


@pytest.mark.parametrize(
    ("action", "number"), [(True, 1), (-2, 15), (-17, 0), (np.int64(-3), 14), ([1.0, 2.0, 3.0], (1.0, 2.0))]
)
def test_pyquaticus_plays_it_and_so_it_plays_wrapped(action, number):
    assert tuple(in_pyquaticus(action)) == tuple(in_pyquaticus(number))


@pytest.mark.parametrize("way", [in_wrapped_env, in_wrapped_policy, in_bare_env, in_pyquaticus])
def test_field_points_are_names_of_any_text_type(way):
    name = "HOME" if way is in_pyquaticus else "CC"
    assert tuple(way(name)) == tuple(way(np.str_(name))) == tuple(way(np.array(name)))
    with pytest.raises(SteerclearError, match=f"unknown field point '{name}C'; did you mean"):
        way(f"{name}C")


@pytest.mark.parametrize("make", [quaticus, lambda: MctfEnv(GameConfig.preset("aamas2024", **RULES))])
def test_boats_without_an_action_stop_and_unknown_ones_are_refused(make):
    env = ShieldedParallelEnv(make(), Shield())
    env.reset(seed=0)
    env.step({})
    assert env.decisions[0].filtered_speed_mps == 0.0
    assert env.decisions[0].reason == Reason.HELD
    with pytest.raises(SteerclearError, match=r"unknown agent 'agent_7' in the actions; agents are agent_0, agent_1"):
        env.step({"agent_7": 4})
    with pytest.raises(SteerclearError, match="actions are a list; give a dict of agent id -> action"):
        env.step([4, 4])


def test_policies_built_with_a_wrapped_env_read_what_the_game_has():
    for game in (quaticus(), MctfEnv(GameConfig.preset("aamas2024", **RULES))):
        env = ShieldedParallelEnv(ShieldedParallelEnv(game, Shield(), "red"), Shield(), "blue")
        assert env._walls is game._walls
        assert env.players is game.players
        with pytest.raises(AttributeError):
            env._nothing_of_the_kind  # noqa: B018 (asking is the test)


def test_envs_whose_boats_act_in_turn_are_refused_with_the_order_that_works():
    from pettingzoo.utils.conversions import parallel_to_aec

    env = MctfEnv(GameConfig.preset("aamas2024", **RULES))
    with pytest.raises(ConfigError, match=r"is an AEC env.*parallel_to_aec\(ShieldedParallelEnv\("):
        ShieldedParallelEnv(parallel_to_aec(env), Shield())
    with pytest.raises(ConfigError, match=r"MctfEnv is a class; give an environment: MctfEnv\(...\)"):
        ShieldedParallelEnv(MctfEnv, Shield())
    in_turn = parallel_to_aec(ShieldedParallelEnv(env, Shield()))
    in_turn.reset(seed=1)
    for _ in range(4):
        in_turn.step(4)
    assert "shield" in in_turn.infos["agent_0"]
