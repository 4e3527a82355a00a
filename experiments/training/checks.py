"""Checks of a config's values; each refuses in one line that says what to give."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from steerclear.shield.exceptions import ConfigError

from ..play.spec import near


def choice(name: str, value: Any, known: tuple[str, ...]) -> None:
    """Refuse what is not among the known words.

    Raises:
        ConfigError: it is something else.
    """
    if value not in known:
        raise ConfigError(f"{name} is {value!r}; {near(str(value), known)}")


def count(name: str, value: Any, low: int, high: int) -> int:
    """Return a whole number within limits.

    Raises:
        ConfigError: it is something else.
    """
    if type(value) is not int or not low <= value <= high:
        raise ConfigError(f"{name} is {value!r}; give a whole number from {low:,} to {high:,}")
    return value


def number(name: str, value: Any, low: float, high: float) -> None:
    """Refuse what is no number within limits.

    Raises:
        ConfigError: it is something else.
    """
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ConfigError(f"{name} is {value!r}; give a number from {low:g} to {high:g}")


def span(name: str, value: Any, low: float, high: float) -> Any:
    """Return a number as it is, and a list of two, least and most, as a tuple.

    Raises:
        ConfigError: it is something else.
    """
    if not isinstance(value, (list, tuple)):
        number(name, value, low, high)
        return value
    if len(value) != 2:
        raise ConfigError(f"{name} is {value!r}; give a number, or two: least and most")
    for one in value:
        number(name, one, low, high)
    if value[0] > value[1]:
        raise ConfigError(f"{name} is {value!r}; give the least first")
    return tuple(value)


def texts(name: str, value: Any) -> tuple[str, ...]:
    """Return a list of names as a tuple.

    Raises:
        ConfigError: it is something else.
    """
    if isinstance(value, str) or not value or not all(isinstance(one, str) and one for one in value):
        raise ConfigError(f"{name} is {value!r}; give a list of names, such as [medium]")
    return tuple(value)


def check_options(algorithm: str, given: Mapping[str, Any], ranges: Mapping[str, tuple[type, float, float]]) -> None:
    """Refuse options of an algorithm that are unknown or cannot be.

    Args:
        algorithm: whose they are, as the config names it.
        given: by name.
        ranges: of each that is known: int or float, and limits.

    Raises:
        ConfigError: one is.
    """
    for name, value in given.items():
        if name not in ranges:
            raise ConfigError(f"unknown option {name!r} of {algorithm}; choose one of {', '.join(ranges)}")
        kind, low, high = ranges[name]
        if kind is int:
            count(f"options.{name}", value, int(low), int(high))
        else:
            number(f"options.{name}", value, low, high)
