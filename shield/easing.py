"""Between an escape and the wanted commands: no more of the escape than fixed things ask for.

Along an edge or a wall what is left of the distance to it falls with the square of the angle towards it. The rows of
the program, which are linear, then find no answer, and a boat that wants through would steer full rudder out and in.
"""

from __future__ import annotations

from .certificates.rating import worst_merit
from .jit import Array, BoolArray, copy_row, lean_kernel
from .linearised import check
from .plan import Plan
from .platforms import layout as L
from .platforms.actuator import command_for_turn
from .platforms.usv import wrap_degrees
from .scene import Boats, Fixed, Memory, Tuning, Work

HALVINGS = 5
"""Looks for the least share of an escape: all but a twentieth of what is to be had."""

WORSE_BY_FIXED = 1e-6
"""Difference of merit that counts where only fixed things are at stake: rounding, since what is given away is so in
every step."""


@lean_kernel
def _mildest_turn(i: int, plan: Plan) -> float:
    """Turn, deg: the wanted one where it is a part of the escape's, straight on where it goes against it.

    As much against it as is allowed in this step would have to be taken back in the next.
    """
    wanted, escape = plan.wanted_turn[i], plan.eased[i, 0]
    return wanted if wanted * escape > 0.0 and abs(wanted) < abs(escape) else 0.0


@lean_kernel
def _go_back(share: float, count: int, state: Array, boats: Boats, tuning: Tuning, plan: Plan) -> None:
    """Commands of the movers that share of the way back from their escapes, ``plan.eased``: turn deg, speed m/s."""
    for m in range(count):
        i = plan.movers[m]
        turn = plan.eased[i, 0] + share * (_mildest_turn(i, plan) - plan.eased[i, 0])
        speed = plan.eased[i, 1] + share * (plan.kept_commands[i, 0] - plan.eased[i, 1])
        speed = max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
        plan.commands[i, 0] = speed
        plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, turn, tuning.dt_s)


@lean_kernel
def ease(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> None:
    """Take back of the movers' escapes, checked as they are, what is not needed to keep what they keep."""
    level = worst_merit(ours, work) - WORSE_BY_FIXED
    for m in range(count):
        i = plan.movers[m]
        plan.eased[i, 0] = wrap_degrees(work.next_state[i, L.HEADING] - state[i, L.HEADING])
        plan.eased[i, 1] = plan.commands[i, 0]
        copy_row(plan.answer[i], plan.commands[i])
    kept, too_far, at = 0.0, 2.0, 0.0
    for _ in range(HALVINGS):
        at = 0.5 * (kept + too_far)  # all the way first
        _go_back(at, count, state, boats, tuning, plan)
        check(count, state, ours, boats, fixed, tuning, memory, work, plan)
        if worst_merit(ours, work) >= level:
            kept = at
        else:
            too_far = at
        if kept == 1.0:
            return
    if at == kept:
        return
    _go_back(kept, count, state, boats, tuning, plan)
    if kept == 0.0:
        for m in range(count):
            copy_row(plan.commands[plan.movers[m]], plan.answer[plan.movers[m]])
    check(count, state, ours, boats, fixed, tuning, memory, work, plan)
