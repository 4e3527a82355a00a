"""The constant arrays of a scene, from settings and platforms."""

from __future__ import annotations

import logging
import math
from functools import lru_cache
from typing import Any

import numpy as np

from .backup.family import OPPONENT_MODELS, OpponentModel
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
from .tables.lookup import Tables
from .tables.settings import OtherMay
from .tracks import steps_of_delay
from .workspace import Boats, Tuning

_LOG = logging.getLogger(__name__)

FADE = 4.0
"""A negative margin from a pursuer counts exp(-FADE) of its present weight at the end of the pursuit."""

JOINT_RUN_S = 3.0
"""Time for which several opponents of a boat are rolled out before they are looked up one by one, s.

With 5 s as few surveyors are hit by two and three rammers, but more commands are changed in games. With 8 s more are
hit, since rolled-out pursuers are not the worst case.
"""

CHASE_S = 30.0
"""Time for which opponents no faster than a boat are followed as pursuers, s.

On the boat's quarter they close in for that long on a nearly parallel course: two such herons leave less room than
either. A rollout that long of faster opponents would report that no manoeuvre is left, which is not so.
"""

STATIC_REACTION_S = 0.5
"""Time beyond a half turn for which static constraints are checked, s."""


def tuning_of(config: ShieldConfig) -> Tuning:
    """Return the scalar settings for compiled code.

    Margins from teammates may have a cap of their own only where their motion is known. That is where one decision
    covers all boats and sees and steers them exactly. It does not apply where opponents are only taken to hold their
    course: their margin is then one with that from teammates.
    """
    exact = config.position_error_m == 0.0 and config.delay_s == 0.0 and config.current_mps == 0.0
    known = config.coordination == "team" and exact and config.effective_adversary_horizon_s > 0.0
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
            teammate_margin_cap_m=config.teammate_margin_cap_m if known else config.margin_cap_m,
            static_decay=_decay(config.static_cbf_rate_per_s, config),
            deadlock_timeout_s=config.deadlock_timeout_s,
            adversary_horizon_s=config.effective_adversary_horizon_s,
            intruder_horizon_s=config.effective_intruder_horizon_s,
            position_error_m=config.position_error_m,
            delay_s=steps_of_delay(config) * config.dt_s,
            track_error_mps=config.track_error_mps,
            work_budget=config.work_budget,
        )
    )


@lru_cache(maxsize=256)
def boats_of(config: ShieldConfig, platforms: tuple[str | Platform, ...], team: tuple[int, ...]) -> Boats:
    """Return the constants of the boats of a fleet.

    Raises:
        PlatformError: a platform is unknown.
    """
    kinds, dt_s = tuple(get_platform(name) for name in platforms), config.model_s
    limits = [limits_of(kind, dt_s) for kind in kinds]
    opponent_model = OPPONENT_MODELS[config.opponent_model]
    stride = max(1, min((_stride(kind, limit, dt_s) for kind, limit in zip(kinds, limits, strict=True)), default=1))
    tables, table, steps = _tables_of(config, kinds, team)
    with_table = np.asarray((table >= 0).any(axis=1))
    params = np.array([kind.pack() for kind in kinds]).reshape(-1, L.N_PARAM)
    steady = np.minimum(params[:, L.MAX_THRUST], [limit.thrust for limit in limits])
    manoeuvres, n_manoeuvres = _manoeuvres_of(opponent_model, kinds, with_table)
    table_decay, decay = _decay(config.table_cbf_rate_per_s, config), _decay(config.cbf_rate_per_s, config)
    table_cap_m = _table_cap_m(config, tables)
    extra = [np.full(len(kinds), dt_s)] if config.moves > 1 else []
    return share(
        Boats(
            params=np.column_stack([params, *extra]),
            team=np.array(team, dtype=np.int64),
            fastest_mps=np.array([kind.fastest_mps(dt_s) for kind in kinds]),
            regain_s=np.array([limit.regain_s for limit in limits]),
            full_thrust_percent=np.where(with_table, FULL_THRUST * params[:, L.MAX_THRUST], ENOUGH_THRUST * steady),
            stride=stride,
            sample_s=stride * dt_s,
            manoeuvres=manoeuvres,
            n_manoeuvres=n_manoeuvres,
            decay=np.where(with_table, table_decay, decay),
            cap_m=np.where(with_table, table_cap_m, config.margin_cap_m),
            min_backup_hold_s=np.array([config.min_backup_hold_s if kind.kind == "rate" else 0.0 for kind in kinds]),
            tables=tables,
            table=table,
            table_margin_m=config.table_margin_m,
            table_steps=np.where(with_table, steps, 0),
            joint_decay=decay,
            joint_samples=math.ceil(max(steps, round(JOINT_RUN_S / dt_s)) / stride),
            has_table=np.asarray((table >= 0).any(axis=0)),
            **_as_opponents(config, limits),
            **_horizons(config, kinds, limits, team, stride * dt_s),
        )
    )


