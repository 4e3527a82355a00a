"""Checks of settings. Each returns the checked value or raises a `ConfigError` that names the remedy."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError


def check_real(
    name: str, value: Any, low: float | None = None, above: float | None = None, high: float | None = None
) -> float:
    """Check that a value is a finite number, ``>= low``, ``> above`` and ``<= high`` where given."""
    if isinstance(value, bool) or not isinstance(value, (int, float, np.integer, np.floating)):
        raise ConfigError(f"{name} is {value!r}; give a number")
    number = float(value)
    if not math.isfinite(number):
        raise ConfigError(f"{name} is {number}; give a finite number")
    if low is not None and number < low:
        raise ConfigError(f"{name} is {number}; it must be >= {low}")
    if above is not None and number <= above:
        raise ConfigError(f"{name} is {number}; it must be > {above}")
    if high is not None and number > high:
        raise ConfigError(f"{name} is {number}; it must be <= {high}")
    return number


def check_count(name: str, value: Any, low: int, high: int | None = None) -> int:
    """Check that a value is a whole number, ``>= low`` and, where given, ``<= high``."""
    if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < low:
        raise ConfigError(f"{name} is {value!r}; give a whole number >= {low}")
    if high is not None and value > high:
        raise ConfigError(f"{name} is {value}; give at most {high}")
    return int(value)


def check_choice(name: str, value: Any, choices: Sequence[Any]) -> None:
    """Check that a value is one of ``choices``."""
    if not any(value is choice or (isinstance(value, str) and value == choice) for choice in choices):
        raise ConfigError(f"{name} is {value!r}; choose one of {', '.join(repr(c) for c in choices)}")


def check_point(name: str, value: Any) -> tuple[float, float]:
    """Check that a value is an (x, y) pair of finite numbers."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise ConfigError(f"{name} is {value!r}; give a pair (x, y)")
    pair = tuple(value)
    if len(pair) != 2:
        raise ConfigError(f"{name} is {value!r}; give a pair (x, y)")
    return check_real(f"{name} x", pair[0]), check_real(f"{name} y", pair[1])


def check_segment(name: str, value: Any) -> tuple[tuple[float, float], tuple[float, float]]:
    """Check that a value is two different points."""
    points = list(value) if isinstance(value, Iterable) and not isinstance(value, str) else []
    ends = tuple(check_point(name, point) for point in points) if len(points) == 2 else ()
    if len(set(ends)) != 2:
        raise ConfigError(f"{name} is {value!r}; give two different points ((x, y), (x, y))")
    return ends[0], ends[1]


def per_boat(name: str, value: Any, n_boats: int, kinds: tuple[type, ...]) -> tuple[Any, ...]:
    """Return one value per boat: a single value is repeated, a sequence must have the right length."""
    if isinstance(value, kinds):
        return (value,) * n_boats
    if isinstance(value, (list, tuple, np.ndarray)):
        if len(value) != n_boats:
            raise ConfigError(f"{name} has {len(value)} entries for {n_boats} boats; give one value, or one per boat")
        if all(isinstance(entry, (*kinds, np.generic)) for entry in value):
            return tuple(value)
    raise ConfigError(f"{name} is {value!r}; give one value, or one per boat ({n_boats})")


def check_obstacles(value: Any) -> dict[str, tuple[Any, ...]]:
    """Check obstacles and return them by kind; None means none.

    Circles are (radius, (x, y)), polygons at least three different corners (x, y); metres.
    """
    if value is None:
        value = {}
    if not isinstance(value, Mapping) or set(value) - {"circle", "polygon"}:
        raise ConfigError(f"obstacles is {value!r}; give a dict with the keys 'circle' and 'polygon' only")
    checked: dict[str, list[Any]] = {"circle": [], "polygon": []}
    for entry in _entries("circle", value.get("circle") or ()):
        if len(entry) != 2:
            raise ConfigError(f"circle obstacle {entry!r}: give (radius, (x, y))")
        radius = check_real("circle obstacle radius", entry[0], above=0.0)
        checked["circle"].append((radius, check_point("circle obstacle centre", entry[1])))
    for entry in _entries("polygon", value.get("polygon") or ()):
        corners = tuple(check_point("polygon obstacle corner", corner) for corner in entry)
        if len(set(corners)) < 3 or len(set(corners)) != len(corners):
            raise ConfigError(f"polygon obstacle {entry!r}: give at least 3 corners, each once")
        checked["polygon"].append(corners)
    return {kind: tuple(shapes) for kind, shapes in checked.items()}


def _entries(kind: str, value: Any) -> list[Any]:
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise ConfigError(f"obstacles[{kind!r}] is {value!r}; give a list")
    entries = list(value)
    for entry in entries:
        if isinstance(entry, str) or not isinstance(entry, Sequence | np.ndarray):
            raise ConfigError(f"{kind} obstacle {entry!r}: give a tuple")
    return entries
