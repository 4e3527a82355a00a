"""Figures for a table's card: error of the reduced model, and loss of value in runs of the full model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..exceptions import TableError
from ..jit import Array
from ..platforms import layout as L
from ..platforms.platform import Platform
from ..platforms.registry import get_platform
from ..platforms.step import step_boat
from ..platforms.usv import fresh_state
from .duel import GREEDY, LEAD, PURE, duel
from .files import ValueTable, stack_tables
from .lookup import WHOLE_S, Tables, table_value
from .moves import SUB_STEP_S, run_hull, sub_steps
from .settings import OtherMay

MANNERS = {"greedy": GREEDY, "lead": LEAD, "pure": PURE}
BAND_M = 1.5
"""Runs start with a value between the radius and this much more."""
DRAWS_PER_RUN = 2000


def full_thrust_state(platform: Platform, speed_mps: float, heading_deg: float = 0.0) -> Array:
    """Return the state row of a boat at maximum thrust, at the origin."""
    state = fresh_state(0.0, 0.0, heading_deg, speed_mps)
    state[L.THRUST] = platform.max_thrust
    state[L.SPEED_ERROR] = platform.max_speed_mps - speed_mps
    state[L.HEADING_ERROR] = 0.0
    return state


def model_error(name: str | Platform, dt_s: float, runs: int, seed: int = 0) -> dict[str, float]:
    """Return the error of the reduced model per table step, over random closed-loop runs of the full model.

    The full boat follows random heading commands at top speed through its autopilot. The reduced one gets the mean
    rudder of the step. Reported are the 99th percentile and the largest error of place, m, heading, deg, and speed,
    m/s.
    """
    platform, random = get_platform(name), np.random.default_rng(seed)
    errors = np.array([_step_error(platform, dt_s, random) for _ in range(runs)])
    found = {}
    for what, column in zip(("place_m", "heading_deg", "speed_mps"), errors.T, strict=True):
        found[f"{what}_p99"] = round(float(np.percentile(column, 99)), 4)
        found[f"{what}_max"] = round(float(column.max()), 4)
    return found


def _step_error(platform: Platform, dt_s: float, random: np.random.Generator) -> tuple[float, float, float]:
    params, count = platform.pack(), sub_steps(dt_s)
    state = full_thrust_state(platform, float(random.uniform(0.2, 1.0)) * platform.max_speed_mps)
    target = 0.0
    for _ in range(int(random.integers(1, 60))):
        if random.random() < 0.1:
            target = float(random.uniform(-180.0, 180.0))
        _follow(params, state, target)
    state[[L.X, L.Y]] = 0.0
    heading, reduced, rudder = state[L.HEADING], np.zeros(L.N_STATE), 0.0
    reduced[L.SPEED] = state[L.SPEED]
    for _ in range(count):
        _follow(params, state, target)
        rudder += state[L.RUDDER] / count
    turned = run_hull(params, reduced, rudder, count, SUB_STEP_S, np.empty((count, 2)))
    sin, cos = math.sin(math.radians(heading)), math.cos(math.radians(heading))
    x, y = reduced[L.X] * cos + reduced[L.Y] * sin, -reduced[L.X] * sin + reduced[L.Y] * cos
    off = (state[L.HEADING] - heading - turned + 180.0) % 360.0 - 180.0
    return math.hypot(x - state[L.X], y - state[L.Y]), abs(off), abs(state[L.SPEED] - reduced[L.SPEED])


def _follow(params: Array, state: Array, target_deg: float) -> None:
    error = (target_deg - state[L.HEADING] + 180.0) % 360.0 - 180.0
    step_boat(params, state, params[L.MAX_SPEED], error, SUB_STEP_S)


def value_loss(
    table: ValueTable,
    radius_m: float,
    runs: int,
    run_s: float,
    seed: int = 0,
    boats: tuple[Platform, Platform] | None = None,
) -> dict[str, Any]:
    """Run the full model from random states whose value is between the radius and `BAND_M` more.

    The own boat always takes the rudder of the highest value, decided anew every 0.1 s. The other plays against it in
    each of `MANNERS` in turn. With a cooperative table both play the joint optimum.

    Returns:
        Number of runs and of separation violations (below the radius); the smallest extra value, m, from which no run
        violated it (``margin_m``); how far below its first value a run came, median and largest (``loss_m``).
    """
    card = table.card
    boats = boats or (get_platform(card.own), get_platform(card.other))
    tables, cooperative = stack_tables([table]), card.other_may == OtherMay.COOPERATIVE.value
    params, random = np.stack([boat.pack() for boat in boats]), np.random.default_rng(seed)
    manners = [GREEDY] if cooperative else list(MANNERS.values())
    found = []
    for run in range(runs):
        own, other, value = _draw(tables, boats, radius_m, random)
        steps = round(run_s / SUB_STEP_S)
        manner = manners[run % len(manners)]
        near = duel(tables, 0, params, own, other, manner, cooperative, sub_steps(card.dt_s), steps)
        found.append((value, near))
    values, nearest = np.array(found).T
    breached = nearest < radius_m
    loss = np.maximum(values - nearest, 0.0)
    return {
        "runs": runs,
        "run_s": run_s,
        "breaches": int(breached.sum()),
        "margin_m": round(float((values[breached] - radius_m).max()), 3) if breached.any() else 0.0,
        "depth_m": round(float((radius_m - nearest[breached]).max()), 3) if breached.any() else 0.0,
        "loss_m": [round(float(np.median(loss)), 3), round(float(loss.max()), 3)],
    }


def _draw(
    tables: Tables, boats: tuple[Platform, Platform], radius_m: float, random: np.random.Generator
) -> tuple[Array, Array, float]:
    """Draw a pair of boats at full thrust whose value is in the band."""
    axes = tables.axes[0]
    last = axes[0] + axes[1] * (axes[3] - 1) + 0.5 * axes[2] * (axes[3] - 1) * (axes[3] - 2)
    for _ in range(DRAWS_PER_RUN):
        own = full_thrust_state(boats[0], float(random.uniform(0.1, 1.0)) * boats[0].max_speed_mps)
        other = full_thrust_state(
            boats[1], float(random.uniform(0.1, 1.0)) * boats[1].max_speed_mps, float(random.uniform(-180.0, 180.0))
        )
        rho, bearing = radius_m * (last / radius_m) ** random.random(), random.uniform(-math.pi, math.pi)
        other[L.X], other[L.Y] = rho * math.sin(bearing), rho * math.cos(bearing)
        heading = math.radians(other[L.HEADING])
        value = table_value(tables, 0, WHOLE_S, other[L.X], other[L.Y], 0.0, heading, own[L.SPEED], other[L.SPEED])
        if radius_m <= value < radius_m + BAND_M:
            return own, other, value
    raise TableError(f"no state of value near {radius_m:g} m was found: the table is empty there; solve it anew")
