"""The one record that compiled code works on: inputs, results, memory, constants and scratch.

A scene serves B decisions, one after another. Arrays over all decisions have B as first dimension; all others belong to
the present decision. In arrays of n + 1 rows, row n is the manoeuvre on trial.
"""

from __future__ import annotations

from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from .jit import Array, BoolArray, IntArray, lean_kernel
from .platforms import layout as L
from .shared import share
from .tables.lookup import Tables

PASSED, LEAST_CHANGE, QP_RELAXED, BACKUP, BEST_EFFORT, HELD, NOT_COVERED, RIGHT_OF_WAY, LIMITED, STOPPED = range(10)
"""Values of `decision.Reason`."""

NO_LAST_RESORT, MUST_STOP, GO_ON = range(3)
"""What the hard line makes of a boat: nothing; a stop; its last manoeuvre, where not even a stop stays clear."""

BY_QP, BY_LINE_SEARCH = 1, 2
"""What found a least change; 0: none was found."""

LARGEST_COMMAND = 1e6
"""Speeds, m/s, and relative headings, deg, beyond this are not valid: their squares overflow in the model."""

OURS, NOMINAL_SPEED, NOMINAL_TURN, AGE_S, ERROR_M, VISITING, HORIZON_S = (L.N_STATE + k for k in range(7))
"""Columns of ``given`` after the state: whether the boat is decided for; its nominal command, m/s and deg relative to
its heading; age of its track, s; bound on its position error, m; `Fleet.visiting`; `Fleet.adversary_horizon_s`."""
DRIVEN, N_GIVEN = L.N_STATE + 7, L.N_STATE + 11
"""Columns from ``DRIVEN`` on: `Fleet.driven`."""

MARGIN_M, SLACK_M, ACTIVE, CUT_SHORT, ADVERSARY_HORIZON_S, SOLVER, N_REPORTED = range(7)
"""Columns of ``reported``: safety margin and slack, m; active constraint, see `Decisions`; whether the work budget
ended the search; how long the boat is adversarial, s (NaN: no opponent); what found a least change, see `BY_QP`.
"""

HAS_BACKUP, BACKUP_RUDDER, BACKUP_HEADING, BACKUP_SPEED, BACKUP_MARGIN, JOINT_MARGIN, STATIC_MARGIN = range(7)
"""Columns of ``memory``: whether the boat holds a backup; its side (1: clockwise), end heading, deg (NaN: no turn is
left), and speed, m/s; verified margins, m: from all boats, from several opponents rolled out, from static constraints.
"""
BACKING_UP, HOLD_S, DEADLOCK_S, DEADLOCK_DEG, FREE_S, BLOCKED_BY, GIVES_WAY, N_MEMORY = range(7, 15)
"""Whether the backup was carried out, and for how long it still is whatever the nominal command, s (below 0: no more).
Then, of `right_of_way`: for how long a teammate has kept the boat from turning, s; its heading when that began, deg;
time since it last happened, s; the teammate (-1: none); the side to which the boat gives way (0: it does not). From
``N_MEMORY`` on: the margin from each boat as an opponent, m."""


RUN_X, RUN_Y, RUN_EAST, RUN_NORTH, RUN_SPEED, RUN_TO_X, RUN_TO_Y, RUN_WORST, RUN_WEIGHT, N_RUN = range(10)
"""Columns of a pursuer's rollout: place, m; heading as a unit vector; speed, m/s; vector to the boat, m; worst margin
so far, m; weight of a margin below 0."""


