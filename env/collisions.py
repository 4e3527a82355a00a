"""Collisions between boats: once per entry into the sum of radii, per pair, for each boat in it.

The game looks once a decision, and misses what happens between; ``contacts`` are counted after every step.
"""

from __future__ import annotations

import math

from steerclear.shield.jit import Array, BoolArray, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L

from .arrays import Games, Rules


@lean_kernel
def _new_in_game(state: Array, radius: Array, touching: BoolArray, new: IntArray) -> None:
    """Count each boat's entries in one game into ``new`` (n,) and update ``touching`` (n, n)."""
    n_boats = state.shape[0]
    for i in range(n_boats):
        new[i] = 0
    for i in range(n_boats):
        x, y = state[i, L.X], state[i, L.Y]
        for j in range(i + 1, n_boats):
            dx, dy = state[j, L.X] - x, state[j, L.Y] - y
            near = math.sqrt(dx * dx + dy * dy) <= radius[i] + radius[j]
            if near and not touching[i, j]:
                new[i] += 1
                new[j] += 1
            touching[i, j] = near
            touching[j, i] = near


@lean_kernel
def check_collisions(rules: Rules, games: Games, first: int, last: int) -> None:
    """Count the pairs of the games first..last-1 that came within touch in this step."""
    for b in range(first, last):
        _new_in_game(games.state[b], rules.agent_radius, games.touching[b], games.new_collisions[b])
        for i in range(rules.n_boats):
            games.collisions[b, i] += games.new_collisions[b, i]
            if rules.decision_steps == 1:  # every step was looked at
                games.contacts[b, i] += games.new_collisions[b, i]


@lean_kernel
def look_for_contacts(rules: Rules, games: Games, first: int, last: int) -> None:
    """Count, after one of several steps of a decision, the pairs that came within touch in it."""
    if rules.decision_steps == 1:
        return
    for b in range(first, last):
        _new_in_game(games.state[b], rules.agent_radius, games.contact[b], games.new_collisions[b])
        for i in range(rules.n_boats):
            games.contacts[b, i] += games.new_collisions[b, i]
