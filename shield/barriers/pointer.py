"""Margins that somebody else wrote, called by compiled code through their address: no decision is compiled for them.

One function serves each barrier, double f(x_m, y_m, ahead_s, values, size, part): its margin (part 0), m, or its slope
along x or y (1, 2). It answers NaN where the barrier's own functions raise.
"""

from __future__ import annotations

import ctypes
import logging
import math
import re
from typing import Any

import numpy as np
from llvmlite import ir
from numba import carray, cfunc, njit, types  # type: ignore[attr-defined]
from numba.core import cgutils, config
from numba.core.errors import NumbaError, UnsupportedBytecodeError
from numba.extending import intrinsic

from .registry import Barrier

LOG = logging.getLogger(__name__)
COLOUR = re.compile(r"\x1b\[[0-9;]*m")
INTERPRETED = bool(getattr(config, "DISABLE_JIT", False))
MARGIN, SLOPE_X, SLOPE_Y = range(3)
DIFFERENCE_M = 0.05
"""Half the distance over which a slope is taken where none is given, m."""

_DOUBLE, _WHOLE = ctypes.c_double, ctypes.c_int64
FUNCTION = ctypes.CFUNCTYPE(_DOUBLE, _DOUBLE, _DOUBLE, _DOUBLE, ctypes.POINTER(_DOUBLE), _WHOLE, _WHOLE)
_SIGNATURE = types.float64(
    types.float64, types.float64, types.float64, types.CPointer(types.float64), types.int64, types.int64
)
_MADE: dict[Barrier, tuple[int, Any]] = {}


def address_of(barrier: Barrier) -> int:
    """Where compiled code finds a barrier's function, in this process."""
    if barrier not in _MADE:
        _MADE[barrier] = _compiled(barrier) or _interpreted(barrier)
    return _MADE[barrier][0]


def _compiled(barrier: Barrier) -> tuple[int, Any] | None:
    """Address and owner of the compiled function; None where the compiler does not take it."""
    if INTERPRETED:
        return None
    try:
        made = cfunc(_SIGNATURE)(_parts_of(barrier))
    except (NumbaError, UnsupportedBytecodeError, TypeError, ValueError, NotImplementedError) as error:
        LOG.warning(
            "barrier %r runs as plain Python, some microseconds a call: the compiler does not take it (%s)",
            barrier.name,
            _why(error),
        )
        return None
    return int(made.address or 0), made


def _why(error: Exception) -> str:
    """Kind of error and the line of its message that says most: numba's begin with the stage that failed."""
    lines = [line.strip() for line in COLOUR.sub("", str(error)).splitlines() if line.strip()]
    telling = [line for line in lines if "not" in line.lower() or "unknown" in line.lower()]
    return ": ".join([type(error).__name__, *(telling or lines)[:1]])


def _parts_of(barrier: Barrier) -> Any:
    """The function to compile: margin, or slope along x or y, of a barrier."""
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "boundscheck": True}
    margin, h = njit(**options)(barrier.margin), DIFFERENCE_M

    def differences(x: float, y: float, ahead: float, values: Any) -> tuple[float, float]:
        along_x = (margin(x + h, y, ahead, values) - margin(x - h, y, ahead, values)) / (2.0 * h)
        return along_x, (margin(x, y + h, ahead, values) - margin(x, y - h, ahead, values)) / (2.0 * h)

    slope = njit(**options)(differences if barrier.slope is None else barrier.slope)

    def part_of(x: float, y: float, ahead: float, pointer: Any, size: int, part: int) -> float:
        values, found = carray(pointer, (size,)), math.nan
        try:
            if part == 0:
                found = float(margin(x, y, ahead, values))
            elif part == 1:
                found = float(slope(x, y, ahead, values)[0])
            else:
                found = float(slope(x, y, ahead, values)[1])
        except Exception:
            found = math.nan
        return found

    return part_of


def _interpreted(barrier: Barrier) -> tuple[int, Any]:
    """The same of a function in Python; the interpreter's lock is taken for each call."""

    def part_of(x: float, y: float, ahead: float, pointer: Any, size: int, part: int) -> float:
        try:
            values = np.ctypeslib.as_array(pointer, (size,)) if size else np.zeros(0)
            if part == MARGIN:
                return float(barrier.margin(x, y, ahead, values))
            if barrier.slope is not None:
                return float(barrier.slope(x, y, ahead, values)[part - SLOPE_X])
            dx, dy = (DIFFERENCE_M, 0.0) if part == SLOPE_X else (0.0, DIFFERENCE_M)
            rise = barrier.margin(x + dx, y + dy, ahead, values) - barrier.margin(x - dx, y - dy, ahead, values)
            return float(rise) / (2.0 * DIFFERENCE_M)
        except Exception:  # foreign code may raise anything
            return math.nan

    made = FUNCTION(part_of)
    return int(ctypes.cast(made, ctypes.c_void_p).value or 0), made


@intrinsic
def _call(context: Any, address: Any, x: Any, y: Any, ahead: Any, values: Any, size: Any, part: Any) -> Any:
    """Call a barrier's function."""

    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        address, x, y, ahead, values, size, part = given
        array = cgutils.create_struct_proxy(signature.args[4])(context, builder, values)
        number, whole = ir.DoubleType(), ir.IntType(64)
        form = ir.FunctionType(number, [number, number, number, number.as_pointer(), whole, whole])
        return builder.call(builder.inttoptr(address, form.as_pointer()), [x, y, ahead, array.data, size, part])

    number, whole = types.float64, types.int64
    return number(whole, number, number, number, values, whole, whole), build


def _call_interpreted(address: int, x: float, y: float, ahead: float, values: Any, size: int, part: int) -> float:
    pointer = values.ctypes.data_as(ctypes.POINTER(_DOUBLE))
    return float(FUNCTION(int(address))(x, y, ahead, pointer, int(size), part))


call: Any = _call_interpreted if INTERPRETED else _call
"""``call(address, x_m, y_m, ahead_s, values, size, part)``: what a barrier's function says, from compiled code."""
