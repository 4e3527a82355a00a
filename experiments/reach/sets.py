"""Sets from which a boat is lost: by the value table, by the shield's own safety margin, and found by playing.

`compare_sets` sets what the shield cannot promise to save beside what reachability says nobody can save; `play_job`
plays games from all round the latter, and tells from which positions the shield did not save the boat.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from steerclear.shield.batch import BatchedShield
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray, IntArray, kernel
from steerclear.shield.model import boats_of
from steerclear.shield.platforms import get_platform
from steerclear.shield.platforms import layout as L
from steerclear.shield.platforms.step import step_boat
from steerclear.shield.platforms.usv import wrap_degrees
from steerclear.shield.tables.areas import HEADINGS_DEG, SPEED_SHARES
from steerclear.shield.tables.duel import GREEDY, LEAD, PURE, best_rudders, chase, duel, steer
from steerclear.shield.tables.files import ValueTable, load_table, stack_tables
from steerclear.shield.tables.lookup import WHOLE_S, Tables, table_value
from steerclear.shield.tables.margin import full_thrust_state
from steerclear.shield.tables.moves import SUB_STEP_S, sub_steps

from ..runner import Experiment
from ..workers import Job, Row

RATIO_GOAL = 1.15
MISSED_PERCENT_GOAL = 2.0
"""Share of the reachability set the shield may call safe, %: what the table's rounding (2.4 cm) and grid leave open."""
RANGES, BEARINGS = 200, 72
"""Cells of compared sets."""
PLAYED_RANGES, PLAYED_BEARINGS = 150, 36
"""Cells of played ones."""
BAND_M = 1.0
"""Every position is played whose value is between the radius and this much more; below nobody can save the boat."""
BEYOND = 79
"""Of those of a higher value one in so many is tried; no whole part of a ring, so that all bearings have their turn."""
LONGEST_S = 45.0
"""Games last as long as the table looks ahead, but no longer."""
MANNERS = (GREEDY, LEAD, PURE)
"""What the opponent does: what the table calls worst, steer for the meeting point, steer at the boat."""
WANTS = AHEAD, AT_IT = 0, 1
"""What the boat's policy wants: straight on at top speed, or straight at the opponent."""
NOT_COMPARED = {
    "separation_m": "both sets are of the separation given with --separation",
    "buffer_m": "both sets are of the separation given with --separation, without buffer",
    "position_error_m": "the value table takes positions as exact; widen both sets with --separation",
    "delay_s": "the value table knows no delay; leave it out, or widen both sets with --separation",
}
NOT_PLAYED = {
    "separation_m": "the sets are of the separation given with --separation",
    "dt_s": "boats move, and tables are stepped, by 0.1 s",
    "delay_s": "the value table knows no delay; widen the sets with --separation",
    "position_error_m": "the value table takes positions as exact; widen the sets with --separation",
    "coordination": "games are played in batches, which decide for whole teams",
}
"""Settings of the shield under which the sets would answer another question, and what to do instead."""
Place = tuple[float, float, float]
"""Heading of the opponent relative to the own one, deg (180 is head-on), own and the opponent's speed, m/s."""


@dataclass(frozen=True)
class SetPair:
    """Areas, m^2, of both sets for one pair of speeds and one relative heading, over the same cells.

    Of positions of the opponent: ``shield_m2`` where the shield's safety margin is negative, ``reach_m2`` where the
    table's value is below the radius, ``missed_m2`` the latter without the former: the table calls them lost, the
    shield calls them safe, and one of the two is wrong.
    """

    own_mps: float
    other_mps: float
    heading_deg: float
    shield_m2: float
    reach_m2: float
    missed_m2: float

    @property
    def ratio(self) -> float:
        """The shield's set by area, times the reachability set."""
        return self.shield_m2 / self.reach_m2

    @property
    def missed_percent(self) -> float:
        """Share of the reachability set that the shield calls safe, %."""
        return 100.0 * self.missed_m2 / self.reach_m2


