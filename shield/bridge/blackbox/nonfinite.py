"""Numbers that are not finite, for which JSON has no word: as texts, and taken out of a message and put back.

A field that is not finite is left out, so that viewers show a gap; in a list of numbers 0 stands in its place, and a
list of nothing else is empty. ``odd`` of the message says where each was and what it is, to the last bit.
"""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np

from ...exceptions import LogError

_PLAIN_NAN = struct.pack(">d", math.nan)
_WORDS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


def to_text(value: float) -> str:
    """A float that is not finite as text: "inf", "-inf", "nan", and for a NaN with other bits "nan:" and 16 digits."""
    packed = struct.pack(">d", value)
    return str(value) if math.isinf(value) or packed == _PLAIN_NAN else f"nan:{packed.hex()}"


def from_text(text: Any) -> float:
    """The float that `to_text` was given.

    Raises:
        LogError: it is none.
    """
    if isinstance(text, str) and text in _WORDS:
        return _WORDS[text]
    try:
        value = float(struct.unpack(">d", bytes.fromhex(str(text).removeprefix("nan:")))[0])
    except (ValueError, struct.error):
        value = 0.0
    if not math.isnan(value):
        raise LogError(f"the log holds {text!r} where a number belongs; it is damaged or of another version")
    return value


def plain(value: Any) -> Any:
    """Nested settings as JSON can hold them: tuples and arrays as lists, floats that are not finite as texts.

    Raises:
        TypeError: something else than texts, numbers, None, mappings and sequences.
    """
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, float):
        return value if math.isfinite(value) else to_text(value)
    if value is None or isinstance(value, (bool, int, str)):
        return value
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
    is_float = isinstance(value, str) and (value in _WORDS or value.startswith("nan:"))
    return from_text(value) if is_float else value


def take_nonfinite(node: Any, at: str = "") -> list[dict[str, str]]:
    """Take numbers that are not finite out of a message, in place; where each was, dots between, and its text."""
    entries = list(node.items()) if isinstance(node, dict) else list(enumerate(node))
    odd = [key for key, value in entries if type(value) is float and not math.isfinite(value)]
    found = [{"at": f"{at}{key}", "value": to_text(node[key])} for key in odd]
    for key in odd:
        if isinstance(node, dict):
            del node[key]
        else:
            node[key] = 0.0
    if isinstance(node, list) and odd and len(odd) == len(node):
        node.clear()
    for key, value in entries:
        if type(value) is dict or type(value) is list:
            found += take_nonfinite(value, f"{at}{key}.")
    return found


def put_back(message: Any, entries: Any) -> None:
    """Put numbers that `take_nonfinite` listed back where they were, in place.

    Raises:
        LogError: an entry is none, or its place is not there.
    """
    try:
        for entry in entries:
            *path, last = entry["at"].split(".")
            node, value = message, from_text(str(entry["value"]))
            for part in path:
                node = node[int(part)] if isinstance(node, list) else node[part]
            if isinstance(node, dict):
                node[last] = value
            elif int(last) == len(node):
                node.append(value)
            else:
                node[int(last)] = value
    except LogError:
        raise
    except (KeyError, IndexError, TypeError, ValueError, AttributeError):
        raise LogError("the log's list of odd numbers does not fit; it is damaged or of another version") from None
