"""What a decider remembers of its boats from one decision to the next."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import Array, BoolArray, IntArray, kernel
from .shared import share


class Memory(NamedTuple):
    """Backup manoeuvre each boat holds between decisions (n boats).

    Attributes:
        kept: whether the boat has one.
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

    kept: BoolArray
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
    """Memory of boats that hold no manoeuvre yet; ``shape`` is (n,) or (games, n)."""
    return share(
        Memory(
            kept=np.zeros(shape, np.bool_),
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


@kernel
def take_memory(games: Memory, game: int, own: Memory) -> None:
    """Copy the memory of one of many games."""
    own.kept[:] = games.kept[game]
    own.side[:] = games.side[game]
    own.target_deg[:] = games.target_deg[game]
    own.speed_mps[:] = games.speed_mps[game]
    own.margin_m[:] = games.margin_m[game]
    own.threat_m[:] = games.threat_m[game]
    own.joint_m[:] = games.joint_m[game]
    own.static_m[:] = games.static_m[game]
    own.backing_up[:] = games.backing_up[game]
    own.dwell_s[:] = games.dwell_s[game]
    own.pressed_s[:] = games.pressed_s[game]
    own.pressed_deg[:] = games.pressed_deg[game]
    own.free_s[:] = games.free_s[game]
    own.blocked_by[:] = games.blocked_by[game]
    own.gives_way[:] = games.gives_way[game]


@kernel
def put_memory(own: Memory, game: int, games: Memory) -> None:
    """Copy the memory of one game back to its place among many."""
    games.kept[game] = own.kept
    games.side[game] = own.side
    games.target_deg[game] = own.target_deg
    games.speed_mps[game] = own.speed_mps
    games.margin_m[game] = own.margin_m
    games.threat_m[game] = own.threat_m
    games.joint_m[game] = own.joint_m
    games.static_m[game] = own.static_m
    games.backing_up[game] = own.backing_up
    games.dwell_s[game] = own.dwell_s
    games.pressed_s[game] = own.pressed_s
    games.pressed_deg[game] = own.pressed_deg
    games.free_s[game] = own.free_s
    games.blocked_by[game] = own.blocked_by
    games.gives_way[game] = own.gives_way
