"""Evidence: whether an opponent steers at a boat of ours, told from where it heads and how it turned.

Three views of an opponent compete: it hunts (steers at a boat of ours, or for where it would meet it), it holds its
course, or it goes about the game (steers at a circle that is kept by rule, a flag's, or somewhere else). The log-odds
that it hunts are of three parts,

    L = PRIOR + log(STRAY + (1 - STRAY) sqrt(2 pi) / AIM_RAD exp(-e^2 / 2 AIM_RAD^2)) + D.

The second is where it heads: e is the angle from its heading to where a hunter would steer; a hunter's are spread about
0, others' all around. The third is how it turned, a sequential test of the likelihood ratio (Wald 1947) that forgets.
With w the turn it made in a step and w_v what view v expects, both as shares of the fullest it can make,

    w_v = clip(e_v / (full turn rate x RESPONSE_S), -1, 1),    r_v = w - w_v,

and r^2 = ELSEWHERE for a turn to somewhere else,

    dD/dt = GAIN_PER_S (min r_others^2 - min r_hunt^2) - D / FORGET_S,    |D| <= MOST_ODDS.

From now on it is feared for the time T between the floor and all of `adversary_s`, on a scale of ratios,

    T = floor^(1 - p) adversary^p,    p = 1 / (1 + exp(-L)).

Who has just appeared, or was not where it could have sailed to, is unknown and feared in full.
"""

from __future__ import annotations

import math

from ..jit import Array, BoolArray, lean_kernel
from ..memory import Memory
from ..platforms import layout as L
from ..platforms.usv import wrap_degrees
from ..scene import Boats, Fixed, Tuning
from ..work import Work

RESPONSE_S = 1.0
"""Time in which autopilots take out what is left of a turn, s."""
GAIN_PER_S = 4.0
"""Log-odds gained in a second by an opponent that turns as hard as it can where one view says so and none other."""
FORGET_S = 20.0
"""Time in which what has been seen of an opponent counts for a third, s."""
MOST_ODDS = 4.0
"""Largest log-odds from turns either way: 98 to 2."""
UNKNOWN_ODDS = 20.0
"""The same of one of which nothing is known: in full."""
PRIOR = -1.0
"""Log-odds that an opponent hunts of which nothing is known but that it is one."""
AIM_RAD = 0.3
"""Spread of a hunter's headings about where it steers, rad."""
STRAY = 0.05
"""Share of hunters that head anywhere."""
ELSEWHERE = 0.5
"""Squared surprise of a turn to somewhere that nobody knows."""
JUMP_M = 1.0
"""Who is farther than this from where it could have sailed to has jumped, m."""

SEEN_X, SEEN_Y, SEEN_HEADING, SEEN_SPEED = range(4)
"""Columns of what was seen of a boat at the last decision."""


@lean_kernel
def _expected_turn(seen: Array, x: float, y: float, full_dps: float) -> float:
    """Turn of a boat that steers for (x, y), as a share of the fullest."""
    bearing_deg = math.degrees(math.atan2(x - seen[SEEN_X], y - seen[SEEN_Y]))
    return max(-1.0, min(1.0, wrap_degrees(bearing_deg - seen[SEEN_HEADING]) / (full_dps * RESPONSE_S)))


@lean_kernel
def _surprise_of_hunt(j: int, turned: float, state: Array, boats: Boats, memory: Memory) -> float:
    """Least squared surprise at boat j's turn if it steers at a boat of another team, or for where it meets it."""
    seen, least = memory.seen[j], 1e9
    for i in range(state.shape[0]):
        target = memory.seen[i]
        if boats.team[i] == boats.team[j] or math.isnan(target[SEEN_X]):
            continue
        gap_m = math.hypot(target[SEEN_X] - seen[SEEN_X], target[SEEN_Y] - seen[SEEN_Y])
        heading = math.radians(target[SEEN_HEADING])
        for lead in range(2):
            way_m = lead * target[SEEN_SPEED] * gap_m / max(boats.params[j, L.MAX_SPEED], 0.1)
            x, y = target[SEEN_X] + way_m * math.sin(heading), target[SEEN_Y] + way_m * math.cos(heading)
            least = min(least, (turned - _expected_turn(seen, x, y, boats.granted_turn_dps[j])) ** 2)
    return least


