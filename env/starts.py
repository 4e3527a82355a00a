"""Start places of boats: fixed ones on a line before the own flag, random ones, or a partial state."""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array, BoolArray, kernel
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.usv import wrap_degrees

from .angles import heading_to
from .arrays import Games, Rules
from .config import GameConfig
from .field import FieldGeometry, line_through_field
from .motion import is_on_side, see_boat
from .obstacles import closest_on_segment, touches_obstacle
from .power_play import plan_power_plays
from .randomness import next_uniform
from .rules import check_bounds, check_grabs, check_tags, check_untags

MAX_TRIES = 20_000
"""Random places tried for one boat before the field counts as full."""


def default_places(config: GameConfig, field: FieldGeometry) -> Array:
    """Return fixed start places (n, 2), m: evenly along the line halfway between own flag and dividing line."""
    along = field.scrimmage[1] - field.scrimmage[0]
    places = np.zeros((config.n_boats, 2))
    for i in range(config.n_boats):
        team, k = divmod(i, config.team_size)
        home = field.flag_home[team]
        middle = 0.5 * (home + np.array(closest_on_segment(field.scrimmage, home[0], home[1])))
        first, last = line_through_field(field.size, middle, along)
        margin = 2.0 * config.agent_radius_m[i]
        place = first + (last - first) * (k + 1) / (config.team_size + 1)
        places[i] = np.maximum(margin, np.minimum(field.size - margin, place))
    return places


@kernel
def place_is_free(rules: Rules, games: Games, b: int, i: int, x: float, y: float, placed: BoolArray) -> bool:
    """Return whether boat ``i`` may start at (x, y): clear of placed boats, flags at home, obstacles and edges."""
    radius = rules.agent_radius[i]
    if not (radius < x < rules.size[0] - radius and radius < y < rules.size[1] - radius):
        return False
    for j in range(rules.n_boats):
        if placed[j] and j != i:
            other = games.state[b, j]
            if math.hypot(other[L.X] - x, other[L.Y] - y) <= radius + rules.agent_radius[j]:
                return False
    for flag in range(2):
        if not games.flag_taken[b, flag]:
            home = rules.flag_home[flag]
            if math.hypot(home[0] - x, home[1] - y) <= rules.flag_keepout:
                return False
    return not touches_obstacle(rules.obstacles, x, y, radius)


@kernel
def draw_place(rules: Rules, games: Games, b: int, i: int, side: int, placed: BoolArray) -> bool:
    """Put boat ``i`` on a random free place; return False if there is none.

    ``side`` is the team on whose side the place is; -1 allows both.
    """
    radius = rules.agent_radius[i]
    for _ in range(MAX_TRIES):
        x = radius + next_uniform(games.rng, b) * (rules.size[0] - 2.0 * radius)
        y = radius + next_uniform(games.rng, b) * (rules.size[1] - 2.0 * radius)
        if side >= 0 and not is_on_side(rules.scrimmage, rules.side_sign[side], x, y):
            continue
        if place_is_free(rules, games, b, i, x, y, placed):
            games.state[b, i, L.X], games.state[b, i, L.Y] = x, y
            return True
    return False


@kernel
def heading_to_scrimmage(rules: Rules, x: float, y: float) -> float:
    """Return the heading from (x, y) to the closest point of the dividing line, deg."""
    px, py = closest_on_segment(rules.scrimmage, x, y)
    return heading_to(px - x, py - y)


def clear_games(rules: Rules, games: Games, chosen: Any) -> None:
    """Set scores, flags, counters and clocks of games (a mask or a number) as at the start of a game."""
    for name in Games._fields:
        if name != "rng":
            getattr(games, name)[chosen] = 0
    for column in (L.SPEED_ERROR, L.HEADING_ERROR):
        games.state[chosen, :, column] = np.nan
    games.tagging_cooldown_s[chosen] = rules.cooldown
    games.made_tag[chosen] = -1
    games.flag_position[chosen] = rules.flag_home


