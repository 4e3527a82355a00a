"""What boats see: the observation vector of each boat, raw and normalised.

Order and units of the numbers: see `observation_layout`.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to, wrap_bearing
from .arrays import Games, Rules
from .observation_layout import OTHER_STATUS, OWN_STATUS, sight_of_line, sight_of_point
from .obstacles import Obstacles, distance_and_heading


@lean_kernel
def _see_field(raw: Array, i: int, state: Array, lines: Array, homes: Array, team: int) -> None:
    """Flag homes, walls and the dividing line (packed ``lines`` (5, 7)) as seen by boat ``i``."""
    x, y, heading = state[i, L.X], state[i, L.Y], state[i, L.HEADING]
    raw[i, 0], raw[i, 1] = sight_of_point(x, y, heading, homes[1 - team, 0], homes[1 - team, 1])
    raw[i, 2], raw[i, 3] = sight_of_point(x, y, heading, homes[team, 0], homes[team, 1])
    for k in range(lines.shape[0]):
        raw[i, 4 + 2 * k], raw[i, 5 + 2 * k] = sight_of_line(x, y, heading, lines, k)
    raw[i, 14] = state[i, L.SPEED]


@lean_kernel
def _see_each_other(raw: Array, state: Array, i: int, j: int, slots: IntArray) -> None:
    """Where boats ``i`` and ``j`` (rows of ``state``) see one another: one arc tangent for both."""
    dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
    distance = math.sqrt(dx * dx + dy * dy)
    there = heading_to(dx, dy)
    # two boats on one point both look east, as in the reference
    back = there if distance == 0.0 else wrap_bearing(there + 180.0)
    at = slots[i, j]
    raw[i, at] = wrap_bearing(there - state[i, L.HEADING])
    raw[i, at + 1] = distance
    raw[i, at + 2] = wrap_bearing(state[j, L.HEADING] - back)
    raw[i, at + 3] = state[j, L.SPEED]
    at = slots[j, i]
    raw[j, at] = wrap_bearing(back - state[j, L.HEADING])
    raw[j, at + 1] = distance
    raw[j, at + 2] = wrap_bearing(state[i, L.HEADING] - there)
    raw[j, at + 3] = state[i, L.SPEED]


@lean_kernel
def _see_status(
    raw: Array,
    i: int,
    slots: IntArray,
    has_flag: BoolArray,
    on_side: BoolArray,
    cooldown: Array,
    is_tagged: BoolArray,
    is_disabled: BoolArray,
    shows_disabled: bool,
) -> None:
    """Status of boat ``i`` (arrays (n,) of one game) into every boat's observation, its own included."""
    for j in range(raw.shape[0]):
        at = slots[j, i] + OTHER_STATUS
        raw[j, at] = has_flag[i]
        raw[j, at + 1] = on_side[i]
        raw[j, at + 2] = cooldown[i]
        raw[j, at + 3] = is_tagged[i]
        if shows_disabled:
            raw[j, at + 4] = is_disabled[i]


@lean_kernel
def _see_obstacles(row: Array, state: Array, obstacles: Obstacles, radius: float, at: int) -> None:
    """Distance (less the boat's radius) and bearing of every obstacle, from ``row[at]`` on."""
    for k in range(obstacles.bounds.shape[0]):
        distance, heading = distance_and_heading(obstacles, k, state[L.X], state[L.Y])
        row[at + 2 * k] = distance - radius
        row[at + 2 * k + 1] = wrap_bearing(heading - state[L.HEADING])


@lean_kernel
def observe_raw(rules: Rules, games: Games, raw: Array, first: int, last: int) -> None:
    """Raw observations of all boats of the games first..last-1 into ``raw`` (last - first, n, n_obs)."""
    n_boats = rules.n_boats
    status = 5 if rules.shows_disabled else 4
    scores = OWN_STATUS + status
    for b in range(first, last):
        seen = raw[b - first]
        state = games.state[b]
        for i in range(n_boats):
            team = rules.team[i]
            _see_field(seen, i, state, rules.sight_lines[team], rules.flag_home, team)
            seen[i, scores] = games.captures[b, team]
            seen[i, scores + 1] = games.captures[b, 1 - team]
            for j in range(i + 1, n_boats):
                _see_each_other(seen, state, i, j, rules.slots)
            _see_status(
                seen,
                i,
                rules.slots,
                games.has_flag[b],
                games.on_side[b],
                games.tagging_cooldown_s[b],
                games.is_tagged[b],
                games.is_disabled[b],
                rules.shows_disabled,
            )
            if rules.obstacles.bounds.shape[0] > 0:
                at = scores + 2 + (OTHER_STATUS + status) * (n_boats - 1)
                _see_obstacles(seen[i], state[i], rules.obstacles, rules.agent_radius[i], at)


@lean_kernel
def normalise(raw: Array, middle: Array, scale: Array, out: np.ndarray) -> None:
    """``out = clip((raw - middle) * scale, -1, 1)`` in float32; raw and out (n, n_obs)."""
    for i in range(raw.shape[0]):
        for k in range(raw.shape[1]):
            out[i, k] = min(1.0, max(-1.0, (raw[i, k] - middle[k]) * scale[k]))


@lean_kernel
def observe_games(rules: Rules, games: Games, middle: Array, scale: Array, raw: Array, out: np.ndarray) -> None:
    """Normalised observations of every game into ``out`` (B, n, n_obs) float32; ``raw`` (k, n, n_obs) is scratch."""
    n_games = games.state.shape[0]
    for first in range(0, n_games, raw.shape[0]):
        last = min(first + raw.shape[0], n_games)
        observe_raw(rules, games, raw, first, last)
        for b in range(first, last):
            normalise(raw[b - first], middle, scale, out[b])
