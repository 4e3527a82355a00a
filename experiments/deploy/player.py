"""A policy in a process of its own: it observes the game as the loop saw it, and answers with commands.

`entries.sandbox` forks the process and ends it when the runner is gone. It reads pickled `Orders`, then snapshots,
and answers in JSON.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import pickle
import threading
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from typing import Any, NamedTuple

import numpy as np
from steerclear import policies
from steerclear.env.config import GameConfig
from steerclear.env.mctf import MctfEnv
from steerclear.env.motion import is_on_side
from steerclear.policies.actions import HOLD, ActionReader
from steerclear.policies.own import own_code
from steerclear.shield.bridge.feed_packets import GameState, game_state
from steerclear.shield.bridge.fleet_file import FleetFile
from steerclear.shield.bridge.messages import Snapshot
from steerclear.shield.exceptions import FleetError, FleetFileError, PolicyError, SteerclearError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees
from steerclear.shield.wrappers.actions import team_answer

from .referee import game_config, stand_in_config

NEED_NO_GAME = ("hold", "random", "waypoints")
"""Policies that use neither flags nor other boats; they can also steer boats that play no game."""
NOBODY = -1
RESTART_S = 1.0  # if the game clock goes back by more than this, a new game has begun, s
FAILED = 3  # exit status if the policy could not be loaded; the answer before it gives the reason
GRACE_S = 5.0  # time the supervisor has to end this process after the runner is gone, s


@dataclass(frozen=True)
class Cast:
    """Assignment of a fleet's boats to the agents of a game."""

    config: GameConfig
    names: tuple[str, ...]  # all boats of the file, in its order
    rows: tuple[int, ...]  # index in ``names`` of each agent's boat, agent_0 first; `NOBODY` for agents without a boat
    ours: tuple[str, ...]  # agents that the policy plays

    @property
    def players(self) -> tuple[str, ...]:
        """Names of the agents' boats, agent_0 first; empty for agents without a boat."""
        return tuple("" if row == NOBODY else self.names[row] for row in self.rows)

    @property
    def there(self) -> tuple[list[int], list[int]]:
        """Numbers of the agents that have a boat, and the indices of their boats in ``names``."""
        return [i for i, row in enumerate(self.rows) if row != NOBODY], [row for row in self.rows if row != NOBODY]


def cast_of(fleet: FleetFile, boats: Sequence[str] | None = None, policy: str = "") -> Cast:
    """Return the cast of a fleet file. If no boat plays, the own boats form a team without opponents.

    Args:
        fleet: the file.
        boats: the boats the policy plays; None: all that a process commands for the team, see `FleetFile.commanded`.
        policy: its name, which tells whether it needs a game.

    Raises:
        FleetFileError: the policy needs a game and the file has none, or one of the boats does not play.
    """
    wanted = [boat.name for boat in fleet.commanded()] if boats is None else list(boats)
    if fleet.agent_ids:
        ours = tuple(boat.agent for boat in map(fleet.boat, wanted) if boat.agent is not None)
        rows = tuple(i for i, boat in enumerate(fleet.boats) if boat.agent is not None)
        return Cast(game_config(fleet), fleet.names, rows, ours)
    if policy not in NEED_NO_GAME and own_code(policy) is None:
        raise FleetFileError(
            f"no boat plays and policy {policy!r} needs a game: give boats an agent: agent_0, agent_1, ..., blue "
            f"first; boats without a game are steered by --policy {', '.join(NEED_NO_GAME)} or FILE.py:NAME of your own"
        )
    config, count = stand_in_config(fleet, wanted), len(wanted)
    own, nobody = tuple(fleet.names.index(name) for name in wanted), (NOBODY,) * count
    agents = tuple(config.agent_ids[count * fleet.team_number :][:count])
    return Cast(config, fleet.names, own + nobody if fleet.team_number == 0 else nobody + own, agents)


