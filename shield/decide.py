"""One control step, compiled: for one team, for boats that decide each for itself, or for thousands of games.

The step checks the nominal commands (`filter.nominal`). Where one fails, it does this for each group of boats that can
meet: find backups (`filter.backup_switch`), solve the QP for the least change (`filter.qp`), blend the remaining
backups with the nominal commands (`filter.blend`). The hard line comes last (`filter.last_line`). Then the step stores
what the next one needs.
"""

from __future__ import annotations

import math
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

import numpy as np

from . import workspace as W
from .backup.assign import note_manoeuvre
from .backup.score import CLEAR_OF_ALL, CLEAR_OF_BOATS, CLEAR_OF_OBSTACLES
from .barriers.boats import reported_margin
from .barriers.clearance import MARGIN
from .barriers.neighbours import note_predicted
from .barriers.registered import unknown_at
from .barriers.static import STATIC, about
from .config import ShieldConfig
from .filter.backup_switch import back_up
from .filter.blend import any_may_be_blended, blend, rescore_backups
from .filter.last_line import keep_last_line, note_last_resorts
from .filter.nominal import check_nominal, close_groups, make_groups, open_group
from .filter.program import Solver, SolverCall
from .filter.qp import ROUNDS, accept, among_mates, begin_program, end_program, linearise, solve
from .filter.right_of_way import forget_deadlock, note_deadlock
from .jit import Array, BoolArray, copy_row, kernel, lean_kernel
from .model import tuning_of
from .platforms import layout as L
from .platforms.usv import wrap_degrees
from .shared import share, type_of
from .tracks import astern_as_turned_ahead, extrapolate, fill_memory, queue_commands, roll_out_pending, steps_of_delay
from .workspace import Boats, Scene, Static, all_spent, new_scene, part_of, unchanged

ROUNDING_S = 1e-9
"""Times this short are none: what is left of a sum of steps."""

TINY_MPS = 1e-9
"""A speed this little below 0 is 0: the rounding of a boat at rest."""

HOLD_OVER = -1.0
"""Time left, s, of a hold that is over while the boat is still on its backup."""

LEAST_TURN_DEG = 1e-3
"""Turns to go below this are made: what is remembered must not hang on the last bit of a heading."""


@lean_kernel
def _note_adversary_horizons(given: Array, scene: Scene) -> None:
    """Note for how long each boat is adversarial: as given, or by the settings where that is NaN."""
    tuning = scene.tuning
    for i in range(given.shape[0]):
        time_s = tuning.intruder_horizon_s if given[i, W.VISITING] != 0.0 else tuning.adversary_horizon_s
        if not math.isnan(given[i, W.HORIZON_S]):
            time_s = given[i, W.HORIZON_S]
        scene.adversary_horizon_s[i] = time_s if tuning.adversary_horizon_s > 0.0 else 0.0


@lean_kernel
def _one_of_one_team(scene: Scene) -> int:
    """Return a boat that is decided for if all of these are of one team, else -1."""
    team, found = scene.boats.team, -1
    for i in range(team.shape[0]):
        if scene.ours[i]:
            if found >= 0 and team[i] != team[found]:
                return -1
            found = i
    return found


@lean_kernel
def _reported_adversary_horizon(i: int, own: int, scene: Scene) -> float:
    """Return how long boat i is adversarial, s: 0 if its way is predicted, NaN if it is nobody's opponent."""
    team = scene.boats.team
    if scene.ours[i] or (own >= 0 and team[i] == team[own]):
        return np.nan
    return 0.0 if scene.predicted[i] else scene.adversary_horizon_s[i]


