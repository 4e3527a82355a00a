"""What boats see: the observation vector of each boat, raw and normalised.

Order of the numbers: see `observation_keys`. Bearings are relative to the boat's heading, deg, clockwise,
in (-180, 180]; distances m; speeds m/s; booleans 0 or 1.
"""

from __future__ import annotations

import math

import numpy as np
from steerclear.shield.jit import Array, kernel
from steerclear.shield.platforms import layout as L

from .angles import heading_to, wrap_bearing
from .arrays import Games, Rules
from .config import GameConfig
from .field import FieldGeometry
from .obstacles import closest_on_segment, distance_and_heading

N_OWN = 21
"""Numbers about the boat itself and the field."""
N_OTHER = 8
"""Numbers about each other boat."""

Key = str | tuple[str, str]

OTHER_ENTRIES = (
    "bearing",
    "distance",
    "relative_heading",
    "speed",
    "has_flag",
    "on_side",
    "tagging_cooldown",
    "is_tagged",
)


def observation_keys(config: GameConfig) -> tuple[Key, ...]:
    """Names of an observation's numbers, in order."""
    keys: list[Key] = []
    for place in ("opponent_home", "own_home", "wall_0", "wall_1", "wall_2", "wall_3", "scrimmage_line"):
        keys += [f"{place}_bearing", f"{place}_distance"]
    keys += ["speed", "has_flag", "on_side", "tagging_cooldown", "is_tagged", "team_score", "opponent_score"]
    others = [f"teammate_{k}" for k in range(config.team_size - 1)]
    others += [f"opponent_{k}" for k in range(config.team_size)]
    keys += [(other, entry) for other in others for entry in OTHER_ENTRIES]
    for k in range(config.n_obstacles):
        keys += [f"obstacle_{k}_distance", f"obstacle_{k}_bearing"]
    return tuple(keys)


def observation_bounds(config: GameConfig, field: FieldGeometry, max_speed_mps: float) -> tuple[Array, Array]:
    """Lower and upper bounds of the raw observation, each (n_obs,)."""
    ranges = {
        "bearing": (-180.0, 180.0),
        "relative_heading": (-180.0, 180.0),
        "distance": (0.0, field.diagonal),
        "speed": (0.0, max_speed_mps),
        "tagging_cooldown": (0.0, config.tagging_cooldown_s),
        "score": (0.0, float(config.max_score)),
    }
    low, high = [], []
    for key in observation_keys(config):
        name = key if isinstance(key, str) else key[1]
        kind = next((end for end in ranges if name.endswith(end)), None)
        bounds = (0.0, 1.0) if kind is None else ranges[kind]
        low.append(bounds[0])
        high.append(bounds[1])
    return np.array(low), np.array(high)


@kernel
def _see_point(row: Array, at: int, state: Array, x: float, y: float) -> None:
    """Bearing and distance of a point."""
    dx, dy = x - state[L.X], y - state[L.Y]
    row[at] = wrap_bearing(heading_to(dx, dy) - state[L.HEADING])
    row[at + 1] = math.sqrt(dx * dx + dy * dy)


@kernel
def _see_segment(row: Array, at: int, state: Array, segment: Array) -> None:
    """Bearing and distance of a segment's closest point."""
    x, y = closest_on_segment(segment, state[L.X], state[L.Y])
    _see_point(row, at, state, x, y)


@kernel
def _see_self(rules: Rules, games: Games, b: int, i: int, row: Array) -> None:
    state = games.state[b, i]
    team = rules.team[i]
    _see_point(row, 0, state, rules.flag_home[1 - team, 0], rules.flag_home[1 - team, 1])
    _see_point(row, 2, state, rules.flag_home[team, 0], rules.flag_home[team, 1])
    for wall in range(4):
        _see_segment(row, 4 + 2 * wall, state, rules.walls[team, wall])
    _see_segment(row, 12, state, rules.scrimmage)
    row[14] = state[L.SPEED]
    row[15] = games.has_flag[b, i]
    row[16] = games.on_side[b, i]
    row[17] = games.tagging_cooldown_s[b, i]
    row[18] = games.is_tagged[b, i]
    row[19] = games.captures[b, team]
    row[20] = games.captures[b, 1 - team]


