"""Scratch of one decision, overwritten every time."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .barriers.clearance import N_CLEARANCE
from .jit import Array, BoolArray, IntArray
from .platforms import layout as L
from .shared import share


class Work(NamedTuple):
    """Scratch of one decision (n boats), overwritten every time; row n of plan-like arrays is for trials.

    Attributes:
        wanted: (n, 2) wanted speed, m/s, and relative heading, deg, of the state that is decided about.
        error_m: (n,) bound on the error of each position in it, m.
        next_state: (n, N_STATE) predicted state after the candidate commands.
        command: (n, 2) the candidate command it is predicted for, speed m/s and relative heading deg.
        driven: (n, 4) what drives a boat whose way is foreseen, see `fleet.Fleet`.
        known: (n,) boats whose way is foreseen, in ``path``, see `barriers.foreseen`.
        row: (N_STATE,) state being run through a manoeuvre.
        plan: (n + 1, 3) side, turn to go deg, speed m/s.
        path: (n + 1, samples + 1, 2) positions along the plans, m; the ways of foreseen boats
            go as far as the longest plan.
        clear: (n + 1, N_CLEARANCE) worst clearance from boats.
        static: (n + 1, N_CLEARANCE) worst clearance from static constraints.
        out, spare, spare2: (N_CLEARANCE,).
        kept: (n,) what the plan held keeps, see `backup.rank.Rank`.
        worth_m: (n,) the other entry of its rank, m.
        threat_m: (n + 1,) margin against pursuing opponents alone, m.
        threats_m: (n + 1, n) the same against each, m; as far as they were looked at. Of one that is looked up without
            the run before.
        threat_by: (n + 1,) the opponent the least margin is from, -1 for none.
        table_m: (n + 1,) the least margin that tables tell where they are looked up first, m.
        pursuers_known: (n + 1,) whether the margins against opponents are all those of the path that is there.
        joint_m: (n + 1,) the least of these runs, m; `FAR` where none were made.
        fails: (n + 1,) whether one of these, or a margin against a pursuer, is below what must be kept.
        short: (n + 1,) whether the margin from some team-mate, or from one that holds its course, is below what must be
            kept.
        target: (n,) margin the boat must keep from boats that are not ours, m.
        mate_target_m: (n,) margin it must keep from those that are, m.
        threat_target_m: (n, n) margin it must keep against each pursuing opponent, m.
        joint_target_m: (n,) margin it must keep on runs of several opponents, m.
        static_target_m: (n,) margin it must keep from static constraints, m.
        bound: (n + 1,) neighbour the worst clearance comes from, -1 for none.
        near: (n, n) pairs that can matter.
        pursued: (n,) whether some opponent that may pursue the boat is near.
        reach_samples: (n,) path samples over which opponents may be followed, as the boat is now.
        breach: (n, n) pairs inside the separation.
        radius: (n, n) radius to keep, m.
        course: (n, 4) position one step on at present velocity, m, and heading as a unit vector.
        ways: (n, 3, 5) places opponents may be at when tables are looked into, see `barriers.value_function`.
        place: (n + 1, 5) place at which the boat itself is looked up.
        lookup: (n, n, 5) the place of each boat at which each opponent was looked up last, and the margin there, m.
        sealed: (n + 1,) whether a table alone made the plan fail, by the targets it was asked for.
        outnumbered: (n,) boats that several opponents can come near to, see `barriers.value_function`.
        ready: (n + 1, 3) what is noted of a plan's path, see `backup.paths`.
        pursuer: (5,) where a pursuer is at the end of its run: x, y, m, heading as a unit vector, speed m/s.
        searched: (n,) changes of plans there had been when a boat was last searched for, -1 for never.
        fear_s: (n,) time from now for which each opponent may do its worst before it holds its course, s.
        first_pursuer: (n,) opponent that is looked at first, see `barriers.opponents`.
        first_refuser: (n,) the same of the opponents that tables tell of, see `backup.laying`.
        first_manner: (n, n) how it is followed first.
        cost: (n,) what rating a manoeuvre of the boat costs, see `backup.effort`.
        spent: (1,) what this decision has cost until now.
        cut_short: (1,) whether its search was ended by its limit.
    """

    wanted: Array
    error_m: Array
    next_state: Array
    command: Array
    driven: Array
    known: BoolArray
    row: Array
    plan: Array
    path: Array
    clear: Array
    static: Array
    out: Array
    spare: Array
    spare2: Array
    kept: IntArray
    worth_m: Array
    threat_m: Array
    threats_m: Array
    threat_by: IntArray
    table_m: Array
    pursuers_known: BoolArray
    joint_m: Array
    fails: BoolArray
    short: BoolArray
    target: Array
    mate_target_m: Array
    threat_target_m: Array
    joint_target_m: Array
    static_target_m: Array
    bound: IntArray
    near: BoolArray
    pursued: BoolArray
    reach_samples: IntArray
    breach: BoolArray
    radius: Array
    course: Array
    ways: Array
    place: Array
    lookup: Array
    sealed: BoolArray
    outnumbered: BoolArray
    ready: Array
    pursuer: Array
    searched: IntArray
    fear_s: Array
    first_pursuer: IntArray
    first_refuser: IntArray
    first_manner: IntArray
    cost: Array
    spent: Array
    cut_short: BoolArray


def new_work(boats: int, samples: int) -> Work:
    """Scratch arrays for a scene of that many boats and path samples."""
    return share(
        Work(
            wanted=np.zeros((boats, 2)),
            error_m=np.zeros(boats),
            next_state=np.zeros((boats, L.N_STATE)),
            command=np.zeros((boats, 2)),
            driven=np.full((boats, 4), np.nan),
            known=np.zeros(boats, np.bool_),
            row=np.zeros(L.N_STATE),
            plan=np.zeros((boats + 1, 3)),
            path=np.zeros((boats + 1, samples + 1, 2)),
            clear=np.zeros((boats + 1, N_CLEARANCE)),
            static=np.zeros((boats + 1, N_CLEARANCE)),
            out=np.zeros(N_CLEARANCE),
            spare=np.zeros(N_CLEARANCE),
            spare2=np.zeros(N_CLEARANCE),
            kept=np.zeros(boats, np.int64),
            worth_m=np.zeros(boats),
            threat_m=np.zeros(boats + 1),
            threats_m=np.zeros((boats + 1, boats)),
            threat_by=np.full(boats + 1, -1, np.int64),
            table_m=np.zeros(boats + 1),
            pursuers_known=np.zeros(boats + 1, np.bool_),
            joint_m=np.zeros(boats + 1),
            fails=np.zeros(boats + 1, np.bool_),
            short=np.zeros(boats + 1, np.bool_),
            target=np.zeros(boats),
            mate_target_m=np.zeros(boats),
            threat_target_m=np.zeros((boats, boats)),
            joint_target_m=np.zeros(boats),
            static_target_m=np.zeros(boats),
            bound=np.full(boats + 1, -1, np.int64),
            near=np.zeros((boats, boats), np.bool_),
            pursued=np.zeros(boats, np.bool_),
            reach_samples=np.zeros(boats, np.int64),
            breach=np.zeros((boats, boats), np.bool_),
            radius=np.zeros((boats, boats)),
            course=np.zeros((boats, 4)),
            ways=np.zeros((boats, 3, 5)),
            place=np.zeros((boats + 1, 5)),
            lookup=np.full((boats, boats, 5), np.nan),
            sealed=np.zeros(boats + 1, np.bool_),
            outnumbered=np.zeros(boats, np.bool_),
            ready=np.full((boats + 1, 3), -1.0),
            pursuer=np.zeros(5),
            searched=np.full(boats, -1, np.int64),
            fear_s=np.full(boats, np.inf),
            first_pursuer=np.zeros(boats, np.int64),
            first_refuser=np.zeros(boats, np.int64),
            first_manner=np.zeros((boats, boats), np.int64),
            cost=np.zeros(boats),
            spent=np.zeros(1),
            cut_short=np.zeros(1, np.bool_),
        )
    )
