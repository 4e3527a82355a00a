"""Search of own commands that keep clear of given tracks: layer by layer, with equal states merged and the best kept.

A layer holds states reachable at one time. From each state, every choice of speed and rudder is held for a few steps of
the full model, controllers included. A choice is dropped as soon as a boat comes within the radius. States in the same
cell (position, heading, speed, thrust) are merged. If more states remain than the width, most places go to those
whose straight course stays clear longest; the rest are spread over all others. From the best states of each layer,
simple courses are simulated to the end: the first that stays clear ends the search.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .boat_model import DOWN, HOLD, UP, Array, IntArray, command_of, compiled, step

N_SPEEDS = 3
_TRIED = 3  # states of a layer from which simple courses are simulated to the end
_LOOK = 5  # steps between checks along a straight course


class Task(NamedTuple):
    """A search task: boat ``p`` must stay farther than ``limit_m`` from ``others`` (K+1, m, 2).

    ``rudders``: choices as shares of full, ascending, symmetric; ``sizes`` (5,): cells of x, y, heading, speed, thrust.
    """

    p: Array
    others: Array
    limit_m: float
    dt_s: float
    rudders: Array
    sizes: Array


class Layer(NamedTuple):
    """Buffers for the states of a layer: rows, cell keys, rates, origins, and a hash table of the cells."""

    made: Array
    keys: IntArray
    rates: Array
    origin: IntArray
    table: IntArray


@compiled
def clear_after(task: Task, s: Array, choice: int, rudder: float, steps: int, k: int) -> bool:
    """Hold a choice for ``steps`` from time index ``k``, in place; return False once a boat is within ``limit_m``."""
    others, limit = task.others, task.limit_m * task.limit_m
    for i in range(k + 1, k + steps + 1):
        speed, error = command_of(task.p, s, choice, rudder, task.dt_s)
        step(task.p, s, speed, error, task.dt_s)
        for m in range(others.shape[1]):
            dx, dy = others[i, m, 0] - s[0], others[i, m, 1] - s[1]
            if not dx * dx + dy * dy > limit:
                return False
    return True


@compiled
def promise(s: Array, others: Array, k: int, limit_m: float, dt_s: float) -> float:
    """Rate a state at time index ``k``: steps until a straight course meets a boat, plus up to 1 for clearance."""
    east, north = s[3] * math.sin(math.radians(s[2])) * dt_s, s[3] * math.cos(math.radians(s[2])) * dt_s
    limit, nearest = limit_m * limit_m, np.inf
    last = others.shape[0] - 1
    i = k
    while i < last:
        i = min(i + _LOOK, last)
        x, y = s[0] + east * (i - k), s[1] + north * (i - k)
        for m in range(others.shape[1]):
            dx, dy = others[i, m, 0] - x, others[i, m, 1] - y
            nearest = min(nearest, dx * dx + dy * dy)
        if nearest <= limit:
            break
    return i + min(math.sqrt(nearest), 50.0) / 50.0


@compiled
def _cell(s: Array, sizes: Array) -> int:
    key = 1469598103934665603
    for i in range(5):
        key = (key ^ (math.floor(s[i] / sizes[i]) + 1048576)) * 1099511628211
        key ^= key >> 29
    return key


@compiled
def _slot(table: IntArray, keys: IntArray, key: int) -> int:
    """Return the place of a key in the hash table, or the empty place where it belongs."""
    place = (key ^ (key >> 17)) & (table.size - 1)
    while table[place] >= 0 and keys[table[place]] != key:
        place = (place + 1) & (table.size - 1)
    return place


@compiled
def _expand(task: Task, layer: Array, k: int, steps: int, room: Layer) -> int:
    """Write the next layer into ``room``; return its number of states."""
    made, keys, rates, origin, table = room
    rudders = task.rudders
    count = 0
    table[:] = -1
    s = np.empty(layer.shape[1])
    for node in range(layer.shape[0]):
        for action in range(N_SPEEDS * rudders.size):
            s[:] = layer[node]
            choice, rudder = action // rudders.size, rudders[action % rudders.size]
            if not clear_after(task, s, choice, rudder, steps, k):
                continue
            key = _cell(s, task.sizes)
            rate = promise(s, task.others, k + steps, task.limit_m, task.dt_s)
            place = _slot(table, keys, key)
            row = table[place]
            if row < 0:
                row = count
                count += 1
                table[place] = row
            elif rates[row] >= rate:
                continue
            made[row] = s
            keys[row], rates[row], origin[row, 0], origin[row, 1] = key, rate, node, action
    return count


@compiled
def _choose(rates: Array, width: int) -> NDArray[np.signedinteger[Any]]:
    """Return indices of the states to keep: three quarters by rate, the rest evenly from what remains."""
    if rates.size <= width:
        return np.arange(rates.size)
    best = max(1, width - width // 4)
    border, kept = np.sort(rates)[rates.size - best], 0
    is_kept = np.zeros(rates.size, np.bool_)
    for i in range(rates.size):
        if rates[i] >= border and kept < best:
            is_kept[i], kept = True, kept + 1
    rest = np.flatnonzero(~is_kept)
    spread = np.arange(width - kept) * rest.size // max(1, width - kept)
    return np.concatenate((np.flatnonzero(is_kept), rest[spread]))


@compiled
def _finish(task: Task, layer: Array, rates: Array, k: int) -> tuple[int, int]:
    """Simulate simple courses from the best states; return (state, action) of one that stays clear, or (-1, -1)."""
    left, rudders, steps = rates.copy(), task.rudders, task.others.shape[0] - 1 - k
    for _ in range(min(_TRIED, left.size)):
        node = int(np.argmax(left))
        left[node] = -np.inf
        for choice in (HOLD, UP, DOWN):
            for r in (rudders.size // 2, 0, rudders.size - 1):
                if clear_after(task, layer[node].copy(), choice, rudders[r], steps, k):
                    return node, choice * rudders.size + r
    return -1, -1


@compiled
def search(task: Task, start: Array, lengths: IntArray, width: int, actions: IntArray) -> tuple[bool, bool]:
    """Search actions that stay farther than the limit from the others until their tracks end.

    ``lengths`` (N,) are steps per choice and sum to K. ``width``: most states per layer. ``actions`` (N,) are written
    if found, each speed choice * rudders + rudder.

    Returns:
        Whether a sequence was found; whether no state was dropped for lack of width.
    """
    most = width * N_SPEEDS * task.rudders.size
    made, keys = np.empty((most, start.size)), np.empty(most, dtype=np.int64)
    rates, origin = np.empty(most), np.empty((most, 2), dtype=np.int64)
    room = Layer(made, keys, rates, origin, np.empty(1 << math.ceil(math.log2(2 * most)), dtype=np.int64))
    history = np.empty((lengths.size, width, 2), dtype=np.int64)
    layer, layer_rates = start.copy().reshape(1, -1), np.zeros(1)
    k, whole = 0, True
    for n in range(lengths.size):
        node, action = _finish(task, layer, layer_rates, k)
        if node >= 0:
            actions[n:] = action
            _trace(history, n, node, actions)
            return True, whole
        steps = lengths[n]
        count = _expand(task, layer, k, steps, room)
        if count == 0:
            return False, whole
        chosen = _choose(rates[:count], width)
        whole = whole and chosen.size == count
        layer, layer_rates = made[chosen], rates[chosen]
        history[n, : chosen.size] = origin[chosen]
        k += steps
    _trace(history, lengths.size, int(np.argmax(layer_rates)), actions)
    return True, whole


@compiled
def _trace(history: IntArray, layers: int, node: int, actions: IntArray) -> None:
    """Write the actions that led to a state of a layer."""
    for n in range(layers - 1, -1, -1):
        actions[n] = history[n, node, 1]
        node = history[n, node, 0]


@compiled
def commands_of(task: Task, start: Array, actions: IntArray, lengths: IntArray, commands: Array) -> None:
    """Convert actions into the commands (K, 2) that make the autopilot apply them."""
    s, k, rudders = start.copy(), 0, task.rudders
    for n in range(lengths.size):
        for _ in range(lengths[n]):
            choice, rudder = actions[n] // rudders.size, rudders[actions[n] % rudders.size]
            speed, error = command_of(task.p, s, choice, rudder, task.dt_s)
            commands[k, 0], commands[k, 1] = speed, error
            step(task.p, s, speed, error, task.dt_s)
            k += 1
