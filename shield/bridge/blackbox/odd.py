"""Numbers that are not finite, for which JSON has no word: taken out of a message, and listed beside what is left.

A field that is not finite is left out, so that viewers show a gap; in a list of numbers 0 stands in its place, and a
list of nothing else is empty. ``odd`` of the message says where each was and what it is, to the last bit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ...exceptions import LogError
from .numbers import Odd, from_json

Entry = dict[str, str]


def take_odd(message: dict[str, Any]) -> list[Entry]:
    """Take numbers that are not finite out of a message, in place.

    Args:
        message: with `numbers.Odd` where they are; its own, not shared with anything else.

    Returns:
        Where each was, names and indices with dots between, and its text.
    """
    found: list[Entry] = []
    _take(message, "", found)
    return found


def _take(node: Any, at: str, found: list[Entry]) -> None:
    if isinstance(node, dict):
        for name in [name for name, value in node.items() if type(value) is Odd]:
            found.append({"at": at + name, "value": str(node.pop(name))})
        for name, value in node.items():
            if type(value) is dict or type(value) is list:
                _take(value, f"{at}{name}.", found)
        return
    only = all(type(value) is Odd for value in node)
    for k, value in enumerate(node):
        if type(value) is Odd:
            found.append({"at": f"{at}{k}", "value": str(value)})
            node[k] = 0.0
        elif type(value) is dict or type(value) is list:
            _take(value, f"{at}{k}.", found)
    if only:
        node.clear()


def put_back(message: Any, entries: Any) -> None:
    """Put numbers that `take_odd` listed back where they were, in place.

    Raises:
        LogError: an entry is none, or its place is not there.
    """
    try:
        for entry in entries:
            *path, last = entry["at"].split(".")
            node = message
            for part in path:
                node = node[int(part)] if isinstance(node, list) else node[part]
            _put(node, last, from_json(str(entry["value"])))
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, LogError):
            raise
        raise LogError("the log's list of odd numbers does not fit; it is damaged or of another version") from None


def _put(node: Any, last: str, value: float) -> None:
    if isinstance(node, Mapping):
        node[last] = value  # type: ignore[index]
    elif int(last) == len(node):
        node.append(value)
    else:
        node[int(last)] = value
