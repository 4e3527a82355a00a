"""Functions that were compiled run as they are: the same statements, by IEEE arithmetic as compiled code has it."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., Any])
Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def ieee(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of `math` that answers NaN where Python raises, and numbers that can be divided by zero."""

    def answer(*numbers: Any) -> Any:
        try:
            found = function(*numbers)
        except ValueError:
            return np.float64(np.nan)
        return np.float64(found) if type(found) is float else found

    return answer


MATH = SimpleNamespace(**{name: ieee(value) if callable(value) else value for name, value in vars(math).items()})


def kernel(function: F) -> F:
    """The function itself; its module's `math` becomes `MATH`."""
    if function.__globals__.get("math") is math:
        function.__globals__["math"] = MATH
    return function


lean_kernel = kernel


def copy_row(to: Array, source: Array) -> None:
    """Copy a row of numbers, as long as ``source``."""
    to[: len(source)] = source