class Boats(NamedTuple):
    """Constants of n boats."""

    params: Array  # (n, N_PARAM) platform rows
    team: IntArray  # (n,)
    fastest_mps: Array  # (n,) speed over ground that no boat of the kind exceeds; the stored speed may lag behind it
    granted_turn_dps: Array  # (n,) turn rate granted to each as an opponent at its top speed
    granted_acc_mps2: Array  # (n,) acceleration granted to each as an opponent
    regain_s: Array  # (n,) time from rest to top speed at the highest acceleration
    granted_dec_mps2: Array  # (n,) rate at which each, as an opponent, loses speed in a turn
    granted_loss: Array  # (n,) share of top speed that each, as an opponent, loses in its granted turn
    samples: IntArray  # (n,) path samples of the horizon
    longest_samples: int  # the most of them: every path is rolled out as far, for pairs of unlike boats
    pursuit_samples: IntArray  # (n,) path samples for which pursuers are followed once thrust is full; >= ``samples``
    chase_samples: IntArray  # (n, n) further samples for which a pursuer (column) no faster than the boat (row) is
    chased_samples: IntArray  # (n,) the most of them in each row
    full_thrust_percent: Array  # (n,) thrust, percent, that counts as full
    thrust_samples: IntArray  # (n,) path samples within which a boat regains its thrust
    fade: Array  # (n,) factor of negative margins against pursuers per path sample
    static_samples: IntArray  # (n,) samples until a half turn could be over
    stride: int  # model steps between path samples
    sample_s: float  # time between path samples, s
    manoeuvres: Array  # (n, most, 3) backup manoeuvres of each, see `backup.family`; NaN beyond its own
    n_manoeuvres: IntArray  # (n,) how many those are
    decay: Array  # (n,) factor by which a margin may shrink in one step; 0: it may fall to 0 at once
    cap_m: Array  # (n,) margins above this may shrink freely, m
    min_backup_hold_s: Array  # (n,) least time for which a backup from opponents is continued, s
    tables: Tables
    table: IntArray  # (n, n) table of each own boat (row) with each opponent (column), -1 for none
    table_margin_m: float  # added to the radius where a table is looked up, m
    table_steps: IntArray  # (n,) steps ahead at which backups are compared by table, 0 for boats without one
    joint_decay: float  # factor by which the margin from several opponents rolled out may shrink in one step
    joint_samples: int  # path samples over which several opponents are rolled out before they are looked up
    has_table: BoolArray  # (n,) whether some boat's table is about this boat


class Registered(NamedTuple):
    """The k registered barriers in force; written before every decision."""

    address: IntArray  # (k,) addresses of their functions in this process
    values: Array  # (k, MOST_VALUES) their present values, NaN beyond
    size: IntArray  # (k,) how many those are; -1: they are missing, and the barrier is unknown
    faults: IntArray  # (k,) how often they gave no usable margin in this decision
    uncertainty_m: float  # how far off a boat may be, and how much a margin may fall short between two samples, m
    late_s: float  # time until the commands take effect, s


MOST_VALUES = 64
"""Most values of one registered barrier."""


def new_registered(count: int = 0, uncertainty_m: float = 0.0, late_s: float = 0.0) -> Registered:
    """Return ``count`` barriers that are unknown so far."""
    values, size = np.full((count, MOST_VALUES), np.nan), np.full(count, -1)
    return share(Registered(np.zeros(count, np.int64), values, size, np.zeros(count, np.int64), uncertainty_m, late_s))


class Static(NamedTuple):
    """Static constraints, already widened by the clearance from them."""

    field: Array  # (xmin, ymin, xmax, ymax), m; infinite where there is no edge
    keep_out: Array  # (k, 3) keep-out circles: centre x, y and radius, m
    circles: Array  # (c, 3) the same of obstacles
    segments: Array  # (s, 4) ends x0, y0, x1, y1 of walls, m
    segment_m: float  # clearance from walls, m
    side_m: float  # distance from a wall within which a boat's side of it is unknown, m
    current_mps: float  # bound on the speed of a current of unknown direction, m/s
    line: Array  # (xmin, ymin, xmax, ymax) of the hard line that stops boats, m; infinite where none does
    last_circles: int  # number of leading circles, and
    last_segments: int  # of leading segments, before which boats are stopped whatever else is in their way
    last_m: float  # how much nearer than the clearance that happens, m
    registered: Registered


