"""Floats as JSON, bit for bit: finite ones as they are, the others as texts, since JSON has no word for them."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np

from ...exceptions import LogError
from ...jit import Array


class Odd(str):
    """The text of a float that is not finite; in a message `odd.take_odd` finds it by its kind."""

    __slots__ = ()


Number = float | Odd

_PLAIN_NAN = struct.pack(">d", math.nan)
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def to_json(value: float) -> Number:
    """A float as JSON can hold it: finite ones as shortest text that reads back to the same bits.

    Args:
        value: any float.

    Returns:
        The float; or "inf", "-inf", "nan", and for a NaN with other bits "nan:" and its 16 hex digits.
    """
    if math.isfinite(value):
        return float(value)
    if value == math.inf:
        return Odd("inf")
    if value == -math.inf:
        return Odd("-inf")
    packed = struct.pack(">d", value)
    return Odd("nan" if packed == _PLAIN_NAN else f"nan:{packed.hex()}")


def from_json(value: Any) -> float:
    """The float that `to_json` was given.

    Raises:
        LogError: neither a number nor one of its texts.
    """
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value)
    if isinstance(value, str):
        if value in _WORDS:
            return _WORDS[value]
        if value.startswith("nan:"):
            return _nan_of(value)
    raise LogError(f"the log holds {value!r} where a number belongs; it is damaged or of another version")


def _nan_of(text: str) -> float:
    try:
        value: float = struct.unpack(">d", bytes.fromhex(text[4:]))[0]
    except (ValueError, struct.error):
        value = 0.0
    if not math.isnan(value):
        raise LogError(f"the log holds {text!r} where a number belongs; it is damaged or of another version")
    return value


def row_to_json(values: Array) -> list[Any]:
    """A 1-D float array as JSON can hold it."""
    listed: list[Any] = values.tolist()
    return listed if np.isfinite(values).all() else [to_json(value) for value in listed]


def row_from_json(values: Any, length: int) -> list[float]:
    """The values `row_to_json` was given.

    Args:
        values: what the log holds.
        length: how many there must be.

    Raises:
        LogError: not a list of that many numbers.
    """
    if not isinstance(values, list) or len(values) != length:
        raise LogError(f"the log holds {values!r} where {length} numbers belong; it is damaged or of another version")
    return [from_json(value) for value in values]


def plain(value: Any) -> Any:
    """Nested settings as JSON can hold them: tuples as lists, floats as `to_json` gives them.

    Raises:
        TypeError: something else than texts, numbers, None, mappings and sequences.
    """
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if value is None or isinstance(value, (bool, int, str)):
        return value
    if isinstance(value, float):
        return to_json(value)
    if isinstance(value, dict):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    raise TypeError(f"a {type(value).__name__} has no place in a log")


def restored(value: Any) -> Any:
    """Settings that `plain` was given, lists staying lists; texts that mean a float become it."""
    if isinstance(value, dict):
        return {key: restored(item) for key, item in value.items()}
    if isinstance(value, list):
        return [restored(item) for item in value]
    if isinstance(value, str) and (value in _WORDS or value.startswith("nan:")):
        return from_json(value)
    return value
