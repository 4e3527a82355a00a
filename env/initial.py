"""Starting a game from a partial state: ``reset(options={"init_dict": {...}})`` with Pyquaticus' own keys."""

from __future__ import annotations

import difflib
from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.shield.exceptions import GameError
from steerclear.shield.jit import Array

from .arrays import Games, Rules
from .config import GameConfig
from .motion import is_on_side
from .obstacles import touches_obstacle
from .power_play import plan_power_plays
from .starts import clear_game, crowded_field_error, settle, start_game

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
