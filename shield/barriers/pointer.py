"""Margins of registered barriers, called by compiled code through their address: no decision is recompiled for them.

Each is one compiled function, double f(x_m, y_m, ahead_s, values, size, part). It returns the margin, m (part 0), or
its gradient along x or y (parts 1, 2); NaN if it raises.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from typing import Any

from llvmlite import ir
from numba import carray, cfunc, njit, types  # type: ignore[attr-defined]
from numba.core import cgutils, config
from numba.core.errors import NumbaError, UnsupportedBytecodeError
from numba.extending import intrinsic

from ..exceptions import ConfigError
from ..foreign import plain_text
from .registry import Barrier, Margin, Slope, takes_values

DIFFERENCE_M = 0.05
"""Half the distance of central differences where no gradient is given, m."""

PLAIN = bool(getattr(config, "DISABLE_JIT", False))
_NUMBER, _WHOLE = types.float64, types.int64
_SIGNATURE = _NUMBER(_NUMBER, _NUMBER, _NUMBER, types.CPointer(_NUMBER), _WHOLE, _WHOLE)
_MADE: dict[tuple[Margin, Slope | None], tuple[int, Any]] = {}
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def address_of(barrier: Barrier) -> int:
    """Return the address of a barrier's function in this process, the same for whatever values it is registered with.

    Raises:
        ConfigError: the compiler rejects the function.
    """
    functions = barrier.margin, barrier.slope
    if functions not in _MADE:
        try:
            _MADE[functions] = _made(barrier)
        except (NumbaError, UnsupportedBytecodeError, TypeError, ValueError, NotImplementedError) as error:
            raise ConfigError(
                f"the compiler does not take barrier {barrier.name!r} ({_why(error)}); write it with numbers, arrays "
                "and math only, as a plain function, and decorate what it calls with numba.njit"
            ) from None
    return _MADE[functions][0]


def _why(error: Exception) -> str:
    """Return the compiler's message, without its trace and colours."""
    lines = [_COLOUR.sub("", line).strip() for line in str(error).splitlines()]
    said = [line for line in lines if line and not line.startswith("Failed in nopython mode")]
    return plain_text(said[0] if said else type(error).__name__)


def _made(barrier: Barrier) -> tuple[int, Any]:
    """Return the address of a barrier's compiled function, and the object that keeps it alive."""
    options: Any = {} if PLAIN else {"nogil": True, "error_model": "numpy", "boundscheck": True}
    compiled = (lambda function: function) if PLAIN else njit(**options)
    margin, slope = (part and _with_values(barrier.name, part, compiled) for part in (barrier.margin, barrier.slope))
    function = _parts_of(margin, slope, compiled)
    if PLAIN:
        return len(_MADE), function

    def part_of(x: float, y: float, ahead: float, pointer: Any, size: int, part: int) -> float:
        return float(function(x, y, ahead, carray(pointer, (size,)), part))

    made = cfunc(_SIGNATURE)(part_of)
    return int(made.address or 0), made


def _with_values(name: str, function: Any, compiled: Callable[[Any], Any]) -> Any:
    """Return the compiled function; one without ``values`` gets them all the same and leaves them."""
    inner = compiled(function)
    if takes_values(name, function):
        return inner

    def leaving(x: float, y: float, ahead: float, values: Any) -> Any:
        return inner(x, y, ahead)

    return compiled(leaving)


def _parts_of(margin: Any, slope: Any, compiled: Callable[[Any], Any]) -> Any:
    """Return one function for the margin of a barrier and its gradient along x or y."""
    h = DIFFERENCE_M

    def differences(x: float, y: float, ahead: float, values: Any) -> tuple[float, float]:
        along_x = (margin(x + h, y, ahead, values) - margin(x - h, y, ahead, values)) / (2.0 * h)
        return along_x, (margin(x, y + h, ahead, values) - margin(x, y - h, ahead, values)) / (2.0 * h)

    gradient = slope or compiled(differences)

    def part_of(x: float, y: float, ahead: float, values: Any, part: int) -> float:
        found = math.nan
        try:
            if part == 0:
                found = float(margin(x, y, ahead, values))
            elif part == 1:
                found = float(gradient(x, y, ahead, values)[0])
            else:
                found = float(gradient(x, y, ahead, values)[1])
        except Exception:  # foreign code may raise anything
            found = math.nan
        return found

    return compiled(part_of)


@intrinsic
def _call(context: Any, address: Any, x: Any, y: Any, ahead: Any, values: Any, size: Any, part: Any) -> Any:
    """Call a barrier's function."""

    def build(context: Any, builder: Any, signature: Any, given: Any) -> Any:
        address, x, y, ahead, values, size, part = given
        array = cgutils.create_struct_proxy(signature.args[4])(context, builder, values)
        number, whole = ir.DoubleType(), ir.IntType(64)
        form = ir.FunctionType(number, [number, number, number, number.as_pointer(), whole, whole])
        return builder.call(builder.inttoptr(address, form.as_pointer()), [x, y, ahead, array.data, size, part])

    return _NUMBER(_WHOLE, _NUMBER, _NUMBER, _NUMBER, values, _WHOLE, _WHOLE), build


def _call_plain(address: int, x: float, y: float, ahead: float, values: Any, size: int, part: int) -> float:
    return float(list(_MADE.values())[address][1](x, y, ahead, values[:size], part))


call: Any = _call_plain if PLAIN else _call
"""``call(address, x_m, y_m, ahead_s, values, size, part)``: the result of a barrier's function, in compiled code."""
