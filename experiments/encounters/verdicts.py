"""What the oracle says about the breaches of a game."""

from __future__ import annotations

import importlib
from typing import Any

import numpy as np
from steerclear.env.record import find_breaches
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform

from .play import Film, water_states
from .scenes import DT_S

MOST_JUDGED = 5
"""Breaches of one game that are judged; a crowd without a guard has hundreds."""
VERDICT_COLUMNS = ("avoidable", "unavoidable", "started_inside", "not_judged", "last_preventable_s")


def judge_game(film: Film, game: int) -> dict[str, float]:
    """Judge the breaches of the own boats in a game, the first `MOST_JUDGED` of them.

    A breach is avoidable when any own boat in it could have avoided it; of team-mates either may.

    Returns:
        How many are ``avoidable``, ``unavoidable``, ``started_inside`` and ``not_judged``, and ``last_preventable_s``,
        how long before the breach the first avoidable one could still be avoided.
    """
    states = water_states(film, game)
    team, radius_m = film.scenes.team, film.conditions.radius_m
    found = find_breaches(states[:, :, :2], radius_m)
    ours = [row for row in found if team[int(row[1])] == 0 or team[int(row[2])] == 0]
    counts = dict.fromkeys(VERDICT_COLUMNS, 0.0) | {"last_preventable_s": np.nan}
    counts["not_judged"] = float(max(0, len(ours) - MOST_JUDGED))
    for step, a, b, _ in ours[:MOST_JUDGED]:
        sides = [
            _side(states, film.scenes.platforms, int(i), int(j), int(step), radius_m)
            for i, j in ((a, b), (b, a))
            if team[int(i)] == 0
        ]
        names = [name for name, _ in sides]
        name = next(n for n in ("avoidable", "started_inside", "unavoidable") if n in names)
        counts[name] += 1.0
        if name == "avoidable" and np.isnan(counts["last_preventable_s"]):
            counts["last_preventable_s"] = min(late for n, late in sides if n == name)
    return counts


def _side(
    states: np.ndarray, platforms: tuple[str, ...], own: int, other: int, step: int, radius_m: float
) -> tuple[str, float]:
    """Outcome for one boat, and how long before the breach it could still be avoided, s (NaN where never)."""
    params = np.array([get_platform(name).pack() for name in platforms])
    verdict = _oracle().judge(states, params, own=own, step=step, radius_m=radius_m, dt_s=DT_S, other=other)
    late = verdict.last_preventable_s
    return str(verdict.outcome), float("nan") if late is None else float(late)


def _oracle() -> Any:
    try:
        return importlib.import_module("steerclear.experiments.oracle")
    except ImportError as error:
        raise ConfigError(f"the oracle cannot be imported ({error}); reinstall steerclear or add --no-judge") from error
