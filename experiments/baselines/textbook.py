"""`TextbookFilter`: a barrier of the literature with the batched shield's interface, and the loop that barriers share.

Every own boat has two inputs z: its velocity (east, north, m/s), or those of `unicycle`. Other boats keep their
velocity; two own boats share the constraint of their pair. With B z the effect of inputs on velocities, a pair's
constraint dh/dt >= -alpha h reads

    <dh/dp, v> + <dh/dv, B_j z_j - B_i z_i> >= -alpha h

With velocities as inputs, and v_j of a boat that is not own, it reads <dh/dp, z_j or v_j> - <dh/dp, z_i> >= -alpha h.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray, kernel
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import clamp, wrap_degrees
from steerclear.shield.renamed import old_names

from .barriers import BARRIERS, Barrier, Gains, dot
from .base import BatchFilter, Games, game_of
from .own_filters import check_gains
from .unicycle import SOLVED, UNSOLVED, command_of_inputs, holds, input_limits, inputs_of_command, solve

__all__ = ["BARRIERS", "NAMES", "Barrier", "TextbookFilter"]
NAMES = tuple(BARRIERS)
FACETS = 16
"""Sides of the polygon inscribed in the disc of speeds; one corner lies in the nominal direction."""
SAME = 1e-9
"""Inputs this near to the nominal ones count as equal."""


class Setup(NamedTuple):
    """Whether inputs are velocities; step, s; platform rows (n, N_PARAM) and `InputLimits` (n, 3) of n boats."""

    of_velocity: bool
    dt_s: float
    params: Array
    limits: Array


class TextbookFilter(BatchFilter):
    """Filter of commands by a barrier of the literature; see `BatchFilter`.

    Reasons: 0 passed bit for bit; 1 changed; 2 the program was infeasible and relaxed (the command may still be the
    nominal one, where no input helps); 3 the relaxed program was not solved either, and the filter stops the boat.
    ``safety_margin_m`` is the distance to the nearest boat less the required radius, m. ``gains`` apply to all boats;
    None: those of each platform.
    """

    def __init__(
        self,
        name: str,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        gains: Gains | None = None,
    ) -> None:
        if name not in BARRIERS:
            raise ConfigError(f"unknown filter {name!r}; choose one of {', '.join(NAMES)}")
        it = BARRIERS[name]
        if gains is not None:
            check_gains(gains, f"gains of {name}")
            if len(gains) != it.count:
                raise ConfigError(f"{len(gains)} gains for {name}; give {it.count}, alpha (1/s) the first")
        super().__init__(name, config, games, platforms, team)
        self._barrier = it
        self.radius_m *= it.widened
        self._gains = np.array([gains or it.tuned.get(kind.name, it.tried[0]) for kind in self._platforms]).T
        limits = np.array([input_limits(kind, config.dt_s) for kind in self._platforms])
        self._setup = Setup(it.of_velocity, config.dt_s, self.params, limits)

    def _decide(self, games: Games) -> None:
        state, ours = games.state, games.ours
        e, x = headings(state), np.moveaxis(state[..., [L.X, L.Y]], -1, 0)
        p, v = _between(x), _between(state[..., L.SPEED] * e)
        i, j = self._gains[:, None, :, None], self._gains[:, None, None, :]
        alpha, *gains = np.where(ours[:, None, :], 0.5 * (i + j), i)
        h, h_p, acts = self._barrier.of(p, v, self.radius_m, gains)
        if self._barrier.of_velocity:
            need = -alpha * h - np.where(ours, 0.0, state[..., L.SPEED])[:, None] * dot(h_p, e[:, :, None])
        else:
            need = -alpha * h - h_p[0] * v[0] - h_p[1] * v[1]
        acts, need = np.ascontiguousarray(np.moveaxis(acts, 0, 3)), np.ascontiguousarray(need)
        decide_games(self._setup, games, acts, need)
        gap = np.where(np.eye(len(self.params), dtype=bool), np.inf, np.hypot(*p)).min(axis=2)
        games.safety_margin_m[ours] = (gap - self.radius_m)[ours]


def _between(of: Array) -> Array:
    """Return the difference of boat j to boat i, (2, B, n, n)."""
    return of[:, :, None, :] - of[:, :, :, None]


@kernel
def headings(state: Array) -> Array:
    """Return unit vectors (2, B, n) of the boats' headings."""
    e = np.empty((2, *state.shape[:2]))
    for b, i in np.ndindex(state.shape[:2]):
        course = math.radians(state[b, i, L.HEADING])
        e[0, b, i], e[1, b, i] = math.sin(course), math.cos(course)
    return e


