"""Barriers of the literature: functions h >= 0 of a pair of boats, with gradients, gains and inputs.

Vectors are arrays of their two components, east and north, of any further shape: p = p_j - p_i, m, and v = v_j - v_i,
m/s. R is the required radius, m, and s = sqrt(|p|^2 - R^2). A pair's constraint is dh/dt >= -alpha h.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np
from steerclear.shield.calls import checked_calls
from steerclear.shield.exceptions import ConfigError, PlatformError
from steerclear.shield.jit import Array
from steerclear.shield.platforms import get_platform

from .own_filters import Jet, check_gains, check_jet, name_of

Gains = tuple[float, ...]
NEAREST_M2, STILL_MPS = 1e-4, 1e-6
"""Lower bound of s^2 (derivative 0 below it), and smoothing of |v|: the papers leave both open."""
WIDENED = 1.05
RATES_PER_S = (0.025, 0.05, 0.075, 0.1, 0.15, 0.2, 0.35, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 10.0, 20.0)


@checked_calls()
@dataclass(frozen=True)
class Barrier:
    """A barrier of the literature: its ``jet`` (p, v, R, *further gains) and its gains, alpha (1/s) first.

    ``tuned``: gains by platform, the winners of `sweep` among those ``tried``; other platforms use the first of
    ``tried``. Inputs are velocities (``of_velocity``) or those of `unicycle`; the radius is multiplied by ``widened``.

    Raises:
        ConfigError: ``jet`` is no function, or gains are none, not numbers, or not as many everywhere.
    """

    jet: Callable[..., Jet]
    tuned: dict[str, Gains]
    tried: tuple[Gains, ...]
    of_velocity: bool = False
    widened: float = 1.0

    def __post_init__(self) -> None:
        if not callable(self.jet):
            raise ConfigError(
                f"jet is {name_of(self.jet)}; give a function of (p, v, radius_m, further gains) that gives h and its "
                "gradients in p and in v"
            )
        if not isinstance(self.tried, tuple | list) or not self.tried:
            raise ConfigError(f"tried is {self.tried!r}; give at least one tuple of gains, as tried=((0.5,),)")
        if not isinstance(self.tuned, dict):
            raise ConfigError(f"tuned is {self.tuned!r}; give gains by platform, as tuned={{'heron': (0.5,)}}, or {{}}")
        for gains in self.tried:
            check_gains(gains, "one of tried", None if gains is self.tried[0] else self.count)
        for platform, gains in self.tuned.items():
            _check_known(platform)
            check_gains(gains, f"tuned[{platform!r}]", self.count)

    @property
    def count(self) -> int:
        """Number of gains."""
        return len(self.tried[0])

    def of(self, p: Array, v: Array, radius_m: float, gains: Sequence[Array]) -> Jet:
        """Return what ``jet`` gives; ConfigError where it takes other arguments or gives something else."""
        return check_jet(self.jet, p, v, radius_m, gains)


def _check_known(platform: Any) -> None:
    """Refuse (ConfigError) gains of a platform that nobody knows, which no boat would use."""
    try:
        get_platform(platform)
    except PlatformError as error:
        raise ConfigError(f"tuned[{platform!r}]: {error}; register a platform of your own before") from None


def dot(a: Array, b: Array) -> Array:
    """Return the inner product."""
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def tangent(p: Array, radius_m: float) -> tuple[Array, Array]:
    """Return s, the length of the tangent from p to the circle of the radius, m, and k of its derivative k p."""
    square = dot(p, p) - radius_m * radius_m
    s = np.sqrt(np.maximum(square, NEAREST_M2))
    return s, np.where(square > NEAREST_M2, 1.0 / s, 0.0)


def pace(v: Array) -> Array:
    """Return |v|, smoothed, m/s."""
    return np.asarray(np.sqrt(dot(v, v) + STILL_MPS * STILL_MPS))


def velocity_cbf(p: Array, v: Array, radius_m: float) -> Jet:
    """Return the distance barrier of boats whose velocity u is their input: h, m^2, and its gradients.

    h = |p|^2 - R^2, constraint <dh/dp, u_j - u_i> >= -alpha h. Ames et al. 2019 (ECC); pairwise as Wang, Ames,
    Egerstedt 2017 (T-RO).
    """
    return dot(p, p) - radius_m * radius_m, 2.0 * p, 2.0 * p


def exponential_cbf(p: Array, v: Array, radius_m: float, a1: Array) -> Jet:
    """Return the exponential distance barrier for boats that accelerate: h, m^2/s, and gradients; a1, 1/s; alpha is a2.

    h = d/dt (|p|^2 - R^2) + a1 (|p|^2 - R^2). Nguyen, Sreenath 2016 (ACC); with linear class-K functions also the
    barrier of Xiao, Belta 2021 (TAC).
    """
    return 2.0 * dot(p, v) + a1 * (dot(p, p) - radius_m * radius_m), 2.0 * (v + a1 * p), 2.0 * p


def collision_cone(p: Array, v: Array, radius_m: float) -> Jet:
    """Return the collision-cone barrier: h, m^2/s, and its gradients.

    The relative velocity stays out of the cone of courses that pass within the radius: h = <p, v> + |v| s, which is
    <p, v> + |p| |v| cos(phi), phi half the angle of the cone. Thontepu et al. 2022, arXiv 2209.11524.
    """
    (s, k), speed = tangent(p, radius_m), pace(v)
    return dot(p, v) + speed * s, v + speed * k * p, p + s * v / speed


def parabolic(p: Array, v: Array, radius_m: float, lambda_share: Array, mu_share: Array) -> Jet:
    """Return the parabolic barrier: h, m/s, and its gradients.

    It bounds the closing speed along the line of sight by the distance and by the speed across it:
    h = v_x + k_l s/|v| v_y^2 + k_m s, (v_x, v_y) = v along and across p. Park et al. 2025, arXiv 2510.01402.

    The formula is from what its authors published with the paper: the README and class ``KinematicBicycle2D_DPCBF`` of
    their library safe_control. Equation numbers of the paper are therefore not cited. k_l (1/m) and k_m (1/s) are gains
    times sqrt(w^2 - 1)/R; R is widened by the factor w, s in that library. With n across the line of sight e,
    dv_x/dp = v_y n/|p| and dv_y/dp = -v_x n/|p|.
    """
    unit = math.sqrt(WIDENED**2 - 1.0) / radius_m
    (s, k), speed, gap = tangent(p, radius_m), pace(v), np.sqrt(dot(p, p)) + 1e-12
    e = p / gap
    n = np.stack([-e[1], e[0]])
    v_x, v_y, k_m = dot(e, v), dot(n, v), mu_share * unit
    bend = lambda_share * unit * v_y / speed
    turn = (v_y - 2.0 * bend * s * v_x) / gap
    h_p = k * (bend * v_y + k_m) * p + turn * n
    h_v = e + 2.0 * bend * s * n - bend * v_y * s / (speed * speed) * v
    return v_x + bend * v_y * s + k_m * s, h_p, h_v


_RATES = tuple(product(RATES_PER_S))
_A1_A2_PER_S = product((0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 4.0), repeat=2)
_GRID = (0.05, 0.1, 0.25, 0.5, 1.0, 4.0), (0.1, 0.5, 2.0), (0.25, 0.5, 1.0, 2.0, 8.0, 16.0)
BARRIERS = {
    "velocity_cbf": Barrier(
        velocity_cbf, tuned={"heron": (0.025,), "surveyor": (0.05,)}, tried=((1.0,), *_RATES), of_velocity=True
    ),
    "exponential_cbf": Barrier(
        exponential_cbf,
        tuned={"heron": (1.0, 0.1), "surveyor": (0.5, 0.05)},
        tried=((1.0, 1.0), *((a2, a1) for a1, a2 in _A1_A2_PER_S)),
    ),
    "collision_cone": Barrier(collision_cone, tuned={"heron": (3.0,), "surveyor": (5.0,)}, tried=((1.0,), *_RATES)),
    "parabolic": Barrier(
        parabolic,
        tuned={"heron": (0.05, 0.5, 8.0), "surveyor": (1.0, 0.5, 0.25)},
        tried=((1.0, 0.1, 0.5), *product(*_GRID)),
        widened=WIDENED,
    ),
}
"""Compared barriers by name; each entry is one safety filter."""
