"""The observation vector of each boat, raw and normalised.

Order and units of the numbers: see `observation_layout`.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, IntArray, lean_kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to, wrap_bearing
from .arrays import Games, Rules
from .observation_layout import OTHER_STATUS, OWN_STATUS, sight_of_line, sight_of_point
from .obstacles import distance_and_heading


@lean_kernel
def _see_field(rules: Rules, state: Array, i: int, row: Array) -> None:
    """Write flag homes, walls and the dividing line as boat ``i`` sees them."""
    x, y, heading, team = state[i, L.X], state[i, L.Y], state[i, L.HEADING], rules.team[i]
    homes, lines = rules.flag_home, rules.sight_lines[team]
    row[0], row[1] = sight_of_point(x, y, heading, homes[1 - team, 0], homes[1 - team, 1])
    row[2], row[3] = sight_of_point(x, y, heading, homes[team, 0], homes[team, 1])
    for k in range(lines.shape[0]):
        row[4 + 2 * k], row[5 + 2 * k] = sight_of_line(x, y, heading, lines, k)
    row[14] = state[i, L.SPEED]


@lean_kernel
def _see_each_other(raw: Array, state: Array, i: int, j: int, slots: IntArray) -> None:
    """Write how boats ``i`` and ``j`` (rows of ``state``) see one another, with one arc tangent for both."""
    dx, dy = state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]
    distance = math.sqrt(dx * dx + dy * dy)
    there = heading_to(dx, dy)
    # two boats at one point see each other in the east, as in the reference
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
def _see_status(rules: Rules, games: Games, b: int, i: int, seen: Array) -> None:
    """Write the status of boat ``i`` into every boat's observation, its own included."""
    for j in range(rules.n_boats):
        at = rules.slots[j, i] + OTHER_STATUS
        seen[j, at] = games.has_flag[b, i]
        seen[j, at + 1] = games.on_side[b, i]
        seen[j, at + 2] = games.tagging_cooldown_s[b, i]
        seen[j, at + 3] = games.is_tagged[b, i]
        if rules.shows_disabled:
            seen[j, at + 4] = games.is_disabled[b, i]


@lean_kernel
def see_obstacles(rules: Rules, state: Array, i: int, row: Array, at: int) -> None:
    """Write distance (less the boat's radius) and bearing of every obstacle from boat ``i``, from ``row[at]`` on."""
    for k in range(rules.obstacles.bounds.shape[0]):
        distance, heading = distance_and_heading(rules.obstacles, k, state[i, L.X], state[i, L.Y])
        row[at + 2 * k] = distance - rules.agent_radius[i]
        row[at + 2 * k + 1] = wrap_bearing(heading - state[i, L.HEADING])


@lean_kernel
def observe_raw(rules: Rules, games: Games, raw: Array, first: int, last: int) -> None:
    """Write raw observations of all boats of the games first..last-1 into ``raw`` (last - first, n, n_obs)."""
    status = 5 if rules.shows_disabled else 4
    scores = OWN_STATUS + status
    obstacles = scores + 2 + (OTHER_STATUS + status) * (rules.n_boats - 1)
    for b in range(first, last):
        seen, state = raw[b - first], games.state[b]
        for i in range(rules.n_boats):
            team = rules.team[i]
            _see_field(rules, state, i, seen[i])
            seen[i, scores] = games.captures[b, team]
            seen[i, scores + 1] = games.captures[b, 1 - team]
            for j in range(i + 1, rules.n_boats):
                _see_each_other(seen, state, i, j, rules.slots)
            _see_status(rules, games, b, i, seen)
            see_obstacles(rules, state, i, seen[i], obstacles)


@lean_kernel
def normalise(raw: Array, middle: Array, scale: Array, out: np.ndarray) -> None:
    """Compute ``out = clip((raw - middle) * scale, -1, 1)`` in float32; raw and out (n, n_obs)."""
    for i in range(raw.shape[0]):
        for k in range(raw.shape[1]):
            out[i, k] = min(1.0, max(-1.0, (raw[i, k] - middle[k]) * scale[k]))


@lean_kernel
def observe_games(rules: Rules, games: Games, middle: Array, scale: Array, raw: Array, out: np.ndarray) -> None:
    """Write normalised observations of every game into ``out`` (B, n, n_obs) float32.

    ``raw`` (k, n, n_obs) is scratch.
    """
    n_games = games.state.shape[0]
    for first in range(0, n_games, raw.shape[0]):
        last = min(first + raw.shape[0], n_games)
        observe_raw(rules, games, raw, first, last)
        for b in range(first, last):
            normalise(raw[b - first], middle, scale, out[b])
