"""Reading of a Pyquaticus environment; settings that a shield would misread are refused by name."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from numbers import Real
from typing import Any

import numpy as np

from ..exceptions import ConfigError
from ..fleet import Fleet
from ..jit import Array, BoolArray, IntArray
from ..platforms import Platform, get_platform
from ..platforms import layout as L
from ..surroundings import Surroundings
from .actions import DISCRETE, Command, Seat, check_agents, plain_action, read_action
from .driving import Driven, Drives, driven_rows
from .game_facts import GameFacts
from .mctf import surroundings
from .readers import game_reader

NEEDED = ("agent_radius", "dynamics", "env_size", "flag_keepout_radius", "flags", "players", "_move_agents")
"""Attributes without which the environment cannot be read or its boats' commands cannot be reached."""

_NAMES = """
gps_env env_bounds env_bounds_unit blue_flag_home red_flag_home flag_homes_unit scrimmage_coords scrimmage_coords_unit
topo_contour_eps agent_radius flag_radius flag_keepout catch_radius untag_radius slip_radius n_circle_segments obstacles
oob_speed_frac tag_speed_frac dynamics tau sim_speedup_factor default_init on_sides_init max_score max_time
tagging_cooldown tag_on_collision tag_on_oob tag_probability power_play_percentage normalize_obs short_obs_hist_length
short_obs_hist_interval long_obs_hist_length long_obs_hist_interval lidar_obs lidar_range num_lidar_rays normalize_state
short_state_hist_length short_state_hist_interval long_state_hist_length long_state_hist_interval render_fps screen_frac
arena_buffer_frac render_agent_ids render_field_points render_traj_mode render_traj_freq render_traj_cutoff
render_lidar_mode render_saving render_transparency_alpha suppress_numpy_warnings
"""

KNOWN_SETTINGS = frozenset(_NAMES.split())
"""Settings whose effect on boats is read from the environment, or that have none. The effect of others is unknown."""

_OF_PLAYERS = {
    "max_speed": "max_speed_mps",
    "speed_factor": "speed_factor",
    "max_thrust": "max_thrust",
    "max_rudder": "max_rudder",
    "turn_loss": "turn_loss",
    "turn_rate": "turn_gain",
    "max_acc": "max_acc",
    "max_dec": "max_dec",
    "rotate_speed": "rotate_speed_dps",
}
"""Pyquaticus' name of a boat's property -> ours, for boats with thrust and rudder."""


@game_reader(lambda env: hasattr(env, "players") and hasattr(env, "flag_homes") and not hasattr(env, "core"))
class PyquaticusReader:
    """Reader of a ``PyQuaticusEnv``: true positions and autopilot memory of every player.

    The environment itself controls tagged and out-of-bounds boats, after the policy's action, and stops disabled ones.
    The shield does not decide for those, and predicts what the environment makes them do.

    Raises:
        ConfigError: the environment has settings that a shield would misread.
        PlatformError: it has boats that are no known platform.
    """

    takes_pairs_only = True

    def __init__(self, env: Any) -> None:
        check_env(env)
        self.env = env
        self.agent_ids: tuple[str, ...] = tuple(str(agent) for agent in env.players)
        self._platforms = platforms_of_players(env)

    def facts(self) -> GameFacts:
        """Return step and sizes, as the environment has them at this moment.

        Raises:
            ConfigError: it now has settings that a shield would misread.
        """
        check_env(self.env)
        self._platforms = platforms_of_players(self.env)
        radius_m = np.broadcast_to(np.asarray(self.env.agent_radius, np.float64), len(self.agent_ids))
        step_s = step_of(self.env)
        obstacles = bool(getattr(self.env, "obstacles", ()))
        return GameFacts(step_s, radius_m, self._teams(), obstacles, moves_of(self.env) * step_s)

    @contextmanager
    def filtering(self, safe: Callable[[Array], Array]) -> Iterator[None]:
        """While inside, commands pass ``safe`` each time before the boats move.

        Actions are read first, so that invalid ones raise the same errors as everywhere else.
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
        """Check that the environment will accept pairs from the boats.

        If a boat's first action was of its declared space, all its actions must be.

        Raises:
            ConfigError: a boat must play other actions.
        """
        checked, match = (getattr(self.env, f"act_space_{name}", {}) for name in ("checked", "match"))
        for agent in agent_ids:
            kind = getattr(self.env, "act_space_str", {}).get(agent, "continuous")
            if checked.get(agent) and match.get(agent) and kind != "continuous":
                raise ConfigError(
                    f"{agent} has played {kind} actions in this environment, which now takes no others from it; "
                    "build it with action_space='continuous', or shield the environment: ShieldedParallelEnv"
                )

    def moment(self) -> float:
        """Return the game's time, s."""
        return float(self.env.current_time)

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """Return all boats."""
        players = list(self.env.players.values())
        state = np.array([_row(player) for player in players])
        teams = self._teams()
        driven = _driven(players)
        return Fleet(
            state,
            teams,
            self._platforms,
            (teams == team) & ~(driven[0] | driven[1] | driven[2]),
            self.agent_ids,
            driven=driven_players(self.env, players, state, teams),
            visiting=np.array([not getattr(player, "on_own_side", True) for player in players], np.bool_),
        )

    def _teams(self) -> IntArray:
        teams = (player.team for player in self.env.players.values())
        return np.array([int(getattr(team, "value", team)) for team in teams], dtype=np.int64)

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """Return the commands of actions of any kind; boats without one stop, as in the env."""
        check_agents(actions, self.agent_ids)
        values = np.zeros((len(self.agent_ids), 2))
        for i, agent in enumerate(self.agent_ids):
            if agent in actions:
                values[i] = read_action(self._seat(agent), actions[agent])
        return values

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """Return the actions in a form the env accepts: numbers, pairs and names unchanged, others made plain.

        The env looks whole numbers up in a list, so it does not accept arrays without axes, tensors or whole-valued
        floats.
        """
        return {
            agent: action if _is_playable(action) else plain_action(self._seat(agent), action)
            for agent, action in actions.items()
        }

    def _seat(self, agent: str) -> Seat:
        """Return the rules for a boat's actions, as in the env: Python's list indices, first two of more entries."""
        player = self.env.players[agent]
        points = tuple(getattr(self.env, "aquaticus_field_points", None) or ())
        return Seat(
            agent,
            float(player.get_max_speed()),
            lambda name: _to_point(self.env, name, player),
            points,
            lowest=-len(DISCRETE),
            bools=True,
            longer=True,
        )

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Return field edge, obstacles and the own flag's circle, see `mctf.surroundings_of`."""
        env, shapes = self.env, getattr(self.env, "obstacles", ())
        circles = tuple((*map(float, one.center_point), float(one.radius)) for one in shapes if hasattr(one, "radius"))
        corners = (one.anchor_points for one in shapes if hasattr(one, "anchor_points"))
        polygons = tuple(tuple((float(x), float(y)) for x, y in points) for points in corners)
        keepout_m = float(env.flag_keepout_radius) if keep_out else 0.0
        return surroundings(env.env_size, circles, polygons, env.flags[team].home, keepout_m, env.agent_radius)


