"""Our learned teams by name: each has its weights, the config that trains it again and its curve in ``teams/``."""

from __future__ import annotations

from pathlib import Path

TEAMS = Path(__file__).parent / "teams"
FILES: dict[str, Path] = {}