class Tuning(NamedTuple):
    """Scalar settings in the form compiled code takes them, see `ShieldConfig`."""

    dt_s: float  # step of decisions
    model_s: float  # step of the boat model; sample 0 of every path is one such step from now
    moves: int  # steps of the model in one of decisions, under one command
    radius_m: float  # separation radius with buffer
    buffer_m: float  # the buffer in it
    straight_horizon_s: float  # how long straight runs are continued beyond the horizon
    margin_cap_m: float  # margins above this are not computed exactly
    speed_weight: float  # cost of changing the speed by top speed, full rudder to no rudder costing 1
    teammate_margin_cap_m: float  # margins from teammates above this may shrink freely
    static_decay: float  # factor by which a margin from static constraints may shrink in one step
    deadlock_timeout_s: float  # time a boat is kept from turning before one of the two gives way
    adversary_horizon_s: float  # time for which an opponent is adversarial; 0: nobody is
    intruder_horizon_s: float  # the same for opponents on the own side of a field
    position_error_m: float  # bound on the error of every position
    delay_s: float  # time from own commands to their effect
    track_error_mps: float  # growth of a position error with the age of its track
    work_budget: float  # cost at which a decision searches no further, see `backup.assign`


class Scene(NamedTuple):
    """Everything that decisions work on, as one `shared` tuple; fields with a shape are allocated by `new_scene`."""

    boats: Boats
    static: Static
    tuning: Tuning
    # of all decisions
    given: Annotated[Array, "B", "n", N_GIVEN]
    sent: Annotated[Array, "B", "n", 2]  # filtered commands; the nominal ones' bits where unchanged
    changed: Annotated[BoolArray, "B", "n"]  # whether any bit is changed
    reasons: Annotated[IntArray, "B", "n"]
    reported: Annotated[Array, "B", "n", N_REPORTED]
    memories: Annotated[Array, "B", "n", "memory"]
    pending: Annotated[Array, "B", "delay", "n", 2]  # commands not yet in effect, see `tracks.roll_out_pending`
    # of this decision
    state: Annotated[Array, "n", L.N_STATE]  # boats at the moment the commands take effect
    ours: Annotated[BoolArray, "n"]  # boats decided for now; of one group while it is open
    memory: Annotated[Array, "n", "memory"]
    error_m: Annotated[Array, "n"]  # bound on the error of each position
    nominal: Annotated[Array, "n", 2]  # nominal commands, speed m/s and relative heading deg
    checked: Annotated[Array, "n", 2]  # those of the nominal check: others where a boat holds or gives way
    checked_turn: Annotated[Array, "n"]  # turn of this step under them, deg
    checked_reason: Annotated[IntArray, "n"]
    command: Annotated[Array, "n", 2]  # candidate commands
    next_state: Annotated[Array, "n", L.N_STATE]  # states one step after them
    stepped: Annotated[Array, "n", 2]  # the commands that led there
    reason: Annotated[IntArray, "n"]
    last_resort: Annotated[IntArray, "n"]  # what the hard line makes of each boat, see `filter.last_line`
    solver: Annotated[IntArray, "n"]  # what found the command, between nominal one and backup: `BY_QP` and the like
    slack_m: Annotated[Array, "n"]
    violated: Annotated[IntArray, "n"]  # constraint that the nominal command violates, as in ``active``; -1: none
    group: Annotated[IntArray, "n"]  # see `filter.nominal`
    moving: Annotated[BoolArray, "n"]  # boats whose commands are being changed
    movers: Annotated[IntArray, "n"]  # their list,
    mover_of: Annotated[IntArray, "n"]  # and each boat's place in it, -1: none
    held: Annotated[Array, "n", 3]  # manoeuvre continued from other states: side, end heading deg (NaN), m/s
    verified: Annotated[Array, "n", 5]  # results of verified backups, see `filter.blend`
    # neighbours
    neighbours: Annotated[BoolArray, "n", "n"]  # pairs that can matter
    inside_separation: Annotated[BoolArray, "n", "n"]  # pairs inside the separation
    radius: Annotated[Array, "n", "n"]  # required distance, m
    course: Annotated[Array, "n", 4]  # position one step ahead at present velocity, and heading as a unit vector
    pursued: Annotated[BoolArray, "n"]  # whether an opponent near the boat may pursue it
    several_pursuers: Annotated[BoolArray, "n"]  # whether several can come near to it, see `barriers.value_function`
    reach_samples: Annotated[IntArray, "n"]  # path samples over which opponents may be followed
    driven: Annotated[Array, "n", 4]
    predicted: Annotated[BoolArray, "n"]  # boats whose way is predicted by what drives them, in ``path``
    adversary_horizon_s: Annotated[Array, "n"]  # time from now for which each opponent is adversarial
    # required margins, m: of the nominal check, 0 while backups are assigned, then of `blend.rescore_backups`
    target: Annotated[Array, "n"]  # from boats that are not own
    teammate_target_m: Annotated[Array, "n"]  # from own boats
    pursuit_target_m: Annotated[Array, "n", "n"]  # from each pursuing opponent
    joint_target_m: Annotated[Array, "n"]  # from several opponents rolled out
    static_target_m: Annotated[Array, "n"]  # from static constraints
    # manoeuvres held; row n: on trial
    manoeuvre: Annotated[Array, "n+1", 3]  # side, turn to go deg, speed m/s
    path: Annotated[Array, "n+1", "samples", 2]  # positions along it, or along the way of predicted boats
    full_thrust: Annotated[Array, "n+1", 3]  # notes on the path, see `backup.paths.FULL_THRUST_SAMPLE`
    table_place: Annotated[Array, "n+1", 5]  # place at which the boat is looked up in tables
    clear: Annotated[Array, "n+1", 4]  # clearance row of boats
    static_clear: Annotated[Array, "n+1", 4]  # clearance row of static constraints,
    static_by: Annotated[IntArray, "n+1"]  # which of them it is from,
    static_known: Annotated[BoolArray, "n+1"]  # and whether these belong to the present path
    active: Annotated[IntArray, "n+1"]  # active constraint: a boat, -1 none, -2 and below static ones
    satisfied: Annotated[IntArray, "n"]  # level that it satisfies, see `backup.score`,
    score_m: Annotated[Array, "n"]  # and the other entry of its score
    violates_predicted: Annotated[BoolArray, "n+1"]  # whether the margin from one whose way is known falls short
    violates_pursuers: Annotated[BoolArray, "n+1"]  # the same against pursuers
    pursuit_margin_m: Annotated[Array, "n+1"]  # least margin against pursuers
    pursuer: Annotated[IntArray, "n+1"]  # the opponent it is from, -1: none
    pursuit_margins_m: Annotated[Array, "n+1", "n"]  # margin from each, as far as they were checked
    joint_m: Annotated[Array, "n+1"]  # least from several opponents rolled out
    table_m: Annotated[Array, "n+1"]  # least that tables give at the first lookup
    pursuers_known: Annotated[BoolArray, "n+1"]  # whether these are all, for the present path
    refused_by_table: Annotated[BoolArray, "n+1"]  # whether a table alone made the manoeuvre fail
    searched: Annotated[IntArray, "n"]  # changes of manoeuvres at the last search for a boat, -1: never
    # scratch
    row: Annotated[Array, L.N_STATE]
    stop_row: Annotated[Array, L.N_STATE]
    out: Annotated[Array, 4]
    scratch_clear: Annotated[Array, 4]
    opponent_places: Annotated[Array, "n", 3, 5]  # places at which an opponent may be when tables are looked up
    table_cache: Annotated[Array, "n", "n", 5]  # place of each boat at the last lookup of each opponent, and margin
    runs: Annotated[Array, 2, N_RUN]  # rollouts of a pursuer: straight for the boat, and leading it
    turns: Annotated[Array, 6, 2]  # cosine and sine of its hardest turns in as many samples and fewer
    first_pursuer: Annotated[IntArray, "n"]  # opponent that is checked first,
    first_rudder: Annotated[IntArray, "n", "n"]  # and its rudder in the first rollouts
    cost: Annotated[Array, "n"]  # cost of scoring a manoeuvre of the boat,
    spent: Annotated[Array, 1]  # cost of this decision so far,
    cut_short: Annotated[BoolArray, 1]  # and whether the work budget ended its search
    # quadratic program, two inputs a mover, see `filter.qp`
    gain: Annotated[Array, "n", 3]
    z_now: Annotated[Array, "2n"]
    z0: Annotated[Array, "2n"]
    z: Annotated[Array, "2n"]
    C: Annotated[Array, "rows", "2n"]
    d: Annotated[Array, "rows"]
    dual: Annotated[Array, "rows"]
    solver_address: Annotated[IntArray, 1]  # of the solver to call, see `filter.program`; 0: the compiled one


