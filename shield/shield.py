"""`Shield`: takes the fleet and the nominal commands, returns filtered commands."""

from __future__ import annotations

import re
import time
from collections import Counter
from collections.abc import Callable, Sequence
from copy import deepcopy
from functools import lru_cache
from typing import Any

import numpy as np

from . import workspace as W
from .arrays import say_once
from .autopilots import Autopilots, all_known, to_turn, unknown_memory
from .backup.paths import SAG_M
from .barriers.registered import RegisteredBarriers
from .barriers.static import STATIC
from .commands import Commands
from .config import ShieldConfig
from .decide import Deciders
from .decision import Decisions
from .exceptions import ConfigError, FleetError
from .filter.program import Solver, solver_of
from .fleet import Fleet
from .jit import Array, BoolArray, IntArray, copy_row, kernel
from .masks import passing
from .model import boats_of, missing_tables
from .platforms import layout as L
from .renamed import takes_old_keywords
from .surroundings import OPEN_WATER, Surroundings, uncertainty_m
from .tracks import carry_over, steps_of_delay, who_stayed
from .workspace import Scene, Static

JUMP_M, JUMP_MPS = 20.0, 50.0
"""An own boat that is farther than this from where it was, plus what no boat moves in the time, was put elsewhere."""

NOMINAL = slice(W.NOMINAL_SPEED, W.NOMINAL_TURN + 1)
"""Columns of nominal commands in what is given."""


