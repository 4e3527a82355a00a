"""Reading a real Pyquaticus environment object."""

from __future__ import annotations

import math
from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np

from ..actions import DISCRETE, Command, Seat, check_agents, plain_action, read_action
from ..fleet import Fleet
from ..jit import Array
from ..platforms import get_platform
from ..platforms import layout as L
from ..surroundings import Surroundings
from .reading import KEEP_OUT_MARGIN_M, obstacles_of


class PyquaticusReader:
    """Reads a ``PyQuaticusEnv``: true positions and autopilot memory of every player.

    The environment drives tagged and out-of-bounds boats itself, after the policy's action: those are not ours to
    decide for and are treated as boats that hold their course.
    """

    filters_inside = False

    def __init__(self, env: Any) -> None:
        self.env = env
        self.agent_ids: tuple[str, ...] = tuple(str(agent) for agent in env.players)
        self._platforms = tuple(get_platform(name).name for name in env.dynamics)
        for agent in self.agent_ids:  # lets the env take a discrete action and a corrected pair alike
            env.act_space_checked[agent] = True
            env.act_space_match[agent] = False

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now."""
        players = list(self.env.players.values())
        state = np.array([_row(player) for player in players])
        teams = np.array([_team(player) for player in players], dtype=np.int64)
        driven = np.array([bool(player.is_tagged) or bool(player.oob) for player in players])
        return Fleet(state, teams, self._platforms, (teams == team) & ~driven, self.agent_ids)

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """Commands of actions of any kind; boats without one stop, as in the env."""
        check_agents(actions, self.agent_ids)
        values = np.zeros((len(self.agent_ids), 2))
        for i, agent in enumerate(self.agent_ids):
            if agent in actions:
                values[i] = read_action(self._seat(agent), actions[agent])
        return values

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """The actions in a form the env takes: plain numbers, pairs and names as they are, others made plain.

        It looks whole numbers up in a list, so that arrays without axes, tensors and whole floats are none to it.
        """
        return {agent: self._playable(agent, action) for agent, action in actions.items()}

    def _playable(self, agent: str, action: Any) -> Any:
        if type(action) in (int, str) or _is_pair(action):
            return action
        return plain_action(self._seat(agent), action)

    def _seat(self, agent: str) -> Seat:
        """The env looks numbers up in a list, by Python's rules, and takes the first two entries of anything longer."""
        player = self.env.players[agent]
        points = tuple(getattr(self.env, "aquaticus_field_points", None) or ())
        return Seat(
            agent,
            float(player.get_max_speed()),
            lambda name: self._to_point(name, player),
            points,
            lowest=-len(DISCRETE),
            bools=True,
            longer=True,
        )

    def _to_point(self, name: str, player: Any) -> Command:
        speed, heading = self.env._afp_to_speed_relheading(name, player)
        return float(speed), float(heading)

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Field edge and obstacles; the own flag's circle, see `mctf.surroundings_of`."""
        env = self.env
        circles, polygons = obstacles_of(getattr(env, "config_dict", {}).get("obstacles"))
        size = np.asarray(env.env_size, dtype=np.float64)
        flag = env.flags[team]
        circle: tuple[tuple[float, float, float], ...] = ()
        if keep_out:
            radius = float(env.flag_keepout_radius) + float(np.max(env.agent_radius)) + KEEP_OUT_MARGIN_M
            circle = ((float(flag.home[0]), float(flag.home[1]), radius),)
        return Surroundings((0.0, 0.0, float(size[0]), float(size[1])), tuple(circles), tuple(polygons), stops=circle)


def _is_pair(action: Any) -> bool:
    """Whether it is a pair of plain numbers."""
    if isinstance(action, np.ndarray):
        return action.shape == (2,)
    return isinstance(action, (list, tuple)) and len(action) == 2 and all(isinstance(one, Real) for one in action)


def _team(player: Any) -> int:
    return int(getattr(player.team, "value", player.team))


def _row(player: Any) -> Array:
    """State row of a player, with its controllers' memory where it has any."""
    row = np.zeros(L.N_STATE)
    row[L.X], row[L.Y] = player.pos[0], player.pos[1]
    row[L.HEADING], row[L.SPEED] = player.heading, player.speed
    memory = getattr(player, "state", {})
    row[L.THRUST] = memory.get("thrust", math.nan)
    row[L.RUDDER] = memory.get("rudder", math.nan)
    row[L.TURN_RATE] = memory.get("turn_rate", 0.0)
    row[L.SPEED_ERROR], row[L.SPEED_INTEGRAL] = _controller(player, "speed")
    row[L.HEADING_ERROR], row[L.HEADING_INTEGRAL] = _controller(player, "heading")
    return row


def _controller(player: Any, name: str) -> tuple[float, float]:
    controller = getattr(player, "_pid_controllers", {}).get(name)
    error = getattr(controller, "_prev_error", None)
    integral = float(getattr(controller, "_integral", 0.0))
    return (math.nan if error is None else float(error)), integral
