"""From settings and platforms to the constant arrays of a scene."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .certificates import CERTIFICATES
from .certificates.paths import SAG_M
from .config import ShieldConfig
from .jit import Array
from .platforms import Platform, get_platform
from .platforms import layout as L
from .platforms.limits import Limits, limits_of
from .scene import Boats, Tuning

FADE = 4.0
"""A negative margin against a hunter at the end of the time it is followed counts exp(-FADE) of one now."""

STATIC_REACTION_S = 0.5
"""Time beyond a half turn over which fixed things are looked at, s."""


def tuning_of(config: ShieldConfig) -> Tuning:
    """Scalar settings for compiled code."""
    decay = 0.0 if math.isinf(config.response_per_s) else math.exp(-config.response_per_s * config.dt_s)
    return Tuning(
        dt_s=config.dt_s,
        radius_m=config.separation_m + config.buffer_m,
        buffer_m=config.buffer_m,
        tail_s=config.tail_s,
        hysteresis_m=config.hysteresis_m,
        decay=decay,
        margin_cap_m=config.margin_cap_m,
        speed_weight=config.speed_weight,
    )


def plans_of(config: ShieldConfig) -> Array:
    """Escape manoeuvres of the certificate chosen, (m, 3)."""
    return CERTIFICATES[config.certificate].plans


@lru_cache(maxsize=256)
def boats_of(config: ShieldConfig, platforms: tuple[str | Platform, ...], team: tuple[int, ...]) -> Boats:
    """Constants of the boats of a fleet.

    Raises:
        PlatformError: a platform is unknown.
    """
    kinds = [get_platform(name) for name in platforms]
    limits = [limits_of(kind, config.dt_s) for kind in kinds]
    certificate = CERTIFICATES[config.certificate]
    share = config.opponent_share if certificate.hunters else 0.0
    horizon_s = [config.horizon_s or certificate.horizon_s(kind, config.dt_s) for kind in kinds]
    strides = [_stride(kind, limit, config.dt_s) for kind, limit in zip(kinds, limits, strict=True)]
    stride = max(1, min(strides, default=1))
    sample_s = stride * config.dt_s
    hunt_s = [
        max(value, config.hunt_s or certificate.hunt_s(limit)) if share > 0.0 else value
        for value, limit in zip(horizon_s, limits, strict=True)
    ]
    return Boats(
        params=np.array([kind.pack() for kind in kinds]).reshape(-1, L.N_PARAM),
        team=np.array(team, dtype=np.int64),
        fastest_mps=np.array([kind.fastest_mps(config.dt_s) for kind in kinds]),
        granted_turn_dps=np.array([share * limit.turn_rate_dps for limit in limits]),
        granted_acc_mps2=np.array([limit.acceleration_mps2 if share > 0.0 else 0.0 for limit in limits]),
        granted_dec_mps2=np.array([limit.turn_deceleration_mps2 for limit in limits]),
        granted_loss=np.array([share * _lasting_loss(limit) for limit in limits]),
        samples=np.array([max(2, math.ceil(value / sample_s)) for value in horizon_s], dtype=np.int64),
        hunt_samples=np.array([max(2, math.ceil(value / sample_s)) for value in hunt_s], dtype=np.int64),
        fade=np.array([math.exp(-FADE * sample_s / value) for value in hunt_s]),
        static_samples=np.array(
            [
                max(2, math.ceil(min(limit.half_turn_s + STATIC_REACTION_S, value) / sample_s))
                for limit, value in zip(limits, horizon_s, strict=True)
            ],
            dtype=np.int64,
        ),
        stride=stride,
        sample_s=sample_s,
    )


def _stride(kind: Platform, limit: Limits, dt_s: float) -> int:
    """Model steps between path samples: the chord between two may cut its arc, v w t^2 / 8 deep, by `SAG_M`."""
    bend = kind.fastest_mps(dt_s) * math.radians(limit.turn_rate_dps)
    return int(math.sqrt(8.0 * SAG_M / bend) / dt_s + 1e-9) if bend > 0.0 else 1


def _lasting_loss(limit: Limits) -> float:
    """Share of top speed lost in a turn, as far as it is not regained at once when the turn ends."""
    return limit.turn_loss * min(1.0, limit.turn_deceleration_mps2 / max(limit.acceleration_mps2, 1e-6))
