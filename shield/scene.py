"""What compiled shield code sees: the fleet, its surroundings, the settings, and what is kept and noted of them.

Named tuples of arrays, so that the same functions serve one decision and thousands of games.
Indices run over all boats of the scene; ``controlled`` says for which the shield decides.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .jit import Array, BoolArray, IntArray
from .memory import Memory
from .plan import Plan
from .platforms import layout as L
from .shared import share
from .tables.lookup import Tables
from .work import Work


class Boats(NamedTuple):
    """Constants of the boats of a scene (n boats).

    Attributes:
        params: platform rows, (n, N_PARAM).
        team: team of each boat, (n,).
        fastest_mps: speed no boat of the kind exceeds over ground, (n,); the stored speed may lag behind it.
        granted_turn_dps: turn rate granted to each boat as an opponent at its top speed, (n,).
        granted_acc_mps2: acceleration granted to each boat as an opponent, (n,).
        regain_s: time each boat takes from rest to its top speed at its highest acceleration, (n,), s.
        granted_dec_mps2: rate at which each boat, as an opponent, loses speed in a turn, (n,).
        granted_loss: share of its top speed that each boat, as an opponent, loses in its granted turn, (n,).
        samples: path samples of each boat's horizon, (n,).
        pursuit_samples: path samples over which pursuing opponents are followed once thrust is full, (n,), at least
            ``samples``.
        chase_samples: path samples for which a pursuing opponent (column) no faster than the boat (row) is followed
            beyond that, (n, n).
        chased_samples: the most of them for each boat, (n,).
        ready_thrust: thrust, percent, from which each boat is taken to have all of it, (n,).
        thrust_samples: path samples until a boat has its thrust back at the latest, (n,): so much longer pursuers are
            followed at most.
        fade: factor of negative margins against pursuers per path sample, for boats that have their thrust, (n,).
        static_samples: samples over which static constraints are looked at, (n,).
        stride: model steps between path samples.
        sample_s: time between path samples, s.
        plans: (n, most, 3) backup manoeuvres each boat looks at, see `backup.families`; NaN beyond its own.
        n_plans: (n,) how many those are.
        decay: factor by which each boat's margin may shrink in one step; 0 lets it fall to 0 at once, (n,).
        cap_m: margins above this may shrink freely, (n,), m.
        dwell_s: least time each boat carries on with a backup from opponents, (n,), s.
        tables: value tables.
        table: table of each own boat (row) with each opponent (column), -1 for none, (n, n).
        table_margin_m: added to the radius where a table is looked into, m.
        table_steps: steps ahead at which each boat's backups are compared by table, 0 for boats without one, (n,).
        joint_decay: factor by which the margin on such runs may shrink in one step.
        joint_samples: path samples over which opponents of a boat that several come near to are run through before they
            are looked up.
        known_range_m: range, m, beyond which each table tells margins of their cap or more, for each of its cells of
            own speed, (tables, cells); infinite where it does so nowhere.
        known_radius_m: largest radius for which that holds, m.
        feared: whether some boat's table is about this boat, (n,).
    """

    params: Array
    team: IntArray
    fastest_mps: Array
    granted_turn_dps: Array
    granted_acc_mps2: Array
    regain_s: Array
    granted_dec_mps2: Array
    granted_loss: Array
    samples: IntArray
    pursuit_samples: IntArray
    chase_samples: IntArray
    chased_samples: IntArray
    ready_thrust: Array
    thrust_samples: IntArray
    fade: Array
    static_samples: IntArray
    stride: int
    sample_s: float
    plans: Array
    n_plans: IntArray
    decay: Array
    cap_m: Array
    dwell_s: Array
    tables: Tables
    table: IntArray
    table_margin_m: float
    table_steps: IntArray
    joint_decay: float
    joint_samples: int
    known_range_m: Array
    known_radius_m: float
    feared: BoolArray


class Static(NamedTuple):
    """Things that do not move, already widened by the distance to keep from them.

    Attributes:
        field: (xmin, ymin, xmax, ymax), m; infinite where there is no edge.
        keep_out: (k, 3) circles kept by rule: centre x, y and radius, m.
        circles: (c, 3) the same of obstacles.
        segments: (s, 4): ends x0, y0, x1, y1, m.
        segment_m: distance to keep from segments, m.
        side_m: distance from a segment within which it is not known on which side of it a boat is, m.
        current_mps: bound on the speed of a current whose direction is not known, m/s.
        line: (xmin, ymin, xmax, ymax) of the hard line that stops boats, m; infinite where none does.
        last_circles, last_segments: how many of the first circles and segments stop boats before them, whatever else
            is in their way.
        last_m: how much nearer than the distance to keep these do, m.
    """

    field: Array
    keep_out: Array
    circles: Array
    segments: Array
    segment_m: float
    side_m: float
    current_mps: float
    line: Array
    last_circles: int
    last_segments: int
    last_m: float


class Registered(NamedTuple):
    """Barriers of other people's that are kept, k of them, see `barriers.registry`; written before every decision.

    Attributes:
        address: (k,) where their functions are, in this process.
        values: (k, `MOST_VALUES`) the numbers they are given now, NaN beyond.
        size: (k,) how many those are; -1: they could not be had, and nothing is known of the barrier.
        faults: (k,) how often they gave no usable margin in this decision.
        off_m: how far off a boat may be, m, and how much a margin may fall short between two samples of a path.
        late_s: time until the moment that is decided for, s.
    """

    address: IntArray
    values: Array
    size: IntArray
    faults: IntArray
    off_m: float
    late_s: float


class Tuning(NamedTuple):
    """Scalar settings in the form compiled code takes them.

    Attributes:
        dt_s: step of decisions, s.
        model_s: step of the boat model, s; sample 0 of every path is one such step from now.
        moves: steps of the model in one of decisions, under one command.
        radius_m: separation radius with buffer, m.
        buffer_m: the buffer in it, m.
        tail_s: how long straight runs are continued beyond the horizon, s.
        margin_cap_m: margins above this are not looked at closely, m.
        speed_weight: cost of changing the commanded speed by top speed, full rudder to no rudder costing 1.
        mate_cap_m: margins from team-mates above this may shrink freely, m.
        static_decay: factor by which a margin from static constraints may shrink in one step.
        give_way_after_s: time a boat is kept from turning by another alongside before one of them gives way, s.
        feared_s: time for which an opponent may do its worst, s; 0: nobody is feared.
        visitor_s: the same of opponents on our side of a field, s.
        position_error_m: bound on the error of every position, m.
        delay_s: time from own commands to their effect, s.
        track_error_mps: how fast what is known of a position goes bad, m/s.
        search_limit: cost at which a decision searches no further, see `backup.effort`.
    """

    dt_s: float
    model_s: float
    moves: int
    radius_m: float
    buffer_m: float
    tail_s: float
    margin_cap_m: float
    speed_weight: float
    mate_cap_m: float
    static_decay: float
    give_way_after_s: float
    feared_s: float
    visitor_s: float
    position_error_m: float
    delay_s: float
    track_error_mps: float
    search_limit: float


class Scene(NamedTuple):
    """All that one decider works with, as one `shared` tuple of arrays and such tuples: functions are handed it whole.

    Attributes:
        state: (n, N_STATE) the boats' states that this decision is about.
        ours: (n,) boats that it decides for.
        boats: their constants.
        static: things that do not move.
        registered: barriers of other people's.
        tuning: the settings.
        memory: what is kept from one decision to the next.
        work: scratch of one decision.
        plan: its program, and what is sent.
    """

    state: Array
    ours: BoolArray
    boats: Boats
    static: Static
    registered: Registered
    tuning: Tuning
    memory: Memory
    work: Work
    plan: Plan


def new_scene(
    boats: Boats,
    around: tuple[Static, Registered],
    tuning: Tuning,
    memory: Memory,
    work: Work,
    plan: Plan,
) -> Scene:
    """A scene that nothing is to be decided about yet."""
    n = len(boats.team)
    return share(Scene(np.zeros((n, L.N_STATE)), np.zeros(n, np.bool_), boats, *around, tuning, memory, work, plan))


def path_samples(boats: Boats) -> int:
    """Path samples that the working memory of these boats must hold."""
    return int((boats.pursuit_samples + boats.thrust_samples + boats.chased_samples).max(initial=1))
