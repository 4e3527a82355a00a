"""Conditions beside the rules, of games and encounters: late commands, errors of what is seen, a current; at work.

They stand round the shields of a game, which itself stays as its rules are.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any
from zlib import crc32

import numpy as np
from numpy.typing import NDArray
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.env.randomness import next_uniform
from steerclear.env.record import absolute_commands
from steerclear.shield.calls import checked_calls
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.fleet import Fleet
from steerclear.shield.jit import Array, copy_row, kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.tracks import whole_steps
from steerclear.shield.wrappers.mctf import MctfReader

from ..oracle import Motion

MOST = {"delay_s": 2.0, "noise_m": 5.0, "current_mps": 2.0}
"""Largest value of each: s, m, m/s."""
NOISE_MEMORY_S = 2.0
"""Time over which a position error is forgotten, s."""
_WORDS = {"delay_s": "{:g} s delay", "noise_m": "{:g} m position noise", "current_mps": "{:g} m/s current"}


@checked_calls()
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
        delay_s = self.delay_steps(dt_s) * dt_s
        told = {"delay_s": delay_s, "position_error_m": self.noise_m, "current_mps": self.current_mps}
        return {name: value for name, value in told.items() if value > 0.0}


def check_values(values: Mapping[str, Any], most: Mapping[str, float]) -> None:
    """Refuse (ConfigError, which names the first) what is no number from 0 to its most."""
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float) or not 0.0 <= value <= most[name]:
            raise ConfigError(f"{name} is {value!r}; give a number from 0 to {most[name]:g}")


def words_of(values: Mapping[str, Any]) -> str:
    """Write the conditions among some values that are above 0; empty without any."""
    return ", ".join(form.format(values[name]) for name, form in _WORDS.items() if values.get(name))


def words_of_settings(shield: Mapping[str, Any]) -> str:
    """Write the settings that a shield was given: ``separation_m 4, cbf_rate_per_s inf``; empty without any."""
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
def observe(
    state: Array, error: Array, seeds: NDArray[Any], bound_m: float, first: bool, dt_s: float, seen: Array
) -> None:
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


_TAG = crc32(b"conditions")


class Disturbances:
    """Delay (of the own team's commands), position errors and current of one game, drawn from its seed.

    Where the boats drift is decided before they move in a step, so that the rules (edges, tags, flags) see them where
    they then are: a boat that the current carries over an edge is out of bounds.

    Raises:
        ConfigError: the current outruns boats that the game drives back into the field.
    """

    def __init__(self, env: MctfEnv, conditions: Conditions, seed: int, own_team: int) -> None:
        check_current(conditions, env.config)
        self._env, self._conditions, self._dt_s = env, conditions, env.config.dt_s
        direction, noise_seed = draw(np.random.default_rng([seed, _TAG]))
        self.current_mps = conditions.current_mps * np.array(direction)
        self._own = np.flatnonzero(env.core.team == own_team)
        self._steps = conditions.delay_steps(self._dt_s)
        self._seeds = np.array([noise_seed], np.uint64)
        self._error = np.zeros((1, env.core.n_boats, 2))
        self._seen = env.core.state.copy()
        self._first = True
        self._waiting: deque[Array] = deque()

    @property
    def seen(self) -> Array:
        """(n, N_STATE) states as shields know them in this step, a copy."""
        return np.array(self._seen[0])

    @property
    def motion(self) -> Motion:
        """What the oracle has to know of them."""
        delays = np.zeros(self._env.core.n_boats, np.int64)
        delays[self._own] = self._steps
        east, north = self.current_mps.tolist()
        return Motion((east, north), tuple(delays.tolist()))

    def reader(self) -> MctfReader:
        """What a shield reads the game by."""
        return _Reader(self._env, self)

    def begin(self) -> None:
        """Fill what is on its way; call once per game, after its reset."""
        held = self._env.core.state[0, self._own][:, [L.SPEED, L.HEADING]]  # until the first command arrives
        self._waiting = deque([held] * self._steps)

    def carry(self, core: BatchedMctf, commands: Array) -> Array:
        """Let the boats drift for a step; the commands (1, n, 2) that take effect now, when these are sent.

        Own ones are the compass courses they were given for.
        """
        if self._waiting:
            own, heading_deg = self._own, core.state[0, self._own, L.HEADING]
            self._waiting.append(absolute_commands(commands[0, own], heading_deg))
            late, commands = self._waiting.popleft(), commands.copy()
            # headings as the game takes them, relative, in [-180, 180)
            commands[0, own] = np.column_stack([late[:, 0], (late[:, 1] - heading_deg + 180.0) % 360.0 - 180.0])
        core.state[:, :, [L.X, L.Y]] += self.current_mps * self._dt_s
        return commands

    def look(self, core: BatchedMctf) -> None:
        """Move the errors on by a step; call it before anything reads the game."""
        bound_m = self._conditions.noise_m
        observe(core.state, self._error, self._seeds, bound_m, self._first, self._dt_s, self._seen)
        self._first = False


class _Reader(MctfReader):
    """Reads a game as it is seen: positions off by their errors, the rest exact."""

    def __init__(self, env: MctfEnv, disturbances: Disturbances) -> None:
        super().__init__(env)
        self._disturbances = disturbances

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats as they are seen now."""
        return replace(super().fleet(team, shield_autopilot), state=self._disturbances.seen)


def check_current(conditions: Conditions, config: GameConfig) -> None:
    """Refuse (ConfigError) a current that some boat out of bounds does not come back against."""
    slowest_mps = config.oob_speed_frac * min(platform.max_speed_mps for platform in config.platforms)
    if conditions.current_mps > 0.0 and not conditions.current_mps < slowest_mps:
        raise ConfigError(
            f"current_mps is {conditions.current_mps:g}, but boats out of bounds are driven back at {slowest_mps:g} "
            f"m/s; give less than that, or a higher oob_speed_frac (it is {config.oob_speed_frac:g})"
        )
