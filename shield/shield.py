"""`Shield`: the fleet and the wanted commands in, safe commands out."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from .commands import Commands
from .config import ShieldConfig
from .deciders import Asked, Decided, Deciders
from .decision import Decisions
from .exceptions import ConfigError, FleetError
from .filter.limiting import tell_of_limits, within_limits
from .filter.program import Solver, solver_of
from .fleet import Fleet
from .jit import Array, BoolArray
from .kept_barriers import KeptBarriers
from .masks import safe_of_fleet
from .memory import part_of
from .ordering import as_given, order_of, ordered
from .platforms import layout as L
from .scene import Boats, Static
from .setup import boats_of, missing_tables, tuning_of
from .surroundings import OPEN_WATER, Surroundings
from .tracking.autopilots import Autopilots, all_known, unknown_memory
from .tracking.remembering import Known, Stayed, carry_over, meets_new
from .tracking.tracks import check_ages
from .warming import tight_spot


class Shield:
    """Filters commanded heading and speed so that boats keep their distance.

    Every step, `decide` sends a wanted command on unchanged when every boat still has a backup after it (and no two
    team-mates have kept each other from turning for seconds, see `right_of_way`). Among team-mates it is otherwise the
    least change that keeps one,

        minimise |u - u_wanted|^2   subject to   h(x+) >= exp(-alpha dt) h(x)   for every pair, edge and obstacle,

    with u the turn and speed of this step, chosen through the autopilot; against opponents the backup, and along edges
    as little of it as will do. What it remembers between calls is the backup
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
        self._deciders: Deciders | None = None
        self._boats: Boats | None = None
        self._missing: BoolArray | None = None
        self._known: Known | None = None
        self.serves: object | None = None
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
            twin._deciders_of(
                fleet if order is None else ordered(fleet, Commands.relative_deg(fleet.state[:, :2]), order)[0]
            )

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
        boats, deciders = self._deciders_of(fleet)
        check_ages(fleet, self.config)
        within, cut = within_limits(wanted, fleet, boats.params)
        seen, unknown = self._with_memory(fleet)
        static = self._around(self.surroundings if surroundings is None else surroundings, deciders)
        works = deciders.pending[0, 0].copy() if deciders.pending.size > 0 else None
        self._ask(seen, within, deciders.asked)
        self._barriers.renew()
        decided = self._decided(static, deciders)
        self._barriers.tell()
        sent, changed, reason = within, decided.changed, decided.reason
        if changed.any():
            sent = within.replaced(changed, decided.sent, fleet.state[:, L.HEADING])
        if cut is not None:
            changed = tell_of_limits(cut, changed, reason)
        if unknown is not None:
            self._follow(unknown, works, sent, fleet, boats)
        return Decisions(
            fleet=fleet,
            wanted=wanted,
            sent=sent,
            intervened=changed,
            reason=reason,
            certificate_m=decided.certificate_m,
            slack_m=decided.slack_m,
            bound=decided.bound,
            solve_time_s=time.perf_counter() - started,
            no_table=self._missing,
            cut_short=decided.cut_short,
            feared_s=decided.feared_s,
            barriers=self.config.barriers,
            area=(self.surroundings if surroundings is None else surroundings).field,
        )

    @property
    def remembered(self) -> dict[str, np.ndarray]:
        """What goes on from decision to decision, by name: live arrays; empty before the first one."""
        if self._deciders is None:
            return {}
        return {**self._deciders.memory._asdict(), "pending": self._deciders.pending}

    def safe_actions(
        self, fleet: Fleet, actions: Sequence[Commands], surroundings: Surroundings | None = None
    ) -> BoolArray:
        """Which of k candidate commands would pass as they are in this step, (n, k); see `masks`.

        Each boat's candidate is judged beside its team-mates' candidates of the same number. It is for this step alone,
        and the shield stays behind it. What the shield remembers is left alone.

        Args:
            fleet: all boats seen now.
            actions: k candidates, each a command of every boat, such as one for each action of a game.
            surroundings: as of `decide`.

        Raises:
            FleetError: no candidates, or as `decide`.
        """
        return safe_of_fleet(self, fleet, actions, surroundings)

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

    def _deciders_of(self, fleet: Fleet) -> tuple[Boats, Deciders]:
        """Boat constants and deciders of a fleet; what is remembered of boats that stay is theirs in a new fleet."""
        if self._boats is None or self._deciders is None or self._known is None or self._known != Known.of(fleet):
            kinds = self.config, fleet.platforms, tuple(int(t) for t in fleet.team)
            boats, self._missing = boats_of(*kinds), missing_tables(*kinds)
            number = 1 if self.config.coordination == "team" else len(fleet)
            new = Deciders(self.config, number, boats, self._barriers.arrays, self._solver())
            self._deciders = self._with_old(fleet, new, boats)
            self._boats, self._known = boats, Known.of(fleet)
        return self._boats, self._deciders

    def _solver(self) -> Solver | None:
        """What answers programs; None: the compiled solver. A method, so that programs can be looked at."""
        return solver_of(self.config.solver)

    def _with_old(self, fleet: Fleet, new: Deciders, boats: Boats) -> Deciders:
        """New deciders with what the old ones remember of boats that stayed."""
        old, believed, self._autopilots = self._deciders, self._autopilots, None
        stayed = Stayed.between(self._known, fleet)
        if old is None or len(stayed.now) == 0:
            return new
        if believed is not None:
            self._autopilots = Autopilots.of(len(fleet))
            self._autopilots.carry_over(believed, stayed)
        met = meets_new(fleet, stayed, boats, self._tuning)
        new.pending[:, :, stayed.now] = old.pending[:1, :, stayed.then]  # all deciders know what all boats were told
        for i, k in [(0, 0)] if self.config.coordination == "team" else zip(*stayed, strict=True):
            carry_over(part_of(old.memory, k), part_of(new.memory, i), stayed, met)
        return new

    def _ask(self, seen: Fleet, within: Commands, asked: Asked) -> None:
        """Write what is to be decided about, for the team, or for each boat.

        A boat that decides for itself knows its own wanted command and takes team-mates to hold their course.
        """
        wanted = within.as_relative_deg(seen.state[:, L.HEADING])
        asked.state[:], asked.ours[:] = seen.state, seen.controlled
        if self.config.coordination == "team":
            asked.wanted[0] = wanted
        else:
            own = np.arange(len(seen))
            asked.ours[~seen.controlled] = False  # these decide nothing
            asked.wanted[:, :, 0], asked.wanted[:, :, 1] = seen.speed_mps, 0.0
            asked.wanted[own, own] = wanted
        asked.age_s[:] = 0.0 if seen.age_s is None else seen.age_s
        asked.error_m[:] = 0.0 if seen.position_error_m is None else seen.position_error_m
        asked.visiting[:] = False if seen.visiting is None else seen.visiting
        asked.adversary_s[:] = np.nan if seen.adversary_s is None else seen.adversary_s
        asked.driven[:] = np.nan if seen.driven is None else seen.driven

    def _decided(self, static: Static, deciders: Deciders) -> Decided:
        """What is decided, (n,): that of the team, or of each boat its own."""
        deciders.decide(static)
        if self.config.coordination == "team":
            return Decided._make(values[0].copy() for values in deciders.decided)
        own = np.arange(len(deciders.asked.state))
        if deciders.pending.shape[1] > 0:  # what each boat was told all others see
            deciders.pending[:, -1] = deciders.pending[own, -1, own]
        decided = Decided._make(values[own, own] for values in deciders.decided)
        first = np.flatnonzero(deciders.asked.ours.any(axis=1))[:1]
        return decided if len(first) == 0 else decided._replace(feared_s=deciders.decided.feared_s[first[0]].copy())

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

    def _follow(self, unknown: BoolArray, works: Array | None, sent: Commands, fleet: Fleet, boats: Boats) -> None:
        """Run the autopilots nobody tells of through what works in this step: of the delay, or what is sent."""
        if self._autopilots is None:
            return
        heading_deg = fleet.state[:, L.HEADING]
        if works is None:
            works = sent.as_relative_deg(heading_deg)
        else:
            with np.errstate(invalid="ignore"):  # what boats not ours were told may be anything
                works[:, 1] = (works[:, 1] - heading_deg + 180.0) % 360.0 - 180.0
        self._autopilots.go_on(unknown, boats.params, works, self.config.dt_s)

    def _around(self, surroundings: Surroundings, deciders: Deciders) -> Static:
        """Static constraints now; what was kept from others is no measure for these."""
        static = self._static(surroundings)
        if static is not self._kept_from:
            self._kept_from = static
            deciders.memory.static_m[:] = 0.0
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
