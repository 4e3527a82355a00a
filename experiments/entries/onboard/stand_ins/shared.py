"""Shared tuples without a compiler: the named tuples themselves."""

from __future__ import annotations

from typing import Any

import numpy as np


def share(row: Any) -> Any:
    """A named tuple of the same fields, whose numbers can be divided by zero."""
    return row._make(
        share(value) if isinstance(value, tuple) else np.float64(value) if type(value) is float else value
        for value in row
    )


def type_of(row: Any) -> None:
    """None: nobody compiles."""