MOST_ROWS = 3000
"""If a QP would have more rows than this, the backups are sent instead."""

_KINDS: dict[Any, type] = {Array: np.float64, IntArray: np.int64, BoolArray: np.bool_}


@cache
def _arrays_of_a_scene() -> list[tuple[str, Any, tuple[int | str, ...]]]:
    """Return name, kind and shape of the fields of a scene that `new_scene` allocates."""
    hints = get_type_hints(Scene, include_extras=True).items()
    found = [(name, get_args(hint)) for name, hint in hints if get_origin(hint) is Annotated]
    return [(name, kind, tuple(shape)) for name, (kind, *shape) in found]


def new_scene(decisions: int, boats: Boats, static: Static, tuning: Tuning, delay: int) -> Scene:
    """Build a scene for a number of decisions.

    Args:
        decisions: how many it serves.
        boats: their constants.
        static: static constraints.
        tuning: the settings.
        delay: decisions whose commands are not yet in effect, at any time.
    """
    n = len(boats.team)
    sizes = {
        "B": decisions,
        "n": n,
        "n+1": n + 1,
        "2n": 2 * n,
        "samples": path_samples(boats) + 1,
        "delay": delay,
        "memory": N_MEMORY + n,
        "rows": min(n * (n + 6) + 2, MOST_ROWS),
    }
    fields: dict[str, Any] = {"boats": boats, "static": static, "tuning": tuning}
    for name, kind, shape in _arrays_of_a_scene():
        fields[name] = np.zeros([sizes[size] if isinstance(size, str) else size for size in shape], _KINDS[kind])
    fields["memories"], fields["pending"][:] = new_memory(decisions, n), np.nan
    return share(Scene(**fields))


