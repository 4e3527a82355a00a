"""One decision, in compiled stages: screen, build rows, check an answer, ladder, commit.

The single decision (`shield.Shield`) calls the stages from Python with a QP backend between them; `decide_compiled`
chains the same stages with the compiled projection for thousands of games. Nothing else differs between the two.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from .active_set import OPTIMAL, project
from .certificates.assign import assign_plans, hold, recheck
from .certificates.clearance import MARGIN
from .certificates.manoeuvre import FIXED_LOST, PAIR_SAFE, STRAIGHT_SAFE, look_around
from .certificates.values import run_opponents
from .jit import Array, BoolArray, IntArray, kernel
from .platforms import layout as L
from .platforms.actuator import command_for_turn, full_turn
from .platforms.step import step_boat
from .platforms.usv import wrap_degrees
from .rows import BOX_ROW, build_rows, inputs_of
from .scene import Boats, Fixed, Memory, Tuning, Work

PASSED, QP, QP_RELAXED, ESCAPE, BEST_EFFORT, HELD, NOT_COVERED = range(7)

LARGEST_COMMAND = 1e6
"""Speeds, m/s, and relative headings, deg, beyond this are no commands: the model's squares of them overflow."""

ROUNDS = 2
"""Times the program is linearised and solved anew before the ladder takes over."""

SAME = 1e-6
"""Scaled input change below which a command counts as unchanged and the wanted one is sent."""

CLEARLY = 1e-2
"""Difference of merit that counts when an answer of the program is weighed against an escape."""

LEAST_TURN_DEG = 1e-3
"""Turns to go below this are made: what is remembered must not hang on the last bit of a heading."""

SLACK_COST = np.array([1e4, 1e2])
"""Weight of the squared slack of boat rows and of fixed-thing rows when they cannot all hold."""


class Plan(NamedTuple):
    """Arrays of the quadratic program of one decision (n boats, at most ``rows`` rows)."""

    commands: Array
    kept_commands: Array
    wanted_turn: Array
    held: Array
    answer: Array
    answer_held: Array
    movers: IntArray
    place: IntArray
    moving: BoolArray
    gain: Array
    z_now: Array
    z0: Array
    z: Array
    C: Array
    d: Array
    kind: IntArray
    label: IntArray
    slack_m: Array
    reason: IntArray


def new_plan(boats: int, rows: int) -> Plan:
    """Program arrays for a scene of that many boats and rows."""
    return Plan(
        commands=np.zeros((boats, 2)),
        kept_commands=np.zeros((boats, 2)),
        wanted_turn=np.zeros(boats),
        held=np.zeros((boats, 3)),
        answer=np.zeros((boats, 2)),
        answer_held=np.zeros((boats, 3)),
        movers=np.zeros(boats, np.int64),
        place=np.full(boats, -1, np.int64),
        moving=np.zeros(boats, np.bool_),
        gain=np.zeros((boats, 3)),
        z_now=np.zeros(2 * boats + 2),
        z0=np.zeros(2 * boats + 2),
        z=np.zeros(2 * boats + 2),
        C=np.zeros((rows, 2 * boats + 2)),
        d=np.zeros(rows),
        kind=np.zeros(rows, np.int64),
        label=np.zeros((rows, 2), np.int64),
        slack_m=np.zeros(boats),
        reason=np.zeros(boats, np.int64),
    )


@kernel
def predict(i: int, commands: Array, state: Array, boats: Boats, tuning: Tuning, work: Work) -> None:
    """State of boat i one step after its command, by the full boat and autopilot model."""
    work.next_state[i] = state[i]
    step_boat(boats.params[i], work.next_state[i], commands[i, 0], commands[i, 1], tuning.dt_s)


@kernel
def set_targets(ours: BoolArray, boats: Boats, memory: Memory, work: Work) -> None:
    """Margin each boat must keep: the discrete-time class-K condition h(x+) >= decay * min(h(x), cap), at least 0."""
    for i in range(ours.shape[0]):
        work.target[i] = 0.0
        if ours[i] and memory.kept[i] and memory.margin_m[i] > 0.0:
            work.target[i] = boats.decay[i] * min(memory.margin_m[i], boats.cap_m[i])