@kernel
def _inputs(
    setup: Setup, i: int, state: Array, nominal: Array, z: Array, B: Array, box: Array, C: Array, d: Array
) -> float:
    """Write boat i's nominal inputs z (2,), B (2, 4), least and greatest z (2, 2), and limits C z >= d.

    An input's effect on the velocity is B[:2] times B[2] times B[3].

    Returns:
        The largest turn rate of this step, rad/s; 0 for velocities as inputs.
    """
    top, ahead, B[:] = setup.limits[i, 0], math.radians(state[L.HEADING]), 1.0
    if setup.of_velocity:
        speed, course = clamp(nominal[0], 0.0, top), math.radians(state[L.HEADING] + nominal[1])
        z[0], z[1], B[0, 1], B[1, 0] = speed * math.sin(course), speed * math.cos(course), 0.0, 0.0
        box[:, 0], box[:, 1] = -top, top
        for k in range(FACETS):
            side = course + (2 * k + 1) * math.pi / FACETS
            C[k, 0], C[k, 1], d[k] = -math.sin(side), -math.cos(side), -top * math.cos(math.pi / FACETS)
        return 0.0
    most = inputs_of_command(setup.params[i], setup.limits[i], state, nominal, setup.dt_s, z, box)
    B[0, 0], B[0, 1], B[0, 3] = math.sin(ahead), math.cos(ahead), setup.limits[i, 2]
    B[1, 0], B[1, 1], B[1, 2], B[1, 3] = math.cos(ahead), -math.sin(ahead), state[L.SPEED], most
    C[0, 0], C[1, 0], C[2, 1], C[3, 1] = 1.0, -1.0, 1.0, -1.0
    d[0], d[1], d[2], d[3] = box[0, 0], -box[0, 1], box[1, 0], -box[1, 1]
    return most


@kernel
def _command(setup: Setup, i: int, state: Array, nominal: Array, z: Array, most_radps: float) -> tuple[float, float]:
    """Return speed and relative heading of boat i that yield its inputs z (2,)."""
    if not setup.of_velocity:
        return command_of_inputs(setup.params[i], setup.limits[i], state, z, most_radps, setup.dt_s)
    speed = math.hypot(z[0], z[1])
    if speed <= SAME:
        return 0.0, nominal[1]
    return speed, wrap_degrees(math.degrees(math.atan2(z[0], z[1])) - state[L.HEADING])


@kernel
def _pair_rows(ours: BoolArray, acts: Array, need: Array, B: Array, box: Array, C: Array, d: Array) -> IntArray:
    """Write rows that inputs could violate, of unit length unless no input matters; return their pairs (rows, 2)."""
    pairs, r = np.zeros((len(d), 2), np.int64), 0
    for i, j in np.ndindex(need.shape):
        if i == j or not ours[i] or (ours[j] and j < i):
            continue
        row, x, y = C[r], acts[i, j, 0], acts[i, j, 1]
        row[:] = 0.0
        for k in range(2):
            row[2 * i + k] = -(x * B[i, k, 0] + y * B[i, k, 1]) * B[i, k, 2] * B[i, k, 3]
            row[2 * j + k] = (x * B[j, k, 0] + y * B[j, k, 1]) * B[j, k, 2] * B[j, k, 3]
        length = math.sqrt((row * row).sum())
        if length <= SAME:
            row[:], length = 0.0, 1.0
        row /= length
        d[r] = need[i, j] / length
        if not np.minimum(row * box[:, 0], row * box[:, 1]).sum() >= d[r]:  # a NaN row counts
            pairs[r, 0], pairs[r, 1], r = i, j, r + 1
    return pairs[:r]


@kernel
def decide_game(setup: Setup, game: Games, acts: Array, need: Array) -> None:
    """Decide for the own boats in one game, arrays (n, ...)."""
    state, nominal, ours, own = game.state, game.nominal, game.ours, np.flatnonzero(game.ours)
    n, sides = len(ours), FACETS if setup.of_velocity else 4
    z0, most, hard = np.zeros(2 * n), np.zeros(n), sides * len(own)
    B, box = np.zeros((n, 2, 4)), np.zeros((2 * n, 2))
    C, d = np.zeros((hard + n * len(own), 2 * n)), np.zeros(hard + n * len(own))
    for m, i in enumerate(own):
        at, limits = slice(2 * i, 2 * i + 2), slice(sides * m, sides * m + sides)
        most[i] = _inputs(setup, int(i), state[i], nominal[i], z0[at], B[i], box[at], C[limits, at], d[limits])
    pairs = _pair_rows(ours, acts, need, B, box, C[hard:], d[hard:])
    rows = hard + len(pairs)
    if holds(C[hard:rows], d[hard:rows], z0, SAME):
        return
    z, slack = z0.copy(), np.zeros(len(pairs))
    status = solve(C[:rows], d[:rows], hard, z0, z, slack)
    for r in range(len(pairs)):
        for i in pairs[r]:
            if ours[i] and (slack[r] > SAME or status == UNSOLVED):
                game.reason[i] = status
    for i in own:
        if game.reason[i] == UNSOLVED:
            game.filtered[i, 0] = 0.0
        elif np.abs(z - z0)[2 * i : 2 * i + 2].max() > SAME:
            to = _command(setup, int(i), state[i], nominal[i], z[2 * i : 2 * i + 2], most[i])
            game.filtered[i, 0], game.filtered[i, 1], game.reason[i] = to[0], to[1], max(game.reason[i], SOLVED)


@kernel
def decide_games(setup: Setup, games: Games, acts: Array, need: Array) -> None:
    """Run `decide_game` for every game; arrays carry a leading games axis."""
    for b in range(len(games.state)):
        decide_game(setup, game_of(games, b), acts[b], need[b])


__getattr__ = old_names(globals(), {"TextbookGuard": "TextbookFilter"})
