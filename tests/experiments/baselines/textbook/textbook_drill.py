"""Small encounters of two boats in open water, for platforms without a name too."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.experiments.jit import kernel
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import fresh_state, get_platform, step_boat
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.limits import cruise
from steerclear.shield.platforms.usv import wrap_degrees

FAMILIES = ("head_on", "crossing", "rammer")
LEAD_S = 12.0
"""Time before the meeting at which an encounter starts, both at top speed, s."""
LENGTH_S = 40.0
AWAY_S = 40.0
"""The own boat's goal lies this long ahead at top speed, s."""


@dataclass(frozen=True)
class Outcome:
    """What came of B encounters.

    Attributes:
        closest_m: (B,) least distance, m.
        breached: (B,) came within the separation.
        changed: (B,) share of decisions whose command is not the wanted one.
        relaxed: (B,) share of decisions whose program had to be relaxed.
        progress: (B,) way made towards the goal, as a share of that at top speed.
    """

    closest_m: Array
    breached: Array
    changed: Array
    relaxed: Array
    progress: Array


@kernel
def _steer(state: Array, x: float, y: float) -> float:
    """Relative heading, deg, towards a place."""
    return wrap_degrees(math.degrees(math.atan2(x - state[L.X], y - state[L.Y])) - state[L.HEADING])


@kernel
def _wish(state: Array, goal: Array, hunting: bool, top_mps: float, wanted: Array) -> None:
    """The own boat makes for its goal; the other holds course, or chases the own boat with lead."""
    for b in range(state.shape[0]):
        own, other = state[b, 0], state[b, 1]
        wanted[b, 0, 0] = wanted[b, 1, 0] = top_mps
        wanted[b, 0, 1] = _steer(own, goal[b, 0], goal[b, 1])
        wanted[b, 1, 1] = 0.0
        if hunting:
            ahead = math.hypot(own[L.X] - other[L.X], own[L.Y] - other[L.Y]) / top_mps
            way, course = own[L.SPEED] * ahead, math.radians(own[L.HEADING])
            wanted[b, 1, 1] = _steer(other, own[L.X] + way * math.sin(course), own[L.Y] + way * math.cos(course))


@kernel
def _move(params: Array, state: Array, sent: Array, dt_s: float, closest_m: Array) -> None:
    for b in range(state.shape[0]):
        for i in range(2):
            step_boat(params, state[b, i], sent[b, i, 0], sent[b, i, 1], dt_s)
        gap = math.hypot(state[b, 0, L.X] - state[b, 1, L.X], state[b, 0, L.Y] - state[b, 1, L.Y])
        closest_m[b] = min(closest_m[b], gap)


def openings(family: str, platform: str, games: int, seed: int) -> tuple[Array, Array]:
    """Starts (B, 2, N_STATE), at top speed, and goals (B, 2) m, of seeded encounters.

    Raises:
        ConfigError: unknown family.
    """
    if family not in FAMILIES:
        raise ConfigError(f"unknown family {family!r}; choose one of {', '.join(FAMILIES)}")
    random = np.random.default_rng([seed, FAMILIES.index(family)])
    kind = get_platform(platform)
    top, cruising = kind.max_speed_mps, _cruising(platform)
    meet, miss = top * LEAD_S, random.uniform(-2.0, 2.0, games)
    side = random.choice([-1.0, 1.0], games) if family == "crossing" else np.zeros(games)
    angle = np.radians({"head_on": 180.0, "crossing": 90.0, "rammer": 180.0}[family] * np.where(side == 0.0, 1.0, side))
    if family == "rammer":
        angle = random.uniform(-math.pi, math.pi, games)
    state = np.tile(cruising, (games, 2, 1))
    state[:, 1, L.X] = -meet * np.sin(angle) + miss * np.cos(angle)
    state[:, 1, L.Y] = meet - meet * np.cos(angle) - miss * np.sin(angle)
    state[:, 1, L.HEADING] = np.degrees(angle)
    if family == "rammer":
        away = np.hypot(state[:, 1, L.X], state[:, 1, L.Y])
        state[:, 1, :2] *= np.maximum(1.0, 0.5 * meet / np.maximum(away, 1e-9))[:, None]
    goal = np.tile([0.0, top * AWAY_S], (games, 1))
    return state, goal


def _cruising(platform: str) -> Array:
    _, state = cruise(get_platform(platform))
    state[L.HEADING] = 0.0
    if get_platform(platform).kind != "usv":
        state = fresh_state(0.0, 0.0, 0.0, get_platform(platform).max_speed_mps)
    return state


def run_drill(guard: Any, family: str, platform: str, games: int, seed: int, config: ShieldConfig) -> Outcome:
    """Play ``games`` encounters; boat 0 is filtered by ``guard``, or by nothing when that is None."""
    state, goal = openings(family, platform, games, seed)
    kind = get_platform(platform)
    params, top = kind.pack(), kind.max_speed_mps
    wanted, ours = np.zeros((games, 2, 2)), np.tile([True, False], (games, 1))
    closest_m = np.full(games, np.inf)
    steps, changed, relaxed = int(LENGTH_S / config.dt_s), np.zeros(games), np.zeros(games)
    for _ in range(steps):
        _wish(state, goal, family == "rammer", top, wanted)
        sent = wanted if guard is None else guard.decide(state, wanted, ours)
        changed += (sent != wanted).any(axis=(1, 2))
        relaxed += 0.0 if guard is None else guard.reason[:, 0] > 1
        _move(params, state, sent, config.dt_s, closest_m)
    left = np.hypot(goal[:, 0] - state[:, 0, L.X], goal[:, 1] - state[:, 0, L.Y])
    return Outcome(
        closest_m=closest_m,
        breached=closest_m < config.separation_m,
        changed=changed / steps,
        relaxed=relaxed / steps,
        progress=(top * AWAY_S - left) / (top * LENGTH_S),
    )
