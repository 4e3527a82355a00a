"""Margins against opponents from the value tables: the worst they can do is looked up instead of run through.

With V(x_i, x_j) the distance boat i can keep from opponent j for as long as the table looks ahead (`shield.tables`),

    h_ij(x) = V(x_i, x_j) - R_ij - m,

where m is the margin for the table's own error. The table says what the worst opponent does from some moment on, not
what it does until then; so it is moved on in each of a few ways, and the least of the values counts.
"""

from __future__ import annotations

import math

import numpy as np

from ..backup.paths import READY_HEADING, READY_SAMPLE, READY_SPEED, sail
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.actuator import actuate
from ..platforms.usv import turn_of_rudder
from ..scene import Boats, Scene
from ..tables.grid import CAP
from ..tables.lookup import own_speed_cell, table_value
from ..work import Work
from .clearance import FAR
from .feared import feared_for

WAYS = 3
"""Ways an opponent may move: straight on, hard to port, hard to starboard."""

ROOM_M = 0.5
"""A table is looked into when it tells distances at least this much beyond the radius, m."""

PLACE_X, PLACE_Y, PLACE_HEADING, PLACE_SPEED, PLACE_USABLE = range(5)
"""Columns of a place: position m, heading rad, speed m/s, and whether the table holds for the boat there."""

MARGIN_THERE = PLACE_USABLE
"""Column of a place that was looked up: the margin there, m."""


@lean_kernel
def _note_place(row: Array, ready_thrust: float, place: Array) -> None:
    """Write the place of a state row; of a boat not at full thrust the table tells nothing."""
    place[PLACE_X], place[PLACE_Y] = row[L.X], row[L.Y]
    place[PLACE_HEADING], place[PLACE_SPEED] = math.radians(row[L.HEADING]), row[L.SPEED]
    place[PLACE_USABLE] = 1.0 if row[L.THRUST] >= ready_thrust else 0.0


@lean_kernel
def run_opponents(steps: int, scene: Scene) -> None:
    """Write where the opponents that tables are looked up for may be after some steps: ``work.ways``.

    These are steps of the boat model, and no fewer than there are in one of decisions.

    What was known of margins against opponents holds no more.
    """
    state, ours, boats, tuning, work = scene.state, scene.ours, scene.boats, scene.tuning, scene.work
    work.pursuers_known[:] = False
    work.lookup[:, :, PLACE_X] = np.nan
    for j in range(state.shape[0]):
        if ours[j] or work.known[j] or not boats.feared[j]:
            continue
        params = boats.params[j]
        full = turn_of_rudder(params, params[L.MAX_THRUST], min(params[L.MAX_RUDDER], 100.0), tuning.model_s)
        for way in range(WAYS):
            copy_row(work.row, state[j])
            turn = full * (0.0 if way == 0 else 2.0 * way - 3.0)
            speed = state[j, L.SPEED] if way == 0 else params[L.MAX_SPEED]
            for _ in range(max(steps, tuning.moves)):
                actuate(params, work.row, speed, turn, tuning.model_s)
            _note_place(work.row, boats.ready_thrust[j], work.ways[j, way])


@lean_kernel
def find_outnumbered(scene: Scene) -> None:
    """Mark the boats of ours of more than one opponent of which the tables tell something, at whatever thrust.

    Each table knows of one opponent only: two may each leave a way out, and not the same. Opponents of such a boat
    are run through for some time as well, before they are looked up: then one manoeuvre has to do for all.
    """
    state, ours, boats, work = scene.state, scene.ours, scene.boats, scene.work
    n = state.shape[0]
    for i in range(n):
        work.outnumbered[i] = False
        if not ours[i] or boats.table_steps[i] == 0:
            continue
        _note_place(state[i], boats.ready_thrust[i], work.place[i])
        count = 0
        for j in range(n):
            if j == i or ours[j] or not work.near[i, j] or not tabled(i, j, boats, work):
                continue
            table_m = boats.tables.axes[boats.table[i, j], CAP] - work.radius[i, j] - boats.table_margin_m - 1e-9
            if table_margin(i, j, work.place[i], work.ways[j], table_m, boats, work) < FAR:
                count += 1
                if count > 1:
                    work.outnumbered[i] = True
                    break


@lean_kernel
def out_of_reach(i: int, j: int, slot: int, closing_m: float, scene: Scene) -> bool:
    """Whether no run of opponent j, looked up at its end, can bring the margin on the path in ``slot`` below its cap.

    It cannot when the opponent, straight at where the boat is then, stays where the table tells enough for all headings
    and speeds, and cannot come near before. ``closing_m`` is the most the distance shrinks by from sample to sample.
    """
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    k, kept_m = int(work.ready[slot, READY_SAMPLE]), work.radius[i, j]
    if k < 0 or kept_m > boats.known_radius_m:
        return False
    path, course = work.path[slot], work.course[j]
    dx, dy = path[0, 0] - course[0], path[0, 1] - course[1]
    before_m = kept_m + tuning.margin_cap_m + k * closing_m
    if not dx * dx + dy * dy > before_m * before_m:
        return False
    table = boats.table[i, j]
    cell = own_speed_cell(boats.tables, table, work.ready[slot, READY_SPEED])
    way = max(boats.params[j, L.MAX_SPEED], state[j, L.SPEED]) * k * boats.sample_s
    dx, dy = path[k, 0] - course[0], path[k, 1] - course[1]
    there_m = boats.known_range_m[table, cell] + way
    return dx * dx + dy * dy > there_m * there_m


