"""Closed loops: shielded boats obey the shield, all others their own commands, everybody by the full model."""

from typing import NamedTuple

import numpy as np
from shield_scenes import distances
from steerclear.shield import Commands, Fleet
from steerclear.shield.batch import BatchedShield
from steerclear.shield.jit import kernel
from steerclear.shield.platforms import get_platform, step_boat
from steerclear.shield.platforms import layout as L


class Run(NamedTuple):
    """What happened: positions (T+1, ..., n, 2) m; reasons, sent commands, certificates and the rest (T, ..., n)."""

    position: np.ndarray
    reason: np.ndarray
    sent: np.ndarray
    safety_margin_m: np.ndarray
    intervened: np.ndarray | None = None
    cut_short: np.ndarray | None = None
    solver: np.ndarray | None = None

    def closest(self, own):
        """Least distance between a boat of ``own`` (n,) bool and any boat, per game."""
        gap = distances(self.position)[..., own, :]
        return gap.min(axis=(0, -2, -1))


@kernel
def step_all(params, state, commands, dt_s):
    """One step of every boat of every game, in place."""
    for b in range(state.shape[0]):
        for i in range(state.shape[1]):
            step_boat(params[i], state[b, i], commands[b, i, 0], commands[b, i, 1], dt_s)


def packed(platforms):
    """Platform rows, (n, N_PARAM)."""
    return np.array([get_platform(name).pack() for name in platforms])


def sail(shield, fleet, wanted, steps, surroundings=None):
    """Run a single shield on; ``wanted(step, state)`` gives (n, 2) speed m/s and relative heading deg."""
    params, state = packed(fleet.platforms), fleet.state.copy()
    fill(state, params)
    position, reason, sent, certificate, intervened, cut, solver = [state[:, :2].copy()], [], [], [], [], [], []
    for step in range(steps):
        now = Fleet(state, fleet.team, fleet.platforms, fleet.controlled, fleet.names)
        decisions = shield.decide(now, Commands.relative_deg(wanted(step, state)), surroundings)
        step_all(params, state[None], decisions.filtered.values[None], shield.config.dt_s)
        position.append(state[:, :2].copy())
        reason.append(decisions.reason.copy())
        sent.append(decisions.filtered.values.copy())
        certificate.append(decisions.safety_margin_m.copy())
        intervened.append(decisions.intervened.copy())
        cut.append(decisions.cut_short.copy())
        solver.append(decisions.solver.copy())
    return Run(*(np.array(kept) for kept in (position, reason, sent, certificate, intervened, cut, solver)))


def sail_games(config, state, platforms, team, wanted, steps, ours=None, surroundings=None):
    """Run B games of the batched shield on; ``wanted(step, state)`` gives (B, n, 2)."""
    more = () if surroundings is None else (surroundings,)
    shield = BatchedShield(config, len(state), tuple(platforms), tuple(team), *more)
    params, state = packed(platforms), state.copy()
    mine = np.array(team) == 0 if ours is None else np.asarray(ours)
    mine = np.broadcast_to(mine, state.shape[:2]).copy()
    position, reason, sent, certificate = [state[..., :2].copy()], [], [], []
    for step in range(steps):
        commands = shield.decide(state, wanted(step, state), mine)
        step_all(params, state, commands, config.dt_s)
        position.append(state[..., :2].copy())
        reason.append(shield.reason.copy())
        sent.append(commands.copy())
        certificate.append(shield.safety_margin_m.copy())
    return Run(np.array(position), np.array(reason), np.array(sent), np.array(certificate))


def bearing_deg(way):
    """Bearings of ways (..., 2), m."""
    return np.degrees(np.arctan2(way[..., 0], way[..., 1]))


def on_course(course_deg, speed_mps):
    """Commands that hold boats to courses, deg, or what a function of step and states says, at a speed, m/s."""

    def wanted(step, state):
        course = course_deg(step, state) if callable(course_deg) else np.asarray(course_deg)
        error = (course - state[..., L.HEADING] + 180.0) % 360.0 - 180.0
        return np.stack([np.broadcast_to(speed_mps, error.shape), error], axis=-1)

    return wanted


def fill(state, params):
    """Give boats whose thrust is unknown the thrust that holds their speed, in place."""
    for row, param in zip(state, params, strict=True):
        if np.isnan(row[L.THRUST]):
            size = int(param[L.MAP_SIZE])
            speeds, thrusts = param[L.MAP_SPEED :][:size], param[L.MAP_THRUST :][:size]
            row[L.THRUST] = min(np.interp(row[L.SPEED], speeds, thrusts), param[L.MAX_THRUST])


def scattered(random, games, platforms, side_m, gap_m=3.5, speed=(0.0, 1.0)):
    """States (B, n, N_STATE) of boats at random in a square, no two nearer than ``gap_m``, at a share of top speed."""
    n = len(platforms)
    state = np.zeros((games, n, L.N_STATE))
    for game in state:
        while True:
            game[:, :2] = random.uniform(0.0, side_m, (n, 2))
            if n == 1 or distances(game[:, :2]).min() >= gap_m:
                break
    top = np.array([get_platform(name).max_speed_mps for name in platforms])
    state[..., L.HEADING] = random.uniform(-180.0, 180.0, (games, n))
    state[..., L.SPEED] = random.uniform(*speed, (games, n)) * top
    state[..., [L.SPEED_ERROR, L.HEADING_ERROR]] = np.nan
    state[..., L.THRUST] = np.nan
    for game in state:
        fill(game, packed(platforms))
    return state


class Wander:
    """Random commands held for a while: (B, n, 2) speed m/s and heading, steered to as an absolute course."""

    def __init__(self, seed, games, platforms, hold_s=3.0, dt_s=0.1, slowest=0.0):
        self.random = np.random.default_rng(seed)
        self.top = np.array([get_platform(name).max_speed_mps for name in platforms])
        self.every, self.slowest = max(1, round(hold_s / dt_s)), slowest
        self.shape = (games, len(platforms))

    def __call__(self, step, state):
        if step % self.every == 0:
            self.speed = self.random.uniform(self.slowest, 1.0, self.shape) * self.top
            self.course = self.random.uniform(-180.0, 180.0, self.shape)
        error = (self.course - state[..., L.HEADING] + 180.0) % 360.0 - 180.0
        return np.stack([self.speed, error], axis=-1)