@kernel
def load_decision(b: int, scene: Scene) -> None:
    """Load decision b into the scene: boats at the moment its commands take effect, and what is remembered of them.

    Tracks are extrapolated straight on by their age and by the delay. Own boats are rolled out through the delay by
    the model, under the commands on their way. What others may do meanwhile widens their position errors.
    """
    given, state, ours, tuning = scene.given[b], scene.state, scene.ours, scene.tuning
    for i in range(ours.shape[0]):
        ours[i] = given[i, W.OURS] != 0.0
        copy_row(state[i], given[i, : L.N_STATE])
        scene.last_resort[i] = W.NO_LAST_RESORT
    note_predicted(given, scene)
    _note_adversary_horizons(given, scene)
    astern_as_turned_ahead(state, ours)
    fill_memory(state, scene.boats.params)
    extrapolate(state, given[:, W.AGE_S])
    roll_out_pending(state, ours, scene.boats.params, scene.pending[b], tuning.dt_s)
    for i in range(ours.shape[0]):
        copy_row(scene.nominal[i], given[i, W.NOMINAL_SPEED : W.NOMINAL_TURN + 1])
        turned = state[i, L.HEADING] - given[i, L.HEADING]  # until the command takes effect
        if turned != 0.0:
            scene.nominal[i, 1] -= turned
        late_s = given[i, W.AGE_S] + (0.0 if ours[i] else tuning.delay_s)
        error_m = max(given[i, W.ERROR_M], tuning.position_error_m)
        scene.error_m[i] = error_m + tuning.track_error_mps * late_s
        copy_row(scene.memory[i], scene.memories[b, i])


@kernel
def store_decision(b: int, scene: Scene) -> None:
    """Store what decision b has come to, and what is remembered of it."""
    given, state, command, reported = scene.given[b], scene.state, scene.command, scene.reported[b]
    own = _one_of_one_team(scene)
    for i in range(state.shape[0]):
        copy_row(scene.memories[b, i], scene.memory[i])
        sent = scene.sent[b, i]
        sent[0], sent[1] = given[i, W.NOMINAL_SPEED], given[i, W.NOMINAL_TURN]
        reason = scene.reason[i]
        active = -1 if reason == W.NOT_COVERED else scene.active[i]
        passed = reason in (W.PASSED, W.NOT_COVERED)
        same = command[i, 0] == scene.nominal[i, 0] and command[i, 1] == scene.nominal[i, 1]
        changed = not (passed or same)
        if changed:
            copy_row(sent, command[i])
            if -TINY_MPS < sent[0] < 0.0:
                sent[0] = 0.0
            turned = state[i, L.HEADING] - given[i, L.HEADING]
            if turned != 0.0:
                sent[1] += turned
            if active == -1 and reason != W.HELD:  # nothing else changes commands
                active = STATIC
        if reason == W.BACKUP and scene.solver[i] == W.BY_LINE_SEARCH:
            reason = W.LEAST_CHANGE
        scene.changed[b, i], scene.reasons[b, i] = changed, reason
        reported[i, W.SLACK_M], reported[i, W.ACTIVE] = scene.slack_m[i], active
        reported[i, W.CUT_SHORT] = 1.0 if scene.ours[i] and scene.cut_short[0] else 0.0
        reported[i, W.ADVERSARY_HORIZON_S] = _reported_adversary_horizon(i, own, scene)
        reported[i, W.SOLVER] = scene.solver[i] if reason == W.LEAST_CHANGE else 0
        reported[i, W.MARGIN_M] = np.inf if reason == W.NOT_COVERED else reported_margin(i, scene)
    if scene.pending.shape[1] > 0:
        queue_commands(scene.pending[b], state, command)


@lean_kernel
def _note_backup_hold(i: int, scene: Scene) -> None:
    """Note whether boat i is on its backup, and for how long it must stay on it.

    Without this hold, a boat at its required margin would switch between nominal command and backup in every step; a
    boat that turns at once would weave. A backup that comes out as the nominal command holds nothing.
    """
    memory, reason = scene.memory[i], scene.reason[i]
    backing_up = reason in (W.BACKUP, W.BEST_EFFORT)
    left_s = 0.0
    if backing_up and not unchanged(i, scene):
        begins = memory[W.BACKING_UP] == 0.0 or memory[W.HOLD_S] == 0.0
        left_s = (scene.boats.min_backup_hold_s[i] if begins else memory[W.HOLD_S]) - scene.tuning.dt_s
        left_s = left_s if left_s > ROUNDING_S else HOLD_OVER
    memory[W.HOLD_S] = left_s
    memory[W.BACKING_UP] = 1.0 if backing_up else 0.0