@kernel
def _find_place(
    rules: Rules, games: Games, b: int, i: int, place: Array, random: bool, own_side: bool, placed: BoolArray
) -> bool:
    """Put boat ``i`` on its fixed place if that is free, otherwise on a random one; False if there is none."""
    team = rules.team[i]
    if games.has_flag[b, i]:
        return draw_place(rules, games, b, i, 1 - team, placed)
    if random:
        return draw_place(rules, games, b, i, team if own_side else -1, placed)
    if place_is_free(rules, games, b, i, place[0], place[1], placed) and is_on_side(
        rules.scrimmage, rules.side_sign[team], place[0], place[1]
    ):
        games.state[b, i, L.X], games.state[b, i, L.Y] = place[0], place[1]
        return True
    return draw_place(rules, games, b, i, team, placed)


@kernel
def start_game(rules: Rules, games: Games, b: int, places: Array, given: Array, random: bool, own_side: bool) -> bool:
    """Place every boat of game ``b``; return False if one found no place.

    The game must be cleared and its carriers marked. A boat whose fixed place is not free gets a random one on its own
    side.

    Args:
        rules: the rules.
        games: the games.
        b: number of the game.
        places: (n, 2) fixed places, m.
        given: (n, 4) x m, y m, speed m/s, heading deg as the caller wants them; NaN where it leaves them open.
        random: draw positions, speeds and headings.
        own_side: draw positions on the own side.
    """
    placed = np.zeros(rules.n_boats, np.bool_)
    for i in range(rules.n_boats):
        placed[i] = not math.isnan(given[i, 0])
        if placed[i]:
            games.state[b, i, L.X], games.state[b, i, L.Y] = given[i, 0], given[i, 1]
    for i in range(rules.n_boats):
        state = games.state[b, i]
        if not placed[i] and not _find_place(rules, games, b, i, places[i], random, own_side, placed):
            return False
        placed[i] = True
        if random:
            state[L.SPEED] = rules.max_speed[i] * next_uniform(games.rng, b)
            state[L.HEADING] = 360.0 * next_uniform(games.rng, b) - 180.0
        else:
            state[L.HEADING] = heading_to_scrimmage(rules, state[L.X], state[L.Y])
        if not math.isnan(given[i, 2]):
            state[L.SPEED] = given[i, 2]
        if not math.isnan(given[i, 3]):
            state[L.HEADING] = wrap_degrees(given[i, 3])
    return True


@kernel
def settle(rules: Rules, games: Games, b: int) -> None:
    """Set sides, last positions, and the grabs, tags and untags that the start places themselves cause."""
    for i in range(rules.n_boats):
        x, y = games.state[b, i, L.X], games.state[b, i, L.Y]
        games.previous_position[b, i, 0], games.previous_position[b, i, 1] = x, y
        games.on_side[b, i] = is_on_side(rules.scrimmage, rules.side_sign[rules.team[i]], x, y)
        if games.has_flag[b, i]:
            games.flag_position[b, 1 - rules.team[i], 0] = x
            games.flag_position[b, 1 - rules.team[i], 1] = y
    check_grabs(rules, games, b, b + 1)
    check_tags(rules, games, b, b + 1)
    check_untags(rules, games, b, b + 1)


@kernel
def _start_where_seen(rules: Rules, games: Games, seen: Array) -> None:
    for b in range(games.state.shape[0]):
        for i in range(rules.n_boats):
            see_boat(games.state[b, i], seen[b, i])
        check_bounds(rules, games, b, b + 1)
        settle(rules, games, b)
        plan_power_plays(rules, games, b)


def start_where_seen(rules: Rules, games: Games, seen: Array) -> None:
    """Start every game with its boats where they are: ``seen`` (B, n, 4) as in `motion.place_boats`."""
    clear_games(rules, games, slice(None))
    _start_where_seen(rules, games, seen)


@kernel
def _start_games(rules: Rules, games: Games, chosen: BoolArray, places: Array, random: bool, own_side: bool) -> bool:
    nothing_given = np.full((rules.n_boats, 4), np.nan)
    for b in range(chosen.shape[0]):
        if chosen[b]:
            if not start_game(rules, games, b, places, nothing_given, random, own_side):
                return False
            settle(rules, games, b)
            plan_power_plays(rules, games, b)
    return True


def reset_games(rules: Rules, games: Games, chosen: BoolArray, places: Array, config: GameConfig) -> None:
    """Start the chosen games anew; ``places`` (n, 2) m are the fixed start places."""
    clear_games(rules, games, chosen)
    if not _start_games(rules, games, chosen, places, not config.default_start, config.on_side_start):
        raise GameError(_CROWDED)


