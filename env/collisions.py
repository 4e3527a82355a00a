"""Collisions between boats: once per entry into the sum of radii, per pair, for each boat in it."""

from __future__ import annotations

import math

from steerclear.shield.jit import kernel
from steerclear.shield.platforms import layout as L

from .arrays import Games, Rules


@kernel
def check_collisions(rules: Rules, games: Games, b: int) -> None:
    """Count pairs that came within touch in this step."""
    for i in range(rules.n_boats):
        games.new_collisions[b, i] = 0
    for i in range(rules.n_boats):
        x, y = games.state[b, i, L.X], games.state[b, i, L.Y]
        for j in range(i + 1, rules.n_boats):
            dx = games.state[b, j, L.X] - x
            dy = games.state[b, j, L.Y] - y
            near = math.sqrt(dx * dx + dy * dy) <= rules.agent_radius[i] + rules.agent_radius[j]
            if near and not games.touching[b, i, j]:
                games.new_collisions[b, i] += 1
                games.new_collisions[b, j] += 1
            games.touching[b, i, j] = near
            games.touching[b, j, i] = near
    for i in range(rules.n_boats):
        games.collisions[b, i] += games.new_collisions[b, i]