@lean_kernel
def commit(scene: Scene) -> None:
    """Keep every boat's manoeuvre for the next decision, as an absolute heading, with its margins.

    A margin from a value table is a barrier for one opponent, so boats with tables remember one margin per opponent.
    Other margins come from one manoeuvre, and another manoeuvre may trade one for the other: the least counts for all.
    """
    for i in range(scene.ours.shape[0]):
        memory, manoeuvre = scene.memory[i], scene.manoeuvre[i]
        if not scene.ours[i]:
            memory[W.HAS_BACKUP], memory[W.BACKING_UP] = 0.0, 0.0
            forget_deadlock(i, scene)
            continue
        memory[W.HAS_BACKUP], memory[W.BACKUP_RUDDER], memory[W.BACKUP_SPEED] = 1.0, manoeuvre[0], manoeuvre[2]
        memory[W.BACKUP_HEADING] = np.nan
        if manoeuvre[1] > LEAST_TURN_DEG:
            end_deg = scene.next_state[i, L.HEADING] + math.copysign(manoeuvre[1], manoeuvre[0])
            memory[W.BACKUP_HEADING] = wrap_degrees(end_deg)
        memory[W.BACKUP_MARGIN] = scene.clear[i, MARGIN]
        memory[W.STATIC_MARGIN] = scene.static_clear[i, MARGIN] if scene.satisfied[i] >= CLEAR_OF_BOATS else 0.0
        memory[W.JOINT_MARGIN] = scene.joint_m[i] if scene.several_pursuers[i] else 0.0
        for j in range(scene.ours.shape[0]):
            apart = scene.boats.table_steps[i] > 0
            memory[W.N_MEMORY + j] = scene.pursuit_margins_m[i, j] if apart else scene.pursuit_margin_m[i]
        _note_backup_hold(i, scene)
        note_deadlock(i, scene)


@lean_kernel
def _note_causes(scene: Scene) -> None:
    """Note which constraint each nominal command violates; an opponent goes before a nearer teammate."""
    for i in range(scene.ours.shape[0]):
        short = scene.ours[i] and scene.satisfied[i] < CLEAR_OF_ALL
        scene.violated[i] = scene.active[i] if short else -1
        pursued = scene.satisfied[i] == CLEAR_OF_OBSTACLES and scene.violates_pursuers[i] and scene.pursuer[i] >= 0
        if short and pursued:
            scene.violated[i] = scene.pursuer[i]


@lean_kernel
def _name_reasons(scene: Scene) -> None:
    """Set the reason PASSED for nominal commands that come out unchanged, and name static constraints as active.

    A static constraint is active where a command was changed for it and satisfies it now. A registered barrier is
    active where a boat stops because the barrier reports nothing at its position.
    """
    for i in range(scene.ours.shape[0]):
        if not scene.ours[i]:
            continue
        reason, same = scene.reason[i], unchanged(i, scene)
        if same and (reason == W.LEAST_CHANGE or (reason == W.BACKUP and scene.slack_m[i] == 0.0)):
            scene.reason[i] = scene.checked_reason[i]
        if scene.reason[i] == W.HELD and unknown_at(i, scene) >= 0:
            scene.active[i] = about(unknown_at(i, scene))
        if scene.violated[i] <= STATIC and scene.satisfied[i] == CLEAR_OF_ALL and not same:
            scene.active[i] = scene.violated[i]


@lean_kernel
def begin(scene: Scene) -> int:
    """Check the nominal commands; return the number of groups in which one fails."""
    check_nominal(scene)
    return groups_left(scene)


@lean_kernel
def groups_left(scene: Scene) -> int:
    """Note what nominal commands violate and the manoeuvres found for them; return the number of groups left."""
    _note_causes(scene)
    for i in range(scene.ours.shape[0]):
        if scene.ours[i]:
            note_manoeuvre(i, scene.held, scene)
    return make_groups(scene)


@lean_kernel
def begin_group(group: int, scene: Scene) -> int:
    """Make backups the commands of a group and set up its QP; return the number of boats in the QP."""
    open_group(group, scene)
    back_up(scene)
    if all_spent(scene) or not any_may_be_blended(scene):
        return 0
    rescore_backups(among_mates(scene), scene)
    return begin_program(scene)


@lean_kernel
def end_group(scene: Scene, safe: bool, count: int) -> None:
    """End the QP of ``count`` boats, and blend the other backups."""
    end_program(scene, safe, count)
    blend(scene)


@lean_kernel
def end(scene: Scene) -> bool:
    """Note active constraints and reasons, and keep what the next decision needs; return whether that is all.

    It is not if a boat has to stop that was to go on: the decision is made again around that stop, since the others
    were verified against what it was to do.
    """
    close_groups(scene)
    if note_last_resorts(scene):
        return False
    keep_last_line(scene)
    commit(scene)
    _name_reasons(scene)
    return True


