"""`BatchedShield`: the same decision for thousands of games, compiled, no Python in the loop."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any, NamedTuple

import numpy as np

from .arrays import NoNumbersError, numbers, truths, whole_numbers
from .barriers.boats import reported_margin
from .barriers.value_function import WAYS
from .config import ShieldConfig
from .exceptions import ConfigError, FleetError
from .filter.flow import decide_compiled
from .fleet import LARGEST, LARGEST_SPEED_MPS, foreseeable
from .game_facts import facts_of_games, warn_of_distances
from .jit import Array, BoolArray, IntArray, copy_row, kernel
from .kept_barriers import KeptBarriers
from .memory import Memory, new_memory, put_memory, take_memory
from .plan import new_plan
from .platforms import Platform
from .platforms import layout as L
from .same_games import check_same_games
from .scene import Scene, new_scene, path_samples
from .setup import boats_of, tuning_of
from .surroundings import OPEN_WATER, Surroundings
from .tracking.driving import driven_boats
from .tracking.tracks import fill_memory, queue_commands, run_on_commands, steps_of_delay, turn_round
from .work import new_work


class Asked(NamedTuple):
    """What is to be decided about, of B games of n boats.

    Attributes:
        state: (B, n, N_STATE) boat states.
        wanted: (B, n, 2) wanted commands.
        ours: (B, n) boats to decide for.
        fear_s: (B, n) time for which each opponent may do its worst, s.
        driven: (B, n, 4) what drives boats that something drives, see `Fleet.driven`.
        known: (B, n) boats whose way is foreseen by that.
    """

    state: Array
    wanted: Array
    ours: BoolArray
    fear_s: Array
    driven: Array
    known: BoolArray


class Decided(NamedTuple):
    """What is decided: see `BatchedShield.decide`."""

    sent: Array
    reason: IntArray
    certificate_m: Array
    cut_short: BoolArray


@kernel
def decide_games(
    asked: Asked,
    decided: Decided,
    scene: Scene,
    memory: Memory,
    pending: Array,
    error_m: Array,
    late_m: float,
) -> None:
    """Decide for every game in turn, for the moment its commands take effect.

    ``scene`` serves one game after another, each with its own part of ``memory``.
    """
    n = asked.state.shape[1]
    boats, tuning, work, plan = scene.boats, scene.tuning, scene.work, scene.plan
    ahead, wanted, margin_m = np.empty_like(asked.state[0]), np.empty_like(asked.wanted[0]), np.empty(n)
    for b in range(asked.state.shape[0]):
        state, ours, sent = asked.state[b], asked.ours[b], decided.sent[b]
        ahead[:] = state
        turn_round(ahead, ours)
        fill_memory(ahead, boats.params)
        run_on_commands(ahead, ours, boats.params, pending[b], tuning.dt_s)
        for i in range(n):
            wanted[i] = asked.wanted[b, i]
            margin_m[i] = error_m[i] if ours[i] else error_m[i] + late_m
            if ahead[i, L.HEADING] != state[i, L.HEADING]:
                wanted[i, 1] += state[i, L.HEADING] - ahead[i, L.HEADING]
        copy_row(work.fear_s, asked.fear_s[b])
        work.driven[:], work.known[:] = asked.driven[b], asked.known[b]
        take_memory(memory, b, scene.memory)
        decide_compiled(scene, ahead, wanted, margin_m, ours)
        put_memory(scene.memory, b, memory)
        decided.cut_short[b] = work.cut_short[0]
        for i in range(n):
            sent[i] = asked.wanted[b, i]
            if plan.commands[i, 0] != wanted[i, 0] or plan.commands[i, 1] != wanted[i, 1]:
                sent[i, 0] = plan.commands[i, 0]
                sent[i, 1] = plan.commands[i, 1] + ahead[i, L.HEADING] - state[i, L.HEADING]
            decided.reason[b, i] = plan.reason[i]
            decided.certificate_m[b, i] = reported_margin(i, ahead, work) if ours[i] else np.inf
        if pending.shape[1] > 0:
            queue_commands(pending[b], ahead, plan.commands)


class BatchedShield:
    """`Shield` for B games of the same fleet, with the exact compiled projection as its QP solver.

    Decisions are those of `Shield` to rounding: the stages are the same functions. Tracks are taken as fresh and
    exact up to ``position_error_m``. It decides for one thread at a time, as `Shield` does.

    Args:
        config: settings; coordination must be "team".
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        surroundings: static constraints, the same for all games.
        flag_of: team whose flag's circle the surroundings' ``stops`` are; None: nobody's in particular.

    Raises:
        ConfigError: a setting that a batch cannot honour, or that is none.
    """

    def __init__(
        self,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        surroundings: Surroundings = OPEN_WATER,
        flag_of: int | None = None,
    ) -> None:
        if not isinstance(config, ShieldConfig) or not isinstance(surroundings, Surroundings):
            found = f"{type(config).__name__} and {type(surroundings).__name__}"
            raise ConfigError(f"config and surroundings are {found}; give ShieldConfig.of(...) and Surroundings(...)")
        if config.coordination != "team":
            raise ConfigError("a batch decides for whole teams at once: set coordination='team'")
        if isinstance(games, bool) or not isinstance(games, (int, np.integer)) or games < 1:
            raise ConfigError(f"games is {games!r}; give a whole number >= 1")
        self.config, self.flag_of = config, flag_of
        self.platforms, self.team = _kinds(platforms), _teams(team)
        if len(self.platforms) != len(self.team) or not self.platforms:
            raise ConfigError(
                f"{len(self.platforms)} platforms and {len(self.team)} team entries; give one of each per boat"
            )
        n = len(self.platforms)
        boats = boats_of(config, self.platforms, self.team)
        self._horizon_s = float(boats.samples.max(initial=0)) * boats.sample_s
        self._memory = new_memory(games, n)
        self._barriers = KeptBarriers(config)
        self._scene = new_scene(
            boats=boats,
            around=(surroundings.pack(config), self._barriers.arrays),
            tuning=tuning_of(config),
            memory=new_memory(n),
            work=new_work(n, path_samples(boats)),
            plan=new_plan(n, n * ((WAYS + 1) * n + 6) + 2),
        )
        self._margin = np.full(n, config.position_error_m)
        self._late_m = config.track_error_mps * config.delay_s
        self._pending = np.full((games, steps_of_delay(config), n, 2), np.nan)
        self.reason = np.zeros((games, n), np.int64)
        self.certificate_m = np.full((games, n), np.inf)
        self.sent = np.zeros((games, n, 2))
        self._undriven = np.full((games, n, 4), np.nan)
        self.cut_short = np.zeros(games, np.bool_)
        self.serves: int | None = None

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the backups of the games in ``mask`` (B,) of True and False, or of all.

        Raises:
            FleetError: the mask is no such array.
        """
        which = slice(None) if mask is None else _mask(mask, len(self.reason))
        self.serves = None if mask is None else self.serves
        self._memory.kept[which] = False
        self._memory.backing_up[which] = False
        self._pending[which] = np.nan

    def decide(
        self,
        state: Array,
        wanted: Array,
        ours: BoolArray,
        visiting: BoolArray | None = None,
        driven: Array | None = None,
    ) -> Array:
        """Safe commands.

        Args:
            state: (B, n, N_STATE) boat states; memory of the autopilot that is NaN is filled from the speed, not
                followed as `Shield` does.
            wanted: (B, n, 2) speed m/s and relative heading deg, as `Commands.game_deg`: games limit speeds themselves.
            ours: (B, n) boats to decide for.
            visiting: (B, n) boats on the other team's side, see `Fleet.visiting`; None: of none it is known.
            driven: (B, n, 4) of boats that the games drive, see `Fleet.driven`; rows of NaN, or None, where nothing is
                known. Those not decided for are foreseen as such.

        Returns:
            (B, n, 2) commands; rows of boats not decided for, and of those that pass, bit for bit as wanted. The
            array is reused by the next call. ``reason`` and ``certificate_m`` (B, n) tell why, ``cut_short`` (B,)
            which decisions were ended by `ShieldConfig.search_limit`.

        Raises:
            FleetError: an array has the wrong shape or holds no numbers, or a state is not finite.
        """
        games = self.reason.shape
        state = _shaped("state", state, (*games, L.N_STATE), numbers)
        wanted = _shaped("wanted", wanted, (*games, 2), numbers)
        ours = _shaped("ours", ours, games, truths)
        seen = np.zeros(games, np.bool_) if visiting is None else _shaped("visiting", visiting, games, truths)
        if not (np.abs(state[:, :, : L.SPEED_ERROR]) <= LARGEST).all() or (np.abs(state) > LARGEST).any():
            raise FleetError(f"a boat's position, heading, speed, thrust or rudder is not finite or beyond {LARGEST:g}")
        if (np.abs(state[:, :, L.SPEED]) > LARGEST_SPEED_MPS).any():
            raise FleetError(f"a boat's speed is beyond {LARGEST_SPEED_MPS:g} m/s; no boat of a game goes so fast")
        fear_s = np.where(seen, self.config.visitor_feared_s, self.config.feared_s)
        driven = self._undriven if driven is None else _shaped("driven", driven, (*games, 4), numbers)
        known = np.empty(games, np.bool_)
        foreseeable(driven.reshape(-1, 4), ours.reshape(-1), self._horizon_s, known.reshape(-1))
        asked = Asked(state, wanted, ours, fear_s, driven, known)
        decided = Decided(self.sent, self.reason, self.certificate_m, self.cut_short)
        self._barriers.renew()
        decide_games(asked, decided, self._scene, self._memory, self._pending, self._margin, self._late_m)
        self._barriers.tell()
        return self.sent

    def filter_for(self, team: int, shield_autopilot: bool = True) -> Any:
        """Command filter for a batched game: ``step(actions, command_filter=shield.filter_for(0))``.

        Args:
            team: the team to shield.
            shield_autopilot: also decide for boats the game drives (tagged, out of bounds; never disabled ones).

        Raises:
            ConfigError: no boat is of that team, or the shield was built for the other team's flag. When it is called:
                the shield was built for other games.
        """
        if isinstance(team, str) or team not in self.team:
            raise ConfigError(f"no boat is of team {team!r}; give one of {sorted(set(self.team))}")
        if self.flag_of not in (None, team):
            raise ConfigError(f"this shield keeps off the flag of team {self.flag_of}; build another for team {team}")
        return GamesFilter(self, team, shield_autopilot)

    def check_games(self, core: Any, team: int | None = None) -> None:
        """Check that games are those the shield was built for: boats, teams, number and step.

        The log says, once, if it keeps boats less far apart than the games count collisions.

        Args:
            core: the `BatchedMctf`.
            team: the team it decides for; None: any.

        Raises:
            ConfigError: they are not.
        """
        check_same_games(core, len(self.reason), self.platforms, self.team, self.config.dt_s)
        warn_of_distances(self.config, facts_of_games(core), team)


