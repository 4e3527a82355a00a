"""What a real Pyquaticus environment drives its boats by, tagged, out of bounds or disabled, for `Fleet.driven`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..jit import Array
from .driving import LEAST_MPS, inwards, nearest, time_until

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
    position = np.array((x, y), dtype=np.float64)
    mark = nearest(position, np.asarray(marks, dtype=np.float64))
    until_s = time_until(position, np.asarray(ends, dtype=np.float64), radius_m, max(speed, float(player.speed)))
    return speed, float(mark[0]), float(mark[1]), float(until_s)


def _in(env: Any, player: Any) -> Row:
    """A boat out of bounds: straight off the nearest edge."""
    speed = float(player.get_max_speed()) * _fraction(env, "oob_speed_frac")
    position, size = np.asarray(player.pos, dtype=np.float64)[:2], np.asarray(env.env_size, dtype=np.float64)
    place, beyond_m = inwards(position, size)
    return speed, float(place[0]), float(place[1]), float(beyond_m) / max(speed, float(player.speed), LEAST_MPS)


def _disabled_for_s(env: Any, player: Any) -> float:
    """Time until the power play that stops a boat ends, s; 0, which is to say nothing, where it is not told."""
    team = int(getattr(player.team, "value", player.team))
    start = getattr(env, ("blue_power_start", "red_power_start")[team], None)
    length = getattr(env, "power_play_length", None)
    if start is None or length is None:
        return 0.0
    ends_s = (float(start) + float(length)) * float(env.sim_speedup_factor) * float(env.dt)
    return math.inf if ends_s < float(env.current_time) else ends_s - float(env.current_time)
