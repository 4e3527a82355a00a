"""What compiled shield code sees: the fleet, its surroundings, the settings, and working memory.

Named tuples of arrays, so that the same functions serve one decision and thousands of games.
Indices run over all boats of the scene; ``controlled`` says for which the shield decides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .certificates.clearance import N_CLEARANCE
from .jit import Array, BoolArray, IntArray, kernel
from .platforms import layout as L
from .shared import share
from .tables.lookup import Tables


class Boats(NamedTuple):
    """Constants of the boats of a scene (n boats).

    Attributes:
        params: platform rows, (n, N_PARAM).
        team: team of each boat, (n,).
        fastest_mps: speed no boat of the kind exceeds over ground, (n,); the stored speed may lag behind it.
        granted_turn_dps: turn rate granted to each boat as an opponent at its top speed, (n,).
        granted_acc_mps2: acceleration granted to each boat as an opponent, (n,).
        granted_dec_mps2: rate at which each boat, as an opponent, loses speed in a turn, (n,).
        granted_loss: share of its top speed that each boat, as an opponent, loses in its granted turn, (n,).
        samples: path samples of each boat's horizon, (n,).
        hunt_samples: path samples over which hunting opponents are followed once thrust is full, (n,), at least
            ``samples``.
        ready_thrust: thrust, percent, from which each boat is taken to have all of it, (n,).
        thrust_samples: path samples until a boat has its thrust back at the latest, (n,): so much longer hunters are
            followed at most.
        fade: factor of negative margins against hunters per path sample, for boats that have their thrust, (n,).
        static_samples: samples over which fixed things are looked at, (n,).
        stride: model steps between path samples.
        sample_s: time between path samples, s.
        plans: escape manoeuvres each boat looks at, the first so many of the family, (n,).
        decay: factor by which each boat's margin may shrink in one step; 0 lets it fall to 0 at once, (n,).
        cap_m: margins above this may shrink freely, (n,), m.
        tables: value tables.
        table: table of each own boat (row) with each opponent (column), -1 for none, (n, n).
        table_margin_m: added to the radius where a table is looked into, m.
        look: steps ahead at which each boat's escapes are compared by table, 0 for boats without one, (n,).
        joint_look: the same for boats that several opponents come near to.
        feared: whether some boat's table is about this boat, (n,).
    """

    params: Array
    team: IntArray
    fastest_mps: Array
    granted_turn_dps: Array
    granted_acc_mps2: Array
    granted_dec_mps2: Array
    granted_loss: Array
    samples: IntArray
    hunt_samples: IntArray
    ready_thrust: Array
    thrust_samples: IntArray
    fade: Array
    static_samples: IntArray
    stride: int
    sample_s: float
    plans: IntArray
    decay: Array
    cap_m: Array
    tables: Tables
    table: IntArray
    table_margin_m: float
    look: IntArray
    joint_look: int
    feared: BoolArray


class Fixed(NamedTuple):
    """Things that do not move, already widened by the distance to keep from them.

    Attributes:
        field: (xmin, ymin, xmax, ymax), m; infinite where there is no edge.
        keep_out: (k, 3) circles kept by rule: centre x, y and radius, m.
        circles: (c, 3) the same of obstacles.
        segments: (s, 4): ends x0, y0, x1, y1, m.
        segment_m: distance to keep from segments, m.
        side_m: distance from a segment within which it is not known on which side of it a boat is, m.
        current_mps: bound on the speed of a current whose direction is not known, m/s.
    """

    field: Array
    keep_out: Array
    circles: Array
    segments: Array
    segment_m: float
    side_m: float
    current_mps: float


class Tuning(NamedTuple):
    """Scalar settings in the form compiled code takes them.

    Attributes:
        dt_s: step of decision and model, s.
        radius_m: separation radius with buffer, m.
        buffer_m: the buffer in it, m.
        tail_s: how long straight runs are continued beyond the horizon, s.
        hysteresis_m: margin by which another manoeuvre must be better to replace the one under way, m.
        margin_cap_m: margins above this are not looked at closely, m.
        speed_weight: cost of changing the commanded speed by top speed, full rudder to no rudder costing 1.
        fixed_decay: factor by which a margin from fixed things may shrink in one step.
        give_way_after_s: time a boat is kept from turning by a team-mate alongside before one of them gives way, s.
    """

    dt_s: float
    radius_m: float
    buffer_m: float
    tail_s: float
    hysteresis_m: float
    margin_cap_m: float
    speed_weight: float
    fixed_decay: float
    give_way_after_s: float


class Memory(NamedTuple):
    """Escape manoeuvre each boat holds between decisions (n boats).

    Attributes:
        kept: whether the boat has one.
        side: 1 clockwise, -1 the other way.
        target_deg: heading it ends on, deg clockwise from north; NaN when there is no turn left to make.
        speed_mps: speed it commands.
        margin_m: margin verified at the last decision.
        threat_m: (n, n) the same against each hunting opponent, or the least of these for all, see `flow.commit`.
        fixed_m: the same from fixed things, 0 where it was not looked at.
        escaping: whether the boat was carrying it out at the last decision.
        pressed_s: how long a team-mate alongside has kept the boat from turning where it wants, or how long it has
            given way to it, see `right_of_way`.
        pressed_deg: heading it had when that began.
        free_s: time since it was last kept from it, s.
        blocked_by: that team-mate, -1 for none.
        gives_way: side to which the boat turns to give way to it, as in ``side``; 0: it does not.
    """

    kept: BoolArray
    side: Array
    target_deg: Array
    speed_mps: Array
    margin_m: Array
    threat_m: Array
    fixed_m: Array
    escaping: BoolArray
    pressed_s: Array
    pressed_deg: Array
    free_s: Array
    blocked_by: IntArray
    gives_way: Array


class Work(NamedTuple):
    """Scratch of one decision (n boats), overwritten every time; row n of plan-like arrays is for trials.

    Attributes:
        next_state: (n, N_STATE) predicted state after the candidate commands.
        row: (N_STATE,) state being run through a manoeuvre.
        plan: (n + 1, 3) side, turn to go deg, speed m/s.
        path: (n + 1, samples + 1, 2) positions along the plans, m.
        clear: (n + 1, N_CLEARANCE) worst clearance from boats.
        fixed: (n + 1, N_CLEARANCE) worst clearance from fixed things.
        out, spare, spare2: (N_CLEARANCE,).
        merit: (n,) merit of the plan held.
        threat_m: (n + 1,) margin against hunting opponents alone, m.
        threats_m: (n + 1, n) the same against each, m; as far as they were looked at.
        fails: (n + 1,) whether one of these is below what must be kept.
        target: (n,) margin the boat must keep, m.
        threat_target_m: (n, n) margin it must keep against each hunting opponent, m.
        fixed_target_m: (n,) margin it must keep from fixed things, m.
        bound: (n + 1,) neighbour the worst clearance comes from, -1 for none.
        near: (n, n) pairs that can matter.
        hunted: (n,) whether some opponent that may hunt the boat is near.
        reach_samples: (n,) path samples over which opponents may be followed, as the boat is now.
        breach: (n, n) pairs inside the separation.
        radius: (n, n) radius to keep, m.
        course: (n, 4) position one step on at present velocity, m, and heading as a unit vector.
        ways: (n, 3, 5) places opponents may be at when tables are looked into, see `certificates.values`.
        place: (n + 1, 5) place at which the boat itself is looked up.
        sealed: (n + 1,) whether a table alone made the plan fail.
        beset: (n,) boats that several opponents can come near to, see `certificates.values`.
        ready: (n + 1, 4) what is noted of a plan's path, see `certificates.paths`.
        decided: (n + 1,) sample at which the merit of a plan that fails was decided; infinite where it hangs on more.
        hunter: (5,) where a hunter is at the end of its run: x, y, m, heading as a unit vector, speed m/s.
        later: (n + 1, 5) place at which such a boat is looked up.
        ways_later: (n, 3, 5) places opponents may be at by then.
        nobody: (n,) False.
        searched: (n,) changes of plans there had been when a boat was last searched for, -1 for never.
        first_hunter: (n,) opponent that is looked at first, see `certificates.hunters`.
        first_refuser: (n,) the same of the opponents that tables tell of, see `certificates.laying`.
        first_manner: (n, n) how it is followed first.
    """

    next_state: Array
    row: Array
    plan: Array
    path: Array
    clear: Array
    fixed: Array
    out: Array
    spare: Array
    spare2: Array
    merit: Array
    threat_m: Array
    threats_m: Array
    fails: BoolArray
    target: Array
    threat_target_m: Array
    fixed_target_m: Array
    bound: IntArray
    near: BoolArray
    hunted: BoolArray
    reach_samples: IntArray
    breach: BoolArray
    radius: Array
    course: Array
    ways: Array
    place: Array
    sealed: BoolArray
    beset: BoolArray
    ready: Array
    decided: Array
    hunter: Array
    later: Array
    ways_later: Array
    nobody: BoolArray
    searched: IntArray
    first_hunter: IntArray
    first_refuser: IntArray
    first_manner: IntArray


def path_samples(boats: Boats) -> int:
    """Path samples that the working memory of these boats must hold."""
    return int((boats.hunt_samples + boats.thrust_samples).max(initial=1))


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
            fixed_m=np.zeros(shape),
            escaping=np.zeros(shape, np.bool_),
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
    own.fixed_m[:] = games.fixed_m[game]
    own.escaping[:] = games.escaping[game]
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
    games.fixed_m[game] = own.fixed_m
    games.escaping[game] = own.escaping
    games.pressed_s[game] = own.pressed_s
    games.pressed_deg[game] = own.pressed_deg
    games.free_s[game] = own.free_s
    games.blocked_by[game] = own.blocked_by
    games.gives_way[game] = own.gives_way


def new_work(boats: int, samples: int) -> Work:
    """Scratch arrays for a scene of that many boats and path samples."""
    return share(
        Work(
            next_state=np.zeros((boats, L.N_STATE)),
            row=np.zeros(L.N_STATE),
            plan=np.zeros((boats + 1, 3)),
            path=np.zeros((boats + 1, samples + 1, 2)),
            clear=np.zeros((boats + 1, N_CLEARANCE)),
            fixed=np.zeros((boats + 1, N_CLEARANCE)),
            out=np.zeros(N_CLEARANCE),
            spare=np.zeros(N_CLEARANCE),
            spare2=np.zeros(N_CLEARANCE),
            merit=np.zeros(boats),
            threat_m=np.zeros(boats + 1),
            threats_m=np.zeros((boats + 1, boats)),
            fails=np.zeros(boats + 1, np.bool_),
            target=np.zeros(boats),
            threat_target_m=np.zeros((boats, boats)),
            fixed_target_m=np.zeros(boats),
            bound=np.full(boats + 1, -1, np.int64),
            near=np.zeros((boats, boats), np.bool_),
            hunted=np.zeros(boats, np.bool_),
            reach_samples=np.zeros(boats, np.int64),
            breach=np.zeros((boats, boats), np.bool_),
            radius=np.zeros((boats, boats)),
            course=np.zeros((boats, 4)),
            ways=np.zeros((boats, 3, 5)),
            place=np.zeros((boats + 1, 5)),
            sealed=np.zeros(boats + 1, np.bool_),
            beset=np.zeros(boats, np.bool_),
            ready=np.full((boats + 1, 4), -1.0),
            decided=np.full(boats + 1, np.inf),
            hunter=np.zeros(5),
            later=np.zeros((boats + 1, 5)),
            ways_later=np.zeros((boats, 3, 5)),
            nobody=np.zeros(boats, np.bool_),
            searched=np.full(boats, -1, np.int64),
            first_hunter=np.zeros(boats, np.int64),
            first_refuser=np.zeros(boats, np.int64),
            first_manner=np.zeros((boats, boats), np.int64),
        )
    )
