"""The global state: every boat's pose and status in field coordinates, flags and scores."""

from __future__ import annotations

import numpy as np
from steerclear.shield.jit import Array, lean_kernel
from steerclear.shield.platforms import layout as L

from .angles import wrap_bearing
from .arrays import Games, Rules
from .config import GameConfig
from .field import FieldGeometry
from .observation_layout import Key
from .obstacles import distance_and_heading
from .sight import sight_of_line

N_BOAT = 11
"""Numbers per boat, before ``is_disabled``, where it is told, and obstacles."""

SCRIMMAGE = 4
"""Which of the sight lines is the dividing line."""

BOAT_ENTRIES = (
    "pos",
    "heading",
    "scrimmage_line_bearing",
    "scrimmage_line_distance",
    "speed",
    "has_flag",
    "on_side",
    "oob",
    "tagging_cooldown",
    "is_tagged",
)
FLAG_ENTRIES = ("blue_flag_home", "red_flag_home", "blue_flag_pos", "red_flag_pos")
TEAM_ENTRIES = ("blue_flag_pickup", "red_flag_pickup", "blue_team_score", "red_team_score")


def global_state_keys(config: GameConfig) -> tuple[Key, ...]:
    """Names of the global state's entries, in order; positions take two numbers."""
    keys: list[Key] = []
    for agent_id in config.agent_ids:
        keys += [(agent_id, entry) for entry in BOAT_ENTRIES]
        keys += [(agent_id, "is_disabled")] if config.shows_disabled else []
        for k in range(config.n_obstacles):
            keys += [(agent_id, f"obstacle_{k}_distance"), (agent_id, f"obstacle_{k}_bearing")]
    return (*keys, *FLAG_ENTRIES, *TEAM_ENTRIES)


def entry_size(key: Key) -> int:
    """How many numbers an entry takes: 2 for positions, 1 for everything else."""
    name = key if isinstance(key, str) else key[1]
    return 2 if name == "pos" or name in FLAG_ENTRIES else 1


def global_state_bounds(config: GameConfig, field: FieldGeometry, max_speed_mps: float) -> tuple[Array, Array]:
    """Lower and upper bounds of the global state vector, each (n_global,)."""
    buffer = 5.0 * max(config.agent_radius_m)
    low: list[float] = []
    high: list[float] = []
    for key in global_state_keys(config):
        name = key if isinstance(key, str) else key[1]
        if entry_size(key) == 2:
            low += [-buffer, -buffer]
            high += list(field.size + buffer)
            continue
        bounds = (0.0, 1.0)
        if name.endswith(("heading", "bearing")):
            bounds = (-180.0, 180.0)
        elif name.endswith("distance"):
            bounds = (0.0, field.diagonal)
        elif name == "speed":
            bounds = (0.0, max_speed_mps)
        elif name == "tagging_cooldown":
            bounds = (0.0, config.tagging_cooldown_s)
        elif name.endswith("score"):
            bounds = (0.0, float(config.max_score))
        low.append(bounds[0])
        high.append(bounds[1])
    return np.array(low), np.array(high)


@lean_kernel
def _describe_boat(rules: Rules, games: Games, b: int, i: int, out: Array) -> None:
    state = games.state[b, i]
    x, y, heading = state[L.X], state[L.Y], state[L.HEADING]
    out[0] = x
    out[1] = y
    out[2] = heading
    out[3], out[4] = sight_of_line(x, y, heading, rules.sight_lines[0], SCRIMMAGE)
    out[5] = state[L.SPEED]
    out[6] = games.has_flag[b, i]
    out[7] = games.on_side[b, i]
    out[8] = games.oob[b, i]
    out[9] = games.tagging_cooldown_s[b, i]
    out[10] = games.is_tagged[b, i]
    at = N_BOAT
    if rules.shows_disabled:
        out[at] = games.is_disabled[b, i]
        at += 1
    for k in range(rules.obstacles.bounds.shape[0]):
        distance, towards = distance_and_heading(rules.obstacles, k, x, y)
        out[at + 2 * k] = distance - rules.agent_radius[i]
        out[at + 2 * k + 1] = wrap_bearing(towards - heading)


@lean_kernel
def describe_game(rules: Rules, games: Games, b: int, out: Array) -> None:
    """Raw global state of game ``b`` into ``out`` (n_global,)."""
    width = N_BOAT + int(rules.shows_disabled) + 2 * rules.obstacles.bounds.shape[0]
    for i in range(rules.n_boats):
        _describe_boat(rules, games, b, i, out[i * width : (i + 1) * width])
    at = rules.n_boats * width
    for team in range(2):
        for axis in range(2):
            out[at + 2 * team + axis] = rules.flag_home[team, axis]
            out[at + 4 + 2 * team + axis] = games.flag_position[b, team, axis]
        out[at + 8 + team] = games.flag_taken[b, team]
        out[at + 10 + team] = games.captures[b, team]
