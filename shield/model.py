"""From settings and platforms to the constant arrays of a scene."""

from __future__ import annotations

import logging
import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from .backup.family import CERTIFICATES, Certificate
from .backup.paths import SAG_M
from .config import ShieldConfig
from .exceptions import TableError
from .jit import Array, BoolArray, IntArray
from .platforms import Platform, get_platform
from .platforms import layout as L
from .platforms.limits import ENOUGH_THRUST, FULL_THRUST, Limits, limits_of
from .shared import share
from .tables.files import ValueTable, load_table, stack_tables
from .tables.grid import CAP
from .tables.lookup import Tables, no_tables
from .tables.settings import OtherMay
from .workspace import Boats, Tuning

_LOG = logging.getLogger(__name__)

FADE = 4.0
"""A negative margin against a pursuer at the end of the time it is followed counts exp(-FADE) of one now."""

JOINT_RUN_S = 3.0
"""Time over which several opponents of a boat are run through before they are looked up one by one, s.

With 5 s as few surveyors are hit by two and three rammers, but more commands are changed in games; with 8 s more are
hit, since pursuers are less than the worst there is.
"""

CHASE_S = 30.0
"""Time over which opponents no faster than a boat are followed as pursuers, s.

On the boat's quarter they close in for so long on an all but parallel course: of herons two such leave less room than
either. Of faster ones a run that long says that all is lost, which it is not.
"""

STATIC_REACTION_S = 0.5
"""Time beyond a half turn over which static constraints are looked at, s."""


def tuning_of(config: ShieldConfig) -> Tuning:
    """Scalar settings for compiled code."""
    return share(
        Tuning(
            dt_s=config.dt_s,
            model_s=config.model_s,
            moves=config.moves,
            radius_m=config.separation_m + config.buffer_m,
            buffer_m=config.buffer_m,
            straight_horizon_s=config.straight_horizon_s,
            margin_cap_m=config.margin_cap_m,
            speed_weight=config.speed_weight,
            teammate_margin_cap_m=config.teammate_margin_cap_m if _mates_are_known(config) else config.margin_cap_m,
            static_decay=_decay(config.static_cbf_rate_per_s, config),
            deadlock_timeout_s=config.deadlock_timeout_s,
            adversary_horizon_s=config.effective_adversary_horizon_s,
            intruder_horizon_s=config.effective_intruder_horizon_s,
            position_error_m=config.position_error_m,
            delay_s=config.delay_s,
            track_error_mps=config.track_error_mps,
            work_budget=config.work_budget,
        )
    )


def _mates_are_known(config: ShieldConfig) -> bool:
    """Whether what teammates will do is known: one program decides for all, and sees and steers them as they are.

    Nor may it be where nothing is feared of opponents but that they hold their course: their margin is one with it.
    """
    exact = config.position_error_m == 0.0 and config.delay_s == 0.0 and config.current_mps == 0.0
    return config.coordination == "team" and exact and config.effective_adversary_horizon_s > 0.0


@lru_cache(maxsize=256)
def boats_of(config: ShieldConfig, platforms: tuple[str | Platform, ...], team: tuple[int, ...]) -> Boats:
    """Constants of the boats of a fleet.

    Raises:
        PlatformError: a platform is unknown.
    """
    kinds = tuple(get_platform(name) for name in platforms)
    limits = [limits_of(kind, config.model_s) for kind in kinds]
    certificate = CERTIFICATES[config.opponent_model]
    granted = 1.0 if config.effective_adversary_horizon_s > 0.0 else 0.0
    strides = [_stride(kind, limit, config.model_s) for kind, limit in zip(kinds, limits, strict=True)]
    stride = max(1, min(strides, default=1))
    lookup = _tables_of(config, kinds, team) if granted == 1.0 else _no_tables(len(kinds))
    with_table = np.asarray((lookup.table >= 0).any(axis=1))
    params = np.array([kind.pack() for kind in kinds]).reshape(-1, L.N_PARAM)
    if config.moves > 1:
        params = np.column_stack([params, np.full(len(kinds), config.model_s)])
    return share(
        Boats(
            params=params,
            team=np.array(team, dtype=np.int64),
            fastest_mps=np.array([kind.fastest_mps(config.model_s) for kind in kinds]),
            granted_turn_dps=np.array([granted * limit.turn_rate_dps for limit in limits]),
            granted_acc_mps2=np.array([limit.acceleration_mps2 if granted > 0.0 else 0.0 for limit in limits]),
            regain_s=np.array([limit.regain_s for limit in limits]),
            granted_dec_mps2=np.array([limit.turn_deceleration_mps2 for limit in limits]),
            granted_loss=np.array([granted * _lasting_loss(limit) for limit in limits]),
            ready_thrust=_ready_thrust(params, limits, with_table),
            stride=stride,
            sample_s=stride * config.model_s,
            **_plans(certificate, kinds, with_table),
            decay=np.where(
                with_table, _decay(config.table_cbf_rate_per_s, config), _decay(config.cbf_rate_per_s, config)
            ),
            cap_m=np.where(with_table, _table_cap(config, lookup), config.margin_cap_m),
            min_backup_hold_s=np.array([config.min_backup_hold_s if kind.kind == "rate" else 0.0 for kind in kinds]),
            tables=lookup.tables,
            table=lookup.table,
            table_margin_m=config.table_margin_m,
            table_steps=np.where(with_table, lookup.steps, 0),
            joint_decay=_decay(config.cbf_rate_per_s, config),
            joint_samples=math.ceil(max(lookup.steps, round(JOINT_RUN_S / config.model_s)) / stride),
            feared=np.asarray((lookup.table >= 0).any(axis=0)),
            **_horizons(config, kinds, limits, team, stride * config.model_s, granted > 0.0),
        )
    )