def _as_opponents(config: ShieldConfig, limits: list[Limits]) -> dict[str, Any]:
    """Return what is granted to each boat as an opponent."""
    pursuers = config.effective_adversary_horizon_s > 0.0
    granted = 1.0 if pursuers else 0.0
    return {
        "granted_turn_dps": np.array([granted * limit.turn_rate_dps for limit in limits]),
        "granted_acc_mps2": np.array([limit.acceleration_mps2 if pursuers else 0.0 for limit in limits]),
        "granted_dec_mps2": np.array([limit.turn_deceleration_mps2 for limit in limits]),
        "granted_loss": np.array([granted * _lasting_loss(limit) for limit in limits]),
    }


@lru_cache(maxsize=256)
def missing_tables(config: ShieldConfig, platforms: tuple[str | Platform, ...], team: tuple[int, ...]) -> BoolArray:
    """Return the pairs (own boat, opponent), (n, n), for which a value table is missing; the log says why."""
    sides, kinds = np.array(team), [get_platform(name) for name in platforms]
    uses = np.array([_uses_table(config, kind) for kind in kinds], dtype=np.bool_)
    found: BoolArray = boats_of(config, platforms, team).table >= 0
    missing: BoolArray = uses[:, None] & (sides[:, None] != sides[None]) & ~found
    return missing


def _horizons(
    config: ShieldConfig, kinds: tuple[Platform, ...], limits: list[Limits], team: tuple[int, ...], sample_s: float
) -> dict[str, Any]:
    """Return for how many samples each boat's paths, pursuers and static constraints are followed."""
    opponent_model, pursuers = OPPONENT_MODELS[config.opponent_model], config.effective_adversary_horizon_s > 0.0
    horizon_s = [config.horizon_s or opponent_model.horizon_s(kind, config.model_s) for kind in kinds]
    pursuit_s, thrust_s, chase_s = list(horizon_s), [0.0] * len(kinds), [0.0] * len(kinds)
    if pursuers:
        pursuit_s = [max(own, opponent_model.pursuit_s(limit)) for own, limit in zip(horizon_s, limits, strict=True)]
        thrust_s = [limit.thrust_s for limit in limits]
        chase_s = [max(0.0, CHASE_S - value) for value in pursuit_s]
    static_s = [min(limit.half_turn_s + STATIC_REACTION_S, own) for own, limit in zip(horizon_s, limits, strict=True)]
    top, side = np.array([kind.pack()[L.MAX_SPEED] for kind in kinds]), np.array(team)
    samples = _samples(horizon_s, sample_s, 2)
    no_faster = (side[:, None] != side[None]) & (top[None] <= top[:, None])
    chase = np.where(no_faster, _samples(chase_s, sample_s, 0)[:, None], 0)
    return {
        "chase_samples": chase,
        "chased_samples": chase.max(axis=1, initial=0),
        "samples": samples,
        "longest_samples": int(samples.max(initial=2)),
        "pursuit_samples": _samples(pursuit_s, sample_s, 2),
        "thrust_samples": _samples(thrust_s, sample_s, 0),
        "fade": np.array([math.exp(-FADE * sample_s / value) for value in pursuit_s]),
        "static_samples": _samples(static_s, sample_s, 2),
    }


