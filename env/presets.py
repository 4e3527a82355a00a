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
}
