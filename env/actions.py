"""Actions that players may send: discrete numbers, (speed, relative heading) pairs, or names of field points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from steerclear.shield.arrays import NoNumbersError, numbers
from steerclear.shield.exceptions import ConfigError, GameError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers.actions import DISCRETE, STOP, Command, Seat, check_agents, read_action

from .angles import heading_to, wrap_bearing
from .config import GameConfig

KINDS = ("discrete", "continuous", "afp")
"""Kinds of action spaces; "afp" are named field points."""


def action_kinds(config: GameConfig, kind: str | Sequence[str] | Mapping[str, str]) -> dict[str, str]:
    """Return the kind of each boat's action space.

    Args:
        config: the game's settings.
        kind: one kind for all boats, one per boat, or a dict by agent id.
    """
    if isinstance(kind, str):
        kinds = dict.fromkeys(config.agent_ids, kind)
    elif isinstance(kind, Mapping):
        kinds = dict(kind)
    else:
        kinds = dict(zip(config.agent_ids, kind, strict=False))
        if len(kind) != config.n_boats:
            raise ConfigError(f"action_kind has {len(kind)} entries for {config.n_boats} boats; give one per boat")
    if set(kinds) != set(config.agent_ids):
        raise ConfigError(f"action_kind names {sorted(kinds)}; name every one of {', '.join(config.agent_ids)}")
    for name in kinds.values():
        if name not in KINDS:
            raise ConfigError(f"unknown action kind {name!r}; choose one of {', '.join(KINDS)}")
    return kinds


def action_space(kind: str, max_speed_mps: float, n_points: int) -> Space[Any]:
    """Return the space of one boat's actions; a field point is its number in `FieldPoints.names`, or its name."""
    if kind == "discrete":
        return Discrete(len(DISCRETE))
    if kind == "afp":
        return Discrete(n_points)
    return Box(np.array([0.0, -180.0], np.float32), np.array([max_speed_mps, 180.0], np.float32), dtype=np.float32)


def discrete_commands(indices: np.ndarray, max_speed_mps: Array) -> Array:
    """Return commands (..., n, 2), m/s and relative deg, of discrete actions (..., n); top speeds are (n,), m/s."""
    try:
        given = numbers(indices)
    except NoNumbersError:
        given = np.full(1, np.nan)
    if not ((given == np.floor(given)) & (given >= 0) & (given <= STOP)).all():
        raise GameError(f"discrete actions must be whole numbers 0..{STOP}")
    commands = DISCRETE[given.astype(np.int64)]
    commands[..., 0] *= max_speed_mps
    return commands


class ActionDecoder:
    """Turns actions into commands: speed m/s, relative heading deg.

    An action's type decides its kind, whatever the boat's declared space, see `shield.wrappers.actions`. Where "afp" is
    declared, whole numbers are field points.

    Args:
        config: the game's settings.
        kinds: declared kind by agent id.
        points: named field points, name -> (x, y) m, in blue's naming.
    """

    def __init__(self, config: GameConfig, kinds: dict[str, str], points: dict[str, Array]) -> None:
        self._config, self._kinds, self._points = config, kinds, points
        self._names = tuple(points)

    def decode(self, actions: Mapping[str, Any], state: Array) -> Array:
        """Return commands (n, 2) of actions by agent id, for boats at ``state`` (n, N_STATE).

        Boats without an action stop.
        """
        ids = self._config.agent_ids
        check_agents(actions, ids)
        commands = np.zeros((len(ids), 2))
        for i, agent_id in enumerate(ids):
            if agent_id in actions:
                commands[i] = read_action(self._seat(agent_id, i, state[i]), actions[agent_id])
        return commands

    def _seat(self, agent_id: str, i: int, state: Array) -> Seat:
        top_mps = float(self._config.platforms[i].max_speed_mps)

        def to_point(name: str) -> Command:
            """Steer at full speed for a named point (mirrored for red); stop within the boat's own radius of it."""
            point = self._points[name]
            if i >= self._config.team_size:
                point = np.array(self._config.env_bounds_m) - point
            dx, dy = point[0] - state[L.X], point[1] - state[L.Y]
            speed = 0.0 if np.hypot(dx, dy) <= self._config.agent_radius_m[i] else top_mps
            return speed, wrap_bearing(heading_to(dx, dy) - state[L.HEADING])

        return Seat(agent_id, top_mps, to_point, self._names, numbered=self._kinds[agent_id] == "afp")