@dataclass(frozen=True)
class PlayedSet:
    """Areas, m^2, for one pair of speeds and one relative heading.

    Of positions of the opponent: ``reach_m2`` where the value is below the radius: all count as lost; of a value up to
    `BAND_M` above it, of which ``played`` were, each against every opponent with every want, ``lost_m2`` from which
    some opponent reached the shielded boat, ``player_m2`` a boat that the table itself steers, at top speed. Of those
    of higher values that were ``tried``, an opponent reached the boat from ``tried_lost``.
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


def places(values: ValueTable) -> list[Place]:
    """The speeds and headings that sets are made for."""
    grid = values.card.make_grid()
    return [(h, a * grid.own_top_mps, b * grid.other_top_mps) for a, b in SPEED_SHARES for h in HEADINGS_DEG]


def _config(radius_m: float, settings: Mapping[str, Any], refused: Mapping[str, str], **given: Any) -> ShieldConfig:
    """Settings of the shield at a radius; opponents are the worst there are, as reachability takes them.

    Raises:
        ConfigError: a refused one, or one that the shield refuses.
    """
    for name, remedy in refused.items():
        if name in settings:
            raise ConfigError(f"{name} cannot be set here: {remedy}")
    return ShieldConfig.of(**{"separation_m": radius_m, "profile": "ramming", **given, **settings})


def _all_round(values: ValueTable, place: Place, radius_m: float, cells: tuple[int, int, float]) -> tuple[Array, Array]:
    """States (k, 2, N_STATE) with the opponent in every cell from the radius to the table's range; their areas, m^2.

    ``cells``: ranges, bearings, and where in a cell's bearings the opponent is, a share.
    """
    ranges, bearings, within = cells
    heading_deg, own_mps, other_mps = place
    own = full_thrust_state(get_platform(values.card.own), own_mps)
    other = full_thrust_state(get_platform(values.card.other), other_mps, heading_deg)
    edges = np.linspace(radius_m, values.card.make_grid().rho_last_m, ranges + 1)
    angles = (np.arange(bearings) + within) * (2.0 * math.pi / bearings)
    rho, beta = (axis.ravel() for axis in np.meshgrid(0.5 * (edges[1:] + edges[:-1]), angles, indexing="ij"))
    state = np.tile(np.stack([own, other]), (rho.size, 1, 1))
    state[:, 1, L.X], state[:, 1, L.Y] = rho * np.sin(beta), rho * np.cos(beta)
    return state, np.repeat(0.5 * np.diff(edges**2) * (2.0 * math.pi / bearings), bearings)


def values_m(values: ValueTable, state: Array) -> Array:
    """The table's value of every state, m."""
    tables = stack_tables([values])
    gap, heading = state[:, 1, : L.Y + 1] - state[:, 0, : L.Y + 1], np.radians(state[:, :, L.HEADING])
    rows = np.column_stack([gap, heading, state[:, :, L.SPEED]])
    return np.array([table_value(tables, 0, WHOLE_S, *row) for row in rows.tolist()])


def sets_config(radius_m: float, settings: Mapping[str, Any]) -> ShieldConfig:
    """Settings of the shield whose set is compared at a radius.

    Raises:
        ConfigError: one of `NOT_COMPARED`, or one that the shield refuses.
    """
    return _config(radius_m, settings, NOT_COMPARED, buffer_m=0.0)


def looks_up(values: ValueTable, config: ShieldConfig) -> bool:
    """Whether the shield looks this opponent up in the value table itself: its set is then the table's, at a margin."""
    return bool(boats_of(config, (values.card.own, values.card.other), (0, 1)).table[0, 1] >= 0)


def compare_sets(
    values: ValueTable, config: ShieldConfig, notice: Callable[[int], None] = lambda done: None
) -> list[SetPair]:
    """Areas of both sets, of the radius that ``config`` keeps, at all `places`, both boats at full thrust."""
    found: list[SetPair] = []
    for place in places(values):
        found.append(compare_pair(values, config, *place))
        notice(len(found))
    return found


def compare_pair(
    values: ValueTable, config: ShieldConfig, heading_deg: float, own_mps: float, other_mps: float
) -> SetPair:
    """Areas of both sets, up to the table's range, for one relative heading and pair of speeds."""
    radius_m = config.separation_m + config.buffer_m + 2.0 * config.position_error_m
    state, cells = _all_round(values, (heading_deg, own_mps, other_mps), radius_m, (RANGES, BEARINGS, 0.0))
    ours = safety_margins_m(state, (values.card.own, values.card.other), config) < 0.0
    theirs = values_m(values, state) < radius_m
    disc, areas = math.pi * radius_m**2, [float(cells[lost].sum()) for lost in (ours, theirs, theirs & ~ours)]
    return SetPair(own_mps, other_mps, heading_deg, disc + areas[0], disc + areas[1], areas[2])


def safety_margins_m(state: Array, names: tuple[str, str], config: ShieldConfig) -> Array:
    """The shield's safety margin for the first boat of every state, m."""
    shield = BatchedShield(config, len(state), names, (0, 1))
    nominal = np.zeros((len(state), 2, 2))
    nominal[:, :, 0] = get_platform(names[0]).max_speed_mps
    shield.decide(state, nominal, np.tile([True, False], (len(state), 1)))
    return np.asarray(shield.safety_margin_m[:, 0])


def played_experiment(own: str, other: str, radius_m: float, settings: Mapping[str, Any]) -> Experiment:
    """The games of two boats, one job a place.

    Raises:
        SteerclearError: there is no table of the pair, or a setting is refused.
    """
    values = load_table(own, other, "worst-case")
    _config(radius_m, settings, NOT_PLAYED)
    told = {"own": own, "other": other, "radius_m": radius_m, "shield": dict(settings)}
    return Experiment("reach-play", told, [{**told, "place": place} for place in places(values)], play_job, "sets")


