"""`Shield`: the fleet and the wanted commands in, safe commands out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from .barriers.value_function import WAYS
from .commands import Commands
from .config import ShieldConfig
from .decision import Decisions
from .exceptions import ConfigError, FleetError
from .filter.answer import Answer, less_turn, to_send
from .filter.flow import PASSES, ROUNDS, SAFE, TO_SOLVE, UNSAFE, accept, begin, finish, linearise
from .filter.limiting import tell_of_limits, within_limits
from .filter.program import Program, solve
from .fleet import Fleet, foreseeable
from .jit import Array, BoolArray
from .kept_barriers import KeptBarriers
from .memory import Memory, new_memory
from .ordering import as_given, order_of, ordered
from .plan import Plan, new_plan
from .platforms import layout as L
from .scene import Boats, Registered, Scene, Static, Tuning, new_scene, path_samples
from .setup import boats_of, missing_tables, tuning_of
from .surroundings import OPEN_WATER, Surroundings
from .tracking.autopilots import Autopilots, all_known, unknown_memory
from .tracking.fears import note_fears
from .tracking.remembering import Known, Stayed, carry_over, meets_new
from .tracking.tracks import prepare, queue_commands, steps_of_delay
from .warming import tight_spot
from .work import Work, new_work

MOST_ROWS = 3000
"""Where a program would have more rows than this, the backups are sent instead."""


@dataclass
class _Seat:
    """Working memory of one decider: the team, or one boat of it; and the scene it was last used in."""

    memory: Memory
    work: Work
    plan: Plan
    scene: Scene | None = None

    def scene_of(self, boats: Boats, static: Static, registered: Registered, tuning: Tuning) -> Scene:
        """The scene with these boats and static constraints; manoeuvres and settings are always the shield's."""
        if self.scene is None or self.scene.boats is not boats or self.scene.static is not static:
            self.scene = new_scene(boats, (static, registered), tuning, self.memory, self.work, self.plan)
        return self.scene


