"""The set from which the shield does not save a boat, found by playing: beside that from which nobody can."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import wrap_degrees
from steerclear.shield.tables.duel import GREEDY, LEAD, PURE, best_rudders, chase, duel, steer
from steerclear.shield.tables.files import ValueTable, load_table, stack_tables
from steerclear.shield.tables.lookup import Tables
from steerclear.shield.tables.margin import full_thrust_state
from steerclear.shield.tables.moves import SUB_STEP_S, sub_steps

from ..jit import kernel
from ..workers import Job, Row
from .unsafe_sets import values_m

RINGS, BEARINGS = 150, 36
BAND_M = 1.0
"""Every position is played whose value is between the radius and this much more; below nobody can save the boat."""
BEYOND = 79
"""Of those of a higher value one in so many is tried; no whole part of a ring, so that all bearings have their turn."""
REFUSED = {
    "separation_m": "the sets are of the radius given with --radius",
    "dt_s": "boats move, and tables are stepped, by 0.1 s",
    "delay_s": "the value table knows no delay; widen the sets with --radius",
    "position_error_m": "the value table takes positions as exact; widen the sets with --radius",
    "coordination": "games are played in batches, which decide for whole teams",
}
"""Settings under which the games would be about something else, and why."""
LONGEST_S = 45.0
"""Games last as long as the table looks ahead, but no longer."""
MANNERS = (GREEDY, LEAD, PURE)
"""What the opponent does: what the table calls worst, steer for the meeting point, steer at the boat."""
AHEAD, AT_IT = 0, 1
WANTS = (AHEAD, AT_IT)
"""What the boat's policy wants: straight on at top speed, or straight at the opponent."""


@dataclass(frozen=True)
class PlayedSet:
    """Areas for one pair of speeds and one relative heading.

    Attributes:
        own_mps: own speed, m/s.
        other_mps: the opponent's speed, m/s.
        heading_deg: heading of the opponent relative to the own one, deg; 180 is head-on.
        reach_m2: positions of the opponent whose value is below the radius, m^2: all count as lost.
        lost_m2: positions of a value up to `BAND_M` above it from which some opponent reached the shielded boat, m^2.
        player_m2: those from which some opponent reached a boat that the table itself steers, at top speed, m^2.
        played: how many of those were played, each against every opponent with every want.
        tried: positions of higher values that were played.
        tried_lost: those of them from which an opponent reached the boat.
    """

    own_mps: float
    other_mps: float
    heading_deg: float
    reach_m2: float
    lost_m2: float
    player_m2: float
    played: int
    tried: int
    tried_lost: int

    @property
    def ratio(self) -> float:
        """The reachability set and what is lost beside it, times the former."""
        return (self.reach_m2 + self.lost_m2) / self.reach_m2

    @property
    def player_ratio(self) -> float:
        """The same of the boat that the table steers: what the table promises and cannot keep."""
        return (self.reach_m2 + self.player_m2) / self.reach_m2


@dataclass(frozen=True)
class Task:
    """One pair of speeds and one heading to play: plain values that travel to other processes."""

    own: str
    other: str
    radius_m: float
    settings: tuple[tuple[str, Any], ...]
    heading_deg: float
    own_mps: float
    other_mps: float


def play_job(job: Job) -> list[Row]:
    """Play the task that plain values describe; its one row."""
    settings = tuple((name, value) for name, value in job["settings"])
    return [asdict(play_set(Task(**{**job, "settings": settings})))]


def play_set(task: Task) -> PlayedSet:
    """Play the positions of one pair of speeds and one heading.

    A position counts as lost when in any of its games the boats came within the radius. Both begin at full thrust.

    Raises:
        SteerclearError: there is no table of the pair, or a setting is refused.
    """
    values = load_table(task.own, task.other, "worst-case")
    config = ShieldConfig.of(**{"separation_m": task.radius_m, "profile": "rammers", **dict(task.settings)})
    state, cells_m2 = _positions(values, task)
    value_m = values_m(values, state)
    reach, band = value_m < task.radius_m, value_m < task.radius_m + BAND_M
    beside, beyond = np.flatnonzero(band & ~reach), np.flatnonzero(~band)[::BEYOND]
    chosen, run_s = np.concatenate([beside, beyond]), min(LONGEST_S, values.card.horizon_s)
    lost = games_lost(values, config, state[chosen], task.radius_m, run_s)
    player_lost = duels_lost(values, state[beside], task.radius_m, run_s)
    return PlayedSet(
        own_mps=task.own_mps,
        other_mps=task.other_mps,
        heading_deg=task.heading_deg,
        reach_m2=math.pi * task.radius_m**2 + float(cells_m2[reach].sum()),
        lost_m2=float(cells_m2[beside][lost[: len(beside)]].sum()),
        player_m2=float(cells_m2[beside][player_lost].sum()),
        played=len(beside),
        tried=len(beyond),
        tried_lost=int(lost[len(beside) :].sum()),
    )


