"""Registered barriers, written by users: what a `Barrier` is, and the barriers known by name."""

from __future__ import annotations

import dis
import inspect
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..arrays import NoNumbersError, numbers
from ..calls import checked_calls
from ..exceptions import ConfigError
from ..foreign import load_others
from ..jit import Array
from ..workspace import MOST_VALUES

FORMS = "(x_m, y_m, ahead_s), or (x_m, y_m, ahead_s, values)"
"""Arguments of the functions of a barrier."""
GROUP = "steerclear.barriers"
"""Entry points of this group name barriers of other packages: a `Barrier`, a function that builds one, or a module that
registers some."""

Margin = Callable[[float, float, float, Array], float] | Callable[[float, float, float], float]
Pair = tuple[float, float]
Slope = Callable[[float, float, float, Array], Pair] | Callable[[float, float, float], Pair]


@checked_calls()
@dataclass(frozen=True)
class Barrier:
    """A function h of place and time that boats keep >= 0, such as the distance from a ferry's domain.

    Attributes:
        name: its name in `ShieldConfig.barriers`.
        margin: h(x_m, y_m, ahead_s, values), or h(x_m, y_m, ahead_s), m, of a boat's centre at x, y m east and north,
            ``ahead_s`` seconds from now. It falls by at most 1 m per metre, as a distance does. Beyond 50 m it may be
            anything, such as +inf.
        slope: (dh/dx, dh/dy), with or without ``values``; None: central differences of the margin.
        values: a tuple of numbers, passed to both as a float64 array, such as a rock's position. Or a function that is
            called before every decision and returns as many each time. Everything that changes must come through it:
            the compiler takes whatever else a function reads as constant.

    Raises:
        ConfigError: the name is not an identifier, something is no function, or the values cannot be used.
    """

    name: str
    margin: Margin
    slope: Slope | None = None
    values: Sequence[float] | Callable[[], Sequence[float]] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ConfigError(f"a barrier cannot be named {self.name!r}; give letters, digits and _")
        if not callable(self.margin) or not (self.slope is None or callable(self.slope)):
            raise ConfigError(f"margin and slope of barrier {self.name!r} must be functions {FORMS}")
        takers = [takes_values(self.name, part) for part in (self.margin, self.slope) if part is not None]
        reading = [part for part in (self.margin, self.slope) if part is not None and _reads_values(part)]
        if reading and isinstance(self.values, tuple) and not self.values:
            name = getattr(reading[0], "__name__", "margin")
            raise ConfigError(
                f"{name} of barrier {self.name!r} reads values, and there are none; give values= (a tuple, or a "
                "function that returns the numbers of now), or define it with (x_m, y_m, ahead_s)"
            )
        if not any(takers) and self.values != ():
            raise ConfigError(f"barrier {self.name!r} has values that no function takes; add the argument values")
        if isinstance(self.values, (list, np.ndarray)):
            raise ConfigError(
                f"values of barrier {self.name!r} are a {type(self.values).__name__}, and later changes to it would "
                "count for nothing; give a function that is asked before every decision (values=lambda: mine), or a "
                "tuple of what never changes"
            )
        if not callable(self.values):
            object.__setattr__(self, "values", tuple(self.now().tolist()))

    def now(self) -> Array:
        """Return the numbers of this moment.

        Raises:
            ConfigError: they are no numbers, not finite, or too many.
        """
        given = self.values() if callable(self.values) else self.values
        try:
            found = numbers(given)
        except NoNumbersError as error:
            raise ConfigError(f"values of barrier {self.name!r} are no numbers ({error})") from None
        if found.ndim != 1 or len(found) > MOST_VALUES or not all(map(math.isfinite, found)):
            raise ConfigError(f"values of barrier {self.name!r}: give at most {MOST_VALUES} finite numbers in a row")
        return found


def takes_values(name: str, function: Callable[..., object]) -> bool:
    """Return whether a function of a barrier takes ``values`` after x, y and the time.

    Raises:
        ConfigError: it takes neither three nor four arguments.
    """
    try:
        signature = inspect.signature(getattr(function, "py_func", function))  # of a compiled function: its source
    except (TypeError, ValueError):
        return True  # the compiler will say
    for count in (4, 3):
        try:
            signature.bind(*range(count))
        except TypeError:
            continue
        return count == 4
    raise ConfigError(f"a function of barrier {name!r} takes {signature}; define it with {FORMS}")


def _reads_values(function: Callable[..., object]) -> bool:
    """Return whether a function uses its fourth argument; False of one whose code cannot be looked at."""
    code = getattr(getattr(function, "py_func", function), "__code__", None)
    if code is None or code.co_argcount < 4 or inspect.ismethod(function):
        return False
    name = code.co_varnames[3]
    parts = (part.argval for part in dis.get_instructions(code) if not part.opname.startswith("STORE"))
    return any(name == part or (isinstance(part, tuple) and name in part) for part in parts)


Given = TypeVar("Given", bound="Barrier | Callable[[], Barrier]")
BARRIERS: dict[str, Barrier] = {}


def register_barrier(barrier: Given) -> Given:
    """Register a barrier under its name in this process; also a decorator of a function that builds one.

    Returns:
        The argument.

    Raises:
        ConfigError: another barrier has that name, or the argument is no barrier.
    """
    found = barrier if isinstance(barrier, Barrier) else barrier() if callable(barrier) else barrier
    if not isinstance(found, Barrier):
        raise ConfigError(f"{found!r} is no barrier; give a Barrier, or a function that builds one")
    if BARRIERS.get(found.name, found) != found:
        raise ConfigError(f"a barrier cannot be named {found.name!r}, which is another's; choose another name")
    BARRIERS.setdefault(found.name, found)
    return barrier


def get_barrier(name: str) -> Barrier:
    """Return the barrier of that name.

    Raises:
        ConfigError: there is none.
    """
    if name not in BARRIERS:
        load_others(GROUP, register_barrier)
    if name not in BARRIERS:
        known = ", ".join(sorted(BARRIERS)) or "none"
        raise ConfigError(
            f"unknown barrier {name!r}; known: {known}; register it first (register_barrier); "
            f"for the command line, by an entry point of {GROUP}"
        )
    return BARRIERS[name]
