"""The one way compiled functions are made here."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit
from numpy.typing import NDArray

F = TypeVar("F", bound=Callable[..., Any])
Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def kernel(function: F) -> F:
    """Compile a function with numba: cached on disk, without the GIL, IEEE division (no ZeroDivisionError).

    Fast-math stays off: results must be the same bits everywhere, and NaN tests must work.
    """
    return cast(F, njit(cache=True, nogil=True, error_model="numpy")(function))
