"""The fleet as a competition's global state tells it: places, headings, speeds, and what the game drives."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from steerclear.shield.fleet import Fleet
from steerclear.shield.platforms import layout as L
from steerclear.shield.wrappers.driving import Driven, Drives, driven_rows

NORMALISED_M = 1.5
"""Where no boat is farther than this from (0, 0), m, the state is normalised, and tells no metres."""


class GameSpec(NamedTuple):
    """What a zip knows of its game; lengths in m, times in s, speeds in m/s.

    Attributes:
        agent_ids: names of all boats, blue's first.
        platforms: name of each boat's platform.
        size: of the field.
        marks: for each team, where its tagged boats are driven to: the nearest of these.
        ends: for each team, the places near which its boats are untagged.
        untag_m: how near.
        oob_share: share of top speed at which boats are driven in.
        tag_share: share at which tagged boats are.
        power_s: how long a power play lasts.
        decision_s: time from decision to decision.
        points: named points of the field, in blue's naming.
        stops: for each team, circles (x, y, radius) to keep out of.
        shield: settings of the shield.
    """

    agent_ids: tuple[str, ...]
    platforms: tuple[str, ...]
    size: tuple[float, float]
    marks: Any
    ends: Any
    untag_m: float
    oob_share: float
    tag_share: float
    power_s: float
    decision_s: float
    points: Mapping[str, tuple[float, float]]
    stops: Any
    shield: Mapping[str, Any]


class Observation(NamedTuple):
    """All boats now: (n, N_STATE) rows, and (n,) what the game does with them and who is on the other side."""

    rows: Any
    tagged: Any
    oob: Any
    disabled: Any
    visiting: Any


def see(spec: GameSpec, state: Mapping[Any, Any]) -> Observation:
    """Read the global state."""
    rows = np.zeros((len(spec.agent_ids), L.N_STATE))
    rows[:, [L.THRUST, L.RUDDER, L.SPEED_ERROR, L.HEADING_ERROR]] = math.nan
    flags = np.zeros((4, len(spec.agent_ids)), np.bool_)
    for i, name in enumerate(spec.agent_ids):
        x, y = state[name, "pos"]
        rows[i, [L.X, L.Y]] = float(x), float(y)
        rows[i, L.HEADING], rows[i, L.SPEED] = float(state[name, "heading"]), float(state[name, "speed"])
        flags[:3, i] = state[name, "is_tagged"], state[name, "oob"], state.get((name, "is_disabled"), False)
        flags[3, i] = not state.get((name, "on_side"), True)
    if not np.isfinite(rows[:, : L.SPEED + 1]).all() or (np.abs(rows[:, [L.X, L.Y]]) <= NORMALISED_M).all():
        raise ValueError("the global state is normalised or not finite; the shield needs it in metres")
    return Observation(rows, *flags)


def fleet_of(spec: GameSpec, observed: Observation, team: int, disabled_for_s: Any) -> Fleet:
    """The fleet to decide for: the team's boats but those that the game drives."""
    half = len(spec.agent_ids) // 2
    teams = np.array([0] * half + [1] * half)
    driven = Driven(observed.tagged, observed.oob, observed.disabled, np.asarray(disabled_for_s))
    rows = driven_rows(_drives(spec), driven, observed.rows, teams)
    ours = (teams == team) & ~(driven.tagged | driven.oob | driven.disabled)
    return Fleet(observed.rows, teams, spec.platforms, ours, spec.agent_ids, driven=rows, visiting=observed.visiting)


def _drives(spec: GameSpec) -> Drives:
    """How the game drives boats."""
    from steerclear.shield.platforms import get_platform

    top_mps = np.array([float(get_platform(name).max_speed_mps) for name in spec.platforms])
    marks, ends = ([np.array(one, dtype=np.float64) for one in places] for places in (spec.marks, spec.ends))
    tagged_mps, oob_mps = top_mps * spec.tag_share, top_mps * spec.oob_share
    return Drives(marks, ends, spec.untag_m, np.array(spec.size), tagged_mps, oob_mps)
