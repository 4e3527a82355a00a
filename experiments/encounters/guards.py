"""Guards by name: ``none``, ``shield``, ``reach``, filters by rollouts (with ``:KEY=VALUE,...``), textbook filters."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from typing import Any, Protocol

import numpy as np
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.surroundings import OPEN_WATER, Surroundings

from .scenes import DT_S, Conditions, Scenes

NONE, SHIELD, REACH = "none", "shield", "reach"
GIVEN = {
    "separation_m": "--radius",
    "position_error_m": "--noise",
    "delay_s": "--delay",
    "current_mps": "--current",
    "dt_s": "no option",
}
"""Settings that the conditions of a run decide."""


class Guard(Protocol):
    """What filters the commands of a batch of games; the batched shield is one."""

    reason: IntArray
    certificate_m: Array

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """Commands (B, n, 2), speed m/s and relative heading deg, for the boats of ``ours`` (B, n)."""
        ...


GuardMaker = Callable[[ShieldConfig, int, tuple[str, ...], tuple[int, ...], Surroundings], Guard]
"""From settings, games, platforms, teams and static constraints to a guard."""


class NoGuard:
    """Passes every command."""

    def __init__(self, games: int, boats: int) -> None:
        self.reason = np.zeros((games, boats), np.int64)
        self.certificate_m = np.full((games, boats), np.inf)

    def decide(self, state: Array, wanted: Array, ours: BoolArray) -> Array:
        """The wanted commands themselves."""
        return wanted


def parse_guards(text: str) -> list[str]:
    """Split names of guards at commas; ``shield:a=1,b=2,none`` is two: a piece ``b=2`` belongs to what is before.

    Raises:
        ConfigError: no name, one that is not known, or settings that it refuses.
    """
    names: list[str] = []
    for piece in filter(None, (part.strip() for part in text.split(","))):
        if names and re.fullmatch(r"\w+=.*", piece):
            names[-1] += f",{piece}"
        else:
            names.append(piece)
    if not names:
        raise ConfigError("--guard names no guard; give none, shield, or one of the filters of the literature")
    for name in names:
        check_guard(name)
    return names


def check_guard(name: str) -> None:
    """Check a guard's name and settings.

    Raises:
        ConfigError: see `parse_guards`.
    """
    base, settings = split_name(name)
    if base == SHIELD:
        ShieldConfig.of(**settings)
    elif base == REACH:
        from ..baselines.reach_guard import check_settings

        check_settings(settings)
    elif base in rollout_names():
        from ..baselines.rollouts import check_settings as check_rollout

        check_rollout(base, settings)
    elif base != NONE and base not in textbook_names():
        names = ", ".join((NONE, SHIELD, REACH, *rollout_names(), *textbook_names()))
        raise ConfigError(f"unknown guard {base!r}; choose from {names}")
    elif settings:
        names = ", ".join((SHIELD, REACH, *rollout_names()))
        raise ConfigError(f"{base!r} takes no settings; only {names} do, as in shield:KEY=VALUE,...")


def textbook_names() -> tuple[str, ...]:
    """Names of the filters of the literature."""
    from ..baselines.textbook import NAMES

    return tuple(NAMES)


def rollout_names() -> tuple[str, ...]:
    """Names of the filters that roll manoeuvres out."""
    from ..baselines.rollouts import NAMES

    return tuple(NAMES)


def split_name(name: str) -> tuple[str, dict[str, Any]]:
    """Split ``shield:KEY=VALUE,...`` into the name and the settings; values are JSON or words.

    Raises:
        ConfigError: a setting without a value, or one that the conditions decide.
    """
    base, _, rest = name.partition(":")
    settings: dict[str, Any] = {}
    for piece in filter(None, rest.split(",")):
        key, equals, value = piece.partition("=")
        if not equals:
            raise ConfigError(f"{piece!r} in guard {name!r} has no value; write {base}:KEY=VALUE,...")
        if key in GIVEN:
            raise ConfigError(f"{key} of guard {name!r} follows from the run; set it with {GIVEN[key]}")
        try:
            settings[key] = json.loads(value)
        except json.JSONDecodeError:
            settings[key] = float(value) if value in ("inf", "-inf", "nan") else value
    return base, settings


def build_guard(guard: str | GuardMaker, scenes: Scenes, conditions: Conditions) -> Guard:
    """Make the guard for a batch of scenes.

    Args:
        guard: a name, or what makes one.
        scenes: games, fleet and field.
        conditions: become settings: radius, position error, delay, speed of the current.

    Raises:
        ConfigError: an unknown name, or a guard that cannot honour the conditions.
    """
    base, settings = split_name(guard) if isinstance(guard, str) else ("", {})
    if base == NONE:
        return NoGuard(scenes.games, len(scenes.team))
    config = ShieldConfig.of(
        separation_m=conditions.radius_m,
        position_error_m=conditions.noise_m,
        delay_s=conditions.delay_s,
        current_mps=conditions.current_mps,
        dt_s=DT_S,
        **({} if base in rollout_names() else settings),
    )
    fleet = (config, scenes.games, scenes.platforms, tuple(scenes.team.tolist()))
    around = OPEN_WATER if scenes.field is None else Surroundings(field=scenes.field)
    if callable(guard):
        return guard(*fleet, around)
    if base == SHIELD:
        return BatchedShield(*fleet, around)
    if base == REACH:
        from ..baselines.reach_guard import ReachGuard, check_settings

        check_settings(settings)
        return ReachGuard(*fleet)
    if base in rollout_names():
        from ..baselines.rollouts import RolloutGuard

        return RolloutGuard(base, *fleet, settings)
    if base not in textbook_names():
        check_guard(base)
    from ..baselines.textbook import TextbookGuard

    return TextbookGuard(base, *fleet)
