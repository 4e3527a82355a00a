"""The rammer: lead pursuit of the nearest boat, the adversary every shield is measured against."""

from __future__ import annotations

import math

from steerclear.shield.jit import lean_kernel
from steerclear.shield.platforms import layout as L

from .geometry import bearing_deg, to_boat
from .layout import HEIGHT, HIT_TEAM_MATES, MAX_SPEED, RADIUS, SPEED_FRACTION, WIDTH, Game

LEAD_LIMIT_S = 30.0


@lean_kernel
def ram(game: Game, boat: int) -> tuple[float, float]:
    """Steer for the point where the nearest boat will be met; stop when there is nobody to meet."""
    target = nearest_target(game, boat)
    if target < 0:
        return 0.0, 0.0
    speed = game.field[SPEED_FRACTION] * game.limits[boat, MAX_SPEED]
    heading = math.radians(game.state[target, L.HEADING])
    east_mps = game.state[target, L.SPEED] * math.sin(heading)
    north_mps = game.state[target, L.SPEED] * math.cos(heading)
    x, y = game.state[target, L.X], game.state[target, L.Y]
    lead_s = meeting_time_s(x - game.state[boat, L.X], y - game.state[boat, L.Y], east_mps, north_mps, speed)
    margin = game.limits[boat, RADIUS]
    # a boat that leaves the field is tagged and driven home: meet there, not beyond the edge
    x = clamp(x + lead_s * east_mps, margin, game.field[WIDTH] - margin)
    y = clamp(y + lead_s * north_mps, margin, game.field[HEIGHT] - margin)
    return speed, bearing_deg(*to_boat(game, boat, x, y))


@lean_kernel
def meeting_time_s(east_m: float, north_m: float, east_mps: float, north_mps: float, speed_mps: float) -> float:
    """Earliest time at which a boat at the origin, at ``speed_mps`` on a straight course, meets a straight mover.

    Solves |p + v t| = s t for the smallest t > 0. When it cannot be met (or only after ``LEAD_LIMIT_S``), the lead is
    the time to cover the present distance, limited the same way: pursuit with a guess is better than none.

    Args:
        east_m: target's position east of the boat, m.
        north_m: target's position north of the boat, m.
        east_mps: target's velocity east, m/s.
        north_mps: target's velocity north, m/s.
        speed_mps: own speed, m/s.
    """
    distance = math.hypot(east_m, north_m)
    guess = min(distance / speed_mps, LEAD_LIMIT_S) if speed_mps > 0.0 else 0.0
    a = speed_mps**2 - east_mps**2 - north_mps**2
    b = east_m * east_mps + north_m * north_mps
    root = b * b + a * distance**2
    if root < 0.0:
        return guess
    root = math.sqrt(root)
    # root + b and root - b are both used so that neither case divides by a small a
    if a > 0.0:
        time = distance**2 / (root - b) if b < 0.0 else (b + root) / a
    elif b < 0.0:
        time = distance**2 / (root - b)
    else:
        return guess
    return time if time <= LEAD_LIMIT_S else guess


@lean_kernel
def nearest_target(game: Game, boat: int) -> int:
    """Nearest boat of the other team, or of any when told to; -1 when there is none."""
    best, best_m = -1, math.inf
    for other in range(game.team.size):
        if other == boat or (game.team[other] == game.team[boat] and game.field[HIT_TEAM_MATES] == 0.0):
            continue
        distance = math.hypot(
            game.state[other, L.X] - game.state[boat, L.X], game.state[other, L.Y] - game.state[boat, L.Y]
        )
        if distance < best_m:
            best, best_m = other, distance
    return best


@lean_kernel
def clamp(value: float, low: float, high: float) -> float:
    """``value`` limited to [low, high]."""
    return min(max(value, low), high)
