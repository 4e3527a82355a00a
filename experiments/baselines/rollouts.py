"""Filters that simulate manoeuvres on the boat's own model: shared code, and gatekeeper. Compiled.

A boat's plan is one row: steps left of its first command, speed m/s and heading deg of that command, speed and
heading of the command after it. Headings are absolute, so a plan means the same trajectory one step later.

gatekeeper follows the nominal command as long as possible, then a backup known to be safe. Source: Agrawal, Chen,
Panagou, "gatekeeper: Online Safety Verification and Control for Nonlinear Systems in Dynamic Environments" (T-RO 2024,
arXiv 2211.14361), and the search over switching times of several agents of arXiv 2604.02401. In their words: a
*candidate* trajectory follows the nominal one for T_S and the backup controller for T_B after it. It is *valid* if it
stays in the safe set all the way and ends in the backup set. The valid one with the greatest T_S is *committed*; if
there is none, the committed one continues. An agent assumes that the others follow their committed trajectories, and
plans while they do not.

The papers leave these choices to the user:

| left open | choice here |
| --- | --- |
| nominal trajectory | the nominal command held, speed and absolute heading: a filter does not know a policy's plans |
| backup controller | the manoeuvre of the library with the greatest least clearance |
| model | the boat's hull and autopilot, step by step: the boat does what is committed |
| backup set | no boat ever comes within the radius if, from the end on, every boat holds its course |
| others | opponents hold course and speed; or fill the disc they can reach (then the backup set is not required) |
| the first committed trajectory | stop on the present heading |
| planning order | teammates one after the other within a step, by number |
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray, kernel
from steerclear.shield.platforms import Platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import wrap_degrees

from .base import BatchFilter, Games, game_of
from .unicycle import input_limits

TURNS_DEG = (30.0, 60.0, 90.0, 130.0, 170.0)
"""Turns of the library, to port and to starboard at top speed, deg from the present heading."""
HOLD_SPEED = -1.0
"""Speed share that means the present speed."""
LIBRARY = np.array([(0.0, HOLD_SPEED), *((side * turn, 1.0) for turn in TURNS_DEG for side in (-1.0, 1.0)), (0.0, 0.0)])
"""(M, 2) turn deg and share of top speed of each manoeuvre: hold, turns to either side, stop."""
SWITCH_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Candidate switching times as shares of the longest; one step and none follow."""
MOST = {"horizon_s": 60.0, "switch_s": 30.0, "alpha_per_s": 10.0}
N_PLAN = 5
NO_PLAN = -1.0
"""Steps left of a boat that has not decided yet."""
PASSED, BACKUP, GOES_ON = 0, 1, 2


