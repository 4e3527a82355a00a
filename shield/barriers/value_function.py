"""Margins against opponents from the value tables: the worst they can do is looked up instead of rolled out.

With V(x_i, x_j) the distance boat i can keep from opponent j for as long as the table looks ahead (`shield.tables`),

    h_ij(x) = V(x_i, x_j) - R_ij - m,

where m is the margin for the table's own error. The table covers the worst opponent from some moment on, not until
then. So the opponent is moved on until then in each of a few ways, and the least value counts.
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.paths import FULL_THRUST_HEADING, FULL_THRUST_SAMPLE, FULL_THRUST_SPEED, sail
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import actuate
from ..platforms.usv import turn_of_rudder
from ..tables.grid import CAP
from ..tables.lookup import full_from_m, table_value
from ..workspace import RUN_EAST, RUN_NORTH, RUN_SPEED, RUN_X, RUN_Y, Scene
from .clearance import FAR

WAYS = 3
"""Ways an opponent may move: straight on, hard to port, hard to starboard."""

ROOM_M = 0.5
"""A table is used if it covers distances at least this far beyond the radius, m."""

PLACE_X, PLACE_Y, PLACE_HEADING, PLACE_SPEED, PLACE_USABLE = range(5)
"""Columns of a place: position m, heading rad, speed m/s, and whether the table holds for the boat there."""

MARGIN_THERE = PLACE_USABLE
"""Column of a place that was looked up: the margin there, m."""


@lean_kernel
def _note_place(row: Array, full_thrust_percent: float, place: Array) -> None:
    """Write the place of a state row; a table reports nothing of a boat that is not at full thrust."""
    place[PLACE_X], place[PLACE_Y] = row[L.X], row[L.Y]
    place[PLACE_HEADING], place[PLACE_SPEED] = math.radians(row[L.HEADING]), row[L.SPEED]
    place[PLACE_USABLE] = 1.0 if row[L.THRUST] >= full_thrust_percent else 0.0


@lean_kernel
def run_opponents(steps: int, scene: Scene) -> None:
    """Write ``scene.opponent_places``: where those with tables may be after some model steps, at least one decision.

    Known margins from opponents become invalid.
    """
    state, ours, boats, tuning = scene.state, scene.ours, scene.boats, scene.tuning
    scene.pursuers_known[:] = False
    scene.table_cache[:, :, PLACE_X] = np.nan
    for j in range(state.shape[0]):
        if ours[j] or scene.predicted[j] or not boats.has_table[j]:
            continue
        params = boats.params[j]
        full = turn_of_rudder(params, params[L.MAX_THRUST], min(params[L.MAX_RUDDER], 100.0), tuning.model_s)
        for way in range(WAYS):
            copy_row(scene.row, state[j])
            turn = full * (0.0 if way == 0 else 2.0 * way - 3.0)
            speed = state[j, L.SPEED] if way == 0 else params[L.MAX_SPEED]
            for _ in range(max(steps, tuning.moves)):
                actuate(params, scene.row, speed, turn, tuning.model_s)
            _note_place(scene.row, boats.full_thrust_percent[j], scene.opponent_places[j, way])


@lean_kernel
def find_several_pursuers(scene: Scene) -> None:
    """Mark own boats near more than one opponent of which the tables report something, at whatever thrust.

    Each table knows one opponent only: two may each leave a way out, and not the same one. Opponents of such a boat
    are also rolled out for some time before they are looked up; then one manoeuvre must clear all.
    """
    state, ours, boats = scene.state, scene.ours, scene.boats
    n = state.shape[0]
    for i in range(n):
        scene.several_pursuers[i] = False
        if not ours[i] or boats.table_steps[i] == 0:
            continue
        _note_place(state[i], boats.full_thrust_percent[i], scene.table_place[i])
        count = 0
        for j in range(n):
            if j == i or ours[j] or not scene.neighbours[i, j] or not tabled(i, j, scene):
                continue
            table_m = boats.tables.axes[boats.table[i, j], CAP] - scene.radius[i, j] - boats.table_margin_m - 1e-9
            if table_margin(i, j, scene.table_place[i], scene.opponent_places[j], table_m, scene) < FAR:
                count += 1
                if count > 1:
                    scene.several_pursuers[i] = True
                    break


@lean_kernel
def set_place(i: int, slot: int, rudder: float, togo_deg: float, speed_mps: float, ahead: int, scene: Scene) -> None:
    """Write where boat i is looked up for the manoeuvre in ``slot``.

    For ahead = 1 that is its predicted state, the same for every manoeuvre. For ahead = 0 it is ``boats.table_steps``
    steps into the manoeuvre, because within one step manoeuvres hardly differ.
    """
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    if boats.table_steps[i] == 0:
        return
    copy_row(scene.row, scene.next_state[i] if ahead == 1 else state[i])
    for _ in range(0 if ahead == 1 else boats.table_steps[i]):
        togo_deg = sail(boats.params[i], scene.row, rudder, togo_deg, speed_mps, tuning.model_s)
    _note_place(scene.row, boats.full_thrust_percent[i], scene.table_place[slot])


@lean_kernel
def tabled(i: int, j: int, scene: Scene) -> bool:
    """Return whether a table is for boat i and opponent j and covers enough of them."""
    boats = scene.boats
    table = boats.table[i, j]
    if table < 0 or scene.inside_separation[i, j] or scene.predicted[j]:
        return False
    return scene.radius[i, j] + boats.table_margin_m + ROOM_M <= boats.tables.axes[table, CAP]


@lean_kernel
def table_answers(i: int, j: int, slot: int, scene: Scene) -> bool:
    """Return whether the table answers for boat i at the place in ``slot`` and opponent j."""
    return scene.table_place[slot, PLACE_USABLE] != 0.0 and tabled(i, j, scene)


@lean_kernel
def beyond_table(i: int, j: int, slot: int, scene: Scene) -> bool:
    """Return whether opponent j is too far for its table to report anything, and for coming near before."""
    boats, path, full_thrust, course = scene.boats, scene.path[slot], scene.full_thrust[slot], scene.course[j]
    own_mps = max(boats.fastest_mps[i], scene.state[i, L.SPEED])
    other_mps = max(boats.params[j, L.MAX_SPEED], scene.state[j, L.SPEED])
    horizon_s = adversarial_for(i, j, full_thrust[FULL_THRUST_SPEED], scene)
    kept_m = max(
        full_from_m(boats.tables, boats.table[i, j], horizon_s), scene.radius[i, j] + scene.tuning.margin_cap_m
    )
    gap_m = math.hypot(path[0, 0] - course[0], path[0, 1] - course[1])
    return gap_m >= kept_m + ROOM_M + (own_mps + other_mps) * boats.sample_s * full_thrust[FULL_THRUST_SAMPLE]


@lean_kernel
def margin_at_full_thrust(i: int, j: int, slot: int, run: Array, scene: Scene) -> float:
    """Return the margin, m, of boat i by table at the end of a rollout of opponent j."""
    boats, path, full_thrust = scene.boats, scene.path[slot], scene.full_thrust[slot]
    table, k = boats.table[i, j], int(full_thrust[FULL_THRUST_SAMPLE])
    horizon_s = adversarial_for(i, j, full_thrust[FULL_THRUST_SPEED], scene)
    dx, dy, heading = run[RUN_X] - path[k, 0], run[RUN_Y] - path[k, 1], math.atan2(run[RUN_EAST], run[RUN_NORTH])
    own_heading, own_mps = full_thrust[FULL_THRUST_HEADING], full_thrust[FULL_THRUST_SPEED]
    value = table_value(boats.tables, table, horizon_s, dx, dy, own_heading, heading, own_mps, run[RUN_SPEED])
    return _margin_of(i, j, value, scene)


@lean_kernel
def _margin_of(i: int, j: int, value_m: float, scene: Scene) -> float:
    """Return the margin, m, for a distance from a table; `FAR` if that is the table's cap."""
    boats = scene.boats
    if value_m >= boats.tables.axes[boats.table[i, j], CAP] - 1e-9:
        return FAR
    return value_m - scene.radius[i, j] - boats.table_margin_m


