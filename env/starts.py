"""Where boats start: fixed places on a line before the own flag, random ones, or a partial state."""

from __future__ import annotations

import difflib
import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array, BoolArray, copy_row, kernel
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
    """Fixed start places (n, 2), m: evenly along the line halfway between the own flag and the dividing line."""
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
    """Whether boat ``i`` may start at (x, y): clear of placed boats, flags that are home, obstacles and edges."""
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
    """Put boat ``i`` on a random free place; ``side`` is the team whose side it must lie on, -1 for anywhere.

    Returns:
        False when no free place was found.
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
    """Heading from (x, y) to the closest point of the dividing line, deg."""
    px, py = closest_on_segment(rules.scrimmage, x, y)
    return heading_to(px - x, py - y)


@kernel
def clear_game(rules: Rules, games: Games, b: int) -> None:
    """Scores, flags, counters and clocks of game ``b`` as at the start of a game."""
    for i in range(rules.n_boats):
        games.state[b, i] = 0.0
        games.state[b, i, L.SPEED_ERROR] = np.nan
        games.state[b, i, L.HEADING_ERROR] = np.nan
        games.error_is_float32[b, i] = False
        games.is_tagged[b, i] = False
        games.is_disabled[b, i] = False
        games.has_flag[b, i] = False
        games.oob[b, i] = False
        games.driven[b, i] = False
        games.tagging_cooldown_s[b, i] = rules.cooldown
        games.made_tag[b, i] = -1
        games.collisions[b, i] = 0
        games.new_collisions[b, i] = 0
        games.contacts[b, i] = 0
    games.touching[b] = False
    games.contact[b] = False
    for team in range(2):
        copy_row(games.flag_position[b, team], rules.flag_home[team])
    games.flag_taken[b] = False
    games.captures[b] = 0
    games.grabs[b] = 0
    games.tags[b] = 0
    games.events[b] = 0
    games.time_s[b] = 0.0
    games.terminated[b] = False
    games.truncated[b] = False


@kernel
def _find_place(
    rules: Rules, games: Games, b: int, i: int, place: Array, random: bool, own_side: bool, placed: BoolArray
) -> bool:
    """Put boat ``i`` on its fixed place when that is free, else on a random one; False when there is none."""
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
    """Place every boat of game ``b`` (already cleared, carriers already marked).

    Args:
        rules: the rules.
        games: the games.
        b: which game.
        places: (n, 2) fixed places, m; a boat whose place is not free gets a random one on its own side.
        given: (n, 4) x m, y m, speed m/s and heading deg that the caller wants; NaN where it does not care.
        random: ignore ``places``; positions, speeds and headings are random.
        own_side: random places lie on the own side.

    Returns:
        False when a boat found no place.
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


def crowded_field_error() -> GameError:
    """The error for boats that do not fit into the field."""
    return GameError("no free start place was found; use a larger field, fewer boats or smaller obstacles")


@kernel
def settle(rules: Rules, games: Games, b: int) -> None:
    """After placing: sides, last positions, and the grabs, tags and untags that the places themselves cause."""
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
def start_where_seen(rules: Rules, games: Games, seen: Array) -> None:
    """Start every game with its boats where they are: ``seen`` (B, n, 4) as in `motion.place_boats`."""
    for b in range(games.state.shape[0]):
        clear_game(rules, games, b)
        for i in range(rules.n_boats):
            see_boat(games.state[b, i], seen[b, i])
        check_bounds(rules, games, b, b + 1)
        settle(rules, games, b)
        plan_power_plays(rules, games, b)


@kernel
def _start_games(rules: Rules, games: Games, chosen: BoolArray, places: Array, random: bool, own_side: bool) -> bool:
    nothing_given = np.full((rules.n_boats, 4), np.nan)
    for b in range(chosen.shape[0]):
        if chosen[b]:
            clear_game(rules, games, b)
            if not start_game(rules, games, b, places, nothing_given, random, own_side):
                return False
            settle(rules, games, b)
            plan_power_plays(rules, games, b)
    return True


