"""A human at the keyboard steers one boat; another policy plays the rest of the team."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.shield.exceptions import PolicyError

from .protocol import Action, TeamPolicy
from .scripted.team import boat_numbers, game_core

Keys = Callable[[], set[str]]
"""Names of the keys held down, such as "up", "left", "w", "left shift"."""

AHEAD, BACK, LEFT, RIGHT = {"up", "w"}, {"down", "s"}, {"left", "a"}, {"right", "d"}
SLOW = {"left shift", "right shift"}
TURN_DEG = 45.0
SHARP_TURN_DEG = 90.0


class KeyboardTeam:
    """One boat steered with the arrow keys or w, a, s, d.

    Ahead: full speed; with left or right: 45 deg to that side. Left or right alone: a sharp turn at half speed, since a
    boat without thrust does not turn. Back: 180 deg at half speed. Shift: half speed. No key: stop.

    Args:
        others: plays the team's other boats.
        agent: the human's boat, as a number in the team or an agent id.
        keys: returns the held keys; None reads the window of render mode "human".
    """

    def __init__(self, others: TeamPolicy, agent: int | str = 0, keys: Keys | None = None) -> None:
        self.name = "keyboard"
        self._others = others
        self._agent = agent
        self._given_keys = keys
        self._boat = ""

    def reset(self, env: Any, agent_ids: Sequence[str], seed: int) -> None:
        """Begin a game."""
        core = game_core(env)
        by_number = dict(enumerate(agent_ids))
        self._boat = by_number.get(self._agent, "") if isinstance(self._agent, int) else self._agent
        if self._boat not in agent_ids:
            raise PolicyError(f"agent is {self._agent!r}; give one of {', '.join(agent_ids)}, or its number from 0")
        self._top_mps = float(core.max_speed_mps[boat_numbers(core, [self._boat])[0]])
        self._keys = self._given_keys or window_keys(env)
        self._rest = [agent_id for agent_id in agent_ids if agent_id != self._boat]
        if self._rest:
            self._others.reset(env, self._rest, seed)

    def act(self, observations: Mapping[str, np.ndarray], infos: Mapping[str, Any]) -> dict[str, Action]:
        """Return the actions of the team."""
        if not self._boat:
            raise PolicyError("the keyboard policy has no game; call reset(env, agent_ids, seed) first")
        actions = self._others.act(observations, infos) if self._rest else {}
        share, heading_deg = steer(self._keys())
        actions[self._boat] = (share * self._top_mps, heading_deg)
        return actions


def steer(keys: set[str]) -> tuple[float, float]:
    """Return share of top speed and relative heading, deg, for the held keys."""
    side = bool(keys & RIGHT) - bool(keys & LEFT)
    if keys & BACK:
        return 0.5, 180.0
    if keys & AHEAD:
        return 0.5 if keys & SLOW else 1.0, TURN_DEG * side
    return (0.5, SHARP_TURN_DEG * side) if side else (0.0, 0.0)


def window_keys(env: Any) -> Keys:
    """Return the keyboard of an env's window."""
    game = getattr(env, "unwrapped", env)
    if getattr(game, "render_mode", None) != "human":
        raise PolicyError("the keyboard policy needs a window: build the env with render_mode='human'")

    def keys() -> set[str]:
        renderer = getattr(game, "renderer", None)  # exists from the first picture on
        return renderer.keys() if renderer is not None else set()

    return keys
