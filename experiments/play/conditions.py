"""Conditions beside the rules, of games and of encounters: late commands, errors of what is seen, a current."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from steerclear.env.randomness import next_uniform
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, copy_row
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracks import whole_steps

from ..jit import kernel

MOST = {"delay_s": 2.0, "noise_m": 5.0, "current_mps": 2.0}
"""Largest value of each: s, m, m/s."""
NOISE_MEMORY_S = 2.0
"""Time over which a position error is forgotten, s."""
_WORDS = {"delay_s": "{:g} s delay", "noise_m": "{:g} m position noise", "current_mps": "{:g} m/s current"}


@dataclass(frozen=True)
class Conditions:
    """What holds for all games of a run, with the shield and without.

    Attributes:
        delay_s: time from a command of an own boat to its effect, s; a game rounds it up to whole steps.
        noise_m: bound on the error of every position that a shield sees, m. Policies observe what the game shows.
        current_mps: speed of the current, m/s; each game draws its direction, of which no shield is told.

    Raises:
        ConfigError: a value that is not finite, negative or beyond `MOST`.
    """

    delay_s: float = 0.0
    noise_m: float = 0.0
    current_mps: float = 0.0

    def __post_init__(self) -> None:
        check_values(asdict(self), MOST)

    @property
    def calm(self) -> bool:
        """Whether there are none: the game is what its rules make it."""
        return not any(asdict(self).values())

    @property
    def words(self) -> str:
        """Those that there are, such as ``0.3 s delay, 0.5 m position noise``."""
        return words_of(asdict(self))

    def delay_steps(self, dt_s: float) -> int:
        """Whole steps from a command to its effect."""
        return whole_steps(self.delay_s, dt_s)

    def shield_settings(self, dt_s: float) -> dict[str, float]:
        """What a shield is told of them, as settings; nothing where there is nothing to tell."""
        told = {
            "delay_s": self.delay_steps(dt_s) * dt_s,
            "position_error_m": self.noise_m,
            "current_mps": self.current_mps,
        }
        return {name: value for name, value in told.items() if value > 0.0}


def check_values(values: Mapping[str, Any], most: Mapping[str, float]) -> None:
    """Refuse what is no number from 0 to its most.

    Raises:
        ConfigError: names the first.
    """
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= most[name]:
            raise ConfigError(f"{name} is {value!r}; give a number from 0 to {most[name]:g}")


def words_of(values: Mapping[str, Any]) -> str:
    """Write the conditions among some values that are above 0; empty without any."""
    return ", ".join(form.format(values[name]) for name, form in _WORDS.items() if values.get(name))


def words_of_settings(shield: Mapping[str, Any]) -> str:
    """Write the settings that a shield was given: ``separation_m 4, response_per_s inf``; empty without any."""
    lists = {name: "+".join(value) for name, value in shield.items() if isinstance(value, (list, tuple))}
    return ", ".join(f"{name} {value}" for name, value in {**shield, **lists}.items())


def draw(rng: np.random.Generator) -> tuple[tuple[float, float], int]:
    """Draw the direction of a current, unit length, and the seed of the position errors."""
    angle = float(rng.uniform(-math.pi, math.pi))
    return (math.cos(angle), math.sin(angle)), int(rng.integers(2**63))


CALM = Conditions()
"""None of them."""


@kernel
def uniform(seeds: Array, b: int) -> float:
    """Next number of game b's own stream in (0, 1): never 0, whose logarithm is asked for."""
    return next_uniform(seeds, b) + 0.5 / 9007199254740992.0


@kernel
def observe(state: Array, error: Array, seeds: Array, bound_m: float, first: bool, dt_s: float, seen: Array) -> None:
    """States as the own team knows them: positions off by a slowly changing error within ``bound_m``.

    The error is a Gauss-Markov process, half the bound per axis, drawn back onto the circle where it leaves it.
    """
    keep = 0.0 if first else math.exp(-dt_s / NOISE_MEMORY_S)
    fresh = 0.5 * bound_m * math.sqrt(1.0 - keep * keep)
    for b in range(state.shape[0]):
        for i in range(state.shape[1]):
            copy_row(seen[b, i], state[b, i])
            if bound_m <= 0.0:
                continue
            size = fresh * math.sqrt(-2.0 * math.log(uniform(seeds, b)))
            angle = 2.0 * math.pi * uniform(seeds, b)
            error[b, i, 0] = keep * error[b, i, 0] + size * math.cos(angle)
            error[b, i, 1] = keep * error[b, i, 1] + size * math.sin(angle)
            length = math.hypot(error[b, i, 0], error[b, i, 1])
            if length > bound_m:
                error[b, i, 0] *= bound_m / length
                error[b, i, 1] *= bound_m / length
            seen[b, i, L.X] += error[b, i, 0]
            seen[b, i, L.Y] += error[b, i, 1]
