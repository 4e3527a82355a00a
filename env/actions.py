"""What players may send: discrete numbers, (speed, relative heading) pairs, or names of field points."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete, Space
from steerclear.shield.exceptions import ConfigError, GameError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .angles import heading_to, wrap_bearing
from .config import GameConfig

KINDS = ("discrete", "continuous", "afp")
"""Kinds of action spaces; "afp" are the named field points."""

HEADING_STEPS_DEG = (180.0, 135.0, 90.0, 45.0, 0.0, -45.0, -90.0, -135.0)
DISCRETE = np.array([(share, heading) for share in (1.0, 0.5) for heading in HEADING_STEPS_DEG] + [(0.0, 0.0)])
"""(17, 2) share of top speed and relative heading deg of each discrete action; the last one stops."""
STOP = len(DISCRETE) - 1


def action_kinds(config: GameConfig, kind: str | Sequence[str] | Mapping[str, str]) -> dict[str, str]:
    """Kind of each boat's action space, from one kind, one per boat, or a dict by agent id.

    Raises:
        ConfigError: an unknown kind, a missing boat or the wrong number of entries.
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
    """Space of one boat's actions; a field point is its number in `FieldPoints.names`, or its name."""
    if kind == "discrete":
        return Discrete(len(DISCRETE))
    if kind == "afp":
        return Discrete(n_points)
    return Box(np.array([0.0, -180.0], np.float32), np.array([max_speed_mps, 180.0], np.float32), dtype=np.float32)


def discrete_commands(indices: np.ndarray, max_speed_mps: Array) -> Array:
    """Commands of discrete actions, many at once.

    Args:
        indices: (..., n) whole numbers 0..16.
        max_speed_mps: (n,) top speeds, m/s.

    Returns:
        (..., n, 2) speed m/s and relative heading deg.

    Raises:
        GameError: not whole numbers, or out of range.
    """
    numbers = np.asarray(indices)
    if not np.issubdtype(numbers.dtype, np.integer) or numbers.min() < 0 or numbers.max() > STOP:
        raise GameError(f"discrete actions must be whole numbers 0..{STOP}")
    commands = DISCRETE[numbers]
    commands[..., 0] *= max_speed_mps
    return commands


class ActionDecoder:
    """Turns whatever a player sends into (speed m/s, relative heading deg).

    The kind of each action is told from its type, whatever the boat's declared space: a string is a field point, a
    pair of numbers is continuous, a whole number is discrete (or a field point's number where "afp" is declared).
    -1 stops, as in Pyquaticus, whose scripted policies send it.

    Args:
        config: the game's settings.
        kinds: declared kind by agent id.
        max_speed_mps: (n,) top speeds, m/s.
        points: named field points, name -> (x, y) m, in blue's naming.
        size: (2,) field, m.
    """

    def __init__(
        self, config: GameConfig, kinds: dict[str, str], max_speed_mps: Array, points: dict[str, Array], size: Array
    ) -> None:
        self._ids = config.agent_ids
        self._index = {agent_id: i for i, agent_id in enumerate(config.agent_ids)}
        self._team_size = config.team_size
        self._radius_m = config.agent_radius_m
        self._kinds = kinds
        self._max_speed_mps = max_speed_mps
        self._points = points
        self._names = tuple(points)
        self._size = size

    def decode(self, actions: Mapping[str, Any], state: Array) -> Array:
        """Commands (n, 2) of all boats; a boat without an action stops.

        Args:
            actions: agent id -> action.
            state: (n, N_STATE) the boats' state rows.

        Raises:
            GameError: not a mapping, an unknown agent or an action that is none.
        """
        if not isinstance(actions, Mapping):
            raise GameError(f"actions are a {type(actions).__name__}; give a dict of agent id -> action")
        commands = np.zeros((len(self._ids), 2))
        for agent_id, action in actions.items():
            if agent_id not in self._index:
                raise GameError(f"unknown agent {agent_id!r} in the actions; agents are {', '.join(self._ids)}")
            i = self._index[agent_id]
            if isinstance(action, str):
                commands[i] = self._to_point(i, action, state[i])
            elif isinstance(action, (int, np.integer)) or np.ndim(action) == 0:
                commands[i] = self._number(agent_id, i, action, state[i])
            else:
                commands[i] = self._pair(agent_id, i, action, state[i])
        return commands

    def _number(self, agent_id: str, i: int, action: Any, state: Array) -> Array | tuple[float, float]:
        value = action.item() if isinstance(action, (np.ndarray, np.generic)) else action
        if isinstance(value, bool) or not isinstance(value, int):
            raise GameError(f"action {action!r} of {agent_id} is not usable; {self._help(agent_id)}")
        if self._kinds[agent_id] == "afp":
            if not 0 <= value < len(self._names):
                raise GameError(f"action {value} of {agent_id} is no field point; {self._help(agent_id)}")
            return self._to_point(i, self._names[value], state)
        if value == -1:
            value = STOP
        if not 0 <= value <= STOP:
            raise GameError(f"action {value} of {agent_id} is out of range; {self._help(agent_id)}")
        return DISCRETE[value] * (self._max_speed_mps[i], 1.0)

    def _pair(self, agent_id: str, i: int, action: Any, state: Array) -> Array | tuple[float, float]:
        try:
            pair = np.asarray(action, dtype=np.float64)
        except (TypeError, ValueError):
            pair = np.zeros(0)
        if pair.shape == (1,):
            return self._number(agent_id, i, np.asarray(action)[0], state)
        if pair.shape != (2,):
            raise GameError(f"action {action!r} of {agent_id} is not usable; {self._help(agent_id)}")
        if not np.isfinite(pair).all():
            raise GameError(f"action {action!r} of {agent_id} is not finite; give finite speed m/s and heading deg")
        return pair

    def _to_point(self, i: int, name: str, state: Array) -> tuple[float, float]:
        """Full speed towards a named point (mirrored for red), stopping within the boat's own radius of it."""
        if name not in self._points:
            near = difflib.get_close_matches(name, self._names, n=3)
            raise GameError(f"unknown field point {name!r}; {f'did you mean {near}?' if near else self._names}")
        point = self._points[name] if i < self._team_size else self._size - self._points[name]
        dx, dy = point[0] - state[L.X], point[1] - state[L.Y]
        speed = 0.0 if np.hypot(dx, dy) <= self._radius_m[i] else float(self._max_speed_mps[i])
        return speed, wrap_bearing(heading_to(dx, dy) - state[L.HEADING])

    def _help(self, agent_id: str) -> str:
        numbers = f"0..{len(self._names) - 1}" if self._kinds[agent_id] == "afp" else f"0..{STOP} (or -1 to stop)"
        return f"give a whole number {numbers}, a pair (speed m/s, relative heading deg) or a field point's name"
