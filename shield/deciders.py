"""Decisions one after another, compiled: of one team, of boats that decide each for itself, or of thousands of games.

All see a fleet of the same n boats and share one scene; each has its own memory and its own commands on their way.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .barriers.boats import reported_margin
from .barriers.foreseen import note_foreseen
from .barriers.static import STATIC
from .config import ShieldConfig
from .filter.flow import begin, begin_group, decide_scene, end, end_group
from .filter.least_change import ROUNDS, accept, linearise
from .filter.program import Program, Solver
from .jit import Array, BoolArray, IntArray, copy_row, kernel
from .memory import Memory, new_memory, put_memory, take_memory
from .plan import HELD, NOT_COVERED, PASSED, new_plan
from .platforms import layout as L
from .scene import Boats, Registered, Scene, Static, new_scene, path_samples
from .setup import tuning_of
from .shared import share, type_of
from .tracking.fears import note_fears, one_of_one_team, told_fear
from .tracking.tracks import fill_memory, queue_commands, run_on, run_on_commands, steps_of_delay, turn_round
from .work import new_work

MOST_ROWS = 3000
"""Where a program would have more rows than this, the backups are sent instead."""


class Asked(NamedTuple):
    """What B decisions on n boats are about.

    Attributes:
        state: (B, n, N_STATE) boats as they are seen; memory of autopilots may be NaN.
        wanted: (B, n, 2) wanted speeds, m/s, and headings, deg relative to the boats' own.
        ours: (B, n) boats to decide for.
        age_s: (B, n) age of each track, s.
        error_m: (B, n) bound on the error of each position when it was taken, m; at least that of the settings counts.
        visiting: (B, n) opponents on our side of a field, see `Fleet.visiting`.
        adversary_s: (B, n) time for which each opponent may do its worst, s; NaN: as the settings say.
        driven: (B, n, 4) what drives boats that something drives, see `Fleet.driven`.
    """

    state: Array
    wanted: Array
    ours: BoolArray
    age_s: Array
    error_m: Array
    visiting: BoolArray
    adversary_s: Array
    driven: Array


class Decided(NamedTuple):
    """What B decisions on n boats come to.

    Attributes:
        sent: (B, n, 2) commands as those wanted; bit for bit those where nothing is changed.
        changed: (B, n) whether any bit is.
        reason: (B, n) values of `decision.Reason`.
        certificate_m: (B, n) margins, m, infinite for boats that are not decided for.
        slack_m: (B, n) what is given up of them, m.
        bound: (B, n) what binds, see `Decisions.bound`.
        cut_short: (B, n) boats that are decided for by a search that was ended by its limit.
        feared_s: (B, n) how long each boat is feared as an opponent, s; NaN of those that are none.
    """

    sent: Array
    changed: BoolArray
    reason: IntArray
    certificate_m: Array
    slack_m: Array
    bound: IntArray
    cut_short: BoolArray
    feared_s: Array


def new_asked(decisions: int, boats: int) -> Asked:
    """Room for what so many decisions are about; fresh and exact tracks of which nothing is said."""
    shape = decisions, boats
    return share(
        Asked(
            state=np.zeros((*shape, L.N_STATE)),
            wanted=np.zeros((*shape, 2)),
            ours=np.zeros(shape, np.bool_),
            age_s=np.zeros(shape),
            error_m=np.zeros(shape),
            visiting=np.zeros(shape, np.bool_),
            adversary_s=np.full(shape, np.nan),
            driven=np.full((*shape, 4), np.nan),
        )
    )


def new_decided(decisions: int, boats: int) -> Decided:
    """Room for the answers of so many decisions."""
    shape = decisions, boats
    return share(
        Decided(
            sent=np.zeros((*shape, 2)),
            changed=np.zeros(shape, np.bool_),
            reason=np.zeros(shape, np.int64),
            certificate_m=np.full(shape, np.inf),
            slack_m=np.zeros(shape),
            bound=np.full(shape, -1),
            cut_short=np.zeros(shape, np.bool_),
            feared_s=np.full(shape, np.nan),
        )
    )


class Desk(NamedTuple):
    """All that B decisions are made with, as one `shared` tuple.

    Attributes:
        asked: what they are about.
        decided: what they come to.
        memory: (B, n) what is remembered from one to the next.
        pending: (B, steps of delay, n, 2) commands on their way, see `run_on_commands`.
        scene: where one after another is made.
    """

    asked: Asked
    decided: Decided
    memory: Memory
    pending: Array
    scene: Scene


@kernel
def take_up(b: int, desk: Desk) -> None:
    """Make decision b the scene's: boats at the moment its commands take effect, and what is remembered of them.

    Tracks are run on straight by their age and by the delay, own boats through the delay by the model under the
    commands on their way; what others may do meanwhile widens the errors of their positions.
    """
    asked, scene = desk.asked, desk.scene
    state, ours, boats, tuning, work = scene.state, scene.ours, scene.boats, scene.tuning, scene.work
    for i in range(ours.shape[0]):
        ours[i] = asked.ours[b, i]
        copy_row(state[i], asked.state[b, i])
    note_foreseen(asked.driven[b], scene)
    note_fears(asked.visiting[b], asked.adversary_s[b], scene)
    turn_round(state, ours)
    fill_memory(state, boats.params)
    run_on(state, asked.age_s[b])
    run_on_commands(state, ours, boats.params, desk.pending[b], tuning.dt_s)
    for i in range(ours.shape[0]):
        copy_row(work.wanted[i], asked.wanted[b, i])
        turned = state[i, L.HEADING] - asked.state[b, i, L.HEADING]  # until the command takes effect
        if turned != 0.0:
            work.wanted[i, 1] -= turned
        late_s = asked.age_s[b, i] + (0.0 if ours[i] else tuning.delay_s)
        error_m = max(asked.error_m[b, i], tuning.position_error_m)
        work.error_m[i] = error_m + tuning.track_error_mps * late_s
    take_memory(desk.memory, b, scene.memory)


@kernel
def hand_over(b: int, desk: Desk) -> None:
    """Write what the scene's decision, number b, has come to, and keep what is remembered of it."""
    asked, decided, scene = desk.asked, desk.decided, desk.scene
    state, work, plan = scene.state, scene.work, scene.plan
    put_memory(scene.memory, b, desk.memory)
    mate = one_of_one_team(scene)
    for i in range(state.shape[0]):
        copy_row(decided.sent[b, i], asked.wanted[b, i])
        reason = plan.reason[i]
        bound = -1 if reason == NOT_COVERED else work.bound[i]
        passed = reason in (PASSED, NOT_COVERED)
        same = plan.commands[i, 0] == work.wanted[i, 0] and plan.commands[i, 1] == work.wanted[i, 1]
        decided.changed[b, i] = not (passed or same)
        if decided.changed[b, i]:
            copy_row(decided.sent[b, i], plan.commands[i])
            turned = state[i, L.HEADING] - asked.state[b, i, L.HEADING]
            if turned != 0.0:
                decided.sent[b, i, 1] += turned
            if bound == -1 and reason != HELD:  # nothing else changes commands
                bound = STATIC
        decided.reason[b, i], decided.slack_m[b, i], decided.bound[b, i] = reason, plan.slack_m[i], bound
        decided.cut_short[b, i] = scene.ours[i] and work.cut_short[0]
        decided.feared_s[b, i] = told_fear(i, mate, scene)
        decided.certificate_m[b, i] = np.inf if reason == NOT_COVERED else reported_margin(i, state, work)
    if desk.pending.shape[1] > 0:
        queue_commands(desk.pending[b], state, plan.commands)


