"""The environment: actions, filters and rewards; a policy written for Pyquaticus runs here unchanged."""

import enum
import logging
import math

import numpy as np
import pytest
from steerclear.env import mctf_v0
from steerclear.env.actions import STOP, action_kinds, discrete_commands
from steerclear.env.compat import Team, TeamMap
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield
from steerclear.shield.exceptions import CallError, ConfigError, GameError
from steerclear.shield.wrappers import ShieldedParallelEnv

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


def test_observations_of_a_step_are_not_overwritten_by_the_next():
    env = MctfEnv(SMALL)
    first, _ = env.reset(seed=0)
    kept = first["agent_0"].copy()
    env.step({"agent_0": 2})
    np.testing.assert_array_equal(first["agent_0"], kept)


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
    words = (
        r"MctfEnv has no max_time_s=; it is a setting of the game: give GameConfig.preset\(name, max_time_s=\.\.\.\)"
    )
    with pytest.raises(CallError, match=words):
        MctfEnv(max_time_s=60.0)
    with pytest.raises(CallError, match="MctfEnv has no rendermode=; did you mean render_mode="):
        MctfEnv(rendermode="human")
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


@pytest.fixture
def env():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1, platforms=("heron", "surveyor")))
    env.reset(seed=0)
    return env


def wanted(env, **actions):
    return env._decoder.decode(actions, env.core.state[0])


def test_field_points_are_mirrored_for_red(env):
    (blue_speed, blue_heading), (red_speed, red_heading) = wanted(env, agent_0="PBX", agent_1="PBX")
    assert (blue_speed, red_speed) == (2.0, 3.0)
    assert blue_heading == pytest.approx(red_heading)
    place = env.core.state[0, 0, :2]
    want = np.degrees(np.arctan2(80.0 - place[0], 30.0 - place[1])) - 90.0
    assert blue_heading == pytest.approx(want)


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
        ("analog", "unknown action kind"),
        (["afp"], "1 entries for 2 boats"),
        ({}, "name every one"),
    ):
        with pytest.raises(ConfigError, match=message):
            action_kinds(config, kind)


@pytest.mark.parametrize("shielded", [False, True])
def test_an_absurdly_large_pair_is_refused_before_it_overflows_the_motion(env, shielded):
    game = ShieldedParallelEnv(env, Shield.for_game(env)) if shielded else env
    game.reset(seed=0)
    before = env.core.state.copy()
    for action in ((1e9, 0.0), (1.0, -1e300)):
        with pytest.raises(GameError, match=r"action of agent_0 in game 0 is beyond 1e\+06"):
            game.step({"agent_0": action})
    np.testing.assert_array_equal(env.core.state, before)
    game.step({"agent_0": (1e6, -1e6)})
    assert np.isfinite(env.core.state[0, :, :5]).all()


def test_many_discrete_actions_at_once():
    speeds = np.array([2.0, 3.0])
    commands = discrete_commands(np.array([[0, 12], [STOP, 7]]), speeds)
    assert commands.tolist() == [[[2.0, 180.0], [1.5, 0.0]], [[0.0, 0.0], [3.0, -135.0]]]
    for bad in (np.array([[17, 0]]), np.array([[-1, 0]]), np.array([[0.5, 0.0]])):
        with pytest.raises(GameError, match=r"0\.\.16"):
            discrete_commands(bad, speeds)


class ForeignTeam(enum.Enum):
    """Another package's team names, as Pyquaticus has its own."""

    BLUE_TEAM = 0
    RED_TEAM = 1

    def __int__(self):
        return self.value


