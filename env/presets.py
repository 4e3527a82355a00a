"""The rules of the competitions, by name."""

from __future__ import annotations

from typing import Any

PRESETS: dict[str, dict[str, Any]] = {
    # Rules of the 2024 competition as its paper gives them, on Heron boats.
    "aamas2024": {
        "env_bounds_m": (80.0, 40.0),
        "platforms": "heron",
        "agent_radius_m": 1.25,
        "tagging_cooldown_s": 10.0,
    },
    # The 2025 competition's configuration.
    "mctf2025": {
        "env_bounds_m": (160.0, 80.0),
        "platforms": "surveyor",
        "agent_radius_m": 2.0,
        "tagging_cooldown_s": 60.0,
    },
    # The 2026 competition's configuration: one decision a second, corners instead of the flag, power plays.
    "mctf2026": {
        "env_bounds_m": (160.0, 80.0),
        "platforms": "surveyor",
        "agent_radius_m": 2.0,
        "tagging_cooldown_s": 60.0,
        "decision_steps": 10,
        "flag_keepout_m": 0.0,
        "flag_radius_m": 1.5,
        "tag_speed_frac": 0.5,
        "capture_at": "own_corners",
        "untag_at": "own_corners",
        "power_play_share": 0.2,
        "shows_disabled": True,
    },
}
