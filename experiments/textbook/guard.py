"""`TextbookGuard`: a barrier of the literature in the place where the shield stands, and the loop that all share.

Every boat of ours has two inputs z: its velocity (east, north, m/s), or those of `inputs`. Others keep their velocity;
two boats of ours both answer their row. With V the velocities that are no input, and B z what inputs do to velocities
(velocities as inputs: what they are), a pair's row dh/dt >= -alpha h reads

    <dh/dp, V_j - V_i> + <dh/dv, B_j z_j - B_i z_i> >= -alpha h      (velocities as inputs: dh/dp in both places).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.filter.program import holds
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import clamp, wrap_degrees

from ..batch_guard import BatchGuard, Games
from ..jit import kernel
from . import collision_cone, exponential_cbf, parabolic, velocity_cbf
from .barrier import Complex, Gains, direction, dot
from .inputs import command_of_inputs, input_limits, inputs_of_command
from .program import SOLVED, UNSOLVED, solve

NAMES = ("velocity_cbf", "exponential_cbf", "collision_cone", "parabolic")
FILES = (velocity_cbf, exponential_cbf, collision_cone, parabolic)
BARRIERS = {name: file.BARRIER for name, file in zip(NAMES, FILES, strict=True)}
FACETS = 16
"""Sides of the polygon within the disc of speeds; one corner lies in the wanted direction."""
SAME = 1e-9
"""Inputs this near to the wanted ones are the wanted ones."""


class Setup(NamedTuple):
    """Whether velocities are the inputs, step, s, platform rows (n, N_PARAM) and `InputLimits` (n, 3) of n boats."""

    of_velocity: bool
    dt_s: float
    params: Array
    limits: Array


class TextbookGuard(BatchGuard):
    """Commands filtered as the literature does; what is not said here is as in `BatchGuard`.

    Reasons: 0 passed bit for bit, 1 changed, 2 the program had no answer and was relaxed (the command may then be
    the wanted one, where no input helps), 3 not even the relaxed program was solved: the boat is told to stop.
    ``certificate_m`` is the distance to the nearest boat less the radius kept, m.

    Args:
        name: one of `NAMES`.
        config: settings; separation, buffer, position error and step are used.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        gains: gains for all boats; None takes those of each platform.
    """

    def __init__(self, name: str, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...],
                 team: tuple[int, ...], gains: Gains | None = None) -> None:  # fmt: skip
        if name not in BARRIERS:
            raise ConfigError(f"unknown filter {name!r}; choose one of {', '.join(NAMES)}")
        super().__init__(name, config, games, platforms, team)
        self._barrier = it = BARRIERS[name]
        self.radius_m *= it.widened
        self._gains = np.array([gains or it.tuned.get(kind.name, it.tried[0]) for kind in self._platforms]).T
        limits = np.array([input_limits(kind, config.dt_s) for kind in self._platforms])
        self._setup = Setup(it.of_velocity, config.dt_s, self.params, limits)

    def _decide(self, games: Games) -> None:
        state, ours = games.state, games.ours
        V = state[..., L.SPEED] * direction(state[..., L.HEADING])
        V = np.where(ours, 0.0, V) if self._barrier.of_velocity else V
        p, v = _between(state[..., L.X] + 1j * state[..., L.Y]), _between(V)
        i, j = self._gains[:, None, :, None], self._gains[:, None, None, :]
        alpha, *gains = np.where(ours[:, None, :], 0.5 * (i + j), i)
        h, h_p, acts = self._barrier.jet(p, v, self.radius_m, *gains)
        decide_games(self._setup, games, acts, -alpha * h - dot(h_p, v))
        gap = np.where(np.eye(len(self.params), dtype=bool), np.inf, abs(p)).min(axis=2)
        games.certificate_m[ours] = (gap - self.radius_m)[ours]


def _between(of: Complex) -> Complex:
    """What boat j has more than boat i, (B, n, n)."""
    return of[:, None, :] - of[:, :, None]


@kernel
def _inputs(
    setup: Setup, i: int, state: Array, wanted: Array, z: Array, B: Complex, box: Array, C: Array, d: Array
) -> float:
    """Write boat i's wanted inputs z (2,), B (2,), least and greatest z (2, 2), and limits C z >= d.

    Returns:
        The largest turn of this step, deg.
    """
    top, ahead = setup.limits[i, 0], math.radians(state[L.HEADING])
    if setup.of_velocity:
        speed, course = clamp(wanted[0], 0.0, top), math.radians(state[L.HEADING] + wanted[1])
        z[0], z[1], B[0], B[1] = speed * math.sin(course), speed * math.cos(course), 1.0, 1j
        box[:, 0], box[:, 1] = -top, top
        for k in range(FACETS):
            side = course + (2 * k + 1) * math.pi / FACETS
            C[k, 0], C[k, 1], d[k] = -math.sin(side), -math.cos(side), -top * math.cos(math.pi / FACETS)
        return 0.0
    most = inputs_of_command(setup.params[i], setup.limits[i], state, wanted, setup.dt_s, z, box)
    e = complex(math.sin(ahead), math.cos(ahead))
    B[0], B[1] = setup.limits[i, 2] * e, math.radians(most) / setup.dt_s * state[L.SPEED] * -1j * e
    C[0, 0], C[1, 0], C[2, 1], C[3, 1] = 1.0, -1.0, 1.0, -1.0
    d[0], d[1], d[2], d[3] = box[0, 0], -box[0, 1], box[1, 0], -box[1, 1]
    return most


@kernel
def _command(setup: Setup, i: int, state: Array, wanted: Array, z: Array, most_deg: float) -> tuple[float, float]:
    """Speed and relative heading of boat i that yield its inputs z (2,)."""
    if not setup.of_velocity:
        return command_of_inputs(setup.params[i], setup.limits[i], state, z, most_deg, setup.dt_s)
    speed = math.hypot(z[0], z[1])
    if speed <= SAME:
        return 0.0, wanted[1]
    return speed, wrap_degrees(math.degrees(math.atan2(z[0], z[1])) - state[L.HEADING])


@kernel
def _pair_rows(ours: BoolArray, acts: Complex, need: Array, B: Complex, box: Array, C: Array, d: Array) -> IntArray:
    """Write the rows that some inputs could break, of unit length unless none has an effect; their pairs (rows, 2)."""
    pairs, r = np.zeros((len(d), 2), np.int64), 0
    for i, j in np.ndindex(acts.shape):
        if i == j or not ours[i] or (ours[j] and j < i):
            continue
        row, along = C[r], acts[i, j].conjugate()
        row[:] = 0.0
        row[2 * i : 2 * i + 2], row[2 * j : 2 * j + 2] = -(along * B[i]).real, (along * B[j]).real
        length = math.sqrt((row * row).sum())
        row *= 1.0 / length if length > SAME else 0.0
        d[r] = need[i, j] / length if length > SAME else need[i, j]
        if np.minimum(row * box[:, 0], row * box[:, 1]).sum() < d[r]:
            pairs[r, 0], pairs[r, 1], r = i, j, r + 1
    return pairs[:r]


@kernel
def decide_game(setup: Setup, game: Games, acts: Complex, need: Array) -> None:
    """Decide for the boats of ours in one game, (n, ...) each."""
    state, wanted, ours, own = game.state, game.wanted, game.ours, np.flatnonzero(game.ours)
    n, sides = len(ours), FACETS if setup.of_velocity else 4
    z0, most, hard = np.zeros(2 * n), np.zeros(n), sides * len(own)
    B, box = np.zeros((n, 2), np.complex128), np.zeros((2 * n, 2))
    C, d = np.zeros((hard + n * len(own), 2 * n)), np.zeros(hard + n * len(own))
    for m, i in enumerate(own):
        at, limits = slice(2 * i, 2 * i + 2), slice(sides * m, sides * m + sides)
        most[i] = _inputs(setup, int(i), state[i], wanted[i], z0[at], B[i], box[at], C[limits, at], d[limits])
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
            game.sent[i, 0] = 0.0
        elif np.abs(z - z0)[2 * i : 2 * i + 2].max() > SAME:
            to = _command(setup, int(i), state[i], wanted[i], z[2 * i : 2 * i + 2], most[i])
            game.sent[i, 0], game.sent[i, 1], game.reason[i] = to[0], to[1], max(game.reason[i], SOLVED)


@kernel
def decide_games(setup: Setup, games: Games, acts: Complex, need: Array) -> None:
    """`decide_game` for every game; arrays carry a leading games axis."""
    state, wanted, ours, memory, sent, reason, clear_m = games
    for b in range(len(state)):
        game = Games(state[b], wanted[b], ours[b], memory[b], sent[b], reason[b], clear_m[b])
        decide_game(setup, game, acts[b], need[b])
