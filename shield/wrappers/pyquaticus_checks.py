"""Which Pyquaticus environments a shield can be put on: settings it would misread are refused by name."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..exceptions import ConfigError
from ..platforms import Platform, get_platform

NEEDED = ("agent_radius", "dynamics", "env_size", "flag_keepout_radius", "flags", "players", "_move_agents")
"""Attributes of the environment without which it cannot be read, or its boats' commands not be reached."""

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
"""Settings whose effect on boats is read from the environment, or is none; of others nobody knows what they do."""

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


def check_env(env: Any) -> None:
    """Refuse an environment that a shield would misread.

    Raises:
        ConfigError: it is one; the message names the setting and the remedy.
    """
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
    _check_settings(getattr(env, "config_dict", None))


def _check_settings(settings: Any) -> None:
    if not isinstance(settings, Mapping):
        return
    for name in settings:
        if name not in KNOWN_SETTINGS:
            near = difflib.get_close_matches(str(name), KNOWN_SETTINGS, n=2)
            hint = f"did you mean {', '.join(near)}?" if near else "remove it"
            raise ConfigError(f"Pyquaticus setting {name!r} is not known here, so neither is what it does; {hint}")


def moves_of(env: Any) -> int:
    """Moves that the environment makes of one action: those of its speed-up, and with a window open of its frames.

    Raises:
        ConfigError: the speed-up is no whole number of steps.
    """
    speedup = getattr(env, "sim_speedup_factor", 1)
    if isinstance(speedup, bool) or not isinstance(speedup, (int, np.integer)) or speedup < 1:
        raise ConfigError(f"sim_speedup_factor = {speedup!r} is not supported; give a whole number of steps, 1 or more")
    frames = getattr(env, "num_renders_per_step", 1) if getattr(env, "render_mode", None) else 1
    return int(speedup) * int(frames)


def step_of(env: Any) -> float:
    """Time that one command moves the boats by, s: with a window open a frame, else a step.

    Raises:
        ConfigError: it is not known, or not the same for all boats.
    """
    whole = getattr(env, "dt", getattr(env, "tau", None))
    steps = {float(step) for step in (getattr(player, "dt", whole) for player in env.players.values()) if step}
    if len(steps) != 1:
        raise ConfigError(
            f"the boats of this {type(env).__name__} move by {sorted(steps) or 'unknown'} s a step; give one with one "
            "step for all"
        )
    return steps.pop()


def platforms_of_players(env: Any) -> tuple[str, ...]:
    """Names of the boats' platforms.

    Raises:
        ConfigError: a boat is not as its platform is here.
        PlatformError: no such platform.
    """
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
        f"{player.id} is a {kind.name} with {name} = {found}, where the shield foresees one with {known}; leave the "
        "boat as Pyquaticus makes it, or use Shield.decide with a Platform of your own"
    )


def check_pairs(env: Any, agent_ids: Sequence[str]) -> None:
    """Refuse an environment that does not play the (speed, relative heading) pairs of a shield around a policy.

    Pyquaticus looks at the first action of a boat: if that is of the declared action space, all must be.

    Raises:
        ConfigError: a boat is bound to other actions.
    """
    spaces = getattr(env, "act_space_str", {})
    for agent in agent_ids:
        bound = getattr(env, "act_space_checked", {}).get(agent) and getattr(env, "act_space_match", {}).get(agent)
        if bound and spaces.get(agent, "continuous") != "continuous":
            raise ConfigError(
                f"{agent} has played {spaces[agent]} actions in this environment, which now takes no others from it; "
                "build it with action_space='continuous', or shield the environment: ShieldedParallelEnv"
            )