def _positions(values: ValueTable, task: Task) -> tuple[Array, Array]:
    """States (k, 2, N_STATE) with the opponent all round the boat, from the radius to the table's end; cells, m^2."""
    edges = np.linspace(task.radius_m, values.card.make_grid().rho_last_m, RINGS + 1)
    bearings = (np.arange(BEARINGS) + 0.5) * (2.0 * math.pi / BEARINGS)
    rho, beta = (axis.ravel() for axis in np.meshgrid(0.5 * (edges[1:] + edges[:-1]), bearings, indexing="ij"))
    own = full_thrust_state(get_platform(task.own), task.own_mps)
    other = full_thrust_state(get_platform(task.other), task.other_mps, task.heading_deg)
    state = np.tile(np.stack([own, other]), (rho.size, 1, 1))
    state[:, 1, L.X], state[:, 1, L.Y] = rho * np.sin(beta), rho * np.cos(beta)
    return state, np.repeat(0.5 * np.diff(edges**2) * (2.0 * math.pi / BEARINGS), BEARINGS)


def games_lost(
    values: ValueTable, config: ShieldConfig, start: Array, radius_m: float, run_s: float
) -> NDArray[np.bool_]:
    """From which of these states (k, 2, N_STATE) a shielded first boat is reached in some game of ``run_s``."""
    kinds = [(manner, want) for manner in MANNERS for want in WANTS]
    state = np.repeat(start, len(kinds), axis=0)
    manner, want = (np.tile(np.array(column), len(start)) for column in zip(*kinds, strict=True))
    names = values.card.own, values.card.other
    params = np.stack([get_platform(name).pack() for name in names])
    reached = np.zeros(len(state), np.bool_)
    if len(state) > 0:
        shield = BatchedShield(config, len(state), names, (0, 1))
        tables, wanted = stack_tables([values]), np.zeros((len(state), 2, 2))
        for _ in range(round(run_s / SUB_STEP_S)):
            ask(params[0], state, want, wanted)
            sent = shield.decide(state, wanted, np.stack([~reached, np.zeros_like(reached)], axis=-1))
            move(tables, params, state, sent, manner, sub_steps(values.card.dt_s), radius_m, reached)
    return np.asarray(reached.reshape(len(start), len(kinds)).any(axis=1))


def duels_lost(values: ValueTable, start: Array, radius_m: float, run_s: float) -> NDArray[np.bool_]:
    """From which of these states (k, 2, N_STATE) a first boat that the table steers is reached in some game."""
    tables, steps = stack_tables([values]), round(run_s / SUB_STEP_S)
    params = np.stack([get_platform(name).pack() for name in (values.card.own, values.card.other)])
    table_steps = sub_steps(values.card.dt_s)

    def lost(own: Array, other: Array, manner: int) -> bool:
        return bool(duel(tables, 0, params, own.copy(), other.copy(), manner, False, table_steps, steps) < radius_m)

    return np.array([any(lost(one[0], one[1], manner) for manner in MANNERS) for one in start], dtype=np.bool_)


@kernel
def ask(params: Array, state: Array, want: IntArray, wanted: Array) -> None:
    """Commands the boats' policies want: top speed, straight on or at the opponent."""
    for b in range(state.shape[0]):
        own, other = state[b, 0], state[b, 1]
        wanted[b, 0, 0], wanted[b, 0, 1] = params[L.MAX_SPEED], 0.0
        if want[b] == AT_IT:
            bearing = math.degrees(math.atan2(other[L.X] - own[L.X], other[L.Y] - own[L.Y]))
            wanted[b, 0, 1] = wrap_degrees(bearing - own[L.HEADING])


@kernel
def move(
    tables: Tables,
    params: Array,
    state: Array,
    sent: Array,
    manner: IntArray,
    table_steps: int,
    radius_m: float,
    reached: BoolArray,
) -> None:
    """One step of all games that go on: the boat as it is told, the opponent in its manner; notes who was reached."""
    for b in range(state.shape[0]):
        if reached[b]:
            continue
        own, other = state[b, 0], state[b, 1]
        if manner[b] == GREEDY:
            _, _, rudder = best_rudders(tables, 0, params, own, other, False, table_steps)
        else:
            rudder = chase(params[1], other, own, manner[b] == LEAD)
        step_boat(params[0], own, sent[b, 0, 0], sent[b, 0, 1], SUB_STEP_S)
        steer(params[1], other, rudder)
        reached[b] = math.hypot(other[L.X] - own[L.X], other[L.Y] - own[L.Y]) < radius_m


def check_settings(settings: Mapping[str, Any]) -> None:
    """Refuse settings of `REFUSED`, and those the shield does.

    Raises:
        ConfigError: one of them.
    """
    for name, why in REFUSED.items():
        if name in settings:
            raise ConfigError(f"{name} cannot be set here: {why}")
    ShieldConfig.of(**settings)


def tasks_of(
    own: str, other: str, radius_m: float, settings: dict[str, Any], places: Sequence[tuple[float, float, float]]
) -> list[Task]:
    """One task for each place (relative heading, deg, own and the other's speed, m/s)."""
    given = tuple(sorted(settings.items()))
    return [Task(own, other, radius_m, given, *place) for place in places]
