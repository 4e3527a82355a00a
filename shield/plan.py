"""`Plan`: the arrays of one decision's quadratic program, and the codes of why a command is what it is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import Array, BoolArray, IntArray, lean_kernel
from .shared import share

PASSED, QP, QP_RELAXED, BACKUP, BEST_EFFORT, HELD, NOT_COVERED, RIGHT_OF_WAY, LIMITED, STOPPED = range(10)

LARGEST_COMMAND = 1e6
"""Speeds, m/s, and relative headings, deg, beyond this are no commands: the model's squares of them overflow."""


class Plan(NamedTuple):
    """Arrays of the quadratic program of one decision (n boats, at most ``rows`` rows).

    ``held`` is the manoeuvre of each boat that is gone on with from other states than it was found in: side, heading it
    ends on, deg (NaN: no turn), and speed, m/s, see `assign.hold`. ``cause`` is what a boat's wanted command is short
    of, as in ``Work.bound``, -1 for nothing. ``verified`` is what the backups come to: of
    each boat the turn of this step, deg, the command, and the rank, see `filter.verified`. ``screened`` are the
    commands that screening looked at, wanted ones but for boats that hold or give way, ``screened_reason`` is
    ``reason`` as it left it. ``group`` says of which group each boat is, see `filter.groups`.
    """

    commands: Array
    screened: Array
    wanted_turn: Array
    held: Array
    cause: IntArray
    verified: Array
    movers: IntArray
    place: IntArray
    moving: BoolArray
    gain: Array
    z_now: Array
    z0: Array
    z: Array
    C: Array
    d: Array
    label: IntArray
    slack_m: Array
    reason: IntArray
    screened_reason: IntArray
    group: IntArray


def new_plan(boats: int, rows: int) -> Plan:
    """Program arrays for a scene of that many boats and rows."""
    return share(
        Plan(
            commands=np.zeros((boats, 2)),
            screened=np.zeros((boats, 2)),
            wanted_turn=np.zeros(boats),
            held=np.zeros((boats, 3)),
            cause=np.full(boats, -1, np.int64),
            verified=np.zeros((boats, 5)),
            movers=np.zeros(boats, np.int64),
            place=np.full(boats, -1, np.int64),
            moving=np.zeros(boats, np.bool_),
            gain=np.zeros((boats, 3)),
            z_now=np.zeros(2 * boats),
            z0=np.zeros(2 * boats),
            z=np.zeros(2 * boats),
            C=np.zeros((rows, 2 * boats)),
            d=np.zeros(rows),
            label=np.zeros((rows, 2), np.int64),
            slack_m=np.zeros(boats),
            reason=np.zeros(boats, np.int64),
            screened_reason=np.zeros(boats, np.int64),
            group=np.zeros(boats, np.int64),
        )
    )


@lean_kernel
def unchanged(i: int, plan: Plan) -> bool:
    """Whether boat i's command is the wanted one, bit for bit."""
    return plan.commands[i, 0] == plan.screened[i, 0] and plan.commands[i, 1] == plan.screened[i, 1]