@kernel
def _see_boat(games: Games, b: int, j: int, at: int, row: Array, bearing: float, distance: float, back: float) -> None:
    """Boat ``j`` as seen from another: its bearing and distance, and ``back``, the heading from ``j`` to the viewer."""
    row[at] = bearing
    row[at + 1] = distance
    row[at + 2] = wrap_bearing(games.state[b, j, L.HEADING] - back)
    row[at + 3] = games.state[b, j, L.SPEED]
    row[at + 4] = games.has_flag[b, j]
    row[at + 5] = games.on_side[b, j]
    row[at + 6] = games.tagging_cooldown_s[b, j]
    row[at + 7] = games.is_tagged[b, j]


@kernel
def _slot(rules: Rules, i: int, j: int) -> int:
    """Where boat ``i``'s observation holds boat ``j``: team-mates in order without itself, then opponents."""
    size = rules.team_size
    k = j % size
    if rules.team[i] != rules.team[j]:
        k += size - 1
    elif j > i:
        k -= 1
    return N_OWN + N_OTHER * k


@kernel
def _see_each_other(rules: Rules, games: Games, b: int, i: int, j: int, raw: Array) -> None:
    """Boats ``i`` and ``j`` see one another: one arc tangent for both."""
    one, two = games.state[b, i], games.state[b, j]
    dx, dy = two[L.X] - one[L.X], two[L.Y] - one[L.Y]
    distance = math.sqrt(dx * dx + dy * dy)
    there = heading_to(dx, dy)
    # two boats on one point both look east, as in the reference
    back = there if distance == 0.0 else wrap_bearing(there + 180.0)
    _see_boat(games, b, j, _slot(rules, i, j), raw[i], wrap_bearing(there - one[L.HEADING]), distance, back)
    _see_boat(games, b, i, _slot(rules, j, i), raw[j], wrap_bearing(back - two[L.HEADING]), distance, there)


@kernel
def observe_raw(rules: Rules, games: Games, b: int, raw: Array) -> None:
    """Raw observations of all boats of game ``b`` into ``raw`` (n, n_obs)."""
    for i in range(rules.n_boats):
        _see_self(rules, games, b, i, raw[i])
        for j in range(i + 1, rules.n_boats):
            _see_each_other(rules, games, b, i, j, raw)
        at = N_OWN + N_OTHER * (rules.n_boats - 1)
        state = games.state[b, i]
        for k in range(rules.obstacles.bounds.shape[0]):
            distance, heading = distance_and_heading(rules.obstacles, k, state[L.X], state[L.Y])
            raw[i, at + 2 * k] = distance - rules.agent_radius[i]
            raw[i, at + 2 * k + 1] = wrap_bearing(heading - state[L.HEADING])


@kernel
def normalise(raw: Array, middle: Array, scale: Array, out: np.ndarray) -> None:
    """``out = clip((raw - middle) * scale, -1, 1)`` in float32; raw and out (n, n_obs)."""
    for i in range(raw.shape[0]):
        for k in range(raw.shape[1]):
            out[i, k] = np.float32(min(1.0, max(-1.0, (raw[i, k] - middle[k]) * scale[k])))


@kernel
def observe_games(rules: Rules, games: Games, middle: Array, scale: Array, raw: Array, out: np.ndarray) -> None:
    """Normalised observations of every game into ``out`` (B, n, n_obs) float32; ``raw`` (n, n_obs) is scratch."""
    for b in range(games.state.shape[0]):
        observe_raw(rules, games, b, raw)
        normalise(raw, middle, scale, out[b])