class Shield:
    """Filters commanded heading and speed so that boats keep their distance.

    In each step, `decide` passes a nominal command unchanged if every boat still has a backup after it (and no two
    teammates have kept each other from turning for seconds, see `right_of_way`). Otherwise, among teammates, it sends
    the least change that leaves every boat a backup,

        minimise |u - u_nominal|^2   subject to   h(x+) >= exp(-alpha dt) min(max(h, 0), cap),

    and to the margins that the backups keep, for every pair, edge and obstacle. Here u is the turn and speed of this
    step, commanded through the autopilot, and h on the right is remembered from the last plan. Against opponents it
    sends the backup; along edges, as little of the backup as suffices.

    Between calls it remembers each boat's backup, its margins and the commands not yet in effect, for as long as the
    boat (name, platform, team) is in the fleet. The same inputs since `reset` give the same bits. It expects one call
    per step of the settings, and boats that follow their commands. It serves one thread at a time: compiled code works
    on its arrays without the GIL.

    Args:
        config: settings; None takes the defaults.
        surroundings: field edge, obstacles and keep-out circles.
        **settings: single settings by name, instead of ``config``.

    Attributes:
        serves: whom wrappers have used it for since `reset`; None: nobody yet.

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
        self.config = ShieldConfig.of(**settings) if config is None else config
        self.surroundings = surroundings
        self._barriers = barriers_of(self.config)
        self._packed: tuple[Surroundings, Static] | None = None
        self._static(surroundings)  # surroundings that do not fit the settings are refused here, not in a loop
        self._kept_from: Static | None = None
        self._deciders: Deciders | None = None
        self._known: tuple[Any, ...] | None = None
        self._missing: BoolArray | None = None
        self._highest_mps = np.zeros(0)  # of boats, in the fleet's order
        self._active = np.zeros(0, np.int64)  # active constraints in the fleet's order; negative indices are used, too
        self._autopilots: Autopilots | None = None
        self.serves: object | None = None

    def __repr__(self) -> str:
        """Return in one line what the shield keeps, and the boats that it has decided for since `reset`."""
        config, field = self.config, self.surroundings.field
        area = "" if field is None else f"; area ({', '.join(f'{edge:g}' for edge in field)}) m"
        kinds = Counter((team, getattr(kind, "name", kind)) for _, kind, team in self._known[1]) if self._known else {}
        boats = ", ".join(f"{count} {kind} of team {team}" for (team, kind), count in sorted(kinds.items()))
        return (
            f"<Shield: separation {config.separation_m:g} m, profile {config.profile}, a decision every "
            f"{config.dt_s:g} s{area}; {boats or 'no boats yet'}>"
        )

    @classmethod
    def for_game(cls, game: Any, **settings: Any) -> Shield:
        """Build the shield for a game, with the game's step, its collision distance and the width of its boats.

        Args:
            game: an `MctfEnv`, a ``PyQuaticusEnv``, a PettingZoo wrapper around one, or a `BatchedMctf` (for one game
                of it at a time; `games_shield` builds the shield for all).
            **settings: settings that differ from the game's, or from the default.

        Raises:
            ConfigError: a game that no shield can be built for, or an unusable setting.
        """
        from .wrappers.checks import settings_of

        return cls(**{**settings_of(game), **settings})

    def wrap(self, policy: Any, read: Callable[[Any], Fleet] | None = None) -> Any:
        """Put this shield around a policy.

        Args:
            policy: a team policy (``reset`` and ``act``, as `steerclear.policies.make` builds them), or any function
                from observations to `Commands`.
            read: for a function: turns its observations into a `Fleet`.

        Raises:
            ConfigError: the policy is neither, or ``read`` is missing.
        """
        from .wrappers.policy import wrap_policy

        return wrap_policy(policy, self, read)

    def reset(self) -> None:
        """Forget all backups, as before a new game."""
        self._known = None
        self.serves = None

    def warm_up(self, fleet: Fleet | None = None) -> None:
        """Compile what decisions run, so that the first one is as fast as any; the shield's memory stays as it is.

        Without it the first decision takes a minute the first time after an installation, and 0.1 s at every start.

        Args:
            fleet: the boats to come, whose value tables are then also loaded.

        Raises:
            FleetError, PlatformError: boats that `decide` would refuse.
        """
        if fleet is not None and not isinstance(fleet, Fleet):
            raise FleetError(f"warm_up takes a Fleet, not {type(fleet).__name__}; build it with Fleet.of(...)")
        twin = Shield(self.config)
        twin.decide(*_tight_spot())
        if fleet is not None:
            fleet.check()
            twin._deciders_of(fleet, twin._static(OPEN_WATER))

    @takes_old_keywords({"wanted": "nominal"})
    def decide(self, fleet: Fleet, nominal: Commands, surroundings: Surroundings | None = None) -> Decisions:
        """Decide for all controlled boats of a fleet.

        Manoeuvres are found one boat at a time, in the order of names. So the same boats get the same commands, bit
        for bit, in whatever order a fleet lists them.

        Args:
            fleet: all boats seen now.
            nominal: the nominal commands, n rows; rows of boats not controlled are passed through. Speeds beyond a
                platform's range are cut first (not those of `Commands.game_deg`).
            surroundings: static constraints now, if they differ from those given at construction.

        Returns:
            One decision per boat, in the fleet's order.

        Raises:
            FleetError: fleet or commands are of another kind, shapes do not fit, a state is not finite or a track too
                old.
            ConfigError: the surroundings are of another kind or leave nothing of the field.
        """
        started = time.perf_counter()
        around = self.surroundings if surroundings is None else surroundings
        _check(fleet, nominal, self.config)
        static = self._static(around)
        deciders = self._deciders_of(fleet, static)
        order, place = order_of(fleet.names)
        within, cut = nominal.within(fleet.names, fleet.controlled, self._highest_mps)
        state, unknown = self._with_memory(fleet, order)
        pending = deciders.scene.pending[:1, :1].copy()  # the commands in effect in this step, if they come late
        self._give(deciders.scene.given, fleet, fleet.state if unknown is None else state[place], within, order)
        self._barriers.renew()
        deciders.decide(self._keep_from(static, deciders.scene))
        self._barriers.tell()
        sent, changed, reason, reported = self._decided(deciders.scene)
        changed, reason = changed[place], reason[place]
        commands = within.replaced(changed, sent[place], fleet.state[:, L.HEADING]) if changed.any() else within
        if cut is not None:
            reason[cut & (reason == W.PASSED)] = W.LIMITED
            changed |= cut
        if self._autopilots is not None and unknown is not None:
            at_once = commands.as_relative_deg(fleet.state[:, L.HEADING])[order]
            in_effect = to_turn(pending[0, 0], state) if pending.size else at_once
            self._autopilots.go_on(unknown, deciders.scene.boats.params, in_effect, self.config.dt_s)
        return Decisions.made(
            fleet=fleet,
            nominal=nominal,
            filtered=commands,
            intervened=changed,
            reason=reason,
            solve_time_s=time.perf_counter() - started,
            no_table=self._missing,
            barriers=self.config.barriers,
            area=around.field,
            **self._as_fields(reported[place]),
        )

    def _as_fields(self, reported: Array) -> dict[str, Any]:
        """Return what compiled code reports, (n, N_REPORTED), as fields of `Decisions`."""
        return {
            "safety_margin_m": reported[:, W.MARGIN_M],
            "slack_m": reported[:, W.SLACK_M],
            "active_constraint": self._active[reported[:, W.ACTIVE].astype(np.int64)],
            "cut_short": reported[:, W.CUT_SHORT] != 0.0,
            "adversary_horizon_s": reported[:, W.ADVERSARY_HORIZON_S],
            "solver": reported[:, W.SOLVER].astype(np.int64),
        }

    @property
    def remembered(self) -> dict[str, Array]:
        """Memory from decision to decision, by name: live arrays; empty before the first one."""
        return {} if self._deciders is None else self._deciders.remembered

    def safe_actions(
        self, fleet: Fleet, actions: Sequence[Commands], surroundings: Surroundings | None = None
    ) -> BoolArray:
        """Return which of k candidate commands would pass unchanged in this step, (n, k); see `masks`.

        Each boat's candidates are checked while its teammates go straight on. The mask is for this step alone, and the
        shield must still filter the chosen command. The shield's memory stays as it is.

        Args:
            fleet: all boats seen now.
            actions: k candidates, each a command for every boat, such as one for each action of a game.
            surroundings: as for `decide`.

        Raises:
            FleetError: no candidates, or as for `decide`.
            ConfigError: as for `decide`.
        """
        if isinstance(actions, Commands) or not len(actions):
            raise FleetError("actions are one Commands or none; give a list of them, one for each candidate")
        for candidate in actions:
            _check(fleet, candidate, self.config)
        around = self.surroundings if surroundings is None else surroundings
        same = self._known is not None and self._known[0] == _boats_in(fleet)
        asked = self if same and self._static(around) is self._kept_from else deepcopy(self)
        return asked._passing(fleet, actions, asked._static(around))

    def _passing(self, fleet: Fleet, actions: Sequence[Commands], static: Static) -> BoolArray:
        deciders, (order, place) = self._deciders_of(fleet, static), order_of(fleet.names)
        highest_mps = deciders.scene.boats.params[place, L.MAX_SPEED]
        candidates, whole = np.empty((len(fleet), len(actions), 2)), np.ones((len(fleet), len(actions)), np.bool_)
        for k, candidate in enumerate(actions):
            within, cut = candidate.within(fleet.names, fleet.controlled, highest_mps)
            candidates[:, k] = within.as_relative_deg(fleet.state[:, L.HEADING])
            whole[:, k] = True if cut is None else ~cut
        believed = deepcopy(self._autopilots)
        state, unknown = self._with_memory(fleet, order)
        self._autopilots = believed  # candidates are not sent: no estimate continues from them
        self._give(deciders.scene.given, fleet, fleet.state if unknown is None else state[place], actions[0], order)
        self._barriers.renew()
        each = np.repeat(candidates[order][np.newaxis], len(deciders.scene.given), axis=0)
        found = passing(deciders, self._keep_from(static, deciders.scene), each)
        self._barriers.tell()
        passes: BoolArray = found[self._own_rows(len(fleet))]
        return passes[place] & whole

    def _deciders_of(self, fleet: Fleet, static: Static) -> Deciders:
        """Return the deciders of a fleet; the memory of boats that stay moves over to a new fleet."""
        known = _boats_in(fleet)
        if self._deciders is not None and self._known is not None and self._known[0] == known:
            return self._deciders
        order, place = order_of(fleet.names)
        platforms, team = tuple(fleet.platforms[i] for i in order), tuple(int(fleet.team[i]) for i in order)
        keys = tuple(zip((fleet.names[i] for i in order), platforms, team, strict=True))
        boats = boats_of(self.config, platforms, team)
        self._missing = missing_tables(self.config, platforms, team)[np.ix_(place, place)]
        self._missing.setflags(write=False)  # decisions about these boats share it
        number = 1 if self.config.coordination == "team" else len(fleet)
        new = Deciders(self.config, number, boats, static, self._solver())
        believed, self._autopilots = self._autopilots, None
        if self._deciders is not None and self._known is not None:
            stayed, then = who_stayed(self._known[1], keys)
            carry_over(self._deciders.scene, new.scene, stayed, then, fleet.state[order])
            if believed is not None and len(stayed) > 0:
                self._autopilots = Autopilots.of(len(fleet))
                self._autopilots.carry_over(believed, stayed, then)
        self._deciders, self._known = new, (known, keys)
        self._highest_mps = boats.params[place, L.MAX_SPEED]
        self._active = np.concatenate([order, np.arange(STATIC - len(self.config.barriers), 0)])
        return new

    def _solver(self) -> Solver | None:
        """Return the QP solver; None: the compiled one. A method, so that tests can look at QPs."""
        return solver_of(self.config.solver)

    def _with_memory(self, fleet: Fleet, order: IntArray) -> tuple[Array, BoolArray | None]:
        """Return states in order with estimated autopilot memory, and of whom; else the states as seen, and None."""
        if self._autopilots is None and all_known(fleet.state):
            return fleet.state, None
        state = fleet.state[order]
        unknown: BoolArray = fleet.controlled[order] & unknown_memory(state)
        if fleet.age_s is not None:  # an old track does not show the commands sent since
            unknown &= fleet.age_s[order] <= 0.5 * self.config.dt_s
        if not unknown.any():
            self._autopilots = None
            return fleet.state, None
        if self._autopilots is None:
            self._autopilots = Autopilots.of(len(fleet))
        self._autopilots.fill(state, unknown, self.config.dt_s, self.config.position_error_m)
        return state, unknown

    def _give(self, given: Array, fleet: Fleet, state: Array, within: Commands, order: IntArray) -> None:
        """Write the inputs of the decision of the team, or of each boat's own decision.

        A boat that decides for itself knows its own nominal command and takes teammates to hold their course.
        """
        if not len(fleet):
            return
        nominal = within.as_relative_deg(fleet.state[:, L.HEADING])
        far_m = JUMP_M + self.config.dt_s * JUMP_MPS
        jumped = _write_fresh(given[0], state, fleet.controlled, nominal, order, far_m)
        if jumped >= 0:
            say_once(
                "jumped",
                f"boat {fleet.names[jumped]!r} is more than {far_m:g} m from where it was a decision "
                f"ago, {self.config.dt_s:g} s; call reset() after a pause, or when boats begin elsewhere",
            )
        for column, told in (
            (W.VISITING, fleet.visiting),
            (W.AGE_S, fleet.age_s),
            (W.ERROR_M, fleet.position_error_m),
            (W.HORIZON_S, fleet.adversary_horizon_s),
            (slice(W.DRIVEN, W.N_GIVEN), fleet.driven),
        ):
            if told is not None:
                given[0, :, column] = told[order]
        if self.config.coordination == "per_boat":
            given[1:] = given[0]
            given[~fleet.controlled[order], :, W.OURS] = 0.0  # their own decisions decide nothing
            given[:, :, W.NOMINAL_SPEED], given[:, :, W.NOMINAL_TURN] = given[:, :, L.SPEED], 0.0
            given[(*self._own_rows(len(fleet)), NOMINAL)] = nominal[order]

    def _own_rows(self, boats: int) -> tuple[Any, ...]:
        """Return where the decision that counts for each boat is: in the only one, or in its own."""
        return (0,) if self.config.coordination == "team" else (np.arange(boats), np.arange(boats))

    def _decided(self, scene: Scene) -> tuple[Array, BoolArray, IntArray, Array]:
        """Return filtered commands (n, 2), which are changed, reasons and reports: of the team, or each boat's own."""
        own = self._own_rows(len(scene.ours))
        reported = scene.reported[own]
        if self.config.coordination == "per_boat":
            if scene.pending.shape[1] > 0:  # all see the command of each boat
                scene.pending[:, -1] = scene.pending[own[0], -1, own[1]]
            for first in np.flatnonzero((scene.given[:, :, W.OURS] != 0.0).any(axis=1))[:1]:
                reported[:, W.ADVERSARY_HORIZON_S] = scene.reported[first, :, W.ADVERSARY_HORIZON_S]
        return scene.sent[own], scene.changed[own], scene.reasons[own], reported

    def _keep_from(self, static: Static, scene: Scene) -> Static:
        """Set static constraints; margins remembered from other constraints do not apply to these."""
        if static is not self._kept_from:
            self._kept_from = static
            scene.memories[:, :, W.STATIC_MARGIN] = 0.0
        return static

    def _static(self, surroundings: Surroundings) -> Static:
        if not isinstance(surroundings, Surroundings):
            raise ConfigError(f"surroundings are a {type(surroundings).__name__}; build them with Surroundings(...)")
        if self._packed is None or (surroundings is not self._packed[0] and surroundings != self._packed[0]):
            self._packed = surroundings, surroundings.pack(self.config, self._barriers.arrays)
        return self._packed[1]


