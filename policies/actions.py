"""Checks one answer of foreign code and turns it into a command; the conversion itself is the game's own."""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear.shield.arrays import NoNumbersError, numbers
from steerclear.shield.exceptions import GameError, PolicyError
from steerclear.shield.wrappers.actions import short

from .games import SeenGame, seen_game

HOLD = (0.0, 0.0)
"""Action of a boat that gave no usable answer: speed 0, heading as it is."""
MAX_SPEED_FACTOR = 10.0
"""A speed beyond this many times the boat's top speed is taken for an error, not for a wish to be clipped."""
MAX_HEADING_DEG = 360.0
"""A relative heading beyond this is taken for an error."""


class ActionReader:
    """Reads actions for the boats of one game.

    Args:
        env: an `MctfEnv`, a Pyquaticus env, a wrapper round one, or the `SeenGame` of one.

    Raises:
        PolicyError: ``env`` is no such env.
    """

    def __init__(self, env: Any) -> None:
        self._game = env if isinstance(env, SeenGame) else seen_game(env)
        self._top_mps = self._game.top_speed_mps
        self._numbers = {agent_id: i for i, agent_id in enumerate(self._game.agent_ids)}

    def command(self, agent_id: str, action: Any) -> tuple[float, float]:
        """Speed m/s and relative heading deg an action asks for, from where the boat is now.

        Args:
            agent_id: whose action it is.
            action: a whole number, a pair (speed m/s, relative heading deg) or the name of a field point.

        Raises:
            PolicyError: the action is none of these, not finite, or absurdly large.
        """
        found = self.problem(agent_id, action)
        if found is not None:
            raise PolicyError(f"{found[0]}: {found[1]}")
        row = self._decode(agent_id, action)
        return float(row[0]), float(row[1])

    def problem(self, agent_id: str, action: Any) -> tuple[str, str] | None:
        """What is wrong with an action, as (kind, explanation); None when it can be used."""
        if action is None:
            return "no answer", "compute_action returned None; return an action"
        numeric = _as_numbers(action)
        if numeric is not None and not np.isfinite(numeric).all():
            return "not finite", f"{short(action)} is not finite"
        try:
            row = self._decode(agent_id, action)
        except GameError as error:
            return "no action", str(error)[:300]
        return self._too_large(agent_id, row)

    def _decode(self, agent_id: str, action: Any) -> np.ndarray:
        return self._game.commands({agent_id: action})[self._numbers[agent_id]]

    def _too_large(self, agent_id: str, row: np.ndarray) -> tuple[str, str] | None:
        limit_mps = MAX_SPEED_FACTOR * self._top_mps[agent_id]
        if abs(row[0]) > limit_mps:
            return "too large", f"speed {row[0]:g} m/s is beyond {limit_mps:g} m/s"
        if abs(row[1]) > MAX_HEADING_DEG:
            return "too large", f"relative heading {row[1]:g} deg is beyond {MAX_HEADING_DEG:g} deg"
        return None


def to_command(env: Any, agent_id: str, action: Any) -> tuple[float, float]:
    """One action as (speed m/s, relative heading deg); see `ActionReader.command`, which is quicker for many.

    Raises:
        PolicyError: nobody reads ``env``, the agent is unknown, or the action is unusable.
    """
    game = seen_game(env)
    if agent_id not in game.agent_ids:
        raise PolicyError(f"unknown agent {agent_id!r}; agents are {', '.join(game.agent_ids)}")
    return ActionReader(game).command(agent_id, action)


def _as_numbers(action: Any) -> np.ndarray | None:
    """The action as floats, or None when it holds no numbers or too large ones (the game's decoder refuses those)."""
    if isinstance(action, (str, bytes)):
        return None
    try:
        return numbers(action)
    except NoNumbersError:
        return None
