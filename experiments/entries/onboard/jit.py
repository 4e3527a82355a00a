"""How functions that were compiled run without a compiler: as they are, on lists, see `shared`."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.shared import Shared

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def entered(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function on lists, for those who have arrays and shared tuples: arrays are written back when it is done."""

    def enter(*arguments: Any) -> Any:
        given = [_lists(one) for one in arguments]
        result = function(*given)
        for one, lists in zip(arguments, given, strict=True):
            if isinstance(one, np.ndarray) and one.dtype != np.uint8 and one.flags.writeable:
                one[...] = np.array(lists, one.dtype).reshape(one.shape)
        return result

    enter.__doc__ = function.__doc__
    return enter


def _lists(value: Any) -> Any:
    if isinstance(value, Shared):
        return value._settle()
    if isinstance(value, np.ndarray):
        return value.tobytes() if value.dtype == np.uint8 else value.tolist()
    return value.item() if isinstance(value, np.generic) else value


def plain_copy_row(to: Any, source: Any) -> None:
    """Copy a row of numbers, as long as ``source``."""
    to[: len(source)] = source


copy_row = entered(plain_copy_row)


def fill(row: Any, value: Any) -> None:
    """Write into every place of a row: one value, or one for each."""
    if isinstance(row, np.ndarray) or isinstance(value, list):
        row[:] = value
    else:
        row[:] = [value] * len(row)


def put(rows: Any, places: tuple[Any, ...], value: Any) -> None:
    """Write one value into all places; those that are None stand for every one there is."""
    if len(places) == 1:
        if places[0] is None:
            fill(rows, value)
        else:
            rows[places[0]] = value
        return
    for row in rows if places[0] is None else (rows[places[0]],):
        put(row, places[1:], value)


def by_zero(over: float) -> float:
    """What IEEE arithmetic makes of a division by zero."""
    return math.nan if over == 0.0 or over != over else math.copysign(math.inf, over)