@kernel
def _write_fresh(given: Array, state: Array, ours: BoolArray, nominal: Array, order: IntArray, far_m: float) -> int:
    """Write boats in that order into ``given``, (n, N_GIVEN): tracks fresh and exact, and nothing else known.

    Returns:
        A boat of ``ours``, then and now, that is farther than ``far_m`` from where ``given`` had it; -1: none.
    """
    jumped = -1
    for k in range(order.shape[0]):
        i = order[k]
        east_m, north_m = state[i, L.X] - given[k, L.X], state[i, L.Y] - given[k, L.Y]
        if ours[i] and given[k, W.OURS] != 0.0 and east_m * east_m + north_m * north_m > far_m * far_m:
            jumped = i
        given[k, :] = 0.0
        copy_row(given[k], state[i])
        given[k, W.OURS] = 1.0 if ours[i] else 0.0
        given[k, W.NOMINAL_SPEED], given[k, W.NOMINAL_TURN] = nominal[i, 0], nominal[i, 1]
        given[k, W.HORIZON_S] = np.nan
        given[k, W.DRIVEN :] = np.nan
    return jumped


def _check(fleet: Fleet, nominal: Commands, config: ShieldConfig) -> None:
    """Raise a FleetError for arguments of another kind, or with values or shapes that cannot be used."""
    if not isinstance(fleet, Fleet) or not isinstance(nominal, Commands):
        raise FleetError(
            f"decide takes a Fleet and Commands, not {type(fleet).__name__} and {type(nominal).__name__}; build "
            "them with Fleet.of(...) and Commands.absolute_rad(...) or Commands.relative_deg(...)"
        )
    fleet.check()
    if nominal.values.shape != (len(fleet), 2):
        raise FleetError(f"commands of shape {nominal.values.shape} for {len(fleet)} boats; give one row per boat")
    if fleet.age_s is not None and (fleet.age_s > config.max_track_age_s).any():
        worst = int(np.argmax(fleet.age_s))
        raise FleetError(
            f"track of {fleet.names[worst]!r} is {fleet.age_s[worst]:.2f} s old, limit {config.max_track_age_s} s; "
            "refresh it, raise max_track_age_s, or leave the boat out: then nobody keeps clear of it"
        )