def reset_games(rules: Rules, games: Games, chosen: BoolArray, places: Array, config: GameConfig) -> None:
    """Start the chosen games anew; ``places`` (n, 2) m are the fixed start places.

    Raises:
        GameError: a boat found no free place.
    """
    if not _start_games(rules, games, chosen, places, not config.default_start, config.on_side_start):
        raise crowded_field_error()


PER_BOAT = (
    "agent_position",
    "agent_speed",
    "agent_heading",
    "agent_has_flag",
    "agent_is_tagged",
    "agent_tagging_cooldown",
    "agent_collisions",
)
PER_TEAM = ("captures", "tags", "grabs")
POWER_PLAYS = ("power_play_start", "power_play_boats")
KEYS = (*PER_BOAT, "agent_pos_unit", *PER_TEAM, *POWER_PLAYS)


def start_from(config: GameConfig, rules: Rules, games: Games, b: int, places: Array, init: Mapping[str, Any]) -> None:
    """Start game ``b`` from a partial state; what is not given is as after a plain reset.

    Args:
        config: the game's settings.
        rules: the rules.
        games: the games.
        b: which game.
        places: (n, 2) fixed start places, m.
        init: any of `KEYS`; per-boat values as a sequence in boat order or a dict by agent id, per-team values as a
            pair (blue, red) or a dict by team. ``power_play_start`` is the decision at which each team's power play
            begins, ``power_play_boats`` the boat of each it disables. Units: m, m/s, deg, s.

    Raises:
        GameError: a key, id, shape or value that the rules do not allow.
    """
    if not isinstance(init, Mapping):
        raise GameError(f"init_dict is {type(init).__name__}; give a dict with any of {', '.join(KEYS)}")
    for key in init:
        if key not in KEYS:
            near = difflib.get_close_matches(str(key), KEYS, n=1)
            raise GameError(
                f"unknown init_dict key {key!r}; {f'did you mean {near[0]}?' if near else f'known: {KEYS}'}"
            )
    if init.get("agent_pos_unit", "m") not in ("m", None):
        raise GameError(f"agent_pos_unit is {init['agent_pos_unit']!r}; only 'm' (metres from the lower left) exists")
    boats = {key: _per_boat(config, key, init[key]) for key in PER_BOAT if key in init}
    teams = {key: _per_team(key, init[key]) for key in PER_TEAM if key in init}
    given = _wanted_places(config, boats)
    carries = np.nan_to_num(boats.get("agent_has_flag", np.zeros(config.n_boats))) != 0.0
    _check_carriers(config, rules, carries, given)
    taken = np.array([carries[rules.team == 1].any(), carries[rules.team == 0].any()])
    _check_places(config, rules, taken, given)
    clear_game(rules, games, b)
    games.has_flag[b] = carries
    games.flag_taken[b] = taken
    if not start_game(rules, games, b, places, given, not config.default_start, config.on_side_start):
        raise crowded_field_error()
    _set_counters(rules, games, b, boats, teams)
    settle(rules, games, b)
    plan_power_plays(rules, games, b)
    _set_power_plays(config, games, b, init)


def _set_power_plays(config: GameConfig, games: Games, b: int, init: Mapping[str, Any]) -> None:
    """Put given power plays in the place of those drawn: decisions (blue, red), and the boats they disable."""
    if "power_play_start" in init:
        games.power_start[b] = _per_team("power_play_start", init["power_play_start"])
    if "power_play_boats" not in init:
        return
    try:
        boats = np.asarray(init["power_play_boats"], dtype=np.float64)
        boats = np.broadcast_to(boats.reshape(2, -1), (2, 2))
    except (TypeError, ValueError):
        boats = np.full((2, 2), np.nan)
    teams = np.arange(2)[:, None] * config.team_size
    if not ((boats == np.floor(boats)) & (boats >= teams) & (boats < teams + config.team_size)).all():
        raise GameError(
            f"power_play_boats is {init['power_play_boats']!r}; give the number of a blue and of a red boat"
        )
    games.power_boats[b] = boats


