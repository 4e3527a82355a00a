"""What a real Pyquaticus environment drives its boats by, tagged, out of bounds or disabled, for `Fleet.driven`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..jit import Array, IntArray
from .driving import Driven, Drives, driven_rows


def driven_players(env: Any, players: Sequence[Any], state: Array, team: IntArray) -> Array | None:
    """Rows of `Fleet.driven` of all players; None where the environment drives none."""
    tagged, oob, disabled = (
        np.array([bool(getattr(player, name, False)) for player in players])
        for name in ("is_tagged", "oob", "is_disabled")
    )
    if not (tagged | oob | disabled).any():
        return None
    disabled_for_s = np.array([_disabled_for_s(env, int(number)) for number in team])
    return driven_rows(_drives(env, players), Driven(tagged, oob, disabled, disabled_for_s), state, team)


def _drives(env: Any, players: Sequence[Any]) -> Drives:
    """Home is the own flag's, or where there are corners the nearer of their marks.

    It leads tagged boats past obstacles by a random planner, and of versions without the radius nobody knows when they
    are home.
    """
    marks = [getattr(env, name, None) for name in ("blue_untag_coords", "red_untag_coords")]
    homes = [np.array([flag.home], dtype=np.float64) for flag in env.flags]
    corners = any(one is not None for one in marks)
    ends = ((env.env_ul, env.env_ll), (env.env_ur, env.env_lr)) if corners else homes
    near_m = float(env.untag_radius if corners else getattr(env, "catch_radius", math.nan))
    top_mps = np.array([float(player.get_max_speed()) for player in players])
    return Drives(
        [np.asarray(one, dtype=np.float64) for one in (marks if corners else homes)],
        [np.asarray(one, dtype=np.float64) for one in ends],
        math.nan if getattr(env, "obstacles", ()) else near_m,
        np.asarray(env.env_size, dtype=np.float64),
        top_mps * float(getattr(env, "tag_speed_frac", 1.0)),
        top_mps * float(getattr(env, "oob_speed_frac", 1.0)),
    )


def _disabled_for_s(env: Any, team: int) -> float:
    """Time until the power play that stops a team's boats ends, s; 0, which is to say nothing, where it is not told."""
    start = getattr(env, ("blue_power_start", "red_power_start")[team], None)
    length = getattr(env, "power_play_length", None)
    if start is None or length is None:
        return 0.0
    ends_s = (float(start) + float(length)) * float(env.sim_speedup_factor) * float(env.dt)
    return math.inf if ends_s < float(env.current_time) else ends_s - float(env.current_time)