class Observer:
    """An `MctfEnv` set to what the loop saw; it never steps.

    A boat never seen appears at its start, tagged and at rest. Without a referee the game is in its initial state.
    Speeds astern appear as 0, since the game's boats have none.
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
            Whether a new game begins: this is the first snapshot, or the game's clock went back.

        Raises:
            FleetError: the snapshot is of other boats.
            FeedError: its game state cannot be used.
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
        position, rules = state[:, [L.X, L.Y]], self.env.core.rules
        sides = zip(rules.side_sign[rules.team], position, strict=True)
        view = dataclasses.replace(
            self._start,
            state=state,
            previous_position=position if begins or self._positions is None else self._positions,
            is_tagged=lost,
            on_side=np.array([is_on_side(rules.scrimmage, sign, *place) for sign, place in sides]),
            time_s=time_s,
        )
        self.env.core.restore(view if game is None else self._with_game(view, game, lost))
        self._positions, self._time_s = position, time_s
        return begins

    def observations(self) -> dict[str, np.ndarray]:
        """Return the observations of all agents, as `MctfEnv.step` does."""
        return dict(zip(self.env.possible_agents, self.env.core.observe()[0].copy(), strict=True))

    def infos(self) -> dict[str, dict[str, Any]]:
        """Return the infos of all agents, as `MctfEnv.step` does."""
        return self.env.infos()

    def _agents_seen(self, snapshot: Snapshot) -> Array:
        seen = np.asarray(snapshot.seen, dtype=np.float64)
        if seen.shape != (len(self.cast.names), 4):
            raise FleetError(f"seen has shape {seen.shape}; give ({len(self.cast.names)}, 4), a row per boat")
        rows = np.full((len(self.cast.rows), 4), np.nan)
        agents, boats = self.cast.there
        rows[agents] = seen[boats]
        rows[~np.isfinite(rows).all(axis=1)] = np.nan
        return rows

    def _with_game(self, view: Any, game: GameState, lost: Array) -> Any:
        """Add the referee's game state to the view; a carried flag is at its carrier if that boat was seen."""
        reported = {"is_tagged": "tagged", "tagging_cooldown_s": "cooldown_s"}
        reported |= {name: name for name in ("has_flag", "oob", "on_side", "driven")}
        arrays = {name: np.array(getattr(view, name)) for name in reported}
        for i, name in enumerate(self.cast.players):
            status = game.boats.get(name)
            if status is not None and not lost[i]:
                for array, key in reported.items():
                    arrays[array][i] = getattr(status, key)
        cooldown = arrays["tagging_cooldown_s"]
        np.minimum(cooldown, self.cast.config.tagging_cooldown_s, out=cooldown)
        flags = np.array([(flag.x_m, flag.y_m) for flag in game.flags])
        for i in map(int, np.flatnonzero(arrays["has_flag"])):
            flags[1 - view.team[i]] = view.state[i, [L.X, L.Y]]
        counts = {name: np.array(getattr(game, name), dtype=np.int64) for name in ("captures", "grabs", "tags")}
        taken = np.array([flag.taken for flag in game.flags])
        return dataclasses.replace(
            view, flag_position=flags, flag_taken=taken, terminated=game.over, **arrays, **counts
        )


@dataclass(frozen=True)
class Orders:
    """First message to the process, pickled."""

    cast: Cast  # boats and agents
    policy: str  # name or path, as `steerclear.policies.make` takes it
    options: Mapping[str, Any] = field(default_factory=dict)  # of the policy
    seed: int = 0  # of all random draws; the second game uses seed + 1, and so on


class Play(NamedTuple):
    """A policy's answer to one snapshot; NaN: no usable answer, or a boat that this policy does not play."""

    relative: Array  # (n_agents, 2) command of each agent's boat: speed m/s, heading deg relative to its own
    driven: Array  # (n_agents,) game-controlled boats: tagged, or out of bounds
    commands: Array  # (n_boats, 2) the same for all boats of the file: speed m/s up to top speed, absolute heading rad
    problems: tuple[str, ...] = ()  # what was wrong with single boats' answers, a line each


