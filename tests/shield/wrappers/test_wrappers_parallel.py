"""The shield around an environment: ours, with the shield inside the step, and one that looks like Pyquaticus'."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Reason, Shield
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers import ShieldedParallelEnv
from steerclear.shield.wrappers.pyquaticus import PyquaticusReader

STRAIGHT, STOP = 4, 16


def duel(gap_m=16.0):
    """One boat each, head on, blue heading east."""
    start = {"agent_position": [[25.0, 20.0], [25.0 + gap_m, 20.0]], "agent_heading": [90.0, -90.0]}
    env = MctfEnv(GameConfig.preset("aamas2024", team_size=1, catch_radius_m=0.1))
    return env, {"init_dict": {**start, "agent_speed": [1.5, 1.5]}}


def sail(env, options, steps=90, action=STRAIGHT):
    """Closest distance of the two boats, m, and all infos."""
    env.reset(seed=0, options=options)
    closest, told = math.inf, []
    for _ in range(steps):
        *_, infos = env.step(dict.fromkeys(env.agents, action))
        position = env.unwrapped.view().position
        closest = min(closest, float(np.hypot(*(position[1] - position[0]))))
        told.append(infos)
    return closest, told


def test_a_shielded_boat_keeps_clear_where_it_would_not():
    env, options = duel()
    bare, _ = sail(env, options)
    env, options = duel()
    shielded, told = sail(ShieldedParallelEnv(env, Shield()), options)
    assert bare < 2.5 <= shielded
    assert {infos["agent_0"]["shield"].intervened for infos in told} == {True, False}
    assert "shield" not in told[0]["agent_1"]


def test_two_wrappers_shield_both_teams_by_their_own_decisions():
    env, options = duel()
    inner = ShieldedParallelEnv(env, Shield(), team="red")
    closest, told = sail(ShieldedParallelEnv(inner, Shield(), team=0), options)
    assert closest >= 2.5
    for agent in ("agent_0", "agent_1"):
        assert {infos[agent]["shield"].boat for infos in told} == {agent}
        assert any(infos[agent]["shield"].intervened for infos in told)


def test_what_is_safe_passes_bit_for_bit():
    (bare, options), (env, _) = duel(35.0), duel(35.0)
    shielded = ShieldedParallelEnv(env, Shield())
    for game in (bare, shielded):
        game.reset(seed=0, options=options)
    random = np.random.default_rng(3)
    for _ in range(30):
        action = {agent: int(random.integers(17)) for agent in bare.agents}
        bare.step(action)
        shielded.step(action)
        assert bare.view().state.tobytes() == shielded.unwrapped.view().state.tobytes()
    assert shielded.decisions[0].reason == Reason.PASSED


def test_decisions_are_of_the_moment_they_were_made():
    env, options = duel(35.0)
    env = ShieldedParallelEnv(env, Shield())
    env.reset(seed=0, options=options)
    for _ in range(10):
        before_deg = env.unwrapped.view().heading_deg[0]
        *_, infos = env.step(dict.fromkeys(env.agents, 2))  # 90 deg to starboard
        decision = infos["agent_0"]["shield"]
        assert math.degrees(decision.nominal_heading_rad) == pytest.approx((before_deg + 90.0) % 360.0)
        assert env.unwrapped.view().heading_deg[0] != before_deg


@pytest.mark.parametrize("autopilot", [True, False])
def test_boats_the_game_drives_are_covered_only_when_asked(autopilot):
    env, options = duel(35.0)
    env = ShieldedParallelEnv(env, Shield(), shield_autopilot=autopilot)
    env.reset(seed=0, options=options | {"init_dict": options["init_dict"] | {"agent_is_tagged": [1, 0]}})
    *_, infos = env.step(dict.fromkeys(env.agents, STRAIGHT))
    assert env.unwrapped.view().driven[0]
    assert (infos["agent_0"]["shield"].reason == Reason.NOT_COVERED) is not autopilot


class Player:
    """A boat as Pyquaticus has it."""

    def __init__(self, name, team, x, y, heading):
        self.id, self.team, self.pos, self.heading, self.speed = name, SimpleNamespace(value=team), [x, y], heading, 1.5
        self.is_tagged = self.oob = False
        self.state = {"thrust": 75.0, "rudder": 0.0}

    def get_max_speed(self):
        return 1.5


class Quaticus:
    """As much of a Pyquaticus environment as the wrapper reads; actions and commands are noted, not sailed."""

    dt = 0.1

    def __init__(self, gap_m):
        self.players = {
            "agent_0": Player("agent_0", 0, 60.0, 40.0, 90.0),
            "agent_1": Player("agent_1", 1, 60.0 + gap_m, 40.0, -90.0),
        }
        self.possible_agents = self.agents = list(self.players)
        self.dynamics, self.flag_homes = ["heron", "heron"], [(20.0, 40.0), (140.0, 40.0)]
        self.flags = [SimpleNamespace(home=home, taken=False) for home in self.flag_homes]
        self.act_space_checked, self.act_space_match = {}, {}
        self.env_size, self.flag_keepout_radius, self.agent_radius = (160.0, 80.0), 3.0, [2.0, 2.0]
        self.metadata, self.stepped, self.moved, self.current_time = {}, [], [], 0.0
        self.aquaticus_field_points = {"HOME": (20.0, 40.0)}
        self._walls = [[1], [2]]

    @property
    def unwrapped(self):
        return self

    def _afp_to_speed_relheading(self, action, player):
        return 1.0, {"HOME": 180.0}[action]

    def reset(self, seed=None, options=None):
        return {}, {agent: {} for agent in self.agents}

    def step(self, actions):
        self.stepped.append(actions)
        asked = PyquaticusReader(self).commands(actions)
        self._move_agents({agent: np.nan_to_num(asked[i]) for i, agent in enumerate(self.agents)})
        return {}, {}, {}, {}, {agent: {} for agent in self.agents}

    def _move_agents(self, commands):
        self.moved.append(commands)


def test_pyquaticus_gets_the_corrected_pair_and_everything_else_as_it_was():
    game = Quaticus(gap_m=6.0)
    env = ShieldedParallelEnv(game, Shield())
    env.reset(seed=0)
    actions = {"agent_0": STRAIGHT, "agent_1": STRAIGHT}
    *_, infos = env.step(actions)
    assert game.stepped == [actions] == [{"agent_0": STRAIGHT, "agent_1": STRAIGHT}]
    sent, decision = game.moved[0], infos["agent_0"]["shield"]
    assert sent["agent_1"].tolist() == [1.5, 0.0]
    assert decision.intervened
    assert decision.nominal_speed_mps == 1.5
    assert sent["agent_0"][0] == decision.filtered_speed_mps
    turn_deg = math.degrees(decision.filtered_heading_rad - decision.nominal_heading_rad)
    assert (sent["agent_0"][1] - turn_deg + 180.0) % 360.0 == pytest.approx(180.0)


@pytest.mark.parametrize("action", [STRAIGHT, STOP, np.array([0.7, 20.0]), "HOME"])
def test_pyquaticus_actions_of_any_kind_are_read_and_pass_when_safe(action):
    game = Quaticus(gap_m=70.0)
    env = ShieldedParallelEnv(game, Shield())
    env.reset(seed=0)
    env.step({"agent_0": action})
    assert game.stepped[0]["agent_0"] is action
    asked = {STRAIGHT: (1.5, 90.0), STOP: (0.0, 90.0), "HOME": (1.0, 270.0)}
    speed, heading = (0.7, 110.0) if isinstance(action, np.ndarray) else asked[action]
    assert env.decisions[0].nominal_speed_mps == pytest.approx(speed)
    assert math.degrees(env.decisions[0].nominal_heading_rad) == pytest.approx(heading)


def test_pyquaticus_boats_that_the_game_drives_are_not_decided_for():
    game = Quaticus(gap_m=6.0)
    game.players["agent_0"].is_tagged = True
    env = ShieldedParallelEnv(game, Shield())
    env.reset(seed=0)
    env.step({"agent_0": STRAIGHT})
    assert env.decisions[0].reason == Reason.NOT_COVERED
    assert game.moved[0]["agent_0"].tolist() == [1.5, 0.0]


def test_rows_of_pyquaticus_players_hold_what_is_known():
    game = Quaticus(gap_m=30.0)
    row = ShieldedParallelEnv(game, Shield()).reader.fleet(0, True).state[0]
    assert (row[L.X], row[L.Y], row[L.HEADING], row[L.SPEED], row[L.THRUST]) == (60.0, 40.0, 90.0, 1.5, 75.0)
    assert np.isnan(row[L.HEADING_ERROR])
