"""Manoeuvre rollout: a manoeuvre's path goes into a slot of the scene, with the place at which tables look it up."""

from __future__ import annotations

from ..barriers.neighbours import may_pursue
from ..barriers.value_function import set_place, table_answers, tabled
from ..jit import copy_row, lean_kernel
from ..platforms import layout as L
from ..platforms.step import step_boat
from ..workspace import Scene
from .paths import Manoeuvre, Span, trace_path

NO_PURSUERS, PURSUERS_TILL_FULL_THRUST, PURSUERS = range(3)
"""How far pursuers are rolled out: not at all; until tables answer (thrust is back; for a while if several); or to the
end of the pursuit."""


@lean_kernel
def pursuit_extent(i: int, slot: int, scene: Scene) -> int:
    """Return how far opponents near boat i must be rolled out as pursuers, which takes a longer path."""
    boats = scene.boats
    if not scene.pursued[i] or boats.table_steps[i] == 0:
        return PURSUERS if scene.pursued[i] else NO_PURSUERS
    how = PURSUERS_TILL_FULL_THRUST if scene.several_pursuers[i] else NO_PURSUERS
    for j in range(scene.neighbours.shape[0]):
        if j == i or not scene.neighbours[i, j] or boats.team[i] == boats.team[j] or not may_pursue(j, scene):
            continue
        if not tabled(i, j, scene):
            return PURSUERS
        if not table_answers(i, j, slot, scene):
            how = PURSUERS_TILL_FULL_THRUST
    return how


@lean_kernel
def _roll_out_command(i: int, slot: int, scene: Scene) -> None:
    """Write boat i's positions during the predicted step, where that has several moves."""
    state, boats, tuning = scene.state, scene.boats, scene.tuning
    if tuning.moves == 1:
        return
    copy_row(scene.row, state[i])
    for move in range(tuning.moves):
        step_boat(boats.params[i], scene.row, scene.stepped[i, 0], scene.stepped[i, 1], tuning.model_s)
        if move % boats.stride == 0:
            path = scene.path[slot, move // boats.stride]
            path[0], path[1] = scene.row[L.X], scene.row[L.Y]


@lean_kernel
def roll_out(i: int, slot: int, rudder: float, togo_deg: float, speed_mps: float, ahead: int, scene: Scene) -> None:
    """Roll a manoeuvre of boat i out into ``slot``, from its predicted state (ahead = 1) or its present one (0)."""
    place_manoeuvre(i, slot, (rudder, togo_deg, speed_mps), ahead, scene)
    lay_placed(i, slot, ahead, scene)


@lean_kernel
def place_manoeuvre(i: int, slot: int, manoeuvre: tuple[float, float, float], ahead: int, scene: Scene) -> None:
    """Write a manoeuvre of boat i (rudder, turn to go deg, speed m/s) into ``slot``, and where it is looked up."""
    rudder, togo_deg, speed_mps = manoeuvre
    scene.manoeuvre[slot, 0], scene.manoeuvre[slot, 1], scene.manoeuvre[slot, 2] = rudder, togo_deg, speed_mps
    scene.pursuers_known[slot], scene.static_known[slot] = False, False
    set_place(i, slot, rudder, togo_deg, speed_mps, ahead, scene)


@lean_kernel
def lay_placed(i: int, slot: int, ahead: int, scene: Scene) -> None:
    """Roll out the manoeuvre that was placed in ``slot``."""
    boats, tuning, manoeuvre = scene.boats, scene.tuning, scene.manoeuvre[slot]
    how = pursuit_extent(i, slot, scene)
    samples, chased = boats.longest_samples, boats.pursuit_samples[i] + boats.chased_samples[i]
    if how != NO_PURSUERS:
        samples = max(samples, chased + boats.thrust_samples[i])
    earliest = 0 if ahead == 1 else (boats.table_steps[i] + boats.stride - 1) // boats.stride
    if scene.several_pursuers[i]:
        earliest = max(earliest, boats.joint_samples)
    if ahead == 1:
        _roll_out_command(i, slot, scene)
    copy_row(scene.row, scene.next_state[i] if ahead == 1 else scene.state[i])
    span = Span(
        tuning.model_s,
        tuning.moves if ahead == 1 else 0,
        boats.stride,
        samples,
        boats.longest_samples,
        chased if how == PURSUERS else 0,
        min(earliest, samples),
        boats.full_thrust_percent[i],
    )
    told = Manoeuvre(manoeuvre[0], manoeuvre[1], manoeuvre[2])
    trace_path(boats.params[i], scene.row, told, span, scene.path[slot], scene.full_thrust[slot])
