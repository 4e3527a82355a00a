"""Actions on their way from foreign code to the game: as JSON, so that nothing is unpickled that it may have made."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.shield.foreign import plain_text

MOST = 64
"""Numbers of an action, and characters of a text, that are looked at: no action has as many."""
DEEPEST = 4
"""Lists within lists that are looked at."""
_NUMBERS = ("bool", "int8", "int16", "int32", "int64", "uint8", "uint16", "uint32", "uint64", "float32", "float64")


class Unreadable:
    """Stands for an answer that is no action; it looks like it.

    Args:
        text: what the answer looks like.
    """

    def __init__(self, text: str) -> None:
        self._text = text

    def __repr__(self) -> str:
        return self._text


def to_plain(action: Any, depth: int = 0) -> Any:
    """An answer as JSON content, from which `from_plain` makes the same action."""
    if hasattr(action, "detach"):  # a tensor
        action = action.detach().cpu().numpy()
    if isinstance(action, (np.ndarray, np.generic)) and action.size <= MOST and action.dtype.name in _NUMBERS:
        return {"array": action.tolist(), "dtype": action.dtype.name, "scalar": isinstance(action, np.generic)}
    if isinstance(action, list | tuple) and len(action) <= MOST and depth < DEEPEST:
        return {"tuple" if isinstance(action, tuple) else "list": [to_plain(item, depth + 1) for item in action]}
    short = (type(action) is int and abs(action) < 2**63) or (type(action) is str and len(action) <= MOST)
    if short or action is None or type(action) in (bool, float):
        return action
    try:
        text = repr(action)
    except Exception:
        text = type(action).__name__
    return {"unreadable": plain_text(text, 80)}


def from_plain(content: Any, depth: int = 0) -> Any:
    """The action that `to_plain` took; whatever else it is given, some action or something unreadable."""
    if not isinstance(content, Mapping):
        return Unreadable("a list") if isinstance(content, list) else content
    array, dtype = content.get("array"), content.get("dtype")
    if dtype in _NUMBERS and array is not None:
        try:
            made = np.array(array, dtype=dtype)
        except (TypeError, ValueError, OverflowError):
            return Unreadable("an array")
        return made[()] if content.get("scalar") is True and made.ndim == 0 else made
    for name, kind in (("tuple", tuple), ("list", list)):
        items = content.get(name)
        if isinstance(items, list) and depth < DEEPEST:
            return kind(from_plain(item, depth + 1) for item in items)
    return Unreadable(plain_text(content.get("unreadable", "nothing"), 80))