def play_job(job: Job) -> list[Row]:
    """Play the positions of one pair of speeds and one heading: a `PlayedSet` as a row.

    A position counts as lost when in any of its games the boats came within the radius. Both begin at full thrust.

    Raises:
        SteerclearError: there is no table of the pair, or a setting is refused.
    """
    values, radius_m = load_table(job["own"], job["other"], "worst-case"), job["radius_m"]
    heading_deg, own_mps, other_mps = place = tuple(job["place"])
    config = _config(radius_m, job["shield"], NOT_PLAYED)
    state, cells_m2 = _all_round(values, place, radius_m, (PLAYED_RANGES, PLAYED_BEARINGS, 0.5))
    value_m = values_m(values, state)
    reach, band = value_m < radius_m, value_m < radius_m + BAND_M
    beside, beyond = np.flatnonzero(band & ~reach), np.flatnonzero(~band)[::BEYOND]
    chosen, run_s = np.concatenate([beside, beyond]), min(LONGEST_S, values.card.horizon_s)
    lost = games_lost(values, config, state[chosen], radius_m, run_s)
    player_lost = duels_lost(values, state[beside], radius_m, run_s)
    found = PlayedSet(
        own_mps=own_mps,
        other_mps=other_mps,
        heading_deg=heading_deg,
        reach_m2=math.pi * radius_m**2 + float(cells_m2[reach].sum()),
        lost_m2=float(cells_m2[beside][lost[: len(beside)]].sum()),
        player_m2=float(cells_m2[beside][player_lost].sum()),
        played=len(beside),
        tried=len(beyond),
        tried_lost=int(lost[len(beside) :].sum()),
    )
    return [asdict(found)]


def games_lost(values: ValueTable, config: ShieldConfig, start: Array, radius_m: float, run_s: float) -> BoolArray:
    """From which of these states (k, 2, N_STATE) a shielded first boat is reached in some game of ``run_s``."""
    kinds = [(manner, want) for manner in MANNERS for want in WANTS]
    state = np.repeat(start, len(kinds), axis=0)
    manner, want = (np.tile(np.array(column), len(start)) for column in zip(*kinds, strict=True))
    names = values.card.own, values.card.other
    params = np.stack([get_platform(name).pack() for name in names])
    reached = np.zeros(len(state), np.bool_)
    if len(state) > 0:
        shield = BatchedShield(config, len(state), names, (0, 1))
        tables, nominal = stack_tables([values]), np.zeros((len(state), 2, 2))
        for _ in range(round(run_s / SUB_STEP_S)):
            ask(params[0], state, want, nominal)
            filtered = shield.decide(state, nominal, np.stack([~reached, np.zeros_like(reached)], axis=-1))
            move(tables, params, state, filtered, manner, sub_steps(values.card.dt_s), radius_m, reached)
    return np.asarray(reached.reshape(len(start), len(kinds)).any(axis=1))


def duels_lost(values: ValueTable, start: Array, radius_m: float, run_s: float) -> BoolArray:
    """From which of these states (k, 2, N_STATE) a first boat that the table steers is reached in some game."""
    tables, steps = stack_tables([values]), round(run_s / SUB_STEP_S)
    params = np.stack([get_platform(name).pack() for name in (values.card.own, values.card.other)])
    table_steps = sub_steps(values.card.dt_s)

    def lost(own: Array, other: Array, manner: int) -> bool:
        return bool(duel(tables, 0, params, own.copy(), other.copy(), manner, False, table_steps, steps) < radius_m)

    return np.array([any(lost(one[0], one[1], manner) for manner in MANNERS) for one in start], dtype=np.bool_)


@kernel
def ask(params: Array, state: Array, want: IntArray, nominal: Array) -> None:
    """Commands the boats' policies want: top speed, straight on or at the opponent."""
    for b in range(state.shape[0]):
        own, other = state[b, 0], state[b, 1]
        nominal[b, 0, 0], nominal[b, 0, 1] = params[L.MAX_SPEED], 0.0
        if want[b] == AT_IT:
            bearing = math.degrees(math.atan2(other[L.X] - own[L.X], other[L.Y] - own[L.Y]))
            nominal[b, 0, 1] = wrap_degrees(bearing - own[L.HEADING])


@kernel
def move(
    tables: Tables,
    params: Array,
    state: Array,
    filtered: Array,
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
        step_boat(params[0], own, filtered[b, 0, 0], filtered[b, 0, 1], SUB_STEP_S)
        steer(params[1], other, rudder)
        reached[b] = math.hypot(other[L.X] - own[L.X], other[L.Y] - own[L.Y]) < radius_m
