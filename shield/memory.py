"""What a decider remembers of its boats from one decision to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import Array, BoolArray, IntArray, copy_row, lean_kernel
from .shared import share


class Memory(NamedTuple):
    """Backup manoeuvre each boat holds between decisions (n boats).

    Attributes:
        has_backup: whether the boat has one.
        side: 1 clockwise, -1 the other way.
        target_deg: heading it ends on, deg clockwise from north; NaN when there is no turn left to make.
        speed_mps: speed it commands.
        margin_m: margin verified at the last decision.
        threat_m: (n, n) the same against each pursuing opponent, or the least of these for all, see `flow.commit`.
        joint_m: of boats that look opponents up, the least on runs of several, 0 where there were none.
        static_m: the margin from static constraints, 0 where it was not looked at.
        backing_up: whether the boat was carrying it out at the last decision.
        dwell_s: how long it still carries on with it whatever is wanted, s.
        pressed_s: how long a team-mate alongside has kept the boat from turning where it wants, or how long it has
            given way to it, see `right_of_way`.
        pressed_deg: heading it had when that began.
        free_s: time since it was last kept from it, s.
        blocked_by: that boat, -1 for none.
        gives_way: side to which the boat turns to give way to it, as in ``side``; 0: it does not.
    """

    has_backup: BoolArray
    side: Array
    target_deg: Array
    speed_mps: Array
    margin_m: Array
    threat_m: Array
    joint_m: Array
    static_m: Array
    backing_up: BoolArray
    dwell_s: Array
    pressed_s: Array
    pressed_deg: Array
    free_s: Array
    blocked_by: IntArray
    gives_way: Array


def new_memory(*shape: int) -> Memory:
    """Memory of boats that hold no manoeuvre yet; ``shape`` is (n,) or (deciders, n)."""
    return share(
        Memory(
            has_backup=np.zeros(shape, np.bool_),
            side=np.ones(shape),
            target_deg=np.zeros(shape),
            speed_mps=np.zeros(shape),
            margin_m=np.zeros(shape),
            threat_m=np.zeros((*shape, shape[-1])),
            joint_m=np.zeros(shape),
            static_m=np.zeros(shape),
            backing_up=np.zeros(shape, np.bool_),
            dwell_s=np.zeros(shape),
            pressed_s=np.zeros(shape),
            pressed_deg=np.zeros(shape),
            free_s=np.zeros(shape),
            blocked_by=np.full(shape, -1, np.int64),
            gives_way=np.zeros(shape),
        )
    )


def part_of(memory: Memory, which: int) -> Memory:
    """The memory of one of many deciders: views, not copies."""
    return Memory(*(values[which] for values in memory))


@lean_kernel
def take_memory(all_memory: Memory, which: int, own: Memory) -> None:
    """Copy the memory of one of many deciders."""
    for i in range(own.side.shape[0]):
        own.has_backup[i] = all_memory.has_backup[which, i]
        own.side[i] = all_memory.side[which, i]
        own.target_deg[i] = all_memory.target_deg[which, i]
        own.speed_mps[i] = all_memory.speed_mps[which, i]
        own.margin_m[i] = all_memory.margin_m[which, i]
        own.joint_m[i] = all_memory.joint_m[which, i]
        own.static_m[i] = all_memory.static_m[which, i]
        own.backing_up[i] = all_memory.backing_up[which, i]
        own.dwell_s[i] = all_memory.dwell_s[which, i]
        own.pressed_s[i] = all_memory.pressed_s[which, i]
        own.pressed_deg[i] = all_memory.pressed_deg[which, i]
        own.free_s[i] = all_memory.free_s[which, i]
        own.blocked_by[i] = all_memory.blocked_by[which, i]
        own.gives_way[i] = all_memory.gives_way[which, i]
        copy_row(own.threat_m[i], all_memory.threat_m[which, i])


@lean_kernel
def put_memory(own: Memory, which: int, all_memory: Memory) -> None:
    """Copy the memory of one decider back to its place among many."""
    for i in range(own.side.shape[0]):
        all_memory.has_backup[which, i] = own.has_backup[i]
        all_memory.side[which, i] = own.side[i]
        all_memory.target_deg[which, i] = own.target_deg[i]
        all_memory.speed_mps[which, i] = own.speed_mps[i]
        all_memory.margin_m[which, i] = own.margin_m[i]
        all_memory.joint_m[which, i] = own.joint_m[i]
        all_memory.static_m[which, i] = own.static_m[i]
        all_memory.backing_up[which, i] = own.backing_up[i]
        all_memory.dwell_s[which, i] = own.dwell_s[i]
        all_memory.pressed_s[which, i] = own.pressed_s[i]
        all_memory.pressed_deg[which, i] = own.pressed_deg[i]
        all_memory.free_s[which, i] = own.free_s[i]
        all_memory.blocked_by[which, i] = own.blocked_by[i]
        all_memory.gives_way[which, i] = own.gives_way[i]
        copy_row(all_memory.threat_m[which, i], own.threat_m[i])