@lean_kernel
def table_margin(i: int, j: int, own: Array, others: Array, enough_m: float, scene: Scene) -> float:
    """Return the margin, m, of boat i at a place from opponent j at the worst of several; `FAR` beyond the table.

    Once the margin is down to ``enough_m``, the remaining places are skipped.
    """
    boats = scene.boats
    table, kept_m = boats.table[i, j], scene.radius[i, j] + boats.table_margin_m
    horizon_s = adversarial_for(i, j, own[PLACE_SPEED], scene)
    least = FAR
    for way in range(others.shape[0]):
        other = others[way]
        dx, dy = other[PLACE_X] - own[PLACE_X], other[PLACE_Y] - own[PLACE_Y]
        headings, speeds = (own[PLACE_HEADING], other[PLACE_HEADING]), (own[PLACE_SPEED], other[PLACE_SPEED])
        value = table_value(boats.tables, table, horizon_s, dx, dy, headings[0], headings[1], speeds[0], speeds[1])
        least = min(least, value)
        if least <= enough_m + kept_m:
            break
    return _margin_of(i, j, least, scene)


@lean_kernel
def margin_at_once(i: int, j: int, slot: int, enough_m: float, scene: Scene) -> float:
    """Return the margin, m, of boat i from opponent j at the first lookup in ``slot``, see `table_margin`."""
    return table_margin(i, j, scene.table_place[slot], scene.opponent_places[j], enough_m, scene)


@lean_kernel
def worst_at_once(i: int, j: int, slot: int, scene: Scene) -> float:
    """Return `margin_at_once`, cached: one step ahead it is the same for every manoeuvre."""
    place, known = scene.table_place[slot], scene.table_cache[i, j]
    same = place[PLACE_X] == known[PLACE_X] and place[PLACE_Y] == known[PLACE_Y]
    if same and place[PLACE_HEADING] == known[PLACE_HEADING] and place[PLACE_SPEED] == known[PLACE_SPEED]:
        return known[MARGIN_THERE]
    margin = margin_at_once(i, j, slot, -FAR, scene)
    copy_row(known, place)
    known[MARGIN_THERE] = margin
    return margin


UNDER_WAY = 1.0 / 3.0
"""Share of its top speed at which a boat is under way."""


@lean_kernel
def adversarial_for(i: int, j: int, speed_mps: float, scene: Scene) -> float:
    """Return the time, s, for which opponent j may do its worst to boat i at a speed; 0: it holds its course."""
    boats = scene.boats
    horizon_s = scene.adversary_horizon_s[j]
    if horizon_s <= 0.0:
        return 0.0
    return horizon_s + max(0.0, UNDER_WAY - speed_mps / boats.params[i, L.MAX_SPEED]) * boats.regain_s[i]
