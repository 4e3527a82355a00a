"""Shared tuples without a compiler: functions that were compiled read lists, everybody else arrays.

Python takes a number out of a list, and goes on with it, several times as fast as out of an array. The lists are what
counts. Who reads a field by name gets an array of it, and what is written into that one is in the lists before the next
such function runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, TypeVar, cast

import numpy as np

Row = TypeVar("Row")

ARRAYS = frozenset({"C", "d", "z", "z0", "z_now"})
"""Fields of the program, which stay arrays: parts of them are handed on and written to."""


class Called:
    """A function of one shared tuple; without a compiler nobody looks at what it is called with."""

    def __init__(self, function: Callable[[Any], None]) -> None:
        self._function = function

    def __call__(self, row: Any) -> None:
        """Call it with a shared tuple."""
        self._function(row)


@cache
def _holder(names: tuple[str, ...]) -> type:
    """A class with these fields, which are read as quickly as Python can."""
    return type("Lists", (), {"__slots__": names})


class Shared:
    """A named tuple whose arrays are kept as lists, ``_lists``; made by `share`.

    Arrays read from it are good until the next function that was compiled runs.
    """

    def __init__(self, row: Any) -> None:
        self._row = type(row)
        self._kinds: dict[str, Any] = {}
        self._parts: dict[str, Any] = {}
        self._out: dict[str, Any] = {}
        self._lists = _holder(row._fields)()
        for name in row._fields:
            setattr(self._lists, name, self._take(name, getattr(row, name)))

    def _take(self, name: str, value: Any) -> Any:
        if isinstance(value, tuple) and hasattr(value, "_fields"):
            value = Shared(value)
        if isinstance(value, Shared):
            self._parts[name] = value
            return value._lists
        if not isinstance(value, np.ndarray) or name in ARRAYS:
            return value.item() if isinstance(value, np.generic) else value
        self._kinds[name] = value.dtype, value.shape
        return value.tobytes() if value.dtype == np.uint8 else value.tolist()

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_"):
            raise AttributeError(name)
        if name in self._parts:
            return self._parts[name]
        value = getattr(self._lists, name)
        if name not in self._kinds:
            return value
        if name not in self._out:
            dtype, shape = self._kinds[name]
            flat = np.frombuffer(value, np.uint8) if dtype == np.uint8 else np.array(value, dtype)
            self._out[name] = flat.reshape(shape)
        return self._out[name]

    def __iter__(self) -> Iterator[Any]:
        return (getattr(self, name) for name in self._row._fields)

    def _replace(self, **fields: Any) -> Any:
        """As of the named tuple."""
        return self._row(**{**dict(zip(self._row._fields, self, strict=True)), **fields})

    def _settle(self) -> Any:
        """Write back what was read, and may have been written to; the lists."""
        for name, array in self._out.items():
            if array.dtype != np.uint8:
                write(getattr(self._lists, name), array.tolist())
        self._out.clear()
        for part in self._parts.values():
            part._settle()
        return self._lists


def write(lists: list[Any], values: list[Any]) -> None:
    """Write values into nested lists, whose rows stay the same objects."""
    if values and isinstance(values[0], list):
        for row, own in zip(lists, values, strict=True):
            write(row, own)
    else:
        lists[:] = values


def share(row: Row) -> Row:
    """A `Shared` tuple of these fields; whatever reads fields by name takes it for the tuple itself."""
    return cast(Row, Shared(row))