@lean_kernel
def set_place(i: int, slot: int, side: float, togo_deg: float, speed_mps: float, done: int, scene: Scene) -> None:
    """Write where boat i is looked up for the manoeuvre in ``slot``.

    That is its predicted state (done = 1), the same for every manoeuvre, or where it is ``boats.table_steps`` steps
    into the manoeuvre (done = 0): within one step manoeuvres hardly differ.
    """
    state, boats, tuning, work = scene.state, scene.boats, scene.tuning, scene.work
    if boats.table_steps[i] == 0:
        return
    copy_row(work.row, work.next_state[i] if done == 1 else state[i])
    for _ in range(0 if done == 1 else boats.table_steps[i]):
        togo_deg = sail(boats.params[i], work.row, side, togo_deg, speed_mps, tuning.model_s)
    _note_place(work.row, boats.ready_thrust[i], work.place[slot])


@lean_kernel
def tabled(i: int, j: int, boats: Boats, work: Work) -> bool:
    """Whether a table is for boat i and opponent j, and tells enough of them."""
    table = boats.table[i, j]
    if table < 0 or work.breach[i, j] or work.known[j]:
        return False
    return work.radius[i, j] + boats.table_margin_m + ROOM_M <= boats.tables.axes[table, CAP]


@lean_kernel
def table_answers(i: int, j: int, slot: int, boats: Boats, work: Work) -> bool:
    """Whether the table answers for boat i at the place in ``slot`` and opponent j."""
    return work.place[slot, PLACE_USABLE] != 0.0 and tabled(i, j, boats, work)


@lean_kernel
def margin_when_ready(i: int, j: int, slot: int, boats: Boats, work: Work) -> float:
    """Margin, m, of boat i where a run of opponent j ends that is to be looked up, in ``work.pursuer``."""
    path, ready, pursuer = work.path[slot], work.ready[slot], work.pursuer
    table, k = boats.table[i, j], int(ready[READY_SAMPLE])
    value = table_value(
        boats.tables,
        table,
        feared_for(i, j, ready[READY_SPEED], boats, work),
        pursuer[0] - path[k, 0],
        pursuer[1] - path[k, 1],
        ready[READY_HEADING],
        math.atan2(pursuer[2], pursuer[3]),
        ready[READY_SPEED],
        pursuer[4],
    )
    if value >= boats.tables.axes[table, CAP] - 1e-9:
        return FAR
    return value - work.radius[i, j] - boats.table_margin_m


@lean_kernel
def table_margin(i: int, j: int, own: Array, others: Array, enough_m: float, boats: Boats, work: Work) -> float:
    """Margin of boat i at a place against opponent j at the worst of several, m; `FAR` beyond the table.

    Once it is down to ``enough_m`` no more of them are looked at.
    """
    table, kept_m = boats.table[i, j], work.radius[i, j] + boats.table_margin_m
    feared_s = feared_for(i, j, own[PLACE_SPEED], boats, work)
    least = FAR
    for way in range(others.shape[0]):
        other = others[way]
        value = table_value(
            boats.tables,
            table,
            feared_s,
            other[PLACE_X] - own[PLACE_X],
            other[PLACE_Y] - own[PLACE_Y],
            own[PLACE_HEADING],
            other[PLACE_HEADING],
            own[PLACE_SPEED],
            other[PLACE_SPEED],
        )
        least = min(least, value)
        if least <= enough_m + kept_m:
            break
    if least >= boats.tables.axes[table, CAP] - 1e-9:
        return FAR
    return least - work.radius[i, j] - boats.table_margin_m


@lean_kernel
def margin_at_once(i: int, j: int, slot: int, enough_m: float, boats: Boats, work: Work) -> float:
    """Margin, m, of boat i where the manoeuvre in ``slot`` is looked up first, against the worst opponent j can do.

    For ``enough_m`` see `table_margin`.
    """
    return table_margin(i, j, work.place[slot], work.ways[j], enough_m, boats, work)


@lean_kernel
def worst_at_once(i: int, j: int, slot: int, boats: Boats, work: Work) -> float:
    """`margin_at_once`, kept: one step on it is the same for every manoeuvre."""
    place, known = work.place[slot], work.lookup[i, j]
    same = place[PLACE_X] == known[PLACE_X] and place[PLACE_Y] == known[PLACE_Y]
    if same and place[PLACE_HEADING] == known[PLACE_HEADING] and place[PLACE_SPEED] == known[PLACE_SPEED]:
        return known[MARGIN_THERE]
    margin = margin_at_once(i, j, slot, -FAR, boats, work)
    copy_row(known, place)
    known[MARGIN_THERE] = margin
    return margin