def _set_counters(rules: Rules, games: Games, b: int, boats: dict[str, Array], teams: dict[str, Array]) -> None:
    if "agent_is_tagged" in boats:
        games.is_tagged[b] = np.nan_to_num(boats["agent_is_tagged"]) != 0.0
    if "agent_tagging_cooldown" in boats:
        elapsed = boats["agent_tagging_cooldown"]
        games.tagging_cooldown_s[b] = np.clip(np.where(np.isnan(elapsed), rules.cooldown, elapsed), 0.0, rules.cooldown)
    if "agent_collisions" in boats:
        games.collisions[b] = np.nan_to_num(boats["agent_collisions"]).astype(np.int64)
    for name, values in teams.items():
        getattr(games, name)[b] = values


def _per_boat(config: GameConfig, key: str, value: Any) -> Array:
    """One row per boat, NaN for boats that are not named; positions (n, 2), everything else (n,)."""
    width = 2 if key == "agent_position" else 1
    rows = np.full((config.n_boats, width), np.nan)
    if isinstance(value, Mapping):
        for agent_id, entry in value.items():
            if agent_id not in config.agent_ids:
                raise GameError(f"{key}: unknown agent {agent_id!r}; agents are {', '.join(config.agent_ids)}")
            rows[config.agent_ids.index(agent_id)] = _numbers(key, entry, width)
    else:
        entries = list(value) if isinstance(value, (list, tuple, np.ndarray)) else []
        if len(entries) != config.n_boats:
            raise GameError(f"{key} is {value!r}; give {config.n_boats} entries in boat order, or a dict by agent id")
        for i, entry in enumerate(entries):
            rows[i] = _numbers(key, entry, width)
    return rows if width == 2 else rows[:, 0]


def _per_team(key: str, value: Any) -> Array:
    """Counts (2,), blue then red; a dict may be keyed by any team whose ``int`` is 0 or 1."""
    counts = np.zeros(2)
    if isinstance(value, Mapping):
        for team, entry in value.items():
            counts[_team_number(key, team)] = _numbers(key, entry, 1)[0]
    else:
        counts[:] = _numbers(key, value, 2)
    if (counts < 0).any():
        raise GameError(f"{key} is {value!r}; counts are >= 0")
    return counts.astype(np.int64)


def _team_number(key: str, team: Any) -> int:
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


def _wanted_places(config: GameConfig, boats: dict[str, Array]) -> Array:
    given = np.full((config.n_boats, 4), np.nan)
    if "agent_position" in boats:
        given[:, :2] = boats["agent_position"]
    if "agent_speed" in boats:
        given[:, 2] = boats["agent_speed"]
    if "agent_heading" in boats:
        given[:, 3] = boats["agent_heading"]
    return given


def _check_carriers(config: GameConfig, rules: Rules, carries: np.ndarray, given: Array) -> None:
    for team in (0, 1):
        if carries[rules.team == team].sum() > 1:
            raise GameError("agent_has_flag: at most one boat of a team can carry the opponents' flag")
    for i in np.flatnonzero(carries & ~np.isnan(given[:, 0])):
        if is_on_side(rules.scrimmage, rules.side_sign[rules.team[i]], given[i, 0], given[i, 1]):
            raise GameError(f"{config.agent_ids[i]} carries a flag but is on its own side; place it on the other side")


def _point(place: Array) -> str:
    return f"({place[0]:g}, {place[1]:g})"


def _check_places(config: GameConfig, rules: Rules, taken: np.ndarray, given: Array) -> None:
    """Given places must lie inside the field, clear of obstacles and of flags that are home, no two on one point."""
    for i in np.flatnonzero(~np.isnan(given[:, 0])):
        name, place, radius = config.agent_ids[i], given[i, :2], config.agent_radius_m[i]
        if not ((place > radius) & (place < rules.size - radius)).all():
            raise GameError(f"{name} at {_point(place)} is not inside the field {_point(rules.size)}; move it inside")
        if touches_obstacle(rules.obstacles, place[0], place[1], radius):
            raise GameError(f"{name} at {_point(place)} touches an obstacle; move it away")
        for flag in (0, 1):
            if not taken[flag] and np.hypot(*(place - rules.flag_home[flag])) <= rules.flag_keepout:
                raise GameError(f"{name} at {_point(place)} is on a flag's home; move it {rules.flag_keepout} m away")
        for j in range(i):
            if (given[j, :2] == place).all():
                raise GameError(f"{config.agent_ids[j]} and {name} are on one point {_point(place)}; move one")
