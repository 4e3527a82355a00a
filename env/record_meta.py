"""The settings that a record carries, read off a game's config."""

from __future__ import annotations

from typing import Any

from steerclear.env.config import GameConfig
from steerclear.shield.exceptions import TraceError

DEFAULT_SEPARATION_M = 2.5

_BESIDE_THE_GAME: dict[str, Any] = {
    "separation_m": DEFAULT_SEPARATION_M,
    "policies": {"blue": "", "red": ""},
    "shielded": [],
    "seed": None,
    "reason_names": [],
    "title": "",
}


def meta_of(config: GameConfig, **settings: Any) -> dict[str, Any]:
    """Return a record's ``meta`` for a game.

    Args:
        config: The game's settings.
        **settings: What the game does not know: ``separation_m``, ``policies`` {blue, red}, ``shielded`` (agent
            ids), ``seed``, ``reason_names`` and ``title``. Those left out describe an unshielded, unnamed game.

    Returns:
        A dict with all of ``record_file.META_KEYS``, the title, the scrimmage line and the obstacles. The radius
        is one number, or one for each boat where they differ.

    Raises:
        TraceError: A setting is unknown.
    """
    unknown = sorted(set(settings) - set(_BESIDE_THE_GAME))
    if unknown:
        raise TraceError(f"unknown {', '.join(unknown)}; a record takes {', '.join(_BESIDE_THE_GAME)}.")
    (width, height), radii = config.env_bounds_m, config.agent_radius_m
    game = {
        "dt_s": config.dt_s,
        "decision_steps": config.decision_steps,
        "corner_radius_m": config.corner_radius_m if "own_corners" in (config.capture_at, config.untag_at) else 0.0,
        "env_bounds_m": config.env_bounds_m,
        "team_size": config.team_size,
        "agent_ids": config.agent_ids,
        "team": [0] * config.team_size + [1] * config.team_size,
        "flag_home": [
            config.blue_flag_home_m or (width / 8, height / 2),
            config.red_flag_home_m or (width * 7 / 8, height / 2),
        ],
        "scrimmage": config.scrimmage_m,
        "catch_radius_m": config.catch_radius_m,
        "flag_keepout_m": config.flag_keepout_m,
        "agent_radius_m": radii[0] if len(set(radii)) == 1 else radii,
        "platforms": [platform.name for platform in config.platforms],
        "obstacles": config.obstacles,
        "preset": config.preset_name,
    }
    return game | _BESIDE_THE_GAME | settings
