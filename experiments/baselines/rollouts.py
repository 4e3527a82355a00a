"""What filters that try manoeuvres out on the boat's own model share: plans, predictions, clearances. Compiled.

A plan of a boat is one row: steps left of its first command, speed m/s and heading deg of that command, speed and
heading of the command after it. Headings are absolute, so that a plan means the same trajectory one step on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import wrap_degrees

from ..jit import kernel
from .base import BatchGuard
from .unicycle import input_limits

GATEKEEPER, GATEKEEPER_WORST, PL_CBF = "gatekeeper", "gatekeeper-worst", "pl-cbf"
TURNS_DEG = (30.0, 60.0, 90.0, 130.0, 170.0)
"""Turns of the library, to port and to starboard at top speed, deg from the present heading."""
HOLD_SPEED = -1.0
"""Speed share that stands for the present speed."""
SWITCH_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Switching times that are tried, as shares of the longest; then one step, then none."""
AREA, NEAREST = 0, 1
PICKS = {"area": AREA, "nearest": NEAREST}
STEP_S = 0.1
"""Step that settings are checked with while no run's is known, s."""
MOST = {"horizon_s": 60.0, "switch_s": 30.0, "alpha_per_s": 10.0}


N_PLAN = 5
NO_PLAN = -1.0
"""Steps left of a boat that has not decided yet."""


@dataclass(frozen=True)
class GatekeeperSettings:
    """How far gatekeeper looks.

    Attributes:
        horizon_s: length of the backup, s, T_B of the paper.
        switch_s: longest switching time that is tried, s, T_H of the paper.
    """

    horizon_s: float = 8.0
    switch_s: float = 4.0


@dataclass(frozen=True)
class LibrarySettings:
    """How PL-CBF looks and chooses.

    Attributes:
        horizon_s: length of a rollout, s, T of the paper.
        alpha_per_s: rate of the row dV/dt >= -alpha V.
        pick: safe mode taken: ``area`` the one that leaves the largest part of the inputs, as the authors' published
            code does, ``nearest`` the one whose program changes the wanted inputs least.
    """

    horizon_s: float = 10.0
    alpha_per_s: float = 1.0
    pick: str = "area"


Settings = GatekeeperSettings | LibrarySettings


def read_settings(name: str, kind: type[Settings], given: Mapping[str, Any], dt_s: float = STEP_S) -> Settings:
    """Make settings of what was given with a guard's name.

    Args:
        name: of the guard, for messages.
        kind: class of its settings.
        given: values by key.
        dt_s: step, s; no time may be shorter.

    Raises:
        ConfigError: an unknown key, or a value out of bounds.
    """
    known = [field.name for field in fields(kind)]
    for key, value in given.items():
        if key not in known:
            raise ConfigError(f"guard {name!r} has no setting {key!r}; it knows {', '.join(known)}")
        _check_value(name, key, value, dt_s)
    return kind(**given)


def _check_value(name: str, key: str, value: Any, dt_s: float) -> None:
    if key == "pick":
        if value not in tuple(PICKS):
            raise ConfigError(f"pick of guard {name!r} is {value!r}; choose {' or '.join(PICKS)}")
        return
    least = dt_s if key.endswith("_s") and not key.endswith("_per_s") else 0.0
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not number or not least <= value <= MOST[key] or value == 0.0:
        low = f"at least {least:g}" if least else "above 0"
        raise ConfigError(f"{key} of guard {name!r} is {value!r}; give a number {low}, at most {MOST[key]:g}")


def library() -> Array:
    """(M, 2) turn deg and share of top speed of each manoeuvre: hold, turns to either side, stop."""
    turns = [(side * turn, 1.0) for turn in TURNS_DEG for side in (-1.0, 1.0)]
    return np.array([(0.0, HOLD_SPEED), *turns, (0.0, 0.0)])


def switch_steps(longest_s: float, dt_s: float) -> IntArray:
    """Switching times in steps, longest first, down to one step and none."""
    longest = max(1, math.floor(longest_s / dt_s + 1e-9))
    tried = {max(1, round(share * longest)) for share in SWITCH_SHARES} | {1, 0}
    return np.array(sorted(tried, reverse=True), dtype=np.int64)


class Setup(NamedTuple):
    """Constants of a fleet of n boats.

    ``params`` (n, N_PARAM), ``limits`` (n, 3) of `unicycle`, ``team`` (n,), ``library`` (M, 2), ``switches``
    in steps, ``steps`` of the horizon, ``worst``: opponents fill the disc they can reach, else they hold course.
    """

    params: Array
    limits: Array
    team: IntArray
    library: Array
    switches: IntArray
    steps: int
    radius_m: float
    dt_s: float
    worst: bool
    alpha_per_s: float
    pick: int


class Around(NamedTuple):
    """The other boats: who is ``near`` (n,), everybody's ``path`` (n, K, 2), and how discs ``grow`` (n,), m/s."""

    near: BoolArray
    path: Array
    grow: Array


@kernel
def advance(setup: Setup, i: int, row: Array, speed_mps: float, heading_deg: float) -> None:
    """One step of boat i under an absolute command, by hull and autopilot model, in place."""
    step_boat(setup.params[i], row, speed_mps, wrap_degrees(heading_deg - row[L.HEADING]), setup.dt_s)


@kernel
def command_of(setup: Setup, i: int, m: int, state: Array) -> tuple[float, float]:
    """Speed, m/s, and absolute heading, deg, of manoeuvre m begun now."""
    share = setup.library[m, 1]
    speed = state[L.SPEED] if share == HOLD_SPEED else share * setup.limits[i, 0]
    return speed, wrap_degrees(state[L.HEADING] + setup.library[m, 0])