def part_of(scene: Scene, static: Static, first: int, last: int, delay: int) -> Scene:
    """Return decisions ``first`` to ``last`` - 1 of a scene, sharing its arrays, with scratch for another thread."""
    part = new_scene(last - first, scene.boats, static, scene.tuning, delay)
    of_all = {name: getattr(scene, name)[first:last] for name, _, shape in _arrays_of_a_scene() if shape[0] == "B"}
    return share(part._replace(**of_all))


def new_memory(decisions: int, boats: int) -> Array:
    """Return memory, (B, n, N_MEMORY + n), of boats that hold no manoeuvre yet."""
    memories = np.zeros((decisions, boats, N_MEMORY + boats))
    memories[..., BACKUP_RUDDER], memories[..., BLOCKED_BY] = 1.0, -1.0
    return memories


def path_samples(boats: Boats) -> int:
    """Return the most samples that paths of these boats have."""
    pursued = (boats.pursuit_samples + boats.thrust_samples + boats.chased_samples).max(initial=1)
    return max(int(pursued), boats.longest_samples)


PATH_COST = 2.0
"""Cost of rolling out a path. The unit is the clearance of one path from one boat that holds its course, about a
microsecond. Work is counted, not seconds, so that the same inputs give the same bits on any machine."""
PURSUER_COST = 5.0
"""Cost of rolling out an opponent as a pursuer, in all variants, or of looking it up."""
ROW_COST = 0.02
"""Cost of the QP for each of its rows and boats."""


@lean_kernel
def all_spent(scene: Scene) -> bool:
    """Return whether the work budget is used up; if so, note that the decision is cut short.

    Every boat then keeps the best manoeuvre found so far, at first the one held since the last decision. The commands
    pass the same exact check as always.
    """
    if scene.spent[0] <= scene.tuning.work_budget:
        return False
    scene.cut_short[0] = True
    return True


@lean_kernel
def unchanged(i: int, scene: Scene) -> bool:
    """Return whether boat i's command is the nominal one, bit for bit."""
    return scene.command[i, 0] == scene.checked[i, 0] and scene.command[i, 1] == scene.checked[i, 1]