class Player:
    """Plays a policy in the game that snapshots show; the game itself steers tagged and out-of-bounds boats home.

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
        """Play one step of an unused game, so that compilation and lazy imports happen before the first snapshot."""
        Observer(self._cast).show(Snapshot(0, 0.0, np.zeros((len(self._cast.names), 4))))
        if self._cast.ours:
            self._begin()
            self._ask()
        self._games = 0

    def play(self, snapshot: Snapshot) -> Play:
        """Answer a snapshot; an exception in the policy's ``act`` becomes a problem of its boats.

        Raises:
            SteerclearError: the snapshot cannot be used, or the policy cannot begin a game.
        """
        if self.observer.show(snapshot) and self._cast.ours:
            self._begin()
        actions, problems = self._ask() if self._cast.ours else ({}, {})
        env = self.observer.env
        relative: Array = env.core.commands(env.decode(actions)[np.newaxis])[0]
        driven = env.core.driven[0].copy()
        for i, agent_id in enumerate(env.possible_agents):
            if agent_id not in self._cast.ours or (agent_id in problems and not driven[i]):
                relative[i] = np.nan
        names = dict(zip(env.possible_agents, self._cast.players, strict=True))
        texts = tuple(f"{names.get(agent_id, agent_id)}: {text}" for agent_id, text in problems.items())
        commands = np.full((len(self._cast.names), 2), np.nan)
        headings_rad = np.radians((env.core.state[0, :, L.HEADING] + relative[:, 1]) % 360.0)
        speeds_mps = np.clip(relative[:, 0], -env.core.max_speed_mps, env.core.max_speed_mps)
        agents, boats = self._cast.there
        commands[boats] = np.column_stack([speeds_mps, headings_rad])[agents]
        return Play(relative, driven, commands, texts)

    def close(self) -> None:
        """Let the policy release its resources."""
        if hasattr(self.policy, "close"):
            self.policy.close()

    def _begin(self) -> None:
        self.policy.reset(self.observer.env, list(self._cast.ours), self._orders.seed + self._games)
        self._games += 1

    def _ask(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Return actions of the own agents and their problems; an agent without a usable action stops."""
        ours = self._cast.ours
        try:
            answer = self.policy.act(self.observer.observations(), self.observer.infos())
            actions, faults = team_answer(answer, ours)
        except (Exception, SystemExit) as error:  # foreign code may raise anything, and call exit()
            return dict.fromkeys(ours, HOLD), dict.fromkeys(ours, f"raised {_line(error, 200)}")
        problems = {**faults, **getattr(self.policy, "held", {})}
        for agent_id, action in actions.items():
            found = self._reader.problem(agent_id, action)
            if found is not None:
                problems[agent_id] = f"{found[0]}: {found[1]}"
                actions[agent_id] = HOLD
        return actions, problems


def load_player(orders: Orders) -> Player:
    """Return a warmed-up player; `PolicyError` where the policy is unknown, does not load, or cannot play this game."""
    try:
        player = Player(orders)
        player.warm_up()
    except PolicyError:
        raise
    except (Exception, SystemExit) as error:
        raise PolicyError(f"policy {orders.policy!r} cannot be loaded: {_line(error)}") from error
    return player


def _line(error: BaseException, most: int = 300) -> str:
    return f"{type(error).__name__}: {' '.join(str(error).split())[:most]}"


class Latest:
    """Receives snapshots in a thread and holds the latest, so that a slow policy skips outdated ones."""

    def __init__(self, snapshots: Connection) -> None:
        self._snapshots = snapshots
        self._ready = threading.Condition()
        self._message = b""
        threading.Thread(target=self._receive, name="snapshots", daemon=True).start()

    def take(self) -> bytes:
        """Wait for a message not taken yet, and return the latest."""
        with self._ready:
            self._ready.wait_for(lambda: self._message)
            message, self._message = self._message, b""
        return message

    def _receive(self) -> None:
        while True:
            try:
                message = self._snapshots.recv_bytes()
            except (OSError, EOFError):
                time.sleep(GRACE_S)  # the runner is gone; the supervisor normally ends this process first
                os._exit(0)
            with self._ready:
                self._message = message
                self._ready.notify()


def serve(read_fd: int, write_fd: int, folder: str) -> int:
    """Load the policy named by the first message, then answer snapshots until the runner is gone."""
    snapshots, answers = Connection(read_fd, writable=False), Connection(write_fd, readable=False)

    def answer(**content: Any) -> None:
        answers.send_bytes(json.dumps(content, allow_nan=False).encode())

    try:
        player = load_player(pickle.loads(snapshots.recv_bytes()))
    except EOFError:
        return 0
    except SteerclearError as error:
        answer(failed=str(error))
        return FAILED
    answer(ready=True)
    latest = Latest(snapshots)
    while True:
        snapshot = pickle.loads(latest.take())
        try:
            play = player.play(snapshot)
        except (SteerclearError, SystemExit) as error:
            answer(number=snapshot.number, commands=None, problems=[_line(error)])
            continue
        rows = [row if math.isfinite(row[0]) else None for row in play.commands.tolist()]
        answer(number=snapshot.number, commands=rows, problems=list(play.problems))