@kernel
def screen(
    state: Array,
    wanted: Array,
    margin_m: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> bool:
    """Check the wanted commands as they are; True when every boat still has its escape after them.

    An unusable command (NaN, infinite or beyond `LARGEST_COMMAND`) is replaced by holding course at zero speed before
    the check.
    """
    n = state.shape[0]
    look_around(state, margin_m, ours, boats, tuning, work)
    set_targets(ours, boats, memory, work)
    for i in range(n):
        plan.commands[i] = wanted[i]
        plan.slack_m[i] = 0.0
        plan.moving[i] = False
        plan.reason[i] = PASSED if ours[i] else NOT_COVERED
        if not ours[i]:
            continue
        if not (abs(wanted[i, 0]) <= LARGEST_COMMAND and abs(wanted[i, 1]) <= LARGEST_COMMAND):
            plan.commands[i, 0], plan.commands[i, 1] = 0.0, 0.0
            plan.reason[i] = HELD
        predict(i, plan.commands, state, boats, tuning, work)
        plan.wanted_turn[i] = wrap_degrees(work.next_state[i, L.HEADING] - state[i, L.HEADING])
    plan.kept_commands[:] = plan.commands
    return assign_plans(plan.commands, 1, False, ours, state, ours, boats, fixed, plans, tuning, memory, work)


@kernel
def lost(ours: BoolArray, memory: Memory, work: Work) -> bool:
    """Whether some boat is short of its margin, as it was on its escape: then the escape goes on until all is safe.

    One step of the program cannot win back what no manoeuvre could; searching for it costs time and makes the boat
    dither.
    """
    found = False
    for i in range(ours.shape[0]):
        short = memory.escaping[i] and memory.margin_m[i] < 0.0 and work.merit[i] < STRAIGHT_SAFE
        found = found or (ours[i] and short)
    return found


@kernel
def pick_movers(ours: BoolArray, work: Work, plan: Plan) -> int:
    """Boats whose certificate fails, and the team-mates it fails against; once in, a boat stays in."""
    n = ours.shape[0]
    for i in range(n):
        if ours[i] and work.merit[i] < PAIR_SAFE:
            plan.moving[i] = True
            j = work.bound[i]
            if j >= 0 and ours[j]:
                plan.moving[j] = True
    count = 0
    for i in range(n):
        plan.place[i] = -1
        if plan.moving[i]:
            plan.movers[count], plan.place[i] = i, count
            count += 1
    return count


@kernel
def build(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    tuning: Tuning,
    work: Work,
    plan: Plan,
) -> int:
    """Linearise about the candidate commands; returns the number of rows, -1 when there are too many."""
    movers = plan.movers[:count]
    for m in range(count):
        hold(movers[m], plan.held, work)
    inputs_of(
        plan.commands,
        plan.kept_commands,
        movers,
        state,
        boats,
        tuning,
        work,
        plan.wanted_turn,
        plan.gain,
        plan.z_now,
        plan.z0,
    )
    return build_rows(
        movers,
        plan.place,
        state,
        ours,
        boats,
        fixed,
        tuning,
        work,
        plan.gain,
        plan.z_now[: 2 * count],
        plan.C[:, : 2 * count],
        plan.d,
        plan.kind,
        plan.label,
    )


@kernel
def add_slack(count: int, rows: int, plan: Plan) -> None:
    """Give boat rows and fixed-thing rows one slack input each (the last two columns), limits none."""
    n = 2 * count
    for r in range(rows):
        for s in range(2):
            plan.C[r, n + s] = 0.0
        if plan.kind[r] != BOX_ROW:
            plan.C[r, n + plan.kind[r]] = 1.0 / math.sqrt(SLACK_COST[plan.kind[r]])
    plan.z0[n], plan.z0[n + 1] = 0.0, 0.0


@kernel
def take_answer(z: Array, count: int, state: Array, boats: Boats, tuning: Tuning, plan: Plan) -> bool:
    """Turn scaled inputs into the commands whose autopilot yields them; False when any of them is not finite.

    A boat whose inputs are unchanged keeps its wanted command, bit for bit.
    """
    root = math.sqrt(tuning.speed_weight)
    for m in range(2 * count):
        if not math.isfinite(z[m]):
            return False
    for m in range(count):
        i = plan.movers[m]
        wanted = plan.kept_commands[i]
        same_speed = abs(z[2 * m + 1] - plan.z0[2 * m + 1]) <= SAME
        if same_speed and abs(z[2 * m] - plan.z0[2 * m]) <= SAME:
            plan.commands[i] = wanted
            continue
        speed = z[2 * m + 1] / root * boats.params[i, L.MAX_SPEED]
        speed = wanted[0] if same_speed else max(0.0, min(boats.params[i, L.MAX_SPEED], speed))
        plan.commands[i, 0] = speed
        plan.commands[i, 1] = command_for_turn(
            boats.params[i], state[i], speed, z[2 * m] * plan.gain[i, 2], tuning.dt_s
        )
    return True


@kernel
def check(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> bool:
    """Exact re-check of candidate commands: full model one step on, then the escapes the rows were about."""
    for m in range(count):
        predict(plan.movers[m], plan.commands, state, boats, tuning, work)
    return recheck(plan.moving, plan.held, state, ours, boats, fixed, tuning, memory, work)


@kernel
def worst_merit(ours: BoolArray, work: Work) -> float:
    """Least merit of any boat of ours."""
    worst = 2.0 * PAIR_SAFE
    for i in range(ours.shape[0]):
        if ours[i]:
            worst = min(worst, work.merit[i])
    return worst


@kernel
def unchanged(i: int, plan: Plan) -> bool:
    """Whether boat i's command is the wanted one, bit for bit."""
    return plan.commands[i, 0] == plan.kept_commands[i, 0] and plan.commands[i, 1] == plan.kept_commands[i, 1]


@kernel
def mark_answer(count: int, reason: int, plan: Plan) -> None:
    """Give the reason to the movers whose command changed."""
    for m in range(count):
        i = plan.movers[m]
        if not unchanged(i, plan):
            plan.reason[i] = reason


@kernel
def mark_relaxed(count: int, work: Work, plan: Plan) -> None:
    """Say of all movers that not everything could be kept, also of those whose wanted command is the best there is."""
    for m in range(count):
        i = plan.movers[m]
        if plan.reason[i] == PASSED or not unchanged(i, plan):
            plan.reason[i] = QP_RELAXED
        plan.slack_m[i] = max(0.0, -min(work.clear[i, MARGIN], work.fixed[i, MARGIN]))


@kernel
def first_move(i: int, state: Array, boats: Boats, tuning: Tuning, work: Work, plan: Plan) -> None:
    """Command of the first step of boat i's manoeuvre, through the autopilot's inverse."""
    side, togo, speed = work.plan[i, 0], work.plan[i, 1], work.plan[i, 2]
    if togo > 0.0:
        togo = min(togo, abs(side) * full_turn(boats.params[i], state[i], speed, tuning.dt_s))
    plan.commands[i, 0] = speed
    plan.commands[i, 1] = command_for_turn(boats.params[i], state[i], speed, math.copysign(togo, side), tuning.dt_s)


@kernel
def set_off(i: int, state: Array, boats: Boats, tuning: Tuning, work: Work, plan: Plan) -> None:
    """Make boat i's command and plan those of its escape; the program's answer is put aside."""
    plan.answer[i], plan.answer_held[i] = plan.commands[i], plan.held[i]
    first_move(i, state, boats, tuning, work, plan)
    side, togo = work.plan[i, 0], work.plan[i, 1]
    plan.held[i, 0], plan.held[i, 2] = side, work.plan[i, 2]
    plan.held[i, 1] = state[i, L.HEADING] + math.copysign(togo, side) if togo > 0.0 else np.nan


@kernel
def ladder(
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> None:
    """No checked answer of the program: the movers take the escape that keeps the worst margin largest.

    Escapes are searched from the present state, the one under way first. When even the best leaves somebody short
    (reason BEST_EFFORT) it is still carried out: avoidance does not switch itself off. A program's answer that
    leaves a better worst margin than any escape is kept (reason QP_RELAXED). When only fixed things are at stake and
    no escape does better by them than the program's answer or the wanted command, that one is sent.
    """
    before = worst_merit(ours, work)
    look = 1
    for m in range(count):
        i = plan.movers[m]
        work.target[i] = 0.0
        hold(i, plan.held, work)
        look = max(look, boats.look[i])
    run_opponents(look, ours, state, boats, tuning, work, work.ways)
    good = assign_plans(plan.commands, 0, True, plan.moving, state, ours, boats, fixed, plans, tuning, memory, work)
    run_opponents(1, ours, state, boats, tuning, work, work.ways)
    for m in range(count):
        set_off(plan.movers[m], state, boats, tuning, work, plan)
    check(count, state, ours, boats, fixed, tuning, memory, work, plan)
    after = worst_merit(ours, work)
    if not good and (before > after + CLEARLY or (before >= FIXED_LOST and before >= after - CLEARLY)):
        for m in range(count):
            i = plan.movers[m]
            plan.commands[i], plan.held[i] = plan.answer[i], plan.answer_held[i]
        check(count, state, ours, boats, fixed, tuning, memory, work, plan)
        mark_relaxed(count, work, plan)
        return
    for m in range(count):
        i = plan.movers[m]
        plan.reason[i] = ESCAPE if work.merit[i] >= FIXED_LOST else BEST_EFFORT
        plan.slack_m[i] = max(0.0, -work.clear[i, MARGIN])


@kernel
def commit(state: Array, ours: BoolArray, memory: Memory, work: Work, plan: Plan) -> None:
    """Keep every boat's manoeuvre for the next decision, as an absolute heading."""
    for i in range(ours.shape[0]):
        if not ours[i]:
            memory.kept[i] = False
            memory.escaping[i] = False
            continue
        memory.kept[i] = True
        memory.side[i] = work.plan[i, 0]
        memory.target_deg[i] = np.nan
        if work.plan[i, 1] > LEAST_TURN_DEG:
            memory.target_deg[i] = wrap_degrees(
                work.next_state[i, L.HEADING] + math.copysign(work.plan[i, 1], work.plan[i, 0])
            )
        memory.speed_mps[i] = work.plan[i, 2]
        memory.margin_m[i] = work.clear[i, MARGIN]
        memory.escaping[i] = plan.reason[i] == ESCAPE or plan.reason[i] == BEST_EFFORT


@kernel
def finish(
    safe: bool,
    count: int,
    state: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> None:
    """Name the reasons of a checked answer, or go down the ladder without one; then remember the escapes."""
    if safe:
        mark_answer(count, QP, plan)
    else:
        count = pick_movers(ours, work, plan)
        ladder(count, state, ours, boats, fixed, plans, tuning, memory, work, plan)
    commit(state, ours, memory, work, plan)


@kernel
def solve_compiled(count: int, rows: int, plan: Plan) -> bool:
    """Solve the program by projection; relaxed with slack when it has no solution. False when neither works."""
    n = 2 * count
    status = project(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n], plan.z[:n])
    if status == OPTIMAL:
        return True
    add_slack(count, rows, plan)
    n += 2
    return project(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n], plan.z[:n]) == OPTIMAL


@kernel
def decide_compiled(
    state: Array,
    wanted: Array,
    margin_m: Array,
    ours: BoolArray,
    boats: Boats,
    fixed: Fixed,
    plans: Array,
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> None:
    """The whole decision for one game; sent commands are in ``plan.commands``, reasons in ``plan.reason``."""
    safe = screen(state, wanted, margin_m, ours, boats, fixed, plans, tuning, memory, work, plan)
    count = 0
    for _ in range(0 if lost(ours, memory, work) else ROUNDS):
        if safe:
            break
        count = pick_movers(ours, work, plan)
        rows = build(count, state, ours, boats, fixed, tuning, work, plan)
        if rows < 0 or not solve_compiled(count, rows, plan):
            break
        if not take_answer(plan.z, count, state, boats, tuning, plan):
            break
        safe = check(count, state, ours, boats, fixed, tuning, memory, work, plan)
    finish(safe, count, state, ours, boats, fixed, plans, tuning, memory, work, plan)