@kernel
def decide_all(desk: Desk) -> None:
    """All decisions, one after another."""
    for b in range(desk.asked.state.shape[0]):
        take_up(b, desk)
        decide_scene(desk.scene)
        hand_over(b, desk)


class Deciders:
    """B deciders of the same fleet.

    Args:
        config: settings.
        number: B.
        boats: constants of the n boats.
        registered: barriers of other people's that are kept.
        solver: what answers programs; None: the compiled one.

    Attributes:
        asked: what is to be decided about; written before every decision.
        decided: what has been; written anew by every decision.
        memory: what each remembers, (B, n).
        pending: (B, steps of delay, n, 2) its commands on their way, see `run_on_commands`.
    """

    def __init__(
        self, config: ShieldConfig, number: int, boats: Boats, registered: Registered, solver: Solver | None = None
    ) -> None:
        n = len(boats.team)
        self.asked, self.decided, self.memory = new_asked(number, n), new_decided(number, n), new_memory(number, n)
        self.pending = np.full((number, steps_of_delay(config), n, 2), np.nan)
        self._boats, self._registered, self._tuning = boats, registered, tuning_of(config)
        self._scratch = new_memory(n), new_work(n, path_samples(boats)), new_plan(n, min(n * (n + 6) + 2, MOST_ROWS))
        self._solver = solver
        self._desk: Any = None
        self._decide_all: Any = None

    def __getstate__(self) -> dict[str, Any]:
        """Without what is made anew at the next decision: addresses and machine code are of this process."""
        return self.__dict__ | {"_desk": None, "_decide_all": None}

    def forget(self, which: slice | BoolArray) -> None:
        """Forget the backups of some deciders, and the commands on their way."""
        self.memory.has_backup[which] = False
        self.memory.backing_up[which] = False
        self.pending[which] = np.nan

    def decide(self, static: Static) -> None:
        """Write into `decided` what is decided about `asked`, beside static constraints that are the same for all."""
        desk = self._desk
        if desk is None or desk.scene.static is not static:
            scene = new_scene(self._boats, (static, self._registered), self._tuning, *self._scratch)
            self._desk = desk = share(Desk(self.asked, self.decided, self.memory, self.pending, scene))
            made = getattr(decide_all, "compile", None)  # there is none where NUMBA_DISABLE_JIT is set
            self._decide_all = decide_all if made is None else made((type_of(desk),))
        if self._solver is None:
            self._decide_all(desk)  # past numba's look at what it is called with, 3 us
            return
        for b in range(len(self.asked.state)):
            take_up(b, desk)
            _decide_with(self._solver, desk.scene)
            hand_over(b, desk)


def _decide_with(solver: Solver, scene: Scene) -> None:
    """`decide_scene` with another solver of its programs."""
    plan = scene.plan
    for group in range(begin(scene)):
        count, safe = begin_group(group, scene), False
        for _ in range(ROUNDS if count > 0 else 0):
            rows, n = linearise(count, scene), 2 * count
            z = solver(Program(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n])) if rows >= 0 else None
            if z is None:
                break
            safe = accept(scene, z, count)
            if safe:
                break
        end_group(scene, safe, count)
    end(scene)