@contextmanager
def _standing_in(thing: Any, name: str, value: Any) -> Iterator[None]:
    """Replace an attribute of an object while inside, and restore it afterwards."""
    before = vars(thing).get(name)
    setattr(thing, name, value)
    try:
        yield
    finally:
        if before is None:
            delattr(thing, name)
        else:
            setattr(thing, name, before)


def _to_point(env: Any, name: str, player: Any) -> Command:
    speed, heading = env._afp_to_speed_relheading(name, player)
    return float(speed), float(heading)


def _is_playable(action: Any) -> bool:
    """Return whether an action is a plain number, a name or a pair of plain numbers."""
    if isinstance(action, np.ndarray):
        return action.shape == (2,)
    pair = isinstance(action, (list, tuple)) and len(action) == 2 and all(isinstance(one, Real) for one in action)
    return pair or type(action) in (int, str)


def _row(player: Any) -> Array:
    """Return the state row of a player, with its controllers' memory where it has any."""
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


def _driven(players: Sequence[Any]) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Return which boats the environment controls: tagged, out of bounds, disabled; each (n,) bool."""
    tagged, oob, disabled = (
        np.array([bool(getattr(player, name, False)) for player in players])
        for name in ("is_tagged", "oob", "is_disabled")
    )
    return tagged, oob, disabled


def driven_players(env: Any, players: Sequence[Any], state: Array, team: IntArray) -> Array | None:
    """Return rows of `Fleet.driven` for all players; None if the environment controls none.

    Home is the own flag, or the nearer corner mark where the environment has those. With obstacles a random planner
    leads tagged boats, so their way is unknown. It is also unknown in versions without the catch radius, where the end
    of the way cannot be told.
    """
    driven = _driven(players)
    if not np.any(driven):
        return None
    homes = [np.array([flag.home], dtype=np.float64) for flag in env.flags]
    marks = [getattr(env, name, None) for name in ("blue_untag_coords", "red_untag_coords")]
    corners = any(one is not None for one in marks)
    ends = ((env.env_ul, env.env_ll), (env.env_ur, env.env_lr)) if corners else homes
    near_m = float(env.untag_radius if corners else getattr(env, "catch_radius", math.nan))
    top_mps = np.array([float(player.get_max_speed()) for player in players])
    drives = Drives(
        [np.asarray(one, dtype=np.float64) for one in (marks if corners else homes)],
        [np.asarray(one, dtype=np.float64) for one in ends],
        math.nan if getattr(env, "obstacles", ()) else near_m,
        np.asarray(env.env_size, dtype=np.float64),
        top_mps * float(getattr(env, "tag_speed_frac", 1.0)),
        top_mps * float(getattr(env, "oob_speed_frac", 1.0)),
    )
    disabled_for_s = np.array([_disabled_for_s(env, int(number)) for number in team])
    return driven_rows(drives, Driven(*driven, disabled_for_s), state, team)


def _disabled_for_s(env: Any, team: int) -> float:
    """Return how long the power play still stops a team's boats, s; 0 (no claim) if the env does not report it."""
    start = getattr(env, ("blue_power_start", "red_power_start")[team], None)
    length = getattr(env, "power_play_length", None)
    if start is None or length is None:
        return 0.0
    ends_s = (float(start) + float(length)) * float(env.sim_speedup_factor) * float(env.dt)
    return math.inf if ends_s < float(env.current_time) else ends_s - float(env.current_time)


