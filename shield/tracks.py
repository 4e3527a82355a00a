"""Tracks made ready for a decision: memory filled in, positions extrapolated through age and delay."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .config import ShieldConfig
from .jit import Array, BoolArray, IntArray, copy_row, kernel
from .platforms import layout as L
from .platforms.step import step_boat
from .workspace import BACKUP_MARGIN, BLOCKED_BY, LARGEST_COMMAND, N_MEMORY, Scene


@kernel
def fill_memory(state: Array, params: Array) -> None:
    """Replace unknown (NaN) thrust by the thrust that holds the speed, unknown rudder and integrals by 0; in place."""
    for i in range(state.shape[0]):
        if math.isnan(state[i, L.THRUST]):
            state[i, L.THRUST] = thrust_at(params[i], state[i, L.SPEED])
        for column in (L.RUDDER, L.SPEED_INTEGRAL, L.HEADING_INTEGRAL, L.TURN_RATE):
            if math.isnan(state[i, column]):
                state[i, column] = 0.0


@kernel
def thrust_at(params: Array, speed_mps: float) -> float:
    """Return the thrust, percent, that holds a straight-line speed, m/s; beyond the thrust map its end."""
    size = int(params[L.MAP_SIZE])
    for k in range(1, size):
        low, high = params[L.MAP_SPEED + k - 1], params[L.MAP_SPEED + k]
        if speed_mps <= high and high > low:
            part = max(0.0, (speed_mps - low) / (high - low))
            start = params[L.MAP_THRUST + k - 1]
            return start + part * (params[L.MAP_THRUST + k] - start)
    return min(params[L.MAP_THRUST + size - 1], params[L.MAX_THRUST])


@kernel
def extrapolate(state: Array, seconds: Array) -> None:
    """Move boats straight on for their number of seconds, in place."""
    for i in range(state.shape[0]):
        heading = math.radians(state[i, L.HEADING])
        state[i, L.X] += state[i, L.SPEED] * seconds[i] * math.sin(heading)
        state[i, L.Y] += state[i, L.SPEED] * seconds[i] * math.cos(heading)


@kernel
def roll_out_pending(state: Array, who: BoolArray, params: Array, pending: Array, dt_s: float) -> None:
    """Step boats of ``who`` through commands not yet in effect, the others straight on; in place.

    Args:
        state: (n, N_STATE) boats now.
        who: (n,) boats whose commands are known.
        params: (n, N_PARAM) platform rows.
        pending: (steps, n, 2) speed m/s and absolute heading deg, the next to take effect first; NaN: none was sent,
            the boat goes straight on, as it does for values that no shield sends.
        dt_s: step, s.
    """
    for k in range(pending.shape[0]):
        for i in range(state.shape[0]):
            # commands of other boats may be anything
            if who[i] and abs(pending[k, i, 0]) <= LARGEST_COMMAND and abs(pending[k, i, 1]) <= 2.0 * LARGEST_COMMAND:
                error = (pending[k, i, 1] - state[i, L.HEADING] + 180.0) % 360.0 - 180.0
                step_boat(params[i], state[i], pending[k, i, 0], error, dt_s)
            else:
                way = state[i, L.SPEED] * dt_s
                heading = math.radians(state[i, L.HEADING])
                state[i, L.X] += way * math.sin(heading)
                state[i, L.Y] += way * math.cos(heading)


@kernel
def queue_commands(pending: Array, state: Array, commands: Array) -> None:
    """Put commands (n, 2), speed m/s and heading deg relative to ``state``, at the end of the queue, in place."""
    last = pending.shape[0] - 1
    for k in range(last):
        for i in range(state.shape[0]):
            copy_row(pending[k, i], pending[k + 1, i])
    for i in range(state.shape[0]):
        pending[last, i, 0] = commands[i, 0]
        pending[last, i, 1] = state[i, L.HEADING] + commands[i, 1]


@kernel
def astern_as_turned_ahead(state: Array, controlled: BoolArray) -> None:
    """Reverse other boats that go astern, in place, so that they go ahead on the same course."""
    for i in range(state.shape[0]):
        if not controlled[i] and state[i, L.SPEED] < 0.0:
            state[i, L.HEADING] = state[i, L.HEADING] % 360.0 - 180.0
            state[i, L.SPEED] = -state[i, L.SPEED]


def whole_steps(time_s: float, dt_s: float) -> int:
    """Return the number of steps that a time takes, rounded up but for rounding errors."""
    return math.ceil(time_s / dt_s - 1e-9)


def steps_of_delay(config: ShieldConfig) -> int:
    """Return the number of decisions whose commands are on their way at any time."""
    return whole_steps(config.delay_s, config.dt_s)


def who_stayed(before: tuple[Any, ...], now: tuple[Any, ...]) -> tuple[IntArray, IntArray]:
    """Return places now and then of boats of the same (name, platform, team); none if two boats share a name."""
    place = {key: k for k, key in enumerate(before)}
    if any(len({name for name, *_ in keys}) < len(keys) for keys in (before, now)):
        place = {}
    stayed = [i for i, key in enumerate(now) if key in place]
    return np.array(stayed, dtype=np.int64), np.array([place[now[i]] for i in stayed], dtype=np.int64)


def carry_over(old: Scene, new: Scene, stayed: IntArray, then: IntArray, state: Array) -> None:
    """Copy what is remembered of boats that stayed to the scene of another fleet, in place.

    Margins are those from the boats seen then. A boat that can meet a new one has no margin that covers all boats: its
    required margin is 0, and it keeps its backup.

    Args:
        old: the scene until now.
        new: the scene from now on.
        stayed: (k,) places in the new one of boats that were in the old one,
        then: (k,) at these places.
        state: (n, N_STATE) boats of the new one.
    """
    if len(stayed) == 0:
        return
    fresh, boats = np.ones(len(state), np.bool_), new.boats
    fresh[stayed] = False
    pursued = boats.pursuit_samples + boats.thrust_samples + boats.chased_samples
    horizon_s = (np.maximum(boats.samples, pursued).max() + 1) * boats.sample_s + new.tuning.straight_horizon_s
    top: Array = np.maximum(boats.fastest_mps, np.abs(state[:, L.SPEED]))
    gap_m = np.hypot(state[:, None, L.X] - state[None, :, L.X], state[:, None, L.Y] - state[None, :, L.Y])
    meets: BoolArray = gap_m <= new.tuning.radius_m + (top[:, None] + top[None]) * horizon_s
    met = (meets & fresh[None] & ~np.eye(len(state), dtype=np.bool_)).any(axis=1)
    new.pending[:, :, stayed] = old.pending[:1, :, then]  # all deciders know all boats' commands
    for_team = len(old.memories) == len(new.memories) == 1
    for i, k in [(0, 0)] if for_team else zip(stayed, then, strict=True):
        kept, was = new.memories[i], old.memories[k]
        kept[stayed, :N_MEMORY] = was[then, :N_MEMORY]
        places = np.full(len(old.ours) + 1, -1.0)  # the last for nobody
        places[then] = stayed
        kept[stayed, BLOCKED_BY] = places[was[then, BLOCKED_BY].astype(np.int64)]
        kept[met, BACKUP_MARGIN] = np.minimum(kept[met, BACKUP_MARGIN], 0.0)
        kept[np.ix_(stayed, N_MEMORY + stayed)] = was[np.ix_(then, N_MEMORY + then)]
