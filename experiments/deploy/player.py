"""A policy that plays on what the loop saw, in a process of its own: the game as it sees it, and its answers."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.env.motion import is_on_side
from steerclear.policies.actions import HOLD, ActionReader
from steerclear.shield.bridge.feed import GameState, game_state
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.exceptions import FleetError, FleetFileError, PolicyError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from .rules import game_config, stand_in_config

NEED_NO_GAME = ("hold", "random", "waypoints")
"""Policies that look at no flag and at nobody: they also steer boats that play no game."""
NOBODY = -1
RESTART_S = 1.0
"""A game whose clock goes back by more than this is a new one."""


@dataclass(frozen=True)
class Cast:
    """Which boat of a fleet plays which agent.

    Attributes:
        config: settings of the game.
        names: all boats of the file, in its order.
        rows: number in ``names`` of each agent's boat, agent_0 first; `NOBODY` for agents of a game without opponents.
        ours: agents the policy plays.
    """

    config: GameConfig
    names: tuple[str, ...]
    rows: tuple[int, ...]
    ours: tuple[str, ...]

    @property
    def players(self) -> tuple[str, ...]:
        """Names of the boats that play, agent_0 first; empty for those that are nobody."""
        return tuple("" if row == NOBODY else self.names[row] for row in self.rows)

    @property
    def there(self) -> list[int]:
        """Numbers of the agents that have a boat."""
        return [i for i, row in enumerate(self.rows) if row != NOBODY]

    @property
    def boats(self) -> list[int]:
        """Numbers in ``names`` of their boats."""
        return [row for row in self.rows if row != NOBODY]


def cast_of(fleet: FleetFile, boats: Sequence[str] | None = None, policy: str = "") -> Cast:
    """The cast of a fleet file. Where no boat plays, our boats are a team without opponents.

    Args:
        fleet: the file.
        boats: the boats the policy plays; None: all that a process commands for our team, see `FleetFile.commanded`.
        policy: its name, which says whether it needs a game.

    Raises:
        FleetFileError: the file has no game and the policy needs one, or one of the boats does not play.
    """
    wanted = [boat.name for boat in fleet.commanded()] if boats is None else list(boats)
    if not fleet.agent_ids and policy in NEED_NO_GAME:
        return _without_game(fleet, wanted)
    if not fleet.agent_ids:
        raise FleetFileError(
            f"no boat plays and policy {policy!r} needs a game: give boats an agent: agent_0, agent_1, ..., blue "
            f"first; boats without a game are steered by --policy {' or '.join(NEED_NO_GAME)}"
        )
    config = game_config(fleet)
    ours = tuple(boat.agent for boat in map(fleet.boat, wanted) if boat.agent is not None)
    rows = tuple(i for i, boat in enumerate(fleet.boats) if boat.agent is not None)
    return Cast(config, fleet.names, rows, ours)


def _without_game(fleet: FleetFile, boats: Sequence[str]) -> Cast:
    config = stand_in_config(fleet, boats)
    ours, nobody = tuple(fleet.names.index(name) for name in boats), (NOBODY,) * len(boats)
    first = len(boats) * fleet.team_number
    agents = tuple(config.agent_ids[first : first + len(boats)])
    return Cast(config, fleet.names, ours + nobody if first == 0 else nobody + ours, agents)


class Observer:
    """An `MctfEnv` that shows what the loop saw; nothing in it moves by itself.

    A boat never seen is shown at its start, tagged, at rest. Without word from a referee the game is as at its start.
    Speeds astern are shown as 0, since boats of the game have none.

    Args:
        cast: who plays.
    """

    def __init__(self, cast: Cast) -> None:
        self.cast = cast
        self.env = MctfEnv(cast.config)
        self.env.reset()
        self._start = self.env.view()
        self._time_s = 0.0
        self._positions: Array | None = None

    def show(self, snapshot: Snapshot) -> bool:
        """Set the env to a snapshot.

        Returns:
            Whether this begins a new game: the first snapshot, or the game's clock went back.

        Raises:
            FleetError: the snapshot is of other boats.
            FeedError: the state of the game in it cannot be used.
        """
        seen = self._agents_seen(snapshot)
        game = game_state(snapshot.game) if snapshot.game else None
        time_s = 0.0 if game is None else game.time_s
        begins = self._positions is None or time_s < self._time_s - RESTART_S
        lost = np.isnan(seen[:, 0])
        state = self._start.state.copy()
        state[~lost, L.X], state[~lost, L.Y] = seen[~lost, 0], seen[~lost, 1]
        state[~lost, L.HEADING] = [wrap_degrees(heading) for heading in seen[~lost, 2]]
        state[~lost, L.SPEED] = np.maximum(seen[~lost, 3], 0.0)
        position = state[:, [L.X, L.Y]]
        view = dataclasses.replace(
            self._start,
            state=state,
            previous_position=position if begins or self._positions is None else self._positions,
            is_tagged=lost,
            on_side=self._sides(position),
            time_s=time_s,
        )
        self.env.core.restore(view if game is None else self._with_game(view, game, lost))
        self._positions, self._time_s = position, time_s
        return begins

    def observations(self) -> dict[str, np.ndarray]:
        """Observations of all agents, as `MctfEnv.step` answers them."""
        rows = self.env.core.observe()[0].copy()
        return {agent_id: rows[i] for i, agent_id in enumerate(self.env.possible_agents)}

    def infos(self) -> dict[str, dict[str, Any]]:
        """Infos of all agents, as `MctfEnv.step` answers them."""
        return self.env.infos()

    def _agents_seen(self, snapshot: Snapshot) -> Array:
        seen = np.asarray(snapshot.seen, dtype=np.float64)
        if seen.shape != (len(self.cast.names), 4):
            raise FleetError(f"seen has shape {seen.shape}; give ({len(self.cast.names)}, 4), a row per boat")
        rows = np.full((len(self.cast.rows), 4), np.nan)
        rows[self.cast.there] = seen[self.cast.boats]
        rows[~np.isfinite(rows).all(axis=1)] = np.nan
        return rows

    def _sides(self, position: Array) -> Array:
        rules = self.env.core.rules
        sides = [is_on_side(rules.scrimmage, rules.side_sign[rules.team[i]], x, y) for i, (x, y) in enumerate(position)]
        return np.array(sides, dtype=np.bool_)

    def _with_game(self, view: Any, game: GameState, lost: Array) -> Any:
        """The view with the referee's word; a flag carried by a boat in sight is where that boat is."""
        arrays = {
            name: np.array(getattr(view, name))
            for name in ("is_tagged", "has_flag", "oob", "on_side", "driven", "tagging_cooldown_s")
        }
        for i, name in enumerate(self.cast.players):
            status = game.boats.get(name)
            if status is None or lost[i]:
                continue
            arrays["is_tagged"][i], arrays["has_flag"][i] = status.tagged, status.has_flag
            arrays["oob"][i], arrays["on_side"][i] = status.oob, status.on_side
            arrays["driven"][i] = status.driven
            arrays["tagging_cooldown_s"][i] = min(status.cooldown_s, self.cast.config.tagging_cooldown_s)
        flags = np.array([(flag.x_m, flag.y_m) for flag in game.flags])
        for i in np.flatnonzero(arrays["has_flag"]):
            flags[1 - view.team[i]] = view.state[i, [L.X, L.Y]]
        counts = {name: np.array(getattr(game, name), dtype=np.int64) for name in ("captures", "grabs", "tags")}
        taken = np.array([flag.taken for flag in game.flags])
        return dataclasses.replace(
            view, flag_position=flags, flag_taken=taken, terminated=game.over, **arrays, **counts
        )


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