@lean_kernel
def _odds_of_heading(j: int, state: Array, boats: Boats) -> float:
    """Log-odds that boat j hunts by where it heads: at a boat of another team, or for where it meets it."""
    least = math.pi
    for i in range(state.shape[0]):
        if boats.team[i] == boats.team[j]:
            continue
        dx, dy = state[i, L.X] - state[j, L.X], state[i, L.Y] - state[j, L.Y]
        time_s = math.hypot(dx, dy) / max(boats.params[j, L.MAX_SPEED], 0.1)
        heading = math.radians(state[i, L.HEADING])
        for lead in range(2):
            way_m = lead * state[i, L.SPEED] * time_s
            bearing = math.atan2(dx + way_m * math.sin(heading), dy + way_m * math.cos(heading))
            least = min(least, abs(math.radians(wrap_degrees(math.degrees(bearing) - state[j, L.HEADING]))))
    peak = (1.0 - STRAY) * math.sqrt(2.0 * math.pi) / AIM_RAD
    return math.log(STRAY + peak * math.exp(-0.5 * (least / AIM_RAD) ** 2))


@lean_kernel
def _surprise_of_others(j: int, turned: float, fixed: Fixed, boats: Boats, memory: Memory) -> float:
    """Least squared surprise at boat j's turn if it holds its course or goes about the game."""
    least = min(ELSEWHERE, turned * turned)
    for c in range(fixed.keep_out.shape[0]):
        x, y = fixed.keep_out[c, 0], fixed.keep_out[c, 1]
        least = min(least, (turned - _expected_turn(memory.seen[j], x, y, boats.granted_turn_dps[j])) ** 2)
    return least


@lean_kernel
def _jumped(j: int, state: Array, boats: Boats, tuning: Tuning, memory: Memory) -> bool:
    """Whether boat j is where it cannot have sailed to, or was not seen before."""
    seen = memory.seen[j]
    way_m = math.hypot(state[j, L.X] - seen[SEEN_X], state[j, L.Y] - seen[SEEN_Y])
    top_mps = max(boats.fastest_mps[j], max(abs(state[j, L.SPEED]), abs(seen[SEEN_SPEED])))
    return not way_m <= top_mps * tuning.dt_s + JUMP_M


@lean_kernel
def _update(j: int, state: Array, boats: Boats, fixed: Fixed, tuning: Tuning, memory: Memory) -> None:
    """Log-odds that opponent j hunts, one step on."""
    if _jumped(j, state, boats, tuning, memory):
        memory.odds[j] = UNKNOWN_ODDS
        return
    full_deg = boats.granted_turn_dps[j] * tuning.dt_s
    turned = max(-1.0, min(1.0, wrap_degrees(state[j, L.HEADING] - memory.seen[j, SEEN_HEADING]) / full_deg))
    gain = _surprise_of_others(j, turned, fixed, boats, memory) - _surprise_of_hunt(j, turned, state, boats, memory)
    rate = GAIN_PER_S * gain - memory.odds[j] / FORGET_S
    memory.odds[j] = max(-MOST_ODDS, min(MOST_ODDS, memory.odds[j] + rate * tuning.dt_s))


@lean_kernel
def watch(
    state: Array, ours: BoolArray, boats: Boats, fixed: Fixed, tuning: Tuning, memory: Memory, work: Work
) -> None:
    """Note how long each opponent is feared for, ``work.fear_s`` (n,), and what is seen of all boats now."""
    for j in range(state.shape[0]):
        work.fear_s[j] = tuning.adversary_s
        if not ours[j] and boats.granted_turn_dps[j] > 0.0 and tuning.floor_s < tuning.adversary_s:
            _update(j, state, boats, fixed, tuning, memory)
            p = 1.0 / (1.0 + math.exp(-PRIOR - _odds_of_heading(j, state, boats) - memory.odds[j]))
            work.fear_s[j] = math.exp((1.0 - p) * math.log(tuning.floor_s) + p * math.log(tuning.adversary_s))
    for j in range(state.shape[0]):
        seen = memory.seen[j]
        seen[SEEN_X], seen[SEEN_Y] = state[j, L.X], state[j, L.Y]
        seen[SEEN_HEADING], seen[SEEN_SPEED] = state[j, L.HEADING], state[j, L.SPEED]
