"""All sequences of bang commands, driven with the package's own boat."""

import math

import numpy as np
from steerclear.shield.jit import kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn, largest_turn, thrust_after
from steerclear.shield.platforms.step import step_boat


@kernel
def _hold(params, state, choice, rudder, steps, others, k, radius_m, dt_s):
    for i in range(k + 1, k + steps + 1):
        speed_mps = state[L.SPEED]
        if choice == 0:
            speed_mps = 0.0
        elif choice == 2:
            speed_mps = params[L.MAX_SPEED]
        trial = state.copy()
        trial[L.THRUST] = thrust_after(params, state, speed_mps, dt_s)
        turn_deg = rudder * largest_turn(params, trial, dt_s)
        step_boat(params, state, speed_mps, command_for_turn(params, state, speed_mps, turn_deg, dt_s), dt_s)
        for m in range(others.shape[1]):
            if math.hypot(others[i, m, 0] - state[L.X], others[i, m, 1] - state[L.Y]) <= radius_m:
                return False
    return True


@kernel
def any_sequence(params, start, others, rudders, macro, radius_m, dt_s):
    """Whether some sequence of (speed choice, rudder), each held for ``macro`` steps, stays clear to the end."""
    steps = others.shape[0] - 1
    depth = (steps + macro - 1) // macro
    choices = 3 * rudders.size
    stack = np.empty((depth + 1, start.size))
    stack[0] = start
    taken = np.zeros(depth, dtype=np.int64)
    level = 0
    while level >= 0:
        if level == depth:
            return True
        if taken[level] == choices:
            taken[level] = 0
            level -= 1
            continue
        action = taken[level]
        taken[level] += 1
        state = stack[level].copy()
        k = level * macro
        length = min(macro, steps - k)
        if _hold(
            params, state, action // rudders.size, rudders[action % rudders.size], length, others, k, radius_m, dt_s
        ):
            level += 1
            stack[level] = state
    return False