class GamesFilter:
    """The command filter of a shield for games, see `BatchedShield.filter_for`; copies of it decide by copies of it."""

    def __init__(self, shield: BatchedShield, team: int, shield_autopilot: bool) -> None:
        self.shield, self.team, self.shield_autopilot = shield, team, shield_autopilot
        self._checked: Any = None

    def __call__(self, core: Any, commands: Array) -> Array:
        """Safe commands (B, n, 2) for games that the shield was built for.

        Raises:
            ConfigError: they are others, or it has begun to serve the other team.
        """
        if self._checked is not core:
            self.shield.check_games(core, self.team)
            self._checked = core
        if self.shield.serves not in (None, self.team):
            raise ConfigError("this shield has begun to serve the other team; build one for each, or reset() it")
        self.shield.serves = self.team
        ours = (core.team == self.team) & ~core.is_disabled
        ours = ours if self.shield_autopilot else ours & ~core.driven
        return self.shield.decide(core.state, commands, ours, ~core.on_side, driven_boats(core))


def _shaped(name: str, value: Any, shape: tuple[int, ...], brought: Callable[[Any], Any]) -> Any:
    """An array of that shape, as compiled code takes it.

    Raises:
        FleetError: it is not.
    """
    try:
        array = brought(value)
    except NoNumbersError as error:
        raise FleetError(f"{name} is not usable ({error}); expected an array of shape {shape}") from None
    if array.shape != shape:
        raise FleetError(f"{name} has shape {array.shape}; expected {shape}")
    return array


def _mask(mask: Any, games: int) -> BoolArray:
    found = np.asarray(mask)
    if found.dtype != np.bool_ or found.shape != (games,):
        raise FleetError(f"mask is {found.dtype} of shape {found.shape}; give bool of shape ({games},)")
    return found


def _kinds(platforms: Any) -> tuple[str | Platform, ...]:
    if isinstance(platforms, (str, Platform)) or not isinstance(platforms, Iterable):
        raise ConfigError(f"platforms is {platforms!r}; give a list of them, one for each boat")
    return tuple(platforms)


def _teams(team: Any) -> tuple[int, ...]:
    try:
        found = whole_numbers(team)
    except NoNumbersError as error:
        raise ConfigError(f"team holds {error}; give a whole number for each boat") from None
    if found.ndim != 1:
        raise ConfigError(f"team has shape {found.shape}; give a whole number for each boat")
    return tuple(found.tolist())