class Shield:
    """Filters commanded heading and speed so that boats keep their distance.

    Every step, `decide` sends a wanted command on unchanged when every boat still has a backup after it (and no two
    team-mates have kept each other from turning for seconds, see `right_of_way`), and otherwise the least change that
    keeps one,

        minimise |u - u_wanted|^2   subject to   h(x+) >= exp(-alpha dt) h(x)   for every pair, edge and obstacle,

    with u the turn and speed of this step, chosen through the autopilot. What it remembers between calls is the backup
    of each boat, its margins, the commands on their way and, where nobody tells it, its autopilot's memory, for as long
    as the boat (name, platform, team) is in the fleet; the same sequence of inputs from `reset` on gives the same bits.
    It takes one call per step of the settings, and boats that do what was sent. It decides for one thread at a time:
    compiled code works on its arrays without the GIL.

    Args:
        config: settings; None takes the defaults.
        surroundings: field edge, obstacles and keep-out circles.
        **settings: single settings by name, instead of ``config``.

    Attributes:
        serves: whom it has decided for since `reset`, where wrappers use it; None: nobody yet.

    Raises:
        ConfigError: a setting is unknown or out of range, or leaves nothing of the field.
    """

    def __init__(
        self, config: ShieldConfig | None = None, surroundings: Surroundings = OPEN_WATER, **settings: Any
    ) -> None:
        if config is not None and settings:
            raise ConfigError("give either a ShieldConfig or single settings, not both")
        if config is not None and not isinstance(config, ShieldConfig):
            raise ConfigError(
                f"config is a {type(config).__name__}; give a ShieldConfig, or settings: Shield(**settings)"
            )
        self.config = config if config is not None else ShieldConfig.of(**settings)
        self.surroundings = surroundings
        self._tuning = tuning_of(self.config)
        self._barriers = KeptBarriers(self.config)
        self._packed: dict[Surroundings, Static] = {}
        self._last_around: tuple[Surroundings, Static] | None = None
        self._static(surroundings)  # one that does not fit the settings is refused here, not in a loop
        self._kept_from: Static | None = None
        self._seats: list[_Seat] = []
        self._boats: Boats | None = None
        self._horizon_s = 0.0
        self._missing: BoolArray | None = None
        self._known: Known | None = None
        self.serves: object | None = None
        self._pending = np.zeros((0, 0, 2))
        self._autopilots: Autopilots | None = None

    @classmethod
    def for_game(cls, game: Any, **settings: Any) -> Shield:
        """The shield for a game, with its step and its distances: where it counts collisions, and how wide boats are.

        Args:
            game: an `MctfEnv`, a ``PyQuaticusEnv``, a PettingZoo wrapper around one, or a `BatchedMctf` (of which it
                decides for one game at a time; `games_shield` builds the shield for all).
            **settings: settings that are to be other than the game's, or than the default.

        Raises:
            ConfigError: a game that no shield can be built for, or an unusable setting.
        """
        from .wrappers.checks import settings_of

        return cls(**{**settings_of(game), **settings})

    def reset(self) -> None:
        """Forget all backups, as before a new game."""
        self._known = None
        self.serves = None

    def warm_up(self, fleet: Fleet | None = None) -> None:
        """Compile what decisions run, so that the first one is as quick as any; the shield's memory is left alone.

        Without it the first decision, and the first that changes a command, take 0.1 s and more, and minutes the first
        time after an installation.

        Args:
            fleet: the boats to come, whose value tables are then read as well.

        Raises:
            FleetError, PlatformError: boats that `decide` would refuse.
        """
        if fleet is not None and not isinstance(fleet, Fleet):
            raise FleetError(f"warm_up takes a Fleet, not {type(fleet).__name__}; build it with Fleet.of(...)")
        for twin in (Shield(solver=self.config.solver), Shield(self.config)):  # by its settings there may be no room
            twin.decide(*tight_spot())
        if fleet is not None:
            fleet.check()
            order = order_of(fleet.names)
            twin._scene(fleet if order is None else ordered(fleet, Commands.relative_deg(fleet.state[:, :2]), order)[0])

    def decide(self, fleet: Fleet, wanted: Commands, surroundings: Surroundings | None = None) -> Decisions:
        """Decide for all controlled boats of a fleet.

        Args:
            fleet: all boats seen now.
            wanted: command of each boat, n rows; rows of boats not controlled are passed through. Speeds beyond what a
                boat's platform does are cut first (not those of `Commands.game_deg`).
            surroundings: static constraints now, when they differ from the ones given at construction.

        Returns:
            One decision per boat, in the fleet's order, which decides nothing: see `ordering`.

        Raises:
            FleetError: fleet or commands are of another kind, shapes do not fit, a state is not finite or a track too
                old.
            ConfigError: the surroundings are of another kind or leave nothing of the field.
        """
        started = time.perf_counter()
        if not isinstance(fleet, Fleet) or not isinstance(wanted, Commands):
            raise FleetError(
                f"decide takes a Fleet and Commands, not {type(fleet).__name__} and {type(wanted).__name__}; build "
                "them with Fleet.of(...) and Commands.absolute_rad(...) or Commands.relative_deg(...)"
            )
        fleet.check()
        if wanted.values.shape != (len(fleet), 2):
            raise FleetError(f"commands of shape {wanted.values.shape} for {len(fleet)} boats; give one row per boat")
        order = order_of(fleet.names)
        if order is None:
            return self._decide(fleet, wanted, surroundings, started)
        return as_given(self._decide(*ordered(fleet, wanted, order), surroundings, started), fleet, wanted, order)

    def _decide(self, fleet: Fleet, wanted: Commands, surroundings: Surroundings | None, started: float) -> Decisions:
        """`decide`, of boats in the order of their names."""
        boats = self._scene(fleet)
        self._foresee(fleet)
        feared_s = self._fear(fleet)
        within, cut = within_limits(wanted, fleet, boats.params)
        seen, unknown = self._with_memory(fleet)
        state, margin = prepare(seen, self.config, boats.params, self._pending)
        turned = state[:, L.HEADING] - fleet.state[:, L.HEADING]  # until the command takes effect
        asked = less_turn(within.as_relative_deg(fleet.state[:, L.HEADING]), turned)
        static = self._around(self.surroundings if surroundings is None else surroundings)
        self._barriers.renew()
        if self.config.coordination == "team":
            seat = self._seats[0]
            self._run(seat, state, asked, margin, fleet.controlled, boats, static)
            answer = Answer(seat.plan, seat.work, state)
        else:
            answer = self._each(state, asked, margin, fleet.controlled, boats, static)
        sent, changed, bound = to_send(fleet, within, asked, turned, answer)
        self._barriers.tell()
        if cut is not None:
            changed = tell_of_limits(cut, changed, answer)
        self._note_sent(seen, unknown, sent, boats)
        return Decisions(
            fleet=fleet,
            wanted=wanted,
            sent=sent,
            intervened=changed,
            reason=answer.reason,
            certificate_m=answer.margin,
            slack_m=answer.slack,
            bound=bound,
            solve_time_s=time.perf_counter() - started,
            no_table=self._missing,
            cut_short=answer.cut_short,
            feared_s=feared_s,
            barriers=self.config.barriers,
        )

    def wrap(self, policy: Any, read: Callable[[Any], Fleet] | None = None) -> Any:
        """Put this shield around a policy.

        Args:
            policy: a team policy (``reset`` and ``act``, as `steerclear.policies.make` builds them), or any function of
                what is seen to `Commands`.
            read: for a function: turns what it sees into a `Fleet`.

        Raises:
            ConfigError: the policy is neither, or ``read`` is missing.
        """
        from .wrappers.policy import wrap_policy

        return wrap_policy(policy, self, read)

    def _scene(self, fleet: Fleet) -> Boats:
        """Boat constants; new working memory when the fleet is not the one of the last call."""
        if self._boats is None or self._known is None or self._known != Known.of(fleet):
            kinds = self.config, fleet.platforms, tuple(int(t) for t in fleet.team)
            boats, self._missing = boats_of(*kinds), missing_tables(*kinds)
            self._seat(fleet, boats)
            self._boats, self._known = boats, Known.of(fleet)
            self._horizon_s = float(boats.samples.max(initial=0)) * boats.sample_s
        return self._boats

    def _foresee(self, fleet: Fleet) -> None:
        """Note which boats' ways are foreseen: those pursue nobody."""
        driven, known = fleet.driven, self._seats[0].work.known
        if driven is None or not foreseeable(driven, fleet.controlled, self._horizon_s, known):
            known[:] = False
        for seat in self._seats:
            seat.work.known[:] = known
            if driven is not None:
                seat.work.driven[:] = driven

    def _fear(self, fleet: Fleet) -> Array:
        """Note how long each boat may do its worst; (n,) s as it is told, see `note_fears`."""
        first = self._seats[0].work
        told_s = note_fears(fleet, self.config, first)
        for seat in self._seats[1:]:
            seat.work.fear_s[:] = first.fear_s
        return told_s

    def _seat(self, fleet: Fleet, boats: Boats) -> None:
        """Make room for the boats of a fleet; those that were there before keep what is remembered of them."""
        n, old, sent = len(fleet), self._seats, self._pending
        rows = min(n * ((WAYS + 1) * n + 6) + 2, MOST_ROWS)
        team, samples = self.config.coordination == "team", path_samples(boats)
        deciders = 1 if team else max(1, n)
        self._seats = [_Seat(new_memory(n), new_work(n, samples), new_plan(n, rows)) for _ in range(deciders)]
        self._pending = np.full((steps_of_delay(self.config), n, 2), np.nan)
        believed, self._autopilots = self._autopilots, None
        stayed = Stayed.between(self._known, fleet)
        if len(stayed.now) == 0:
            return
        if believed is not None:
            self._autopilots = Autopilots.of(n)
            self._autopilots.carry_over(believed, stayed)
        self._pending[:, stayed.now] = sent[:, stayed.then]
        met = meets_new(fleet, stayed, boats, self._tuning)
        for i, k in [(0, 0)] if team else zip(*stayed, strict=True):
            carry_over(old[k].memory, self._seats[i].memory, stayed, met)

    def _with_memory(self, fleet: Fleet) -> tuple[Fleet, BoolArray | None]:
        """The fleet with what is believed of its autopilots, and (n,) own boats of which nobody tells it, if any."""
        if self._autopilots is None and all_known(fleet.state):
            return fleet, None
        unknown: BoolArray = fleet.controlled & unknown_memory(fleet.state)
        if fleet.age_s is not None:  # what was sent since is not in what is seen
            unknown &= fleet.age_s <= 0.5 * self.config.dt_s
        if not unknown.any():
            self._autopilots = None
            return fleet, None
        if self._autopilots is None:
            self._autopilots = Autopilots.of(len(fleet))
        fleet = replace(fleet, state=fleet.state.copy())
        self._autopilots.fill(fleet.state, unknown, self.config.dt_s, self.config.position_error_m)
        return fleet, unknown

    def _note_sent(self, seen: Fleet, unknown: BoolArray | None, sent: Commands, boats: Boats) -> None:
        """Queue what was sent, and run the autopilots nobody tells of through what works in this step."""
        if len(self._pending) == 0 and unknown is None:
            return
        heading_deg = seen.state[:, L.HEADING]
        works = sent.as_relative_deg(heading_deg)
        if len(self._pending) > 0:
            first = self._pending[0].copy()
            queue_commands(self._pending, seen.state, works)
            works = first
            works[:, 1] = (works[:, 1] - heading_deg + 180.0) % 360.0 - 180.0
        if unknown is not None and self._autopilots is not None:
            self._autopilots.go_on(unknown, boats.params, works, self.config.dt_s)

    def _around(self, surroundings: Surroundings) -> Static:
        """Static constraints now; what was kept from others is no measure for these."""
        static = self._static(surroundings)
        if static is not self._kept_from:
            self._kept_from = static
            for seat in self._seats:
                seat.memory.static_m[:] = 0.0
        return static

    def _static(self, surroundings: Surroundings) -> Static:
        if not isinstance(surroundings, Surroundings):
            raise ConfigError(f"surroundings are a {type(surroundings).__name__}; build them with Surroundings(...)")
        if self._last_around is not None and surroundings is self._last_around[0]:
            return self._last_around[1]
        if surroundings not in self._packed:
            if len(self._packed) > 64:
                self._packed.clear()
            self._packed[surroundings] = surroundings.pack(self.config)
        self._last_around = surroundings, self._packed[surroundings]
        return self._packed[surroundings]

    def _run(
        self, seat: _Seat, state: Array, wanted: Array, margin: Array, ours: BoolArray, boats: Boats, static: Static
    ) -> None:
        """The stages of `flow` with the QP backend in between."""
        scene = seat.scene_of(boats, static, self._barriers.arrays, self._tuning)
        todo = begin(scene, state, wanted, margin, ours)
        if todo == PASSES:
            return
        found, count = UNSAFE, 0
        for _ in range(ROUNDS if todo == TO_SOLVE else 0):
            count, rows = linearise(scene)
            z = self._solve(count, rows, seat.plan) if rows >= 0 else None
            if z is None:
                break
            found = accept(scene, z, count)
            if found != UNSAFE:
                break
        finish(scene, found == SAFE, count)

    def _solve(self, count: int, rows: int, plan: Plan) -> Array | None:
        """Answer of the program, if it has one."""
        n = 2 * count
        return solve(Program(plan.C[:rows, :n], plan.d[:rows], plan.z0[:n]), self.config.solver)

    def _each(
        self, state: Array, wanted: Array, margin: Array, controlled: BoolArray, boats: Boats, static: Static
    ) -> Answer:
        """One program per boat: it knows its own wanted command and takes team-mates to hold theirs."""
        answer = Answer.empty(len(state))
        straight = np.zeros_like(wanted)
        straight[:, 0] = state[:, L.SPEED]
        for i in np.flatnonzero(controlled):
            asked = straight.copy()
            asked[i] = wanted[i]
            seat = self._seats[i]
            self._run(seat, state, asked, margin, controlled, boats, static)
            answer.take(int(i), seat.plan, seat.work, state)
        return answer