def _samples(times_s: list[float], sample_s: float, least: int) -> IntArray:
    return np.array([max(least, math.ceil(value / sample_s)) for value in times_s], dtype=np.int64)


def _tables_of(
    config: ShieldConfig, kinds: tuple[Platform, ...], team: tuple[int, ...]
) -> tuple[Tables, IntArray, int]:
    """Return the value tables, the table of each pair of own boat and opponent, and the model steps of one table step.

    Opponents of pairs without a table (-1) are rolled out instead, as are all opponents of boats that look none up.
    """
    which = np.full((len(kinds), len(kinds)), -1, dtype=np.int64)
    found: dict[tuple[Platform, Platform], int] = {}
    tables: list[ValueTable] = []
    for i, own in enumerate(kinds):
        for j, other in enumerate(kinds):
            if team[i] == team[j] or not _uses_table(config, own):
                continue
            if (own, other) not in found:
                table = _table_or_none(own, other)
                if table is None:
                    continue
                found[own, other] = len(tables)
                tables.append(table)
            which[i, j] = found[own, other]
    steps = max((round(table.card.dt_s / config.model_s) for table in tables), default=1)
    return stack_tables(tables), which, max(config.moves, steps)


def _uses_table(config: ShieldConfig, kind: Platform) -> bool:
    """Return whether a boat looks opponents up where there is a table; none exists for boats with a rate loop."""
    if config.effective_adversary_horizon_s <= 0.0 or kind.kind == "rate":
        return False
    return OPPONENT_MODELS[config.opponent_model].uses_table(limits_of(kind, config.model_s))


@lru_cache(maxsize=64)
def _table_or_none(own: Platform, other: Platform) -> ValueTable | None:
    """Return the table of a pair, or None if there is no usable one, which is logged once."""
    try:
        return load_table(own, other, OtherMay.WORST_CASE)
    except TableError as error:
        _LOG.warning("%s; opponents are run through as pursuers instead", error)
        return None


def _manoeuvres_of(
    opponent_model: OpponentModel, kinds: tuple[Platform, ...], with_table: BoolArray
) -> tuple[Array, IntArray]:
    """Return `Boats.manoeuvres` and `Boats.n_manoeuvres`."""
    families = [opponent_model.manoeuvres(*boat) for boat in zip(kinds, with_table, strict=True)]
    manoeuvres = np.full((len(kinds), max((len(family) for family in families), default=0), 3), np.nan)
    for rows, family in zip(manoeuvres, families, strict=True):
        rows[: len(family)] = family
    return manoeuvres, np.array([len(family) for family in families], dtype=np.int64)


def _decay(cbf_rate_per_s: float, config: ShieldConfig) -> float:
    """Return the factor by which a margin may shrink in one step."""
    return 0.0 if math.isinf(cbf_rate_per_s) else math.exp(-cbf_rate_per_s * config.dt_s)


def _table_cap_m(config: ShieldConfig, tables: Tables) -> float:
    """Return the margin above which it may shrink freely, m: at most what tables cover beyond the required distance."""
    kept_m = config.separation_m + config.buffer_m + 2.0 * config.position_error_m + config.table_margin_m
    known_m = min((float(axes[CAP]) for axes in tables.axes), default=math.inf)
    return max(0.0, min(config.margin_cap_m, known_m - kept_m))


def _stride(kind: Platform, limit: Limits, dt_s: float) -> int:
    """Return model steps between path samples: the chord may cut the arc, v w t^2 / 8 deep, by `SAG_M`."""
    bend = kind.fastest_mps(dt_s) * math.radians(limit.turn_rate_dps)
    return int(math.sqrt(8.0 * SAG_M / bend) / dt_s + 1e-9) if bend > 0.0 else 1


def _lasting_loss(limit: Limits) -> float:
    """Return the share of top speed lost in a turn, less what is regained at once when the turn ends."""
    return limit.turn_loss * min(1.0, limit.turn_deceleration_mps2 / max(limit.acceleration_mps2, 1e-6))