class GoForTheFlag:
    """Built and called as Pyquaticus' scripted policies are; touches everything they touch on the env object."""

    def __init__(self, agent_id, env):
        self.id = agent_id
        mine = [team for team in ForeignTeam if agent_id in env.agent_ids_of_team[team]]
        self.team = mine[0]
        self.opponents = env.agent_ids_of_team[ForeignTeam(1 - self.team.value)]
        self.normalizer = env.global_state_normalizer
        self.walls = env._walls[self.team.value]
        self.max_speed = env.max_speeds[env.players[self.id].idx]
        self.points = None if env.gps_env else env.aquaticus_field_points
        self.middle = np.mean([env.flag_homes[ForeignTeam.RED_TEAM], env.flag_homes[ForeignTeam.BLUE_TEAM]], axis=0)
        self.reach = env.catch_radius - env.flag_keepout_radius
        self.size, self.line, self.obstacles = env.env_size, env.scrimmage_coords, env.obstacles

    def compute_action(self, obs, info):
        state = info[self.id]["global_state"]
        if not isinstance(state, dict):
            state = self.normalizer.unnormalized(state)
        other = "red" if self.team == ForeignTeam.BLUE_TEAM else "blue"
        own = "blue" if other == "red" else "red"
        goal = state[own + "_flag_home"] if state[(self.id, "has_flag")] else state[other + "_flag_pos"]
        dx, dy = goal - state[(self.id, "pos")]
        bearing = math.degrees(math.atan2(dx, dy)) - state[(self.id, "heading")]
        return self.max_speed, (bearing + 180.0) % 360.0 - 180.0


def test_a_pyquaticus_style_policy_plays_and_scores():
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1))
    obs, info = env.reset(seed=0, options={"init_dict": {"agent_position": {"agent_1": (77.0, 2.0)}}})
    policy = GoForTheFlag("agent_0", env)
    for _ in range(600):
        obs, _, _, _, info = env.step({"agent_0": policy.compute_action(obs["agent_0"], info), "agent_1": -1})
        if env.core.captures[0, 0]:
            break
    assert env.game_events[ForeignTeam.BLUE_TEAM] == {"scores": 1, "grabs": 1, "tags": 0, "collisions": 0}


def test_a_normalised_global_state_can_be_turned_back():
    env = MctfEnv("aamas2024")
    _, infos = env.reset(seed=0)
    state = infos["agent_0"]["global_state"]
    back = env.global_state_normalizer.unnormalized(env.global_state_normalizer.normalized(state))
    for key, value in state.items():
        np.testing.assert_allclose(back[key], value, atol=1e-4, err_msg=str(key))
    obs = env.agent_obs_normalizer
    raw = infos["agent_2"]["unnorm_obs"]
    np.testing.assert_allclose(obs.normalized(raw), env.core.observations[0, 2], atol=1e-6)


def test_players_and_flags_are_live():
    env = MctfEnv("aamas2024")
    env.reset(seed=0)
    player, flag = env.players["agent_4"], env.flags[0]
    env.step({"agent_4": 4})
    assert player.speed == env.core.state[0, 4, 3] > 0.0
    np.testing.assert_array_equal(player.pos, env.core.state[0, 4, :2])
    np.testing.assert_array_equal(player.prev_pos, env.core.previous_position[0, 4])
    assert (player.idx, player.team, player.get_max_speed()) == (4, Team.RED_TEAM, 2.0)
    assert (player.has_flag, player.is_tagged, player.oob, player.on_own_side) == (False, False, False, True)
    assert (player.heading, player.tagging_cooldown) == (-90.0, 10.0)
    assert not flag.taken
    np.testing.assert_array_equal(flag.pos, flag.home)
    assert env.current_time == pytest.approx(0.1)
    assert [p.id for p in env.agents_of_team[1]] == ["agent_3", "agent_4", "agent_5"]
    player.pos[0] = 3.0
    assert env.core.state[0, 4, 0] != 3.0, "a policy cannot move boats through what it is shown"


def test_team_maps_take_any_team_and_nothing_else():
    pair = TeamMap("a", "b")
    assert [pair[0], pair[ForeignTeam.RED_TEAM], pair[Team.BLUE_TEAM]] == ["a", "b", "a"]
    assert dict(pair) == {Team.BLUE_TEAM: "a", Team.RED_TEAM: "b"}
    assert len(pair) == 2
    for bad in (2, "blue", None):
        with pytest.raises(KeyError):
            pair[bad]