_CROWDED = "no free start place was found; use a larger field, fewer boats or smaller obstacles"

PER_BOAT = {
    "agent_position": 2,
    "agent_speed": 1,
    "agent_heading": 1,
    "agent_has_flag": 1,
    "agent_is_tagged": 1,
    "agent_tagging_cooldown": 1,
    "agent_collisions": 1,
}
"""Per-boat keys of a partial state, and how many numbers each has."""

PER_TEAM = ("captures", "tags", "grabs", "power_play_start")
KEYS = (*PER_BOAT, "agent_pos_unit", *PER_TEAM, "power_play_boats")


def start_from(config: GameConfig, rules: Rules, games: Games, b: int, places: Array, init: Mapping[str, Any]) -> None:
    """Start game ``b`` from a partial state; the rest is as after a plain reset.

    Args:
        config: the game's settings.
        rules: the rules.
        games: the games.
        b: which game.
        places: (n, 2) fixed start places, m.
        init: any of `KEYS`; per-boat values as a sequence in boat order or a dict by agent id, per-team values as a
            pair (blue, red) or a dict by team. ``power_play_start`` is the decision at which each team's power play
            begins; ``power_play_boats`` is the boat of each team that it disables. Units: m, m/s, deg, s.

    Raises:
        GameError: a key, id, shape or value that the rules do not allow.
    """
    if not isinstance(init, Mapping):
        raise GameError(f"init_dict is {type(init).__name__}; give a dict with any of {', '.join(KEYS)}")
    for key in init:
        if key not in KEYS:
            near = difflib.get_close_matches(str(key), KEYS, n=1)
            hint = f"did you mean {near[0]}?" if near else f"known: {KEYS}"
            raise GameError(f"unknown init_dict key {key!r}; {hint}")
    if init.get("agent_pos_unit", "m") not in ("m", None):
        raise GameError(f"agent_pos_unit is {init['agent_pos_unit']!r}; only 'm' (metres from the lower left) exists")
    n, ids = config.n_boats, config.agent_ids
    boats = {key: np.full((n, width), np.nan) for key, width in PER_BOAT.items()}
    boats |= {key: _rows(key, init[key], ids, PER_BOAT[key], _boat_number) for key in PER_BOAT if key in init}
    teams = {key: _counts(key, init[key]) for key in PER_TEAM if key in init}
    drawn = _power_play_boats(config, init["power_play_boats"]) if "power_play_boats" in init else None
    one = {key: rows[:, 0] for key, rows in boats.items()}
    given = np.column_stack([boats["agent_position"], one["agent_speed"], one["agent_heading"]])
    carries = np.nan_to_num(one["agent_has_flag"]) != 0.0
    taken = np.array([carries[rules.team == 1].any(), carries[rules.team == 0].any()])
    _check_carriers(config, rules, carries, given)
    _check_places(config, rules, taken, given)
    clear_games(rules, games, b)
    games.has_flag[b], games.flag_taken[b] = carries, taken
    if not start_game(rules, games, b, places, given, not config.default_start, config.on_side_start):
        raise GameError(_CROWDED)
    games.is_tagged[b] = np.nan_to_num(one["agent_is_tagged"]) != 0.0
    elapsed_s = np.nan_to_num(one["agent_tagging_cooldown"], nan=rules.cooldown)
    games.tagging_cooldown_s[b] = np.clip(elapsed_s, 0.0, rules.cooldown)
    games.collisions[b] = np.nan_to_num(one["agent_collisions"]).astype(np.int64)
    for name in ("captures", "tags", "grabs"):
        getattr(games, name)[b] = teams.get(name, 0)
    settle(rules, games, b)
    plan_power_plays(rules, games, b)
    if "power_play_start" in teams:
        games.power_start[b] = teams["power_play_start"]
    if drawn is not None:
        games.power_boats[b] = drawn