@lru_cache(maxsize=256)
def missing_tables(config: ShieldConfig, platforms: tuple[str | Platform, ...], team: tuple[int, ...]) -> BoolArray:
    """Pairs (own boat, opponent), (n, n), that a value table should answer for and none does; the log says why."""
    sides = np.array(team)
    wanted = config.effective_adversary_horizon_s > 0.0
    limits = [limits_of(get_platform(name), config.model_s) for name in platforms]
    kinds = [get_platform(name) for name in platforms]
    uses = np.array(
        [wanted and _uses_table(config, kind, limit) for kind, limit in zip(kinds, limits, strict=True)], dtype=np.bool_
    )
    found: BoolArray = boats_of(config, platforms, team).table >= 0
    missing: BoolArray = uses[:, None] & (sides[:, None] != sides[None]) & ~found
    missing.setflags(write=False)  # all shields of such a fleet tell the same one
    return missing


def _horizons(
    config: ShieldConfig,
    kinds: tuple[Platform, ...],
    limits: list[Limits],
    team: tuple[int, ...],
    sample_s: float,
    pursuers: bool,
) -> dict[str, Any]:
    """How many samples each boat's paths, pursuers and static constraints are followed for."""
    certificate = CERTIFICATES[config.opponent_model]
    horizon_s = [config.horizon_s or certificate.horizon_s(kind, config.model_s) for kind in kinds]
    pursuit_s, static_s, thrust_s = list(horizon_s), [], []
    for i, limit in enumerate(limits):
        static_s.append(min(limit.half_turn_s + STATIC_REACTION_S, horizon_s[i]))
        thrust_s.append(limit.thrust_s if pursuers else 0.0)
        if pursuers:
            pursuit_s[i] = max(horizon_s[i], certificate.pursuit_s(limit))
    chase = _chases(kinds, team, pursuit_s, pursuers, sample_s)
    return {
        "chase_samples": chase,
        "chased_samples": chase.max(axis=1, initial=0),
        "samples": _samples(horizon_s, sample_s, 2),
        "pursuit_samples": _samples(pursuit_s, sample_s, 2),
        "thrust_samples": _samples(thrust_s, sample_s, 0),
        "fade": np.array([math.exp(-FADE * sample_s / value) for value in pursuit_s]),
        "static_samples": _samples(static_s, sample_s, 2),
    }


def _chases(
    kinds: tuple[Platform, ...], team: tuple[int, ...], pursuit_s: list[float], pursuers: bool, sample_s: float
) -> IntArray:
    """Samples beyond its own pursuit for which each boat (row) is followed by opponents that are no faster, (n, n)."""
    top, side = np.array([kind.pack()[L.MAX_SPEED] for kind in kinds]), np.array(team)
    longer = _samples([max(0.0, CHASE_S - value) if pursuers else 0.0 for value in pursuit_s], sample_s, 0)
    follows = (side[:, None] != side[None]) & (top[None] <= top[:, None])
    return np.where(follows, longer[:, None], 0)


