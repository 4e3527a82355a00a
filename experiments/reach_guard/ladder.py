"""When the program has no checked answer: the rudder, or braking, that leaves the greatest value."""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import turn_of_rudder

from ..jit import kernel
from .values import WAYS, Setup, joint, margin_of, run_on

RUDDERS = 9
BRAKE = RUDDERS
"""Number of the backup that stops the boat on its course."""
SWEEPS = 2
"""Times the boats choose, one after the other, each knowing the others' choices."""


@kernel
def share_of(k: int) -> float:
    """Rudder of backup k as a share of full, positive to starboard; 0 for braking."""
    return 0.0 if k == BRAKE else 2.0 * k / (RUDDERS - 1) - 1.0


@kernel
def backup(setup: Setup, i: int, k: int, row: Array) -> tuple[float, float]:
    """Speed and relative heading that make boat i begin or go on with backup k from state ``row``."""
    params = setup.params[i]
    speed = 0.0 if k == BRAKE else params[L.MAX_SPEED]
    full = abs(turn_of_rudder(params, params[L.MAX_THRUST], min(params[L.MAX_RUDDER], 100.0), setup.dt_s))
    return speed, command_for_turn(params, row, speed, share_of(k) * full, setup.dt_s)


@kernel
def try_backup(setup: Setup, i: int, k: int, state: Array, end: Array) -> None:
    """Write the state after ``look`` steps of backup k."""
    end[:] = state
    for _ in range(setup.look):
        speed, heading = backup(setup, i, k, end)
        step_boat(setup.params[i], end, speed, heading, setup.dt_s)


@kernel
def _least(setup: Setup, ours: BoolArray, near: BoolArray, i: int, later: Array, ways: Array) -> float:
    """Least margin of boat i in the states ``later``."""
    least = math.inf
    for j in range(near.shape[0]):
        if near[i, j]:
            least = min(least, margin_of(setup, ours, i, j, later, ways))
        if near[j, i] and joint(setup, ours, i, j):
            least = min(least, margin_of(setup, ours, j, i, later, ways))
    return least


@kernel
def _choose(
    setup: Setup, ours: BoolArray, near: BoolArray, i: int, state: Array, later: Array, ways: Array, side: Array
) -> int:
    """Best backup of boat i with the others as in ``later``; it changes sides only for what is clearly better."""
    best, chosen = -math.inf, 0
    for turn in range(RUDDERS + 1):
        k = (RUDDERS // 2 + turn) % (RUDDERS + 1)
        try_backup(setup, i, k, state[i], later[i])
        value = _least(setup, ours, near, i, later, ways)
        if share_of(k) * side[i] < 0.0:
            value -= setup.hysteresis_m
        if value > best:
            best, chosen = value, k
    try_backup(setup, i, chosen, state[i], later[i])
    return chosen


@kernel
def take_backups(
    setup: Setup, state: Array, ours: BoolArray, near: BoolArray, movers: BoolArray, commands: Array, side: Array
) -> None:
    """Give every mover, (n,), its best backup's first command and ``side``, -1, 0 or 1; others go by ``commands``."""
    n = state.shape[0]
    later, ways = state.copy(), np.empty((n, WAYS, L.N_STATE))
    run_on(setup, state, setup.look, ways)
    for i in range(n):
        if ours[i]:
            for _ in range(setup.look):
                step_boat(setup.params[i], later[i], commands[i, 0], commands[i, 1], setup.dt_s)
    for sweep in range(SWEEPS):
        for i in range(n):
            if movers[i]:
                chosen = _choose(setup, ours, near, i, state, later, ways, side)
                if sweep == SWEEPS - 1:
                    commands[i, 0], commands[i, 1] = backup(setup, i, chosen, state[i])
                    side[i] = np.sign(share_of(chosen))
