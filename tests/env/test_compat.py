"""A policy written for Pyquaticus, built with the environment object, runs here unchanged."""

import enum
import math

import numpy as np
import pytest
from steerclear.env import MctfEnv
from steerclear.env.compat import Team, TeamMap
from steerclear.env.config import GameConfig


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


def test_obstacles_are_listed_as_pyquaticus_lists_them():
    shapes = {"circle": [(2.0, (40.0, 10.0))], "polygon": [((1.0, 1.0), (2.0, 1.0), (1.0, 2.0))]}
    env = MctfEnv(GameConfig.preset("aamas2024", obstacles=shapes))
    circle, polygon = env.obstacles
    assert (circle.radius, circle.center_point) == (2.0, (40.0, 10.0))
    assert polygon.anchor_points == [(1.0, 1.0), (2.0, 1.0), (1.0, 2.0)]


def test_team_maps_take_any_team_and_nothing_else():
    pair = TeamMap("a", "b")
    assert [pair[0], pair[ForeignTeam.RED_TEAM], pair[Team.BLUE_TEAM]] == ["a", "b", "a"]
    assert dict(pair) == {Team.BLUE_TEAM: "a", Team.RED_TEAM: "b"}
    assert len(pair) == 2
    for bad in (2, "blue", None):
        with pytest.raises(KeyError):
            pair[bad]
