"""Checks of a config's values; each refuses in one line that says what to give."""

from __future__ import annotations

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
