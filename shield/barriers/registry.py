"""Barriers of other people's: what a `Barrier` is, and which there are by name."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from ..arrays import NoNumbersError, numbers
from ..exceptions import ConfigError
from ..foreign import load_others
from ..jit import Array
from ..workspace import MOST_VALUES

GROUP = "steerclear.barriers"
"""Entry points of this group name barriers of other packages: a `Barrier`, a function that builds one, or a module that
registers some."""

Margin = Callable[[float, float, float, Array], float]
Slope = Callable[[float, float, float, Array], tuple[float, float]]


@dataclass(frozen=True)
class Barrier:
    """A function h of place and time that boats keep >= 0, such as the distance from a ferry's domain.

    Attributes:
        name: what it is known by.
        margin: h(x_m, y_m, ahead_s, values), m, of a boat's centre at a place, m east and north, so many seconds from
            now. It falls by no more than 1 m in a metre, as a distance does; beyond 50 m it may be anything, as +inf.
        slope: (dh/dx, dh/dy) of the same; None: central differences of the margin.
        values: numbers both are given, as a float64 array: where the ferry is, say. Or a function, asked before every
            decision, that gives as many each time. All that changes has to come by them: the compiler takes whatever
            else a function reads to be constant.

    Raises:
        ConfigError: the name is none, or something is no function.
    """

    name: str
    margin: Margin
    slope: Slope | None = None
    values: Sequence[float] | Callable[[], Sequence[float]] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise ConfigError(f"a barrier cannot be named {self.name!r}; give letters, digits and _")
        if not callable(self.margin) or not (self.slope is None or callable(self.slope)):
            raise ConfigError(
                f"margin and slope of barrier {self.name!r} must be functions (x_m, y_m, ahead_s, values)"
            )
        if not callable(self.values):
            object.__setattr__(self, "values", tuple(self.now().tolist()))

    def now(self) -> Array:
        """The numbers of this moment.

        Raises:
            ConfigError: they are none, not finite, or too many.
        """
        given = self.values() if callable(self.values) else self.values
        try:
            found = numbers(given)
        except NoNumbersError as error:
            raise ConfigError(f"values of barrier {self.name!r} are no numbers ({error})") from None
        if found.ndim != 1 or len(found) > MOST_VALUES or not all(map(math.isfinite, found)):
            raise ConfigError(f"values of barrier {self.name!r}: give at most {MOST_VALUES} finite numbers in a row")
        return found


Given = TypeVar("Given", bound="Barrier | Callable[[], Barrier]")
BARRIERS: dict[str, Barrier] = {}


def register_barrier(barrier: Given) -> Given:
    """Make a barrier known by its name, in this process; a decorator, too, of a function that builds one.

    Returns:
        What was given.

    Raises:
        ConfigError: another barrier has that name, or it is no barrier.
    """
    found = barrier if isinstance(barrier, Barrier) else barrier() if callable(barrier) else barrier
    if not isinstance(found, Barrier):
        raise ConfigError(f"{found!r} is no barrier; give a Barrier, or a function that builds one")
    if BARRIERS.get(found.name, found) != found:
        raise ConfigError(f"a barrier cannot be named {found.name!r}, which is another's; choose another name")
    BARRIERS.setdefault(found.name, found)
    return barrier


def get_barrier(name: str) -> Barrier:
    """The barrier of that name.

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
