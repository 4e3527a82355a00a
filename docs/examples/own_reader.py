"""A reader of your own, for a PettingZoo game with its own frame and actions; checked by the suite."""

from contextlib import contextmanager
from dataclasses import replace
from unittest.mock import patch

import numpy as np
from gymnasium.spaces import Box
from pettingzoo import ParallelEnv
from steerclear.experiments.conformance import check_reader
from steerclear.shield import Fleet, Shield, Surroundings
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform
from steerclear.shield.wrappers import GameFacts, ShieldedParallelEnv, game_reader

DT_S, TEAM = 0.1, np.array([0, 1])
BOAT = replace(get_platform("si"), name="lake_boat", max_speed_mps=2.0)  # moves as a `Lake` moves boats


class Lake(ParallelEnv):
    """Two boats on 60 x 40 m; headings in rad, counter-clockwise from east; actions: speed m/s, left turn rad/s."""

    possible_agents = ("ours", "theirs")

    def action_space(self, agent):
        """Speed, m/s, and turn to the left, rad/s."""
        return Box(np.array([0.0, -1.5]), np.array([2.0, 1.5]), dtype=np.float64)

    def reset(self, seed=None, options=None):
        """Boats lie 20 m apart, bow to bow."""
        self.agents, self.steps = list(self.possible_agents), 0
        self.boats = np.array([[20.0, 20.0, 0.0, 0.0], [40.0, 20.5, np.pi, 0.0]])  # x, y, m; heading; speed
        return {agent: self.boats for agent in self.agents}, {agent: {} for agent in self.agents}

    def step(self, actions):
        """Move for 0.1 s: speed at once, 90 deg/s at most, along the mean of old and new speed and heading."""
        speed, turn = np.array([actions[agent] for agent in self.agents]).T
        before, turned = self.boats[:, 3], DT_S * np.clip(turn, -np.pi / 2, np.pi / 2)
        way_m, along = DT_S * (before + speed) / 2, self.boats[:, 2] + turned / 2
        moved = [way_m * np.cos(along), way_m * np.sin(along), turned, speed - before]
        self.boats, self.steps = self.boats + np.column_stack(moved), self.steps + 1
        each = [{agent: value for agent in self.agents} for value in (self.boats, 0.0, False, False)]
        return *each, {agent: {} for agent in self.agents}


@game_reader(fits=lambda env: isinstance(env, Lake))
class LakeReader:
    """Tells the wrappers of a `Lake` what they have to know."""

    agent_ids, takes_pairs_only = Lake.possible_agents, False

    def __init__(self, env):
        self.env = env

    def fleet(self, team, shield_autopilot):
        """All boats now, headings in deg, clockwise from north; this game drives none itself."""
        return Fleet.of(
            position_m=self.env.boats[:, :2],
            heading_deg=90.0 - np.degrees(self.env.boats[:, 2]),
            speed_mps=self.env.boats[:, 3],
            team=TEAM,
            controlled=np.equal(TEAM, team),  # those that the shield decides for
            names=self.agent_ids,
            platforms=BOAT,
        )

    def commands(self, actions):
        """From the game's actions: rows of speed, m/s, and the turn of this step, deg, clockwise."""
        pairs = [actions.get(agent, (0.0, 0.0)) for agent in self.agent_ids]
        return np.array([(speed, -np.degrees(turn * DT_S)) for speed, turn in pairs])

    @contextmanager
    def filtering(self, safe):
        """And back: while inside, ``step`` plays what ``safe`` makes of the commands; what passes stays as it was."""
        step = self.env.step

        def safe_step(actions):
            nominal = self.commands(actions)
            rows = zip(self.agent_ids, nominal, safe(nominal), strict=True)
            changed = {agent: (to[0], -np.radians(to[1]) / DT_S) for agent, asked, to in rows if (to != asked).any()}
            return step({**actions, **changed})

        with patch.object(self.env, "step", safe_step):
            yield

    def facts(self):
        """Step, sizes and teams: boats hit each other at 2.5 m."""
        return GameFacts(dt_s=DT_S, radius_m=np.array([1.25, 1.25]), team=TEAM, obstacles=False)

    def moment(self):
        """The game's time, s."""
        return DT_S * self.env.steps

    def surroundings(self, team, keep_out):
        """Field, m; obstacles would stand here, too."""
        return Surroundings(field=(0.0, 0.0, 60.0, 40.0))

    def playable(self, actions):
        """Actions in a form that the game takes: as they are."""
        return dict(actions)

    def check_answers(self, agent_ids):
        """Whether the game takes (speed, relative heading) pairs, which a wrapped policy answers."""
        raise ConfigError("a Lake takes turns per second; wrap the env instead of the policy")


check_reader(Lake)
for name, env in (("off", Lake()), ("on", ShieldedParallelEnv(Lake(), Shield.for_game(Lake())))):
    env.reset()
    nearest_m = np.inf
    for _ in range(80):
        env.step({agent: (2.0, 0.0) for agent in env.agents})
        nearest_m = min(nearest_m, float(np.hypot(*(env.boats[0, :2] - env.boats[1, :2]))))
    print(f"shield {name}: nearest {nearest_m:.2f} m")
