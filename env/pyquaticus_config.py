"""Settings under Pyquaticus' names, as in competitors' own configuration files."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

from steerclear.shield.exceptions import ConfigError
from steerclear.shield.wrappers.pyquaticus import KNOWN_SETTINGS

from .config import GameConfig

RENAMED = {
    "env_bounds": "env_bounds_m",
    "blue_flag_home": "blue_flag_home_m",
    "red_flag_home": "red_flag_home_m",
    "scrimmage_coords": "scrimmage_m",
    "agent_radius": "agent_radius_m",
    "flag_radius": "flag_radius_m",
    "flag_keepout": "flag_keepout_m",
    "catch_radius": "catch_radius_m",
    "obstacles": "obstacles",
    "oob_speed_frac": "oob_speed_frac",
    "dynamics": "platforms",
    "tau": "dt_s",
    "default_init": "default_start",
    "on_sides_init": "on_side_start",
    "max_score": "max_score",
    "max_time": "max_time_s",
    "tagging_cooldown": "tagging_cooldown_s",
    "tag_on_collision": "tag_on_collision",
    "tag_on_oob": "tag_on_oob",
    "sim_speedup_factor": "decision_steps",
    "tag_speed_frac": "tag_speed_frac",
    "tag_probability": "tag_probability",
    "untag_radius": "corner_radius_m",
    "power_play_percentage": "power_play_share",
}
"""Pyquaticus' name -> ours."""

ONLY = {
    "gps_env": (False,),
    "env_bounds_unit": ("m",),
    "flag_homes_unit": ("m",),
    "scrimmage_coords_unit": ("m",),
    "lidar_obs": (False,),
    "normalize_obs": (True,),
    "short_obs_hist_length": (1,),
    "long_obs_hist_length": (1,),
    "short_state_hist_length": (1,),
    "long_state_hist_length": (1,),
}
"""Settings that have one supported value; others are refused, not ignored."""

WITHOUT_EFFECT = KNOWN_SETTINGS - set(RENAMED) - set(ONLY)
"""Settings of drawing, lidar, histories and path planning: accepted, without effect."""

ONLY_2026 = frozenset({"tag_speed_frac", "tag_probability", "untag_radius", "power_play_percentage"})
"""Settings that only the environment of the 2026 competition has."""

OF_2026 = {"capture_at": "own_corners", "untag_at": "own_corners", "shows_disabled": True}
"""What that environment does without any setting."""

DEFAULTS = {"platforms": "heron", "flag_radius_m": 1.5}
"""Pyquaticus' defaults that differ from ours."""


def from_pyquaticus(settings: Mapping[str, Any], team_size: int, **overrides: Any) -> GameConfig:
    """Return a `GameConfig` from a Pyquaticus configuration dict.

    Args:
        settings: a configuration as for Pyquaticus; missing settings have Pyquaticus' defaults.
        team_size: boats per team.
        **overrides: settings of `GameConfig` that take precedence.

    Raises:
        ConfigError: a setting is unknown or has an unsupported value.
    """
    if not isinstance(settings, Mapping):
        raise ConfigError(f"the configuration is {type(settings).__name__}; give a dict")
    other = OF_2026 if ONLY_2026 & set(settings) else {}
    ours: dict[str, Any] = {**DEFAULTS, **other, "team_size": team_size, "preset_name": "pyquaticus"}
    for name, value in settings.items():
        if name in RENAMED:
            if not (isinstance(value, str) and value == "auto"):
                ours[RENAMED[name]] = value
        elif name in ONLY:
            if value not in ONLY[name]:
                raise ConfigError(f"{name} = {value!r} is not supported; use {ONLY[name][0]!r}")
        elif name not in WITHOUT_EFFECT:
            near = difflib.get_close_matches(str(name), [*RENAMED, *ONLY, *WITHOUT_EFFECT], n=2)
            hint = f"did you mean {', '.join(near)}?" if near else "remove it"
            raise ConfigError(f"unknown Pyquaticus setting {name!r}; {hint}")
    if "env_bounds" in settings and "env_bounds_m" not in {**ours, **overrides}:
        raise ConfigError("env_bounds = 'auto' is not supported; give the field's width and height or env_bounds_m")
    return GameConfig.build(**{**ours, **overrides})
