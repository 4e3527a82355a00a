"""What a real Pyquaticus environment drives its boats by, tagged, out of bounds or disabled, for `Fleet.driven`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..jit import Array
from .driving import inwards, time_until

UNKNOWN = (math.nan, math.nan, math.nan, math.nan)
Row = tuple[float, float, float, float]


def driven_players(env: Any, players: Sequence[Any]) -> Array | None:
    """Rows of `Fleet.driven` of all players; None where the environment drives none.

    Of tagged boats among obstacles nothing is said: it leads them past those by a random planner.
    """
    rows = np.array([_row(env, player) for player in players])
    return None if np.isnan(rows[:, 0]).all() else rows


def _row(env: Any, player: Any) -> Row:
    if getattr(player, "is_disabled", False):
        return 0.0, math.nan, math.nan, _disabled_for_s(env, player)
    if player.is_tagged:
        return UNKNOWN if getattr(env, "obstacles", ()) else _home(env, player)
    return _in(env, player) if player.oob else UNKNOWN


def _fraction(env: Any, name: str) -> float:
    return float(getattr(env, name, 1.0))


def _home(env: Any, player: Any) -> Row:
    """A tagged boat: to its own flag's home, or where there are corners to the nearer of their marks."""
    team, (x, y) = int(getattr(player.team, "value", player.team)), player.pos
    speed = float(player.get_max_speed()) * _fraction(env, "tag_speed_frac")
    if player.oob:
        speed = min(speed, float(player.get_max_speed()) * _fraction(env, "oob_speed_frac"))
    marks = getattr(env, ("blue_untag_coords", "red_untag_coords")[team], None)
    if marks is None:
        marks = ends = (env.flags[team].home,) * 2
        radius_m = float(getattr(env, "catch_radius", math.nan))
    else:
        ends = (env.env_ul, env.env_ll) if team == 0 else (env.env_ur, env.env_lr)
        radius_m = float(env.untag_radius)
    if math.isnan(radius_m):  # of another version: nobody knows when it is home
        return UNKNOWN
    places = np.asarray(marks, dtype=np.float64)
    mark = places[int(np.argmin(np.hypot(*(places - (x, y)).T)))]
    ends_m = np.asarray(ends, dtype=np.float64)
    return speed, float(mark[0]), float(mark[1]), time_until(x, y, ends_m, radius_m, max(speed, float(player.speed)))


def _in(env: Any, player: Any) -> Row:
    """A boat out of bounds: straight off the nearest edge."""
    speed = float(player.get_max_speed()) * _fraction(env, "oob_speed_frac")
    x, y, beyond_m = inwards(float(player.pos[0]), float(player.pos[1]), np.asarray(env.env_size, dtype=np.float64))
    return speed, x, y, beyond_m / max(speed, float(player.speed), 1e-6)


def _disabled_for_s(env: Any, player: Any) -> float:
    """Time until the power play that stops a boat ends, s; 0, which is to say nothing, where it is not told."""
    team = int(getattr(player.team, "value", player.team))
    start = getattr(env, ("blue_power_start", "red_power_start")[team], None)
    length = getattr(env, "power_play_length", None)
    if start is None or length is None:
        return 0.0
    ends_s = (float(start) + float(length)) * float(env.sim_speedup_factor) * float(env.dt)
    return math.inf if ends_s < float(env.current_time) else ends_s - float(env.current_time)
