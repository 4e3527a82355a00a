"""Values of a packet of the feed, each read with its check and its one line of what to give instead."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NoReturn

from ..exceptions import FeedError

MAX_NAME = 64


def mapping_of(entry: Any, what: str) -> Mapping[str, Any]:
    """The object itself.

    Raises:
        FeedError: it is none; ``what`` says what it was to be.
    """
    if not isinstance(entry, Mapping):
        raise FeedError(f"{what} is {short(entry)}; give an object")
    return entry


def number_of(entry: Mapping[str, Any], key: str, low: float, high: float) -> float:
    """A finite number from ``low`` to ``high``.

    Raises:
        FeedError: it is missing or none of these.
    """
    value = entry.get(key)
    usable = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not usable or not low <= value <= high:  # type: ignore[operator] # a number when usable
        raise FeedError(f"{key} is {short(value)}; give a number from {low:g} to {high:g}")
    return float(value)  # type: ignore[arg-type] # checked above


def count_of(entry: Mapping[str, Any], key: str, default: int | None = None) -> int:
    """A whole number >= 0; ``default`` where it is left out.

    Raises:
        FeedError: it is none.
    """
    value = entry.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 2**63:
        raise FeedError(f"{key} is {short(value)}; give a whole number >= 0")
    return value


def pair_of(entry: Mapping[str, Any], key: str) -> tuple[int, int]:
    """Two counts, blue's and red's.

    Raises:
        FeedError: they are not two, or no counts.
    """
    value = entry.get(key)
    if not isinstance(value, (list, tuple)) or len(value) != 2:
        raise FeedError(f"{key} is {short(value)}; give blue's and red's count")
    return count_of({key: value[0]}, key), count_of({key: value[1]}, key)


def truth_of(entry: Mapping[str, Any], key: str) -> bool:
    """True or false.

    Raises:
        FeedError: it is missing or neither.
    """
    value = entry.get(key)
    if not isinstance(value, bool):
        raise FeedError(f"{key} is {short(value)}; give true or false")
    return value


def name_of(entry: Mapping[str, Any], key: str) -> str:
    """A name.

    Raises:
        FeedError: it is missing, empty, too long, or cannot be printed.
    """
    value = entry.get(key)
    if not isinstance(value, str) or not 0 < len(value) <= MAX_NAME or not value.isprintable():
        raise FeedError(f"{key} is {short(value)}; give a name of 1 to {MAX_NAME} characters")
    return value


def refuse_constant(name: str) -> NoReturn:
    """What the JSON reader is to do with NaN and Infinity.

    Raises:
        FeedError: always.
    """
    raise FeedError(f"{name} is no number of JSON")


def short(value: Any) -> str:
    """A value as a text that fits a message."""
    text = value if isinstance(value, str) else repr(value) if not isinstance(value, BaseException) else str(value)
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= 60 else text[:59] + "…"
