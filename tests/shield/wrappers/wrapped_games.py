"""What the tests of wrappers share: every wrapper we offer round a game, played and told apart bit for bit."""

import hashlib
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.shield import Shield
from steerclear.shield.wrappers import MctfVectorEnv, ShieldedParallelEnv, TeamBatch, games_shield
from steerclear.shield.wrappers.pyquaticus import PyquaticusReader

GAMES, STRAIGHT = 2, 4
SMALL = GameConfig.preset("aamas2024", default_start=False, env_bounds_m=(40.0, 24.0), max_time_s=30.0)
"""Boats are in each other's way from the start: shields have work."""


def digest(*parts):
    """The bits of arrays and texts."""
    found = hashlib.sha256()
    for part in parts:
        found.update(np.ascontiguousarray(part).tobytes() if isinstance(part, np.ndarray) else repr(part).encode())
    return found.hexdigest()


class Env:
    """A `ShieldedParallelEnv` round one game, or two round each other."""

    def __init__(self, teams=("blue",)):
        self.env = MctfEnv(SMALL)
        for team in teams:
            self.env = ShieldedParallelEnv(self.env, Shield(), team)

    def begin(self):
        self.env.reset(seed=3)

    def play(self, steps=25):
        told = []
        for step in range(steps):
            actions = {agent: (2.0, 40.0 * np.sin(step + i)) for i, agent in enumerate(self.env.possible_agents)}
            *_, infos = self.env.step(actions)
            told += [replace(info["shield"], solve_time_s=0.0) for info in infos.values() if "shield" in info]
        return digest(self.env.unwrapped.core.state, told)

    @property
    def intervened(self):
        return self.env.decisions.count_intervened


class Policy:
    """A `ShieldedTeamPolicy` in a game of its own."""

    def __init__(self):
        self.env = MctfEnv(SMALL)
        self.team = Shield().wrap(policies.make("waypoints"))

    def begin(self):
        self.seen = self.env.reset(seed=3)
        self.team.reset(self.env, self.env.possible_agents[:3], 0)

    def play(self, steps=25):
        for _ in range(steps):
            observations, *_, infos = self.env.step(self.team.act(*self.seen))
            self.seen = observations, infos
        return digest(self.env.core.state, self.team.decisions.reason, self.team.decisions.safety_margin_m)


class Batch:
    """A `TeamBatch`, bare or in one of the vector environments, against a batch policy."""

    def __init__(self, front=lambda batch: batch):
        core = BatchedMctf(SMALL, n_games=GAMES)
        self.front = front(
            TeamBatch(core, policies.make_batch("medium"), "blue", shield=games_shield(core, team="blue"), seed=4)
        )

    @property
    def batch(self):
        return getattr(self.front, "batch", self.front)

    def begin(self):
        self.front.reset()

    def play(self, steps=25):
        seen = [self.front.step((7 * np.arange(self.batch.learners) + step) % 17)[0] for step in range(steps)]
        return digest(self.batch.core.state, self.batch.shield.reason, self.batch.shield.safety_margin_m, *seen)


def sb3_front(batch):
    """`MctfVecEnv`, imported where it is asked for: its package is an extra."""
    from steerclear.shield.wrappers import MctfVecEnv

    return MctfVecEnv(batch)


KINDS = {
    "env": Env,
    "both teams": lambda: Env(("blue", "red")),
    "policy": Policy,
    "batch": Batch,
    "gymnasium": lambda: Batch(MctfVectorEnv),
}
"""Every wrapper that needs no extra, by name."""


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
