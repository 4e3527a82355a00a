import numpy as np
import pytest
from steerclear.env.actions import DISCRETE, STOP, action_kinds, discrete_commands
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield
from steerclear.shield.exceptions import ConfigError, GameError
from steerclear.shield.wrappers import ShieldedParallelEnv


@pytest.fixture
def env():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1, platforms=("heron", "surveyor")))
    env.reset(seed=0)
    return env


def wanted(env, **actions):
    return env._decoder.decode(actions, env.core.state[0])


def test_the_seventeen_discrete_actions():
    headings = [180, 135, 90, 45, 0, -45, -90, -135]
    assert DISCRETE.tolist() == [[s, h] for s in (1.0, 0.5) for h in headings] + [[0.0, 0.0]]


def test_field_points_are_mirrored_for_red(env):
    (blue_speed, blue_heading), (red_speed, red_heading) = wanted(env, agent_0="PBX", agent_1="PBX")
    assert (blue_speed, red_speed) == (2.0, 3.0)
    assert blue_heading == pytest.approx(red_heading)
    place = env.core.state[0, 0, :2]
    want = np.degrees(np.arctan2(80.0 - place[0], 30.0 - place[1])) - 90.0
    assert blue_heading == pytest.approx(want)


def test_a_boat_stops_within_its_radius_of_a_field_point(env):
    env.core.state[0, 0, :2] = (40.5, 20.5)
    assert wanted(env, agent_0="CC")[0, 0] == 0.0
    env.core.state[0, 0, :2] = (41.5, 20.0)
    assert wanted(env, agent_0="CC")[0].tolist() == [2.0, -180.0 + 360.0]


def test_a_declared_field_point_space_understands_numbers():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1), action_kind="afp")
    env.reset(seed=0)
    assert env.action_space("agent_0").n == 45
    by_number = wanted(env, agent_0=list(env.aquaticus_field_points).index("SC"))
    np.testing.assert_array_equal(by_number, wanted(env, agent_0="SC"))
    with pytest.raises(GameError, match="45 of agent_0 is no field point"):
        wanted(env, agent_0=45)


def test_kinds_are_given_once_per_boat_or_by_name():
    config = GameConfig(team_size=1)
    assert action_kinds(config, ["afp", "discrete"]) == {"agent_0": "afp", "agent_1": "discrete"}
    assert action_kinds(config, {"agent_1": "afp", "agent_0": "continuous"})["agent_0"] == "continuous"
    for kind, message in (
        ("analog", "unknown action kind 'analog'"),
        (["afp"], "1 entries for 2 boats"),
        ({"agent_0": "afp"}, "name every one"),
    ):
        with pytest.raises(ConfigError, match=message):
            action_kinds(config, kind)


def test_many_discrete_actions_at_once():
    speeds = np.array([2.0, 3.0])
    commands = discrete_commands(np.array([[0, 12], [STOP, 7]]), speeds)
    assert commands.tolist() == [[[2.0, 180.0], [1.5, 0.0]], [[0.0, 0.0], [3.0, -135.0]]]
    for bad in (np.array([[17, 0]]), np.array([[-1, 0]]), np.array([[0.5, 0.0]])):
        with pytest.raises(GameError, match=r"0\.\.16"):
            discrete_commands(bad, speeds)


@pytest.mark.parametrize("action", [(1e9, 0.0), (1.0, -1e300), (2e6, 0)])
@pytest.mark.parametrize("shielded", [False, True])
def test_an_absurdly_large_pair_is_refused_before_it_overflows_the_motion(env, action, shielded):
    game = ShieldedParallelEnv(env, Shield.for_game(env)) if shielded else env
    game.reset(seed=0)
    before = env.core.state.copy()
    with pytest.raises(GameError, match=r"action of agent_0 in game 0 is beyond 1e\+06"):
        game.step({"agent_0": action})
    np.testing.assert_array_equal(env.core.state, before)
    game.step({"agent_0": (1e6, -1e6)})
    assert np.isfinite(env.core.state[0, :, :5]).all()
