"""The conditions at work in one game: they stand round its shields; the game and its rules stay as they are."""

from __future__ import annotations

from collections import deque
from dataclasses import replace
from zlib import crc32

import numpy as np
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.mctf import MctfEnv
from steerclear.env.record import absolute_commands
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.fleet import Fleet
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers.mctf import MctfReader

from ..oracle import Motion
from .conditions import Conditions, draw, observe

_TAG = crc32(b"conditions")


class Sea:
    """Delay, position errors and current of one game.

    Where the boats drift is decided before they move in a step, so that the rules (edges, tags, flags) see them where
    they then are: a boat that the current carries over an edge is out of bounds.

    Args:
        env: the game.
        conditions: what there is of each.
        seed: of the game; the same seed draws the same current and the same errors, with a shield or without.
        own_team: whose commands come late.

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
        """Let the boats drift for a step; the commands (1, n, 2) that take effect now, when these are sent."""
        arrived = self._arrived(core, commands)
        core.state[:, :, [L.X, L.Y]] += self.current_mps * self._dt_s
        return arrived

    def look(self, core: BatchedMctf) -> None:
        """Move the errors on by a step; call it before anything reads the game."""
        bound_m = self._conditions.noise_m
        observe(core.state, self._error, self._seeds, bound_m, self._first, self._dt_s, self._seen)
        self._first = False

    def _arrived(self, core: BatchedMctf, sent: Array) -> Array:
        """Commands (1, n, 2) that take effect now, own ones as the compass courses they were given for."""
        if not self._waiting:
            return sent
        own, heading_deg = self._own, core.state[0, self._own, L.HEADING]
        self._waiting.append(absolute_commands(sent[0, own], heading_deg))
        arrived = sent.copy()
        arrived[0, own] = _relative(self._waiting.popleft(), heading_deg)
        return arrived


class _Reader(MctfReader):
    """Reads a game as it is seen: positions off by their errors, the rest exact."""

    def __init__(self, env: MctfEnv, sea: Sea) -> None:
        super().__init__(env)
        self._sea = sea

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats as they are seen now."""
        return replace(super().fleet(team, shield_autopilot), state=self._sea.seen)


def check_current(conditions: Conditions, config: GameConfig) -> None:
    """Refuse a current that no boat comes back against.

    Raises:
        ConfigError: the game drives some boat that is out of bounds no faster than the current.
    """
    slowest_mps = config.oob_speed_frac * min(platform.max_speed_mps for platform in config.platforms)
    if conditions.current_mps > 0.0 and not conditions.current_mps < slowest_mps:
        raise ConfigError(
            f"current_mps is {conditions.current_mps:g}, but boats out of bounds are driven back at {slowest_mps:g} "
            f"m/s; give less than that, or a higher oob_speed_frac (it is {config.oob_speed_frac:g})"
        )


def _relative(commands: Array, heading_deg: Array) -> Array:
    """Commands (n, 2) of speed m/s and absolute heading deg as the game takes them, headings in [-180, 180)."""
    relative = np.array(commands)
    relative[:, 1] = (commands[:, 1] - heading_deg + 180.0) % 360.0 - 180.0
    return relative