def check_env(env: Any) -> None:
    """Refuse an environment that a shield would misread; the message names the setting and the remedy."""
    missing = [name for name in NEEDED if not hasattr(env, name)]
    if missing:
        raise ConfigError(
            f"{type(env).__name__} has no {', '.join(missing)}; give a PyQuaticusEnv, or use Shield.decide with a "
            "Fleet of your own"
        )
    if getattr(env, "gps_env", False):
        raise ConfigError(
            "gps_env = True is not supported: its positions are web-Mercator units, not metres; use gps_env=False"
        )
    moves_of(env)
    settings = getattr(env, "config_dict", None)
    for name in settings if isinstance(settings, Mapping) else ():
        if name not in KNOWN_SETTINGS:
            near = difflib.get_close_matches(str(name), KNOWN_SETTINGS, n=2)
            hint = f"did you mean {', '.join(near)}?" if near else "remove it"
            raise ConfigError(f"Pyquaticus setting {name!r} is not known here, so neither is what it does; {hint}")


def moves_of(env: Any) -> int:
    """Return the substeps of one action: the speed-up, times the frames of a step if a window is open."""
    speedup = getattr(env, "sim_speedup_factor", 1)
    if isinstance(speedup, bool) or not isinstance(speedup, (int, np.integer)) or speedup < 1:
        raise ConfigError(f"sim_speedup_factor = {speedup!r} is not supported; give a whole number of steps, 1 or more")
    frames = getattr(env, "num_renders_per_step", 1) if getattr(env, "render_mode", None) else 1
    return int(speedup) * int(frames)


def step_of(env: Any) -> float:
    """Return the length of a substep, s: a frame if a window is open, otherwise a step."""
    whole = getattr(env, "dt", getattr(env, "tau", None))
    steps = {float(step) for step in (getattr(player, "dt", whole) for player in env.players.values()) if step}
    if len(steps) != 1:
        raise ConfigError(
            f"the boats of this {type(env).__name__} move by {sorted(steps) or 'unknown'} s a step; give one with one "
            "step for all"
        )
    return steps.pop()


def platforms_of_players(env: Any) -> tuple[str, ...]:
    """Return the names of the boats' platforms; refuse boats that differ from them."""
    kinds = [get_platform(name) for name in env.dynamics]
    if len(kinds) != len(env.players):
        raise ConfigError(f"dynamics names {len(kinds)} boats of {len(env.players)}; give one for each")
    for player, kind in zip(env.players.values(), kinds, strict=True):
        if kind.kind == "usv":
            _check_player(player, kind)
        elif float(player.get_max_speed()) != kind.max_speed_mps:
            raise _other(player, kind, "max_speed", player.get_max_speed(), kind.max_speed_mps)
    return tuple(kind.name for kind in kinds)


def _check_player(player: Any, kind: Platform) -> None:
    for theirs, ours in _OF_PLAYERS.items():
        found, known = getattr(player, theirs, None), getattr(kind, ours)
        if found is not None and found != known:
            raise _other(player, kind, theirs, found, known)
    points = getattr(player, "thrust_map", None)
    if points is not None and not np.array_equal(np.transpose(points), np.array(kind.thrust_map)):
        raise _other(player, kind, "thrust_map", np.asarray(points).tolist(), kind.thrust_map)
    controllers = getattr(player, "_pid_controllers", {})
    for name, gains in (("speed", kind.speed_pid), ("heading", kind.heading_pid)):
        for gain in ("kp", "ki", "kd"):
            found, known = getattr(controllers.get(name), f"_{gain}", None), getattr(gains, gain)
            if found is not None and found != known:
                raise _other(player, kind, f"{gain} of its {name} controller", found, known)


def _other(player: Any, kind: Platform, name: str, found: Any, known: Any) -> ConfigError:
    return ConfigError(
        f"{player.id} is a {kind.name} with {name} = {found}, where the shield predicts one with {known}; leave the "
        "boat as Pyquaticus makes it, or use Shield.decide with a Platform of your own"
    )
