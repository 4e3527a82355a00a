"""The arrays of B games that compiled code reads and writes, and the rules it reads."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms.layout import N_STATE
from steerclear.shield.shared import share

from .config import GameConfig
from .field import CORNER_INSET_M, FieldGeometry, own_corners
from .observation_layout import boat_slots, pack_lines
from .obstacles import Obstacles, pack_obstacles


class Rules(NamedTuple):
    """Everything fixed during a game, in the form compiled code takes. Units as in `GameConfig`."""

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
    corners: Array  # (2, 2, 2) m, by team the two corners of its side
    corner_marks: Array  # (2, 2, 2) m, where a tagged boat is driven to
    tag_speed_frac: float
    tag_probability: float
    max_cycles: int  # decisions of a game
    power_length: float  # of a power play, decisions
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
    """State of B games of n boats; teams are 0 (blue) and 1 (red). Every array is changed in place.

    ``state`` rows are laid out as in `steerclear.shield.platforms.layout`.
    """

    state: Array  # (B, n, N_STATE)
    previous_position: Array  # (B, n, 2) m, before the last move
    error_is_float32: BoolArray  # (B, n) the heading controller's memory came in single precision
    is_tagged: BoolArray  # (B, n)
    is_disabled: BoolArray  # (B, n) stopped by a power play
    has_flag: BoolArray  # (B, n)
    oob: BoolArray  # (B, n)
    on_side: BoolArray  # (B, n)
    driven: BoolArray  # (B, n) the game, not the policy, decides the command
    tagging_cooldown_s: Array  # (B, n) s since the last tag, up to the cool-down
    made_tag: IntArray  # (B, n) boat tagged in this step, -1 for none
    collisions: IntArray  # (B, n) collisions so far, one per entry per pair
    touching: BoolArray  # (B, n, n) pairs within the sum of their radii
    new_collisions: IntArray  # (B, n) collisions begun in this decision
    contacts: IntArray  # (B, n) the same as ``collisions``, looked for after every step: what really happened
    contact: BoolArray  # (B, n, n) pairs within touch after the last step
    power_start: IntArray  # (B, 2) decision at which a team's power play begins, -1 for none
    power_boats: IntArray  # (B, 2, 2) boats it disables: the first, and one more if it begins twice, see `power_play`
    power_begun: IntArray  # (B, 2) how often it began
    flag_position: Array  # (B, 2, 2) m
    flag_taken: BoolArray  # (B, 2) the flag of that team is carried by an opponent
    captures: IntArray  # (B, 2)
    grabs: IntArray  # (B, 2)
    tags: IntArray  # (B, 2)
    events: IntArray  # (B, 2, 4) captures, grabs, tags made and boats gone out of bounds in this step
    time_s: Array  # (B,)
    terminated: BoolArray  # (B,) a team reached max_score
    truncated: BoolArray  # (B,) time is up
    rng: np.ndarray  # (B,) uint64 state of each game's random numbers


CAPTURE, GRAB, TAG, OUT = 0, 1, 2, 3
"""Columns of ``events``."""


def make_rules(config: GameConfig, field: FieldGeometry) -> Rules:
    """Pack a config and its field for compiled code."""
    platforms = [get_platform(name) for name in config.platforms]
    reward = config.reward
    return share(
        Rules(
            n_boats=config.n_boats,
            team_size=config.team_size,
            dt_s=config.dt_s,
            decision_steps=config.decision_steps,
            decision_s=config.decision_s,
            max_time_s=config.max_time_s,
            max_score=config.max_score,
            agent_radius=np.array(config.agent_radius_m, dtype=np.float64),
            catch_radius=config.catch_radius_m,
            flag_keepout=config.flag_keepout_m,
            cooldown=config.tagging_cooldown_s,
            oob_speed_frac=config.oob_speed_frac,
            tag_on_oob=config.tag_on_oob,
            tag_on_collision=config.tag_on_collision,
            capture_at_base=config.capture_at == "own_base",
            capture_at_corner=config.capture_at == "own_corners",
            untag_at_corner=config.untag_at == "own_corners",
            corner_radius=config.corner_radius_m,
            corners=own_corners(field.size, 0.0),
            corner_marks=own_corners(field.size, CORNER_INSET_M),
            tag_speed_frac=config.tag_speed_frac,
            tag_probability=config.tag_probability,
            max_cycles=math.ceil(config.max_time_s / config.decision_s),
            power_length=math.ceil(config.max_time_s / config.decision_s) * config.power_play_share,
            shows_disabled=config.shows_disabled,
            size=field.size,
            flag_home=field.flag_home,
            scrimmage=field.scrimmage,
            sight_lines=np.stack([pack_lines(np.concatenate([walls, [field.scrimmage]])) for walls in field.walls]),
            side_sign=field.side_sign,
            slots=boat_slots(config),
            team=np.repeat(np.array([0, 1], dtype=np.int64), config.team_size),
            params=np.stack([platform.pack() for platform in platforms]),
            max_speed=np.array([platform.max_speed_mps for platform in platforms]),
            obstacles=pack_obstacles(config.obstacles),
            reward=np.array([reward.capture, reward.grab, reward.tag, -reward.oob, -reward.collision]),
        )
    )


def make_games(config: GameConfig, n_games: int) -> Games:
    """Arrays for ``n_games`` games, zero; `starts` fills them."""
    n = config.n_boats

    def booleans(*shape: int) -> BoolArray:
        return np.zeros((n_games, *shape), dtype=np.bool_)

    def counts(*shape: int) -> IntArray:
        return np.zeros((n_games, *shape), dtype=np.int64)

    def reals(*shape: int) -> Array:
        return np.zeros((n_games, *shape))

    return share(
        Games(
            state=reals(n, N_STATE),
            previous_position=reals(n, 2),
            error_is_float32=booleans(n),
            is_tagged=booleans(n),
            is_disabled=booleans(n),
            has_flag=booleans(n),
            oob=booleans(n),
            on_side=booleans(n),
            driven=booleans(n),
            tagging_cooldown_s=reals(n),
            made_tag=counts(n),
            collisions=counts(n),
            touching=booleans(n, n),
            new_collisions=counts(n),
            contacts=counts(n),
            contact=booleans(n, n),
            power_start=counts(2),
            power_boats=counts(2, 2),
            power_begun=counts(2),
            flag_position=reals(2, 2),
            flag_taken=booleans(2),
            captures=counts(2),
            grabs=counts(2),
            tags=counts(2),
            events=counts(2, 4),
            time_s=np.zeros(n_games),
            terminated=np.zeros(n_games, dtype=np.bool_),
            truncated=np.zeros(n_games, dtype=np.bool_),
            rng=np.zeros(n_games, dtype=np.uint64),
        )
    )