def _rows(key: str, value: Any, names: Sequence[Any], width: int, number: Callable[..., int]) -> Array:
    """Return one row of numbers per boat or team of ``names``, NaN where a dict has no entry: (n, width)."""
    rows = np.full((len(names), width), np.nan)
    if isinstance(value, Mapping):
        for name, entry in value.items():
            rows[number(key, name, names)] = _numbers(key, entry, width)
        return rows
    entries = list(value) if isinstance(value, (list, tuple, np.ndarray)) else []
    if len(entries) != len(names):
        order = "in boat order, or a dict by agent id" if len(names) != 2 else "in order, or a dict"
        raise GameError(f"{key} is {value!r}; give {len(names)} entries {order}")
    for row, entry in zip(rows, entries, strict=True):
        row[:] = _numbers(key, entry, width)
    return rows


def _boat_number(key: str, agent_id: Any, ids: Sequence[str]) -> int:
    if agent_id not in ids:
        raise GameError(f"{key}: unknown agent {agent_id!r}; agents are {', '.join(ids)}")
    return ids.index(agent_id)


def _team_number(key: str, team: Any, _: Sequence[int]) -> int:
    """Return 0 or 1 for any team whose ``int`` is that."""
    try:
        number = int(team)
    except (TypeError, ValueError):
        number = -1
    if number not in (0, 1):
        raise GameError(f"{key}: unknown team {team!r}; teams are 0 (blue) and 1 (red)")
    return number


def _numbers(key: str, value: Any, width: int) -> Array:
    try:
        numbers = np.asarray(value, dtype=np.float64).reshape(-1)
    except (TypeError, ValueError):
        numbers = np.array([np.nan])
    if numbers.shape != (width,) or not np.isfinite(numbers).all():
        raise GameError(f"{key}: {value!r} is not usable; give {width} finite number(s)")
    return numbers


def _counts(key: str, value: Any) -> Array:
    """Return counts (2,) of blue and red, 0 where a dict has no entry."""
    counts = np.nan_to_num(_rows(key, value, (0, 1), 1, _team_number)[:, 0])
    if (counts < 0).any():
        raise GameError(f"{key} is {value!r}; counts are >= 0")
    return counts.astype(np.int64)


def _power_play_boats(config: GameConfig, value: Any) -> Array:
    """Return the boats (2, 2) that the power plays of each team disable."""
    try:
        boats = np.asarray(value, dtype=np.float64)
        boats = np.broadcast_to(boats.reshape(2, -1), (2, 2))
    except (TypeError, ValueError):
        boats = np.full((2, 2), np.nan)
    first = np.arange(2)[:, None] * config.team_size
    if not ((boats == np.floor(boats)) & (boats >= first) & (boats < first + config.team_size)).all():
        raise GameError(f"power_play_boats is {value!r}; give the number of a blue and of a red boat")
    return boats


def _check_carriers(config: GameConfig, rules: Rules, carries: np.ndarray, given: Array) -> None:
    """Check that at most one boat of a team carries a flag, and none on its own side."""
    for team in (0, 1):
        if carries[rules.team == team].sum() > 1:
            raise GameError("agent_has_flag: at most one boat of a team can carry the opponents' flag")
    for i in np.flatnonzero(carries & ~np.isnan(given[:, 0])):
        if is_on_side(rules.scrimmage, rules.side_sign[rules.team[i]], given[i, 0], given[i, 1]):
            raise GameError(f"{config.agent_ids[i]} carries a flag but is on its own side; place it on the other side")


def _check_places(config: GameConfig, rules: Rules, taken: np.ndarray, given: Array) -> None:
    """Check that given places are inside the field, clear of obstacles and of flags at home, and all different."""
    for i in np.flatnonzero(~np.isnan(given[:, 0])):
        place, radius = given[i, :2], config.agent_radius_m[i]
        here = f"{config.agent_ids[i]} at ({place[0]:g}, {place[1]:g})"
        if not ((place > radius) & (place < rules.size - radius)).all():
            raise GameError(f"{here} is not inside the field ({rules.size[0]:g}, {rules.size[1]:g}); move it inside")
        if touches_obstacle(rules.obstacles, place[0], place[1], radius):
            raise GameError(f"{here} touches an obstacle; move it away")
        for flag in (0, 1):
            if not taken[flag] and np.hypot(*(place - rules.flag_home[flag])) <= rules.flag_keepout:
                raise GameError(f"{here} is on a flag's home; move it {rules.flag_keepout} m away")
        for j in range(i):
            if (given[j, :2] == place).all():
                raise GameError(f"{config.agent_ids[j]} and {here} are on one point; move one")
