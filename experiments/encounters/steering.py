"""What every boat of a batch wants to do next, from its script. Compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.actuator import command_for_turn
from steerclear.shield.platforms.usv import wrap_degrees

from ..jit import kernel
from . import script as S

LONGEST_LEAD_S = 20.0
"""A hunter looks no further ahead than this, s."""


class Roles(NamedTuple):
    """The boats of B encounters of n boats, and what they are to do.

    ``params`` (n, N_PARAM), ``team`` (n,), ``scripts`` (B, n, N_SCRIPT), ``goals`` (B, n, G, 2) m.
    """

    params: Array
    team: IntArray
    scripts: Array
    goals: Array


@kernel
def meeting_s(px: float, py: float, vx: float, vy: float, speed_mps: float) -> float:
    """Time until a pursuer can meet a target at relative place p that moves with v, or the longest lead, s."""
    a = vx * vx + vy * vy - speed_mps * speed_mps
    b = px * vx + py * vy
    c = px * px + py * py
    best = LONGEST_LEAD_S
    if abs(a) < 1e-9:
        if b < 0.0:
            best = min(best, -c / (2.0 * b))
        return best
    root = b * b - a * c
    if root < 0.0:
        return best
    for sign in (-1.0, 1.0):
        time_s = (-b + sign * math.sqrt(root)) / a
        if 0.0 < time_s < best:
            best = time_s
    return best


@kernel
def nearest_foe(state: Array, team: IntArray, i: int) -> int:
    """The nearest boat of another team, or -1."""
    found, best = -1, math.inf
    for j in range(state.shape[0]):
        if team[j] != team[i]:
            gap = math.hypot(state[j, L.X] - state[i, L.X], state[j, L.Y] - state[i, L.Y])
            if gap < best:
                found, best = j, gap
    return found


@kernel
def bearing_deg(x: float, y: float, to_x: float, to_y: float) -> float:
    """Direction from one place to another, deg clockwise from north."""
    return math.degrees(math.atan2(to_x - x, to_y - y))


@kernel
def hunt_deg(me: Array, target: Array, lead: float, standoff_m: float, speed_mps: float) -> float:
    """Heading of a hunter towards where its target will be."""
    course = math.radians(target[L.HEADING])
    east, north = math.sin(course), math.cos(course)
    x, y = target[L.X] + standoff_m * east, target[L.Y] + standoff_m * north
    vx, vy = target[L.SPEED] * east, target[L.SPEED] * north
    ahead_s = lead * meeting_s(x - me[L.X], y - me[L.Y], vx, vy, speed_mps)
    return bearing_deg(me[L.X], me[L.Y], x + vx * ahead_s, y + vy * ahead_s)


@kernel
def next_phase(row: Array, now: int, time_s: float, gap_m: float) -> int:
    """The phase a script is in, given the one it was in."""
    while now + 1 < S.PHASES:
        begin = S.PHASE + (now + 1) * S.N_PHASE
        if time_s + 1e-9 < row[begin + S.AT_S] and not gap_m < row[begin + S.WITHIN_M]:
            break
        now += 1
    return now


@kernel
def steer(
    params: Array, row: Array, now: int, me: Array, states: Array, foe: int, goal: Array, dt_s: float, wanted: Array
) -> None:
    """The command of one boat in a phase of its script: speed m/s and relative heading deg into ``wanted`` (2,)."""
    begin = S.PHASE + now * S.N_PHASE
    aim, speed, angle = int(row[begin + S.AIM]), row[begin + S.SPEED_MPS], row[begin + S.ANGLE_DEG]
    wanted[0], wanted[1] = speed, 0.0
    if aim == S.AIM_NOWHERE or (aim == S.AIM_TARGET and foe < 0):
        wanted[0] = 0.0
        return
    heading = angle
    if aim == S.AIM_GOALS:
        heading = angle + bearing_deg(me[L.X], me[L.Y], goal[0], goal[1])
    elif aim == S.AIM_TARGET:
        heading = angle + hunt_deg(me, states[foe], row[begin + S.LEAD], row[begin + S.STANDOFF_M], speed)
    error = wrap_degrees(heading - me[L.HEADING])
    wanted[1] = error
    if row[S.AUTHORITY] > 0.0:
        wanted[1] = command_for_turn(params, me, speed, error, dt_s)


@kernel
def want(
    state: Array,
    seen: Array,
    roles: Roles,
    goal_at: IntArray,
    phase_at: IntArray,
    time_s: float,
    dt_s: float,
    wanted: Array,
) -> None:
    """Commands of all boats; own boats (team 0) steer by what is seen, the others by what is true.

    Args:
        state: (B, n, N_STATE) true states.
        seen: (B, n, N_STATE) states as the own team knows them.
        roles: the boats.
        goal_at: (B, n) number of the goal made for.
        phase_at: (B, n) phase of the script, moved on here.
        time_s: time since the start.
        dt_s: step.
        wanted: (B, n, 2) speed m/s and relative heading deg, written.
    """
    for b in range(state.shape[0]):
        for i in range(state.shape[1]):
            row, known = roles.scripts[b, i], state[b]
            if roles.team[i] == 0:
                known = seen[b]
            foe = int(row[S.TARGET])
            if foe < 0:
                foe = nearest_foe(known, roles.team, i)
            gap = math.inf
            if foe >= 0:
                gap = math.hypot(known[foe, L.X] - known[i, L.X], known[foe, L.Y] - known[i, L.Y])
            phase_at[b, i] = next_phase(row, phase_at[b, i], time_s, gap)
            goal = roles.goals[b, i, goal_at[b, i]]
            steer(roles.params[i], row, phase_at[b, i], known[i], known, foe, goal, dt_s, wanted[b, i])
