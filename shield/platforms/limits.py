"""Limits of a platform, measured by simulating its own model: how fast it gains speed, how long a turn takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise

import numpy as np

from ..jit import Array
from . import layout as L
from .actuator import actuate, largest_turn
from .platform import Platform
from .usv import fresh_state, turn_of_rudder

LONGEST_S = 60.0

EVERY_S = 0.5
"""Time between the tested moments of a stop."""

FULL_THRUST = 0.9
"""Share of full thrust from which the value tables apply to a boat; they are solved for full thrust."""

ENOUGH_THRUST = 0.85
"""Share of the thrust at top speed from which a boat escapes pursuers about as well as with all of it."""


@dataclass(frozen=True)
class Limits:
    """Measured limits of a platform behind its autopilot."""

    top_speed_mps: float  # top speed, m/s
    acceleration_mps2: float  # highest acceleration, mean over any 0.2 s, from rest or after a hard turn, m/s^2
    turn_rate_dps: float  # highest turn rate in a hard turn begun at top speed, deg/s (thrust may rise in it)
    # time of a 180 deg turn begun at top speed, at full speed command and the rudder that the autopilot can hold, s
    half_turn_s: float
    turn_loss: float  # share of top speed lost in a long turn at full rudder and full speed command
    turn_deceleration_mps2: float  # mean rate at which that speed is lost, over the first half of the loss, m/s^2
    thrust: float  # thrust at top speed, percent; 0 without a thrust model
    # longest time under a full speed command until 90 % of that thrust is reached, from rest or out of a stop, s
    thrust_s: float

    @property
    def regain_s(self) -> float:
        """Time from rest to top speed at the highest acceleration, s."""
        return self.top_speed_mps / max(self.acceleration_mps2, 1e-6)


@lru_cache(maxsize=64)
def limits_of(platform: Platform, dt_s: float = 0.1) -> Limits:
    """Return the limits of a platform, by simulation with step ``dt_s``, s."""
    speeds = np.array([float(state[L.SPEED]) for state in _hard_turn(platform, dt_s)])
    return Limits(
        top_speed_mps=platform.max_speed_mps,
        acceleration_mps2=_acceleration(platform, dt_s),
        turn_rate_dps=_turn_rate(platform, dt_s),
        half_turn_s=_half_turn(platform, dt_s),
        turn_loss=1.0 - speeds.min() / speeds[0],
        turn_deceleration_mps2=_deceleration(speeds, dt_s),
        thrust=round(float(cruise(platform, dt_s)[1][L.THRUST]), 3),
        thrust_s=_thrust(platform, dt_s),
    )


def _hard_turn(platform: Platform, dt_s: float, any_rudder: bool = True) -> Iterator[Array]:
    """Yield a boat's states in a turn of `LONGEST_S` begun at top speed; the first is at full thrust.

    With ``any_rudder`` the boat can hold its full rudder: what opponents are assumed able to do must not depend on
    their autopilot.
    """
    params, state = cruise(platform, dt_s)
    if any_rudder:
        params = params.copy()
        params[L.HEADING_KP] = np.inf
    yield state
    for _ in range(int(LONGEST_S / dt_s)):
        actuate(params, state, platform.max_speed_mps, 2.0 * largest_turn(params, state, dt_s) + 1e-9, dt_s)
        yield state


def _acceleration(platform: Platform, dt_s: float) -> float:
    """Return the larger acceleration of two: from rest, and after a long hard turn, when the lost speed returns."""
    *_, turning = _hard_turn(platform, dt_s)
    return max(_gain(platform, start, dt_s) for start in (fresh_state(0.0, 0.0, 0.0), turning))


def _gain(platform: Platform, state: Array, dt_s: float) -> float:
    """Return the highest mean acceleration over any 0.2 s of a straight run at full speed command, m/s^2."""
    params = platform.pack()
    speeds = [float(state[L.SPEED])]
    window = max(1, round(0.2 / dt_s))
    for _ in range(int(LONGEST_S / dt_s)):
        actuate(params, state, platform.max_speed_mps, 0.0, dt_s)
        speeds.append(float(state[L.SPEED]))
        if state[L.SPEED] > 0.98 * platform.max_speed_mps and len(speeds) > window:
            break
    return max(b - a for a, b in zip(speeds, speeds[window:], strict=False)) / (window * dt_s)


def cruise(platform: Platform, dt_s: float = 0.1) -> tuple[Array, Array]:
    """Return parameters and state of a boat settled at top speed, heading north from the origin."""
    params, state = platform.pack(), fresh_state(0.0, 0.0, 0.0)
    for _ in range(int(LONGEST_S / dt_s)):
        actuate(params, state, platform.max_speed_mps, 0.0, dt_s)
    state[[L.X, L.Y]] = 0.0
    return params, state


def _turn_rate(platform: Platform, dt_s: float) -> float:
    """Return the highest turn rate, deg/s.

    In a turn the speed controller adds thrust for the lost speed, which also makes the boat turn faster. A boat that
    needs way to turn is granted the most thrust and the highest speed at once: it may have both after a zig-zag. What a
    boat turns always adds to a turn to the same side.
    """
    if platform.kind == "rate":
        return max(platform.max_turn_rate_at(0.0), platform.max_turn_rate_at(platform.max_speed_mps))
    if platform.full_turn_speed_mps > 0.0:
        full = float(turn_of_rudder(platform.pack(), platform.max_thrust, min(platform.max_rudder, 100.0), 1.0))
        return full * platform.way_share(platform.newest_mps(dt_s)) + abs(platform.rotate_speed_dps)
    drift_dps = platform.rotate_speed_dps if platform.kind == "usv" else 0.0
    return round(max(_turns(platform, dt_s, True)) / dt_s - drift_dps + abs(drift_dps), 9)


def _turns(platform: Platform, dt_s: float, any_rudder: bool) -> Iterator[float]:
    """Yield the turns, deg, of the steps of a hard turn."""
    headings = (float(state[L.HEADING]) for state in _hard_turn(platform, dt_s, any_rudder))
    return ((after - before) % 360.0 for before, after in pairwise(headings))


def _deceleration(speeds: Array, dt_s: float) -> float:
    lost = speeds[0] - speeds.min()
    half = int(np.argmax(speeds <= speeds[0] - 0.5 * lost))
    return float(0.5 * lost / (half * dt_s)) if half > 0 else 0.0


def _half_turn(platform: Platform, dt_s: float) -> float:
    """Return the time of a turn of 180 deg, s."""
    turned, step = 0.0, 0
    for turn in _turns(platform, dt_s, False):
        turned, step = turned + turn, step + 1
        if turned >= 180.0:
            break
    return step * dt_s


def _thrust(platform: Platform, dt_s: float) -> float:
    """Return the longest time to regain thrust out of a stop begun at top speed and ended at any moment up to rest."""
    if platform.kind != "usv":
        return 0.0
    params, slowing = cruise(platform, dt_s)
    enough = FULL_THRUST * slowing[L.THRUST]
    longest = _until_thrust(platform, fresh_state(0.0, 0.0, 0.0), enough, dt_s)
    for _ in range(int(LONGEST_S / EVERY_S)):
        if slowing[L.SPEED] < 0.01 * platform.max_speed_mps:
            break
        for _ in range(max(1, round(EVERY_S / dt_s))):
            actuate(params, slowing, 0.0, 0.0, dt_s)
        longest = max(longest, _until_thrust(platform, slowing.copy(), enough, dt_s))
    return longest


def _until_thrust(platform: Platform, state: Array, enough: float, dt_s: float) -> float:
    """Return the time under a full speed command until the thrust reaches ``enough``, s."""
    params, step = platform.pack(), 0
    while state[L.THRUST] < enough and step * dt_s < LONGEST_S:
        actuate(params, state, platform.max_speed_mps, 0.0, dt_s)
        step += 1
    return step * dt_s
