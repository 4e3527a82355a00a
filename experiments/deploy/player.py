"""`Player`: a policy that plays on what the loop saw. It runs in a process of its own, see `policy_process`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.policies.actions import HOLD, ActionReader
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.exceptions import PolicyError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L

from .observing import Cast, Observer


@dataclass(frozen=True)
class Orders:
    """What a process is to play: pickled and sent to it.

    Attributes:
        cast: who plays.
        policy: name or path, as `steerclear.policies.make` takes it.
        options: of the policy.
        seed: of everything it draws; a second game is played from seed + 1, and so on.
    """

    cast: Cast
    policy: str
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0


@dataclass(frozen=True)
class Play:
    """A policy's answer to one snapshot.

    Attributes:
        relative: (n_agents, 2) what each agent's boat is to obey, as in the game: speed m/s, heading deg relative to
            its own; NaN: no usable answer, or not played by this policy.
        driven: (n_agents,) boats the game drives: tagged, or out of bounds.
        commands: (n_boats, 2) the same for all boats of the file: speed m/s, up to the boat's top speed, and absolute
            heading rad.
        problems: what was wrong with single boats' answers, a line each.
    """

    relative: Array
    driven: Array
    commands: Array
    problems: tuple[str, ...] = ()


class Player:
    """A policy in the game that snapshots show, with the game's own drive home of tagged and out-of-bounds boats.

    Args:
        orders: what to play.

    Raises:
        PolicyError: the policy is unknown, cannot be loaded, or cannot play this game.
    """

    def __init__(self, orders: Orders) -> None:
        self._orders = orders
        self._cast = orders.cast
        self.observer = Observer(orders.cast)
        self._reader = ActionReader(self.observer.env)
        self.policy = policies.make(orders.policy, **orders.options)
        self._games = 0

    def warm_up(self) -> None:
        """Play one step of a game nobody sees, so that what compiles or loads late does it now.

        Raises:
            PolicyError: the policy cannot begin a game.
        """
        if self._cast.ours:
            self._begin()
            self._ask()
        self._games = 0

    def play(self, snapshot: Snapshot) -> Play:
        """Answer a snapshot; what the policy raises is a problem of its boats.

        Raises:
            SteerclearError: the snapshot cannot be used, or the policy cannot begin a game.
        """
        if self.observer.show(snapshot) and self._cast.ours:
            self._begin()
        actions, problems = self._ask() if self._cast.ours else ({}, {})
        core = self.observer.env.core
        wanted = self.observer.env.decode(actions)
        relative: Array = core.commands(wanted[np.newaxis])[0]
        driven = core.driven[0].copy()
        for i, agent_id in enumerate(self.observer.env.possible_agents):
            if agent_id not in self._cast.ours or (agent_id in problems and not driven[i]):
                relative[i] = np.nan
        names = dict(zip(self.observer.env.possible_agents, self._cast.players, strict=True))
        texts = tuple(f"{names[agent_id]}: {text}" for agent_id, text in problems.items())
        return Play(relative, driven, self._absolute(relative), texts)

    def close(self) -> None:
        """Let the policy give back what it holds."""
        if hasattr(self.policy, "close"):
            self.policy.close()

    def _begin(self) -> None:
        self.policy.reset(self.observer.env, list(self._cast.ours), self._orders.seed + self._games)
        self._games += 1

    def _ask(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Actions of our agents, a stop for those without a usable one, and what was wrong with these."""
        try:
            answer = self.policy.act(self.observer.observations(), self.observer.infos())
            actions = {agent_id: answer[agent_id] for agent_id in self._cast.ours}
        except (Exception, SystemExit) as error:  # foreign code may raise anything, and call exit()
            text = f"raised {type(error).__name__}: {' '.join(str(error).split())[:200]}"
            return dict.fromkeys(self._cast.ours, HOLD), dict.fromkeys(self._cast.ours, text)
        problems = dict(getattr(self.policy, "held", {}))
        for agent_id, action in actions.items():
            found = self._reader.problem(agent_id, action)
            if found is not None:
                problems[agent_id] = f"{found[0]}: {found[1]}"
                actions[agent_id] = HOLD
        return actions, problems

    def _absolute(self, relative: Array) -> Array:
        core = self.observer.env.core
        commands = np.full((len(self._cast.names), 2), np.nan)
        headings_rad = np.radians((core.state[0, :, L.HEADING] + relative[:, 1]) % 360.0)
        speeds_mps = np.clip(relative[:, 0], -core.max_speed_mps, core.max_speed_mps)
        commands[self._cast.boats] = np.column_stack([speeds_mps, headings_rad])[self._cast.there]
        return commands


def load_player(orders: Orders) -> Player:
    """A player that has played a step; whatever the policy raises on the way is a `PolicyError`.

    Raises:
        PolicyError: the policy is unknown, cannot be loaded, or cannot play this game.
    """
    try:
        player = Player(orders)
        player.warm_up()
    except PolicyError:
        raise
    except (Exception, SystemExit) as error:
        said = " ".join(str(error).split())[:300]
        raise PolicyError(f"policy {orders.policy!r} cannot be loaded: {type(error).__name__}: {said}") from error
    return player
