"""One step of any platform: the single place where dynamics are chosen by kind."""

from __future__ import annotations

from ..jit import Array, lean_kernel
from . import layout as L
from .held import moves_in
from .integrators import step_double_integrator, step_single_integrator
from .rate import step_rate
from .usv import step_usv


@lean_kernel
def step_boat(params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float) -> None:
    """Advance one boat by one step, in place, in one move or in several under the same command, see `held`.

    Args:
        params: platform row, shape ``(N_PARAM,)``.
        state: state row, shape ``(N_STATE,)``.
        desired_speed_mps: commanded speed, m/s.
        heading_error_deg: commanded heading minus present heading, deg, as the autopilot is given it.
        dt_s: step, s.
    """
    moves = moves_in(params, dt_s)
    for _ in range(moves):
        _move_boat(params, state, desired_speed_mps, heading_error_deg, dt_s / moves)


@lean_kernel
def _move_boat(params: Array, state: Array, desired_speed_mps: float, heading_error_deg: float, dt_s: float) -> None:
    kind = params[L.KIND]
    if kind == L.KIND_USV:
        step_usv(params, state, desired_speed_mps, heading_error_deg, dt_s)
    elif kind == L.KIND_SINGLE_INTEGRATOR:
        step_single_integrator(params, state, desired_speed_mps, heading_error_deg, dt_s)
    elif kind == L.KIND_RATE:
        step_rate(params, state, desired_speed_mps, heading_error_deg, dt_s)
    else:
        step_double_integrator(params, state, desired_speed_mps, heading_error_deg, dt_s)