def _boats_in(fleet: Fleet) -> tuple[Any, ...]:
    """Return what distinguishes the boats of one fleet from those of another."""
    return fleet.platforms, fleet.names, fleet.team.tobytes()


def barriers_of(config: ShieldConfig) -> RegisteredBarriers:
    """Return the registered barriers of a shield with these settings."""
    return RegisteredBarriers(config.barriers, uncertainty_m(config) + SAG_M, steps_of_delay(config) * config.dt_s)


@lru_cache(maxsize=256)
def order_of(names: tuple[str, ...]) -> tuple[IntArray, IntArray]:
    """Return indices (n,) of boats by name, with numbers in names by size; and each boat's place in that order."""
    order = np.array(sorted(range(len(names)), key=lambda i: _parts(names[i])), dtype=np.int64)
    return order, np.argsort(order)


def _parts(name: str) -> list[tuple[int, str, str]]:
    """Return a name's sort key: texts and, at every other place, numbers of any length."""
    parts = enumerate(re.split("([0-9]+)", name))
    return [(len(part.lstrip("0")), part.lstrip("0"), part) if k % 2 else (0, "", part) for k, part in parts]


def _tight_spot() -> tuple[Fleet, Commands, Surroundings]:
    """Return two boats that meet head on between obstacles, which a QP solver is asked about, and a far opponent."""
    fleet = Fleet.of(
        position_m=[(0.0, 0.0), (0.0, 4.2), (300.0, 3.0)],
        heading_rad=[0.0, np.pi, -np.pi / 2],
        speed_mps=[1.5, 1.5, 1.5],
        team=[0, 0, 1],
        platforms="heron",
    )
    around = Surroundings(keep_out=((0.0, -4.0, 1.0),), stops=((-4.0, 0.0, 1.0),), circles=((-4.0, 6.0, 0.5),))
    return fleet, Commands.relative_deg(np.array([[2.0, 0.0]] * 3)), around