@kernel
def roll_plan(setup: Setup, j: int, state: Array, plan: Array, path: Array) -> None:
    """Write the places (K, 2) of boat j under its plan; a boat without one holds course."""
    row = state.copy()
    path[0, 0], path[0, 1] = row[L.X], row[L.Y]
    for k in range(1, path.shape[0]):
        speed, heading = (plan[1], plan[2]) if k <= plan[0] else (plan[3], plan[4])
        if plan[0] == NO_PLAN:
            speed, heading = state[L.SPEED], state[L.HEADING]
        advance(setup, j, row, speed, heading)
        path[k, 0], path[k, 1] = row[L.X], row[L.Y]


@kernel
def predict_other(setup: Setup, state: Array, path: Array) -> None:
    """Write the places (K, 2) of an opponent: on its course, or at the centre of the disc it can reach."""
    course = math.radians(state[L.HEADING])
    speed = 0.0 if setup.worst else state[L.SPEED]
    for k in range(path.shape[0]):
        path[k, 0] = state[L.X] + k * setup.dt_s * speed * math.sin(course)
        path[k, 1] = state[L.Y] + k * setup.dt_s * speed * math.cos(course)


@kernel
def predict_all(setup: Setup, state: Array, ours: BoolArray, plan: Array, path: Array, grow: Array) -> None:
    """Places (n, K, 2) of all boats and growth (n,), m/s, of the discs around them."""
    for j in range(state.shape[0]):
        grow[j] = 0.0
        if ours[j]:
            roll_plan(setup, j, state[j], plan[j], path[j])
            continue
        predict_other(setup, state[j], path[j])
        if setup.worst:
            grow[j] = setup.limits[j, 0]


@kernel
def mark_near(setup: Setup, i: int, state: Array, steps: int, near: BoolArray) -> bool:
    """Mark (n,) whom boat i could touch within so many steps, both at top speed; whether there is anybody."""
    found = False
    for j in range(state.shape[0]):
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]) - setup.radius_m
        fast = setup.limits[i, 0] + max(setup.limits[j, 0], state[j, L.SPEED])
        near[j] = j != i and gap <= fast * steps * setup.dt_s
        found = found or near[j]
    return found


@kernel
def gap_at(setup: Setup, around: Around, k: int, x: float, y: float) -> float:
    """Least clearance of a place at step k from all who are near, m; 0 is the radius to keep."""
    path, least = around.path, math.inf
    for j in range(path.shape[0]):
        if around.near[j]:
            gap = math.hypot(path[j, k, 0] - x, path[j, k, 1] - y) - around.grow[j] * k * setup.dt_s
            least = min(least, gap)
    return least - setup.radius_m


@kernel
def gap_after(setup: Setup, around: Around, k: int, row: Array) -> float:
    """Least clearance for ever after step k if every boat then holds its course, m."""
    near, path, course = around.near, around.path, math.radians(row[L.HEADING])
    least = math.inf
    for j in range(near.shape[0]):
        if not near[j]:
            continue
        px, py = path[j, k, 0] - row[L.X], path[j, k, 1] - row[L.Y]
        vx = (path[j, k, 0] - path[j, k - 1, 0]) / setup.dt_s - row[L.SPEED] * math.sin(course)
        vy = (path[j, k, 1] - path[j, k - 1, 1]) / setup.dt_s - row[L.SPEED] * math.cos(course)
        square = vx * vx + vy * vy
        ahead_s = max(0.0, -(px * vx + py * vy) / square) if square > 1e-12 else 0.0
        least = min(least, math.hypot(px + ahead_s * vx, py + ahead_s * vy))
    return least - setup.radius_m


class RolloutGuard(BatchGuard):
    """Commands of B games of the same fleet, filtered by manoeuvres that are rolled out.

    Reasons: 0 passed bit for bit, 1 changed (gatekeeper: the backup begins now), 2 gatekeeper: no candidate is valid
    and the committed trajectory goes on; PL-CBF: its program has no answer and the boat follows the mode taken.
    ``safety_margin_m`` is the least clearance of what is committed, or the value of the mode taken, m; inf where nobody
    is within reach. Fixed things and the field's edge are not kept clear of.

    Args:
        name: of the filter.
        config: settings; separation, buffer, position error and step are used.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        settings: of the filter, by key.

    Raises:
        ConfigError: unknown setting, a fleet that does not fit, or a delay, which these filters know nothing of.
    """

    columns, forgotten = N_PLAN, NO_PLAN
    kind: type[Settings]

    def __init__(
        self,
        name: str,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        read, dt_s = read_settings(name, self.kind, settings or {}, config.dt_s), config.dt_s
        super().__init__(name, config, games, platforms, team)
        library_s = read if isinstance(read, LibrarySettings) else LibrarySettings()
        self._setup = Setup(
            params=self.params,
            limits=np.array([input_limits(kind, dt_s) for kind in self._platforms]),
            team=np.array(team, dtype=np.int64),
            library=library(),
            switches=switch_steps(read.switch_s if isinstance(read, GatekeeperSettings) else dt_s, dt_s),
            steps=max(1, round(read.horizon_s / dt_s)),
            radius_m=self.radius_m,
            dt_s=dt_s,
            worst=name == GATEKEEPER_WORST,
            alpha_per_s=library_s.alpha_per_s,
            pick=PICKS[library_s.pick],
        )
