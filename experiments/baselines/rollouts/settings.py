"""Settings of the filters by rollouts, their bounds, and the library of manoeuvres."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, IntArray

TURNS_DEG = (30.0, 60.0, 90.0, 130.0, 170.0)
"""Turns of the library, to port and to starboard at top speed, deg from the present heading."""
HOLD_SPEED = -1.0
"""Speed share that stands for the present speed."""
SWITCH_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Switching times that are tried, as shares of the longest; then one step, then none."""
AREA, NEAREST = 0, 1
PICKS = {"area": AREA, "nearest": NEAREST}
MOST = {"horizon_s": 60.0, "switch_s": 30.0, "alpha_per_s": 10.0}


@dataclass(frozen=True)
class GatekeeperSettings:
    """How far gatekeeper looks.

    Attributes:
        horizon_s: length of the backup, s, T_B of the paper.
        switch_s: longest switching time that is tried, s, T_H of the paper.
    """

    horizon_s: float = 8.0
    switch_s: float = 4.0


@dataclass(frozen=True)
class LibrarySettings:
    """How PL-CBF looks and chooses.

    Attributes:
        horizon_s: length of a rollout, s, T of the paper.
        alpha_per_s: rate of the row dV/dt >= -alpha V.
        pick: safe mode taken: ``area`` the one that leaves the largest part of the inputs, as the authors' published
            code does, ``nearest`` the one whose program changes the wanted inputs least.
    """

    horizon_s: float = 10.0
    alpha_per_s: float = 1.0
    pick: str = "area"


Settings = GatekeeperSettings | LibrarySettings


def read_settings(name: str, kind: type[Settings], given: Mapping[str, Any], dt_s: float) -> Settings:
    """Make settings of what was given with a guard's name.

    Args:
        name: of the guard, for messages.
        kind: class of its settings.
        given: values by key.
        dt_s: step, s; no time may be shorter.

    Raises:
        ConfigError: an unknown key, or a value out of bounds.
    """
    known = [field.name for field in fields(kind)]
    for key, value in given.items():
        if key not in known:
            raise ConfigError(f"guard {name!r} has no setting {key!r}; it knows {', '.join(known)}")
        _check_value(name, key, value, dt_s)
    return kind(**given)


def _check_value(name: str, key: str, value: Any, dt_s: float) -> None:
    if key == "pick":
        if value not in tuple(PICKS):
            raise ConfigError(f"pick of guard {name!r} is {value!r}; choose {' or '.join(PICKS)}")
        return
    least = dt_s if key.endswith("_s") and not key.endswith("_per_s") else 0.0
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not least <= value <= MOST[key] or value == 0.0:
        low = f"at least {least:g}" if least else "above 0"
        raise ConfigError(f"{key} of guard {name!r} is {value!r}; give a number {low}, at most {MOST[key]:g}")


def library() -> Array:
    """(M, 2) turn deg and share of top speed of each manoeuvre: hold, turns to either side, stop."""
    turns = [(side * turn, 1.0) for turn in TURNS_DEG for side in (-1.0, 1.0)]
    return np.array([(0.0, HOLD_SPEED), *turns, (0.0, 0.0)])


def switch_steps(longest_s: float, dt_s: float) -> IntArray:
    """Switching times in steps, longest first, down to one step and none."""
    longest = max(1, math.floor(longest_s / dt_s + 1e-9))
    tried = {max(1, round(share * longest)) for share in SWITCH_SHARES} | {1, 0}
    return np.array(sorted(tried, reverse=True), dtype=np.int64)