@lean_kernel
def decide_scene(scene: Scene) -> None:
    """Make the whole decision: filtered commands go to ``scene.command``, reasons to ``scene.reason``."""
    while True:
        for group in range(begin(scene)):
            count, safe = begin_group(group, scene), False
            for _ in range(ROUNDS if count > 0 else 0):
                rows = linearise(count, scene)
                if rows < 0 or not solve(count, rows, scene):
                    break
                safe = accept(count, scene)
                if safe:
                    break
            end_group(scene, safe, count)
        if end(scene):
            return


@kernel
def decide_all(scene: Scene) -> None:
    """All decisions, one after another."""
    for b in range(scene.given.shape[0]):
        load_decision(b, scene)
        decide_scene(scene)
        store_decision(b, scene)


class Deciders:
    """B deciders of the same fleet; what is given, decided and remembered are arrays of ``scene``.

    Args:
        config: settings.
        number: B.
        boats: constants of the n boats.
        static: static constraints and registered barriers, the same for all.
        solver: what answers programs; None: the compiled one.
        threads: how many share the B decisions; what is decided is the same. Other solvers take one.
    """

    def __init__(
        self,
        config: ShieldConfig,
        number: int,
        boats: Boats,
        static: Static,
        solver: Solver | None = None,
        threads: int = 1,
    ) -> None:
        self._delay = steps_of_delay(config)
        self.scene = new_scene(number, boats, static, tuning_of(config), self._delay)
        self._solver, self._threads = solver, max(1, min(threads, number)) if solver is None else 1
        self._solver_call: SolverCall | None = None
        self._decide_all: Any = None
        self._parts: list[Scene] = []
        self._pool: ThreadPoolExecutor | None = None

    def __getstate__(self) -> dict[str, Any]:
        return self.__dict__ | {
            "_decide_all": None,
            "_parts": [],
            "_pool": None,
            "_solver_call": None,
        }  # those are of one process

    @property
    def remembered(self) -> dict[str, Array]:
        """What goes on from decision to decision, by name: live arrays, (B, ...)."""
        return {"memory": self.scene.memories, "pending": self.scene.pending}

    def forget(self, which: slice | BoolArray) -> None:
        """Forget the backups of some deciders, and the commands on their way."""
        memories, pending = self.scene.memories, self.scene.pending
        memories[which, :, W.HAS_BACKUP], memories[which, :, W.BACKING_UP] = 0.0, 0.0
        pending[which] = np.nan

    def beside(self, static: Static) -> Scene:
        """The scene with these static constraints, from now on."""
        if self.scene.static is not static:
            self.scene = share(self.scene._replace(static=static))
            self._decide_all, self._parts = None, []
        return self.scene

    def decide(self, static: Static) -> None:
        """Write into the scene what is decided about what is given, beside these static constraints."""
        self.beside(static)
        if self._solver is not None:
            if self._solver_call is None:
                self._solver_call = SolverCall(self._solver, self.scene)
            self.scene.solver_address[0] = self._solver_call.address
        if self._decide_all is None:
            made = getattr(decide_all, "compile", None)  # there is none where NUMBA_DISABLE_JIT is set
            self._decide_all = decide_all if made is None else made((type_of(self.scene),))  # saves 3 us a call
        if self._threads == 1:
            self._decide_all(self.scene)
        else:
            self._decide_in_threads()
        if self._solver_call is not None:
            self._solver_call.raise_what_was_raised()

    def _decide_in_threads(self) -> None:
        """Share the decisions; each thread has its own scratch and counts its own faults of registered barriers."""
        faults = self.scene.static.registered.faults
        if self._pool is None:
            self._pool = ThreadPoolExecutor(self._threads, "shield")
        if not self._parts:
            bounds = np.linspace(0, len(self.scene.given), self._threads + 1).astype(np.int64).tolist()
            for first, last in pairwise(bounds):
                static = self.scene.static._replace(
                    registered=self.scene.static.registered._replace(faults=np.zeros_like(faults))
                )
                self._parts.append(part_of(self.scene, static, first, last, self._delay))
        for part in self._parts:
            part.static.registered.faults[:] = 0
        list(self._pool.map(self._decide_all, self._parts))
        for part in self._parts:
            faults += part.static.registered.faults
