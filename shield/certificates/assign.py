"""Which escape manoeuvre each boat of ours holds: found one boat at a time, the others' kept, until all fit."""

from __future__ import annotations

from ..jit import Array, BoolArray, kernel
from ..platforms import layout as L
from ..scene import Boats, Fixed, Memory, Tuning, Work
from .manoeuvre import FIXED_LOST, PAIR_SAFE, lay_path, rate_path
from .paths import angle_to_go

COMMANDED = -1.0
"""Speed entry of a manoeuvre that keeps the commanded speed."""

SWEEPS = 3


@kernel
def _take(i: int, slot: int, merit: float, work: Work) -> None:
    """Make the trial in ``slot`` boat i's plan."""
    work.plan[i] = work.plan[slot]
    work.path[i] = work.path[slot]
    work.clear[i] = work.clear[slot]
    work.fixed[i] = work.fixed[slot]
    work.bound[i] = work.bound[slot]
    work.merit[i] = merit


@kernel
def kept_turn(i: int, heading_deg: float, memory: Memory) -> float:
    """Turn still to make of the manoeuvre in memory, deg; past its target it is done."""
    togo = angle_to_go(heading_deg, memory.target_deg[i], memory.side[i])
    return 0.0 if togo > 270.0 else togo


@kernel
def choose_plan(
    i: int,
    wanted_mps: float,
    done: int,
    exhaustive: bool,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
) -> None:
    """Give boat i a manoeuvre: the first that is safe, or with ``exhaustive`` the best of all.

    The first manoeuvre of the family and the one in memory are tried before the others. The one under way
    is left only for one that is better by the hysteresis, so that a side once taken is kept.
    """
    trial = state.shape[0]
    top = boats.params[i, L.MAX_SPEED]
    heading = work.next_state[i, L.HEADING] if done == 1 else state[i, L.HEADING]
    best = -1e9
    for p in range(-1, plans.shape[0]):
        # order: family's first, memory (p = 0 stands for it once the first is done), the rest
        bonus = 0.0
        if p == 0:
            if not memory.kept[i]:
                continue
            side, speed = memory.side[i], memory.speed_mps[i]
            togo = kept_turn(i, heading, memory)
            bonus = tuning.hysteresis_m if memory.escaping[i] else 0.0
        else:
            q = 0 if p == -1 else p
            side, togo = plans[q, 0], plans[q, 1]
            speed = wanted_mps if plans[q, 2] == COMMANDED else plans[q, 2] * top
        lay_path(i, trial, side, togo, speed, done, state, boats, tuning, work)
        merit = rate_path(i, trial, best - bonus, state, ours, boats, fixed, tuning, work)
        merit_kept = merit + (bonus if merit < FIXED_LOST else 1e-3 * bonus)
        if merit_kept > best:
            best = merit_kept
            _take(i, trial, merit, work)
        if merit >= PAIR_SAFE and not exhaustive:
            return


@kernel
def refresh(
    i: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    tuning: Tuning,
    work: Work,
) -> None:
    """Rate boat i's plan again against the others' present plans."""
    work.merit[i] = rate_path(i, i, -1e9, state, ours, boats, fixed, tuning, work)


@kernel
def assign_plans(
    commands: Array,
    done: int,
    exhaustive: bool,
    who: BoolArray,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
) -> bool:
    """Give the boats of ``who`` a manoeuvre, from their predicted (done = 1) or present states (0).

    Boats of ours outside ``who`` keep the paths they have.

    Returns:
        Whether all boats of ours keep clear of all boats and of fixed things.
    """
    n = state.shape[0]
    for i in range(n):
        if who[i]:
            if memory.kept[i]:
                heading = work.next_state[i, L.HEADING] if done == 1 else state[i, L.HEADING]
                togo = kept_turn(i, heading, memory)
                lay_path(i, i, memory.side[i], togo, memory.speed_mps[i], done, state, boats, tuning, work)
            else:
                lay_path(i, i, 1.0, 0.0, commands[i, 0], done, state, boats, tuning, work)
    for sweep in range(SWEEPS):
        good = True
        for i in range(n):
            if not who[i]:
                continue
            if sweep > 0:
                refresh(i, state, ours, boats, fixed, tuning, work)
                if work.merit[i] >= PAIR_SAFE:
                    continue
            good = False
            choose_plan(
                i,
                commands[i, 0],
                done,
                exhaustive and sweep == 0,
                state,
                ours,
                boats,
                fixed,
                plans,
                tuning,
                memory,
                work,
            )
        if good:
            break
    good = True
    for i in range(n):
        if ours[i]:
            refresh(i, state, ours, boats, fixed, tuning, work)
            good = good and work.merit[i] >= PAIR_SAFE
    return good
