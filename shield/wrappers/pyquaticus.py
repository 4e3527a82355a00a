"""Reading a real Pyquaticus environment object."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np

from ..fleet import Fleet
from ..jit import Array, IntArray
from ..platforms import layout as L
from ..surroundings import Surroundings
from .actions import DISCRETE, Command, Seat, check_agents, plain_action, read_action
from .game_facts import GameFacts
from .pyquaticus_checks import check_env, check_pairs, moves_of, platforms_of_players, step_of
from .pyquaticus_driving import driven_players
from .reading import KEEP_OUT_MARGIN_M


class PyquaticusReader:
    """Reads a ``PyQuaticusEnv``: true positions and autopilot memory of every player.

    The environment drives tagged and out-of-bounds boats itself, after the policy's action, and stops disabled ones:
    those are not ours to decide for, and are foreseen as what they are (`pyquaticus_driving`).

    Raises:
        ConfigError: the environment has settings that a shield would misread.
        PlatformError: it has boats that nobody knows here.
    """

    takes_pairs_only = True

    def __init__(self, env: Any) -> None:
        check_env(env)
        self.env = env
        self.agent_ids: tuple[str, ...] = tuple(str(agent) for agent in env.players)
        self._platforms = platforms_of_players(env)

    def facts(self) -> GameFacts:
        """Step and sizes, as the environment has them now.

        Raises:
            ConfigError: it has settings by now that a shield would misread.
        """
        check_env(self.env)
        self._platforms = platforms_of_players(self.env)
        radius_m = np.broadcast_to(np.asarray(self.env.agent_radius, np.float64), len(self.agent_ids))
        step_s = step_of(self.env)
        obstacles = bool(getattr(self.env, "obstacles", ()))
        return GameFacts(step_s, radius_m, self._teams(), obstacles, moves_of(self.env) * step_s)

    @contextmanager
    def filtering(self, safe: Callable[[Array], Array]) -> Iterator[None]:
        """While inside, what the environment read from the actions passes ``safe`` each time before its boats move.

        Actions are looked at first, so that those which are none are refused in the same words everywhere.
        """
        env = self.env
        step, move = env.step, env._move_agents

        def stepping(actions: Any, *more: Any, **named: Any) -> Any:
            self.commands(actions)
            return step(self.playable(actions), *more, **named)

        def moving(commands: Mapping[str, Any], *more: Any, **named: Any) -> Any:
            wanted = np.array([commands[agent] for agent in self.agent_ids], dtype=np.float64)
            changed = {
                agent: sent.copy()
                for agent, asked, sent in zip(self.agent_ids, wanted, safe(wanted), strict=True)
                if not np.array_equal(sent, asked, equal_nan=True)
            }
            return move({**commands, **changed}, *more, **named)

        with _standing_in(env, "step", stepping), _standing_in(env, "_move_agents", moving):
            yield

    def check_answers(self, agent_ids: Sequence[str]) -> None:
        """Check that the environment plays pairs.

        Raises:
            ConfigError: it does not.
        """
        check_pairs(self.env, agent_ids)

    def moment(self) -> float:
        """Time of the game, s."""
        return float(self.env.current_time)

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now."""
        players = list(self.env.players.values())
        state = np.array([_row(player) for player in players])
        teams = self._teams()
        driven = np.array([_driven(player) for player in players])
        ours = (teams == team) & ~driven
        return Fleet(
            state,
            teams,
            self._platforms,
            ours,
            self.agent_ids,
            driven=driven_players(self.env, players, state, teams),
            visiting=np.array([not getattr(player, "on_own_side", True) for player in players], np.bool_),
        )

    def _teams(self) -> IntArray:
        return np.array([_team(player) for player in self.env.players.values()], dtype=np.int64)

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
        circles, polygons = _obstacles(getattr(env, "obstacles", ()))
        size = np.asarray(env.env_size, dtype=np.float64)
        flag, keepout_m = env.flags[team], float(env.flag_keepout_radius)
        circle: tuple[tuple[float, float, float], ...] = ()
        if keep_out and keepout_m > 0.0:
            radius = keepout_m + float(np.max(env.agent_radius)) + KEEP_OUT_MARGIN_M
            circle = ((float(flag.home[0]), float(flag.home[1]), radius),)
        return Surroundings((0.0, 0.0, float(size[0]), float(size[1])), circles, polygons, stops=circle)


@contextmanager
def _standing_in(thing: Any, name: str, value: Any) -> Iterator[None]:
    """The object's attribute is this while inside, and afterwards what it was."""
    before = vars(thing).get(name)
    setattr(thing, name, value)
    try:
        yield
    finally:
        if before is None:
            delattr(thing, name)
        else:
            setattr(thing, name, before)


def _obstacles(obstacles: Sequence[Any]) -> tuple[tuple[Any, ...], tuple[Any, ...]]:
    """Circles (x, y, radius) and polygons of corners, of Pyquaticus' objects."""
    circles = [(*map(float, one.center_point), float(one.radius)) for one in obstacles if hasattr(one, "radius")]
    corners = [one.anchor_points for one in obstacles if hasattr(one, "anchor_points")]
    polygons = [tuple((float(x), float(y)) for x, y in points) for points in corners]
    return tuple(circles), tuple(polygons)


def _driven(player: Any) -> bool:
    """Whether the environment decides for this boat."""
    return bool(player.is_tagged or player.oob or getattr(player, "is_disabled", False))


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
