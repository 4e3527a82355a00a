"""From settings and platforms to the constant arrays of a scene."""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from .certificates import CERTIFICATES
from .certificates.paths import STRIDE
from .config import ShieldConfig
from .jit import Array
from .platforms import Platform, get_platform
from .platforms import layout as L
from .platforms.limits import limits_of
from .scene import Boats, Tuning

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
    sample_s = STRIDE * config.dt_s
    return Boats(
        params=np.array([kind.pack() for kind in kinds]).reshape(-1, L.N_PARAM),
        team=np.array(team, dtype=np.int64),
        fastest_mps=np.array([kind.fastest_mps(config.dt_s) for kind in kinds]),
        granted_turn_dps=np.array([share * limit.turn_rate_dps for limit in limits]),
        granted_acc_mps2=np.array([limit.acceleration_mps2 if share > 0.0 else 0.0 for limit in limits]),
        samples=np.array([max(2, math.ceil(value / sample_s)) for value in horizon_s], dtype=np.int64),
        static_samples=np.array(
            [
                max(2, math.ceil(min(limit.half_turn_s + STATIC_REACTION_S, value) / sample_s))
                for limit, value in zip(limits, horizon_s, strict=True)
            ],
            dtype=np.int64,
        ),
    )
