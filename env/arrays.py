"""The arrays of B games that compiled code reads and writes, and the rules that it reads."""

from __future__ import annotations

import math
from typing import Annotated, Any, NamedTuple, get_type_hints

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms.layout import N_STATE
from steerclear.shield.shared import share

from .config import GameConfig
from .field import CORNER_INSET_M, FieldGeometry, own_corners
from .observation_layout import boat_slots, pack_lines
from .obstacles import Obstacles, pack_obstacles


class Rules(NamedTuple):
    """Everything fixed during a game, in the form for compiled code. Units as in `GameConfig`."""

    n_boats: int
    team_size: int
    dt_s: float
    decision_steps: int
    decision_s: float
    max_time_s: float
    max_score: int
    agent_radius: Array
    catch_radius: float
    flag_keepout: float
    cooldown: float
    oob_speed_frac: float
    tag_on_oob: bool
    tag_on_collision: bool
    capture_at_base: bool
    capture_at_corner: bool
    untag_at_corner: bool
    corner_radius: float
    corners: Array  # (2, 2, 2) m, the two corners of each team's side
    corner_marks: Array  # (2, 2, 2) m, where the game steers a tagged boat
    tag_speed_frac: float
    tag_probability: float
    max_cycles: int  # decisions of a game
    power_length: int  # of a power play, decisions
    shows_disabled: bool
    size: Array
    flag_home: Array
    scrimmage: Array
    sight_lines: Array
    slots: IntArray
    side_sign: Array
    team: IntArray
    params: Array
    max_speed: Array
    obstacles: Obstacles
    reward: Array


class Games(NamedTuple):
    """State of B games of n boats; teams are 0 (blue) and 1 (red). Every array (B, ...) is changed in place.

    Rows of ``state`` are laid out as in `steerclear.shield.platforms.layout`.
    """

    state: Annotated[Array, "n", N_STATE]
    previous_position: Annotated[Array, "n", 2]  # m, before the last move
    error_is_float32: Annotated[BoolArray, "n"]  # the last error of the heading controller was in single precision
    is_tagged: Annotated[BoolArray, "n"]
    is_disabled: Annotated[BoolArray, "n"]  # stopped by a power play
    has_flag: Annotated[BoolArray, "n"]
    oob: Annotated[BoolArray, "n"]  # out of bounds
    on_side: Annotated[BoolArray, "n"]
    driven: Annotated[BoolArray, "n"]  # the game, not the policy, decides the command
    tagging_cooldown_s: Annotated[Array, "n"]  # s since the last tag, up to the cool-down
    made_tag: Annotated[IntArray, "n"]  # boat tagged in this step, -1 for none
    collisions: Annotated[IntArray, "n"]  # collisions so far; each pair counts once per entry
    touching: Annotated[BoolArray, "n", "n"]  # pairs within the sum of their radii
    new_collisions: Annotated[IntArray, "n"]  # collisions begun in this decision
    contacts: Annotated[IntArray, "n"]  # like ``collisions``, but checked after every step, not once per decision
    contact: Annotated[BoolArray, "n", "n"]  # pairs in touch after the last step
    power_start: Annotated[IntArray, 2]  # decision at which a team's power play begins, -1 for none
    power_boats: Annotated[IntArray, 2, 2]  # boats it disables: the first, and one more if it begins twice
    power_begun: Annotated[IntArray, 2]  # how often it has begun
    flag_position: Annotated[Array, 2, 2]  # m
    flag_taken: Annotated[BoolArray, 2]  # the flag of that team is carried by an opponent
    captures: Annotated[IntArray, 2]
    grabs: Annotated[IntArray, 2]
    tags: Annotated[IntArray, 2]
    events: Annotated[IntArray, 2, 4]  # captures, grabs, tags made and boats newly out of bounds in this decision
    time_s: Annotated[Array, ()]
    terminated: Annotated[BoolArray, ()]  # a team reached max_score
    truncated: Annotated[BoolArray, ()]  # time is up
    rng: Annotated[NDArray[np.uint64], ()]  # state of each game's random numbers


_KINDS: dict[Any, type] = {Array: np.float64, IntArray: np.int64, BoolArray: np.bool_, NDArray[np.uint64]: np.uint64}

CAPTURE, GRAB, TAG, OUT = 0, 1, 2, 3
"""Columns of ``events``."""


def make_rules(config: GameConfig, field: FieldGeometry) -> Rules:
    """Pack a config and its field for compiled code."""
    reward, decisions = config.reward, math.ceil(config.max_time_s / config.decision_s)
    same = {name: getattr(config, name) for name in Rules._fields if hasattr(config, name)}
    packed = {
        "agent_radius": np.array(config.agent_radius_m, dtype=np.float64),
        "catch_radius": config.catch_radius_m,
        "flag_keepout": config.flag_keepout_m,
        "cooldown": config.tagging_cooldown_s,
        "capture_at_base": config.capture_at == "own_base",
        "capture_at_corner": config.capture_at == "own_corners",
        "untag_at_corner": config.untag_at == "own_corners",
        "corner_radius": config.corner_radius_m,
        "corners": own_corners(field.size, 0.0),
        "corner_marks": own_corners(field.size, CORNER_INSET_M),
        "max_cycles": decisions,
        "power_length": math.floor(decisions * config.power_play_share + 1e-9),
        "size": field.size,
        "flag_home": field.flag_home,
        "scrimmage": field.scrimmage,
        "sight_lines": np.stack([pack_lines(np.concatenate([walls, [field.scrimmage]])) for walls in field.walls]),
        "side_sign": field.side_sign,
        "slots": boat_slots(config),
        "team": np.repeat(np.array([0, 1], dtype=np.int64), config.team_size),
        "params": np.stack([platform.pack() for platform in config.platforms]),
        "max_speed": np.array([platform.max_speed_mps for platform in config.platforms]),
        "obstacles": pack_obstacles(config.obstacles),
        "reward": np.array([reward.capture, reward.grab, reward.tag, -reward.oob, -reward.collision]),
    }
    return share(Rules(**(same | packed)))


def make_games(config: GameConfig, n_games: int) -> Games:
    """Return zeroed arrays for ``n_games`` games; `starts` fills them."""
    arrays = {}
    for name, kind in get_type_hints(Games, include_extras=True).items():
        axes = [config.n_boats if axis == "n" else axis for axis in kind.__metadata__ if axis != ()]
        arrays[name] = np.zeros((n_games, *axes), dtype=_KINDS[kind.__origin__])
    return share(Games(**arrays))