def _ready_thrust(params: Array, limits: list[Limits], with_table: BoolArray) -> Array:
    """Thrust, percent, from which boats have enough: of that at top speed, or for a table of all there is."""
    top = params[:, L.MAX_THRUST]
    steady = np.minimum(top, [limit.thrust for limit in limits])
    return np.asarray(np.where(with_table, FULL_THRUST * top, ENOUGH_THRUST * steady))


def _samples(times_s: list[float], sample_s: float, least: int) -> IntArray:
    return np.array([max(least, math.ceil(value / sample_s)) for value in times_s], dtype=np.int64)


class _Lookup(NamedTuple):
    """Value tables of a fleet: all of them, which holds for each pair (-1: none), and the steps of one table step."""

    tables: Tables
    table: IntArray
    steps: int


def _no_tables(boats: int) -> _Lookup:
    return _Lookup(no_tables(), np.full((boats, boats), -1, dtype=np.int64), 1)


def _tables_of(config: ShieldConfig, kinds: tuple[Platform, ...], team: tuple[int, ...]) -> _Lookup:
    """Tables of all pairs of opponents whose own boat looks them up; pairs without one are run through instead."""
    lookup = _no_tables(len(kinds))
    found: dict[tuple[Platform, Platform], int] = {}
    tables: list[ValueTable] = []
    for i, own in enumerate(kinds):
        if not _uses_table(config, own, limits_of(own, config.model_s)):
            continue
        for j, other in enumerate(kinds):
            if team[i] == team[j]:
                continue
            if (own, other) not in found:
                table = _table_or_none(own, other)
                if table is None:
                    continue
                found[own, other] = len(tables)
                tables.append(table)
            lookup.table[i, j] = found[own, other]
    steps = max((round(table.card.dt_s / config.model_s) for table in tables), default=1)
    return _Lookup(stack_tables(tables), lookup.table, max(config.moves, steps))


def _uses_table(config: ShieldConfig, kind: Platform, limit: Limits) -> bool:
    """Whether a boat looks opponents up where there is a table; there is none for boats that turn by a rate loop."""
    return kind.kind != "rate" and CERTIFICATES[config.opponent_model].uses_table(limit)


@lru_cache(maxsize=64)
def _table_or_none(own: Platform, other: Platform) -> ValueTable | None:
    """The table of a pair; without a usable one its opponents are run through as pursuers, which the log says once."""
    try:
        return load_table(own, other, OtherMay.WORST_CASE)
    except TableError as error:
        _LOG.warning("%s; opponents are run through as pursuers instead", error)
        return None


def _plans(certificate: Certificate, kinds: tuple[Platform, ...], with_table: BoolArray) -> dict[str, Any]:
    """`Boats.plans` and `Boats.n_plans`."""
    families = [certificate.manoeuvres(*boat) for boat in zip(kinds, with_table, strict=True)]
    plans = np.full((len(kinds), max((len(family) for family in families), default=0), 3), np.nan)
    for rows, family in zip(plans, families, strict=True):
        rows[: len(family)] = family
    return {"plans": plans, "n_plans": np.array([len(family) for family in families], dtype=np.int64)}


def _decay(cbf_rate_per_s: float, config: ShieldConfig) -> float:
    """Factor by which a margin may shrink in one step."""
    return 0.0 if math.isinf(cbf_rate_per_s) else math.exp(-cbf_rate_per_s * config.dt_s)


def _widest_m(config: ShieldConfig) -> float:
    """Distance kept between boats whose tracks are as good as the settings say, m."""
    return config.separation_m + config.buffer_m + 2.0 * config.position_error_m


def _table_cap(config: ShieldConfig, lookup: _Lookup) -> float:
    """Margins above this may shrink freely, m: no more than the tables can tell."""
    kept_m = _widest_m(config) + config.table_margin_m
    known_m = min((float(axes[CAP]) for axes in lookup.tables.axes), default=math.inf)
    return max(0.0, min(config.margin_cap_m, known_m - kept_m))


def _stride(kind: Platform, limit: Limits, dt_s: float) -> int:
    """Model steps between path samples: the chord between two may cut its arc, v w t^2 / 8 deep, by `SAG_M`."""
    bend = kind.fastest_mps(dt_s) * math.radians(limit.turn_rate_dps)
    return int(math.sqrt(8.0 * SAG_M / bend) / dt_s + 1e-9) if bend > 0.0 else 1


def _lasting_loss(limit: Limits) -> float:
    """Share of top speed lost in a turn, as far as it is not regained at once when the turn ends."""
    return limit.turn_loss * min(1.0, limit.turn_deceleration_mps2 / max(limit.acceleration_mps2, 1e-6))