class Setup(NamedTuple):
    """Constants of a fleet of n boats.

    ``params`` (n, N_PARAM), ``limits`` (n, 3) of `unicycle`, ``team`` (n,), ``library`` (M, 2); ``switches`` and
    ``steps`` (horizon) in steps; ``worst``: opponents fill the disc they can reach, else they hold course.
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


class Around(NamedTuple):
    """The other boats: ``near`` (n,) marks those in reach; ``path`` (n, K, 2) of all; discs ``grow`` (n,) by m/s."""

    near: BoolArray
    path: Array
    grow: Array


@kernel
def advance(setup: Setup, i: int, row: Array, speed_mps: float, heading_deg: float) -> None:
    """Advance boat i by one step under an absolute command, with hull and autopilot model, in place."""
    step_boat(setup.params[i], row, speed_mps, wrap_degrees(heading_deg - row[L.HEADING]), setup.dt_s)


@kernel
def command_of(setup: Setup, i: int, m: int, state: Array) -> tuple[float, float]:
    """Return speed, m/s, and absolute heading, deg, of manoeuvre m begun in ``state``."""
    share = setup.library[m, 1]
    speed = state[L.SPEED] if share == HOLD_SPEED else share * setup.limits[i, 0]
    return speed, wrap_degrees(state[L.HEADING] + setup.library[m, 0])


@kernel
def roll_plan(setup: Setup, j: int, state: Array, plan: Array, path: Array) -> None:
    """Write the positions (K, 2) of boat j under its plan; a boat without a plan holds course."""
    row = state.copy()
    path[0, 0], path[0, 1] = row[L.X], row[L.Y]
    for k in range(1, path.shape[0]):
        speed, heading = (plan[1], plan[2]) if k <= plan[0] else (plan[3], plan[4])
        if plan[0] == NO_PLAN:
            speed, heading = state[L.SPEED], state[L.HEADING]
        advance(setup, j, row, speed, heading)
        path[k, 0], path[k, 1] = row[L.X], row[L.Y]


@kernel
def predict_all(setup: Setup, state: Array, ours: BoolArray, plan: Array, path: Array, grow: Array) -> None:
    """Write positions (n, K, 2) of all boats and growth (n,), m/s, of the discs around them.

    An opponent holds its course; with ``worst`` it is at the centre of the disc it can reach.
    """
    for j in range(state.shape[0]):
        grow[j] = 0.0
        if ours[j]:
            roll_plan(setup, j, state[j], plan[j], path[j])
            continue
        course, speed = math.radians(state[j, L.HEADING]), 0.0 if setup.worst else state[j, L.SPEED]
        for k in range(path.shape[1]):
            path[j, k, 0] = state[j, L.X] + k * setup.dt_s * speed * math.sin(course)
            path[j, k, 1] = state[j, L.Y] + k * setup.dt_s * speed * math.cos(course)
        if setup.worst:
            grow[j] = setup.limits[j, 0]


@kernel
def mark_near(setup: Setup, i: int, state: Array, steps: int, near: BoolArray) -> bool:
    """Mark (n,) boats that boat i could touch within ``steps``, both at top speed; return whether there is any."""
    found = False
    for j in range(state.shape[0]):
        gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y]) - setup.radius_m
        fast = setup.limits[i, 0] + max(setup.limits[j, 0], state[j, L.SPEED])
        near[j] = j != i and gap <= fast * steps * setup.dt_s
        found = found or near[j]
    return found


@kernel
def gap_at(setup: Setup, around: Around, k: int, x: float, y: float) -> float:
    """Return the least clearance of a position at step k from all near boats, m; 0 is exactly the radius."""
    path, least = around.path, math.inf
    for j in range(path.shape[0]):
        if around.near[j]:
            gap = math.hypot(path[j, k, 0] - x, path[j, k, 1] - y) - around.grow[j] * k * setup.dt_s
            least = min(least, gap)
    return least - setup.radius_m


@kernel
def gap_after(setup: Setup, around: Around, k: int, row: Array) -> float:
    """Return the least clearance for ever after step k if every boat then holds its course, m."""
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


class RolloutFilter(BatchFilter):
    """Filter of commands of B games of the same fleet by rolled-out manoeuvres; see `BatchFilter`.

    Reasons: 0 passed bit for bit; 1 changed (gatekeeper: the backup begins now); 2 gatekeeper: no candidate is valid
    and the committed trajectory continues; PL-CBF: the program has no usable answer and the boat follows the chosen
    mode. ``safety_margin_m`` is the least clearance of the committed trajectory, or the value of the chosen mode, m;
    inf if no boat is within reach. The filters do not avoid static obstacles or the field's edge. ``settings`` are the
    filter's own, by key.
    """

    columns, forgotten = N_PLAN, NO_PLAN
    defaults: ClassVar[dict[str, Any]]

    def __init__(
        self,
        name: str,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        dt_s = config.dt_s
        read = self.read_settings(name, settings or {}, dt_s)
        super().__init__(name, config, games, platforms, team)
        longest = max(1, math.floor(read.get("switch_s", dt_s) / dt_s + 1e-9))
        switches = {max(1, round(share * longest)) for share in SWITCH_SHARES} | {1, 0}
        self._setup = Setup(
            params=self.params,
            limits=np.array([input_limits(kind, dt_s) for kind in self._platforms]),
            team=self.team,
            library=LIBRARY,
            switches=np.array(sorted(switches, reverse=True), dtype=np.int64),
            steps=max(1, round(read["horizon_s"] / dt_s)),
            radius_m=self.radius_m,
            dt_s=dt_s,
            worst=name == "gatekeeper-worst",
            alpha_per_s=read.get("alpha_per_s", 1.0),
        )

    @classmethod
    def read_settings(cls, name: str, given: Mapping[str, Any], dt_s: float = 0.1) -> dict[str, Any]:
        """Return all settings of a filter from those given with its name; no time may be shorter than a step.

        Raises:
            ConfigError: an unknown key, or a value out of bounds.
        """
        for key, value in given.items():
            if key not in cls.defaults:
                raise ConfigError(f"filter {name!r} has no setting {key!r}; it knows {', '.join(cls.defaults)}")
            least = 0.0 if key == "alpha_per_s" else dt_s
            number = isinstance(value, (int, float)) and not isinstance(value, bool)
            if not number or not least <= value <= MOST[key] or value == 0.0:
                low = f"at least {least:g}" if least else "above 0"
                raise ConfigError(f"{key} of filter {name!r} is {value!r}; give a number {low}, at most {MOST[key]:g}")
        return {**cls.defaults, **given}


@kernel
def backup_value(setup: Setup, i: int, start: Array, k: int, m: int, around: Around, floor_m: float) -> float:
    """Return the least clearance, m, of manoeuvre m begun at step k in state ``start``; -inf once below ``floor_m``."""
    speed, heading = command_of(setup, i, m, start)
    row, least = start.copy(), math.inf
    for t in range(1, setup.steps + 1):
        advance(setup, i, row, speed, heading)
        least = min(least, gap_at(setup, around, k + t, row[L.X], row[L.Y]))
        if not least >= floor_m:
            return -math.inf
    if not setup.worst:
        least = min(least, gap_after(setup, around, k + setup.steps, row))
    return least if least >= floor_m else -math.inf


@kernel
def _decide_boat(setup: Setup, i: int, state: Array, around: Around, plan: Array, filtered: Array) -> tuple[int, float]:
    """Commit to the valid candidate that switches last, or continue; return the reason and the least clearance, m."""
    speed, heading = filtered[0], wrap_degrees(state[L.HEADING] + filtered[1])
    trail, least_m = np.empty((setup.switches[0] + 1, L.N_STATE)), np.empty(setup.switches[0] + 1)
    trail[0], least_m[0] = state, gap_at(setup, around, 0, state[L.X], state[L.Y])
    for k in range(1, trail.shape[0]):
        trail[k] = trail[k - 1]
        advance(setup, i, trail[k], speed, heading)
        least_m[k] = min(least_m[k - 1], gap_at(setup, around, k, trail[k, L.X], trail[k, L.Y]))
    reason, value = GOES_ON, least_m[0]
    for s in setup.switches:
        best, best_m = -math.inf, -1
        if least_m[s] >= 0.0:
            for m in range(setup.library.shape[0]):
                clear_m = backup_value(setup, i, trail[s], s, m, around, max(0.0, best))
                if clear_m > best:
                    best, best_m = clear_m, m
        if best_m >= 0:
            plan[0], plan[1], plan[2] = s, speed, heading
            plan[3], plan[4] = command_of(setup, i, best_m, trail[s])
            reason, value = PASSED if s > 0 else BACKUP, min(best, least_m[s])
            break
    if reason != PASSED:
        first = 1 if plan[0] >= 1.0 else 3
        filtered[0], filtered[1] = plan[first], wrap_degrees(plan[first + 1] - state[L.HEADING])
    return reason, value


@kernel
def decide_game(setup: Setup, game: Games) -> None:
    """Decide for the own boats, one after the other; ``filtered`` starts as the nominal commands."""
    state, _, ours, plan, filtered, reason, clear_m = game
    n, steps = state.shape[0], setup.switches[0] + setup.steps
    path, grow, near = np.empty((n, steps + 1, 2)), np.empty(n), np.empty(n, np.bool_)
    around = Around(near, path, grow)
    for i in range(n):
        if ours[i] and plan[i, 0] == NO_PLAN:
            plan[i, 0], plan[i, 1], plan[i, 2] = 0.0, 0.0, state[i, L.HEADING]
            plan[i, 3], plan[i, 4] = 0.0, state[i, L.HEADING]
    predict_all(setup, state, ours, plan, path, grow)
    for i in range(n):
        if not ours[i]:
            continue
        mark_near(setup, i, state, steps, near)
        reason[i], clear_m[i] = _decide_boat(setup, i, state[i], around, plan[i], filtered[i])
        roll_plan(setup, i, state[i], plan[i], path[i])
    for i in range(n):
        if ours[i] and plan[i, 0] >= 1.0:
            plan[i, 0] -= 1.0


@kernel
def decide_games(setup: Setup, games: Games) -> None:
    """Run `decide_game` for every game; the memory holds the boats' plans."""
    for b in range(len(games.state)):
        decide_game(setup, game_of(games, b))


class Gatekeeper(RolloutFilter):
    """gatekeeper; in ``gatekeeper-worst`` opponents fill the disc they can reach at top speed.

    Settings: ``horizon_s``, length of the backup (T_B of the paper), and ``switch_s``, longest switching time (T_H).
    """

    defaults: ClassVar[dict[str, Any]] = {"horizon_s": 8.0, "switch_s": 4.0}

    def _decide(self, games: Games) -> None:
        decide_games(self._setup, games)
