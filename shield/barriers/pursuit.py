"""The worst that opponents may do to a boat: rolled out as pursuers, or looked up where a value table answers."""

from __future__ import annotations

import math
from typing import NamedTuple

from .. import workspace as W
from ..backup.paths import FULL_THRUST_SAMPLE
from ..jit import Array, copy_row, lean_kernel
from ..platforms import layout as L
from ..tables.lookup import WHOLE_S
from ..workspace import Scene
from .clearance import FAR, MARGIN, nearest_on
from .neighbours import may_pursue
from .value_function import adversarial_for, beyond_table, margin_at_full_thrust, table_answers, tabled, worst_at_once

RUDDERS = (1.0, 0.6, 0.3, 0.0)
"""Rudders of the pursuers that are rolled out: shares of the hardest turn that they are assumed to make.

A hard turn costs speed, a gentle one time. Each pursuer turns as hard as its own entry, but loses only the speed of the
next gentler one. So it does better than any that turns steadily in between. The last entry serves only as that.
"""
FORGOTTEN_LOSS = 0.1
"""Pursuers that lose less of their speed for good in their hardest turn are rolled out with that turn only."""
LEAD_SHARE = 0.15
"""Largest lead of a pursuer on the boat, as a share of the time that the pursuit lasts."""
CHASE_LEAD_SHARE = 0.3
"""The same for a pursuer that is no faster than the boat and is followed for longer."""
LONGEST_STRIDE = 6
"""Most samples in one stride of a pursuer far away; ``scene.turns`` has a row for each number of them."""
CHASE_STRIDE = 4
"""Samples in one stride of a near pursuer once the boat has long run straight."""
ROUNDING_M = 1e-6
"""Tolerance with which a pursuer counts as past, m."""


class Pursuit(NamedTuple):
    """For how long a pursuer is followed, and what follows from that."""

    samples: int  # the last
    adverse: int  # sample from which on it holds its course and speed
    closely: int  # sample from which on the boat runs straight: it is followed in longer strides
    ahead: float  # most samples by which it leads the boat
    fade: float  # factor of negative margins per sample, 0 to 1
    to_table: bool  # whether a table is looked up at the end: it is then followed to there in any case
    most_m: float  # most that either moves from sample to sample


@lean_kernel
def closing(i: int, j: int, scene: Scene) -> float:
    """Return the most by which the distance of a pair can shrink from sample to sample, m."""
    state, boats = scene.state, scene.boats
    top_i = max(boats.fastest_mps[i], state[i, L.SPEED])
    top_j = max(boats.fastest_mps[j], state[j, L.SPEED])
    return (top_i + top_j) * boats.sample_s


@lean_kernel
def _faded(worst: float, weight: float, radius_m: float, x0: float, y0: float, x1: float, y1: float) -> float:
    """Return the least margin over a leg, weighted if negative, or ``worst`` if that is less."""
    limit = radius_m + (worst if worst >= 0.0 else worst / weight)
    if limit <= 0.0:
        return worst
    _, x, y = nearest_on(x0, y0, x1, y1)
    square = x * x + y * y
    if square >= limit * limit:
        return worst
    margin = math.sqrt(square) - radius_m
    return margin if margin >= 0.0 else margin * weight


@lean_kernel
def _aim(rx: float, ry: float, vx: float, vy: float, way: float, ahead: float) -> tuple[float, float]:
    """Return where a pursuer steers: to the point where it meets the boat if the boat keeps its velocity.

    If there is no such point, or only a far one, it steers ``ahead`` samples ahead of the boat. A pursuer about as
    fast as the boat and on its quarter comes nearest by closing in slowly on a nearly parallel course. (rx, ry) points
    from pursuer to boat; (vx, vy) is the boat's and ``way`` the pursuer's movement per sample, m.
    """
    a, b, c = vx * vx + vy * vy - way * way, rx * vx + ry * vy, rx * rx + ry * ry
    root, time = b * b - a * c, -1.0
    if root > 0.0:
        root = math.sqrt(root)
        if abs(a) < 1e-9:
            time = -0.5 * c / b if b < 0.0 else -1.0
        else:
            one, other = (-b - root) / a, (-b + root) / a
            early, late = min(one, other), max(one, other)
            time = early if early > 0.0 else late
    time = min(time, ahead) if time > 0.0 else ahead
    return rx + time * vx, ry + time * vy


@lean_kernel
def _turn_towards(ux: float, uy: float, ax: float, ay: float, c: float, s: float) -> tuple[float, float, float]:
    """Return heading (ux, uy) turned towards (ax, ay) by at most cosine c and sine s, and the share of that used."""
    along, across = ux * ax + uy * ay, ux * ay - uy * ax
    if along > 0.0 and abs(across) * c <= along * s:
        norm = math.sqrt(ax * ax + ay * ay)
        if norm <= 1e-12:
            return ux, uy, 1.0
        return ax / norm, ay / norm, min(1.0, abs(across) / (norm * s)) if s > 0.0 else 0.0
    if across >= 0.0:
        return c * ux - s * uy, s * ux + c * uy, 1.0
    return c * ux + s * uy, c * uy - s * ux, 1.0


@lean_kernel
def _speed_after(j: int, speed_mps: float, steady_mps: float, time_s: float, scene: Scene) -> float:
    """Return the speed of pursuer j after a time, if its speed in the present turn settles at the steady one."""
    if speed_mps > steady_mps:
        return max(steady_mps, speed_mps - scene.boats.granted_dec_mps2[j] * time_s)
    return min(steady_mps, speed_mps + scene.boats.granted_acc_mps2[j] * time_s)


@lean_kernel
def _never_near(i: int, j: int, slot: int, lasts: int, scene: Scene) -> bool:
    """Return whether no rollout of opponent j, however it steers, ends below the cap, so that none is needed.

    The boat then stays clear of all points that j may have reached, with room for the longest strides of rollouts. If
    j is no slower than the boat, clearance at one sample implies clearance at all before it. If j is slower, the room
    shrinks from sample to sample back by at most the difference of their ways. False when in doubt.
    """
    path, course, sample_s = scene.path[slot], scene.course[j], scene.boats.sample_s
    way_m, closing_m = _fastest_mps(j, scene) * sample_s, closing(i, j, scene)
    kept_m = scene.radius[i, j] + scene.tuning.margin_cap_m + (1.0 + 0.5 * CHASE_STRIDE) * closing_m
    slower_m, k = closing_m - 2.0 * way_m, lasts
    while True:
        dx, dy = path[k, 0] - course[0], path[k, 1] - course[1]
        room_m = math.sqrt(dx * dx + dy * dy) - way_m * k - kept_m
        if not room_m >= max(0.0, slower_m):
            return False
        if room_m >= slower_m * k:
            return True
        k -= int(room_m / slower_m)


@lean_kernel
def _fastest_mps(j: int, scene: Scene) -> float:
    """Return the speed that opponent j does not exceed as a pursuer."""
    return max(scene.boats.params[j, L.MAX_SPEED], scene.state[j, L.SPEED])


@lean_kernel
def _pursuit_of(i: int, j: int, slot: int, lasts: int, closely: int, to_table: bool, scene: Scene) -> Pursuit:
    """Return a pursuit of boat i by opponent j for ``lasts`` samples, or until thrust on the path in ``slot`` is full.

    The pursuer's lead on the boat grows with the length of the pursuit. Negative margins fade equally by the end of
    any.
    """
    boats = scene.boats
    samples = min(lasts, int(scene.full_thrust[slot, FULL_THRUST_SAMPLE])) if to_table else lasts
    horizon_s = adversarial_for(i, j, scene.state[i, L.SPEED], scene)
    own_mps = max(boats.fastest_mps[i], scene.state[i, L.SPEED])
    return Pursuit(
        samples,
        samples if horizon_s >= WHOLE_S else min(samples, math.ceil(horizon_s / boats.sample_s)),
        closely,
        (CHASE_LEAD_SHARE if lasts > closely else LEAD_SHARE) * lasts,
        boats.fade[i] ** (boats.pursuit_samples[i] / lasts),
        to_table,
        max(own_mps, _fastest_mps(j, scene)) * boats.sample_s,
    )


@lean_kernel
def _stride(k: int, free: int, pursuit: Pursuit) -> int:
    """Return the samples in the next stride of a pursuer from sample k, if it cannot come near within ``free``."""
    left, stride = pursuit.samples - k, 1 if k < pursuit.closely else CHASE_STRIDE
    if free > 0:
        stride = max(stride, min(free, LONGEST_STRIDE))
    return min(stride, left, pursuit.adverse - k if k < pursuit.adverse else left)


@lean_kernel
def _note_turns(j: int, rudder: int, scene: Scene) -> None:
    """Write cosine and sine of opponent j's hardest turns in 1, 2, ... samples, also from rest: it speeds up soon."""
    turn = RUDDERS[rudder] * (math.radians(scene.boats.granted_turn_dps[j]) * scene.boats.sample_s)
    turns = scene.turns
    turns[0, 0], turns[0, 1] = math.cos(turn), math.sin(turn)
    for k in range(1, turns.shape[0]):
        turns[k, 0] = turns[k - 1, 0] * turns[0, 0] - turns[k - 1, 1] * turns[0, 1]
        turns[k, 1] = turns[k - 1, 1] * turns[0, 0] + turns[k - 1, 0] * turns[0, 1]


@lean_kernel
def _begin_run(j: int, run: Array, own: Array, scene: Scene) -> None:
    """Place a run of opponent j where j is one step ahead."""
    copy_row(run, scene.course[j])
    run[W.RUN_SPEED], run[W.RUN_WORST], run[W.RUN_WEIGHT] = scene.state[j, L.SPEED], scene.tuning.margin_cap_m, 1.0
    run[W.RUN_TO_X], run[W.RUN_TO_Y] = own[0, 0] - run[W.RUN_X], own[0, 1] - run[W.RUN_Y]


@lean_kernel
def _is_past(k: int, x: float, y: float, worst: float, own: Array, radius_m: float, pursuit: Pursuit) -> bool:
    """Return whether a rollout at (x, y) cannot lower its margin any more, however it steers in the time left."""
    dx, dy = own[pursuit.samples, 0] - x, own[pursuit.samples, 1] - y
    reach_m = radius_m + worst + ROUNDING_M + (pursuit.samples - k) * pursuit.most_m
    return not pursuit.to_table and dx * dx + dy * dy >= reach_m * reach_m


@lean_kernel
def _move_on(k: int, lead: int, i: int, j: int, slot: int, loss: float, pursuit: Pursuit, scene: Scene) -> int:
    """Move a rollout of opponent j on from sample k; return the sample it then is at: the last if it is past."""
    run, own, sample_s = scene.runs[lead], scene.path[slot], scene.boats.sample_s
    x, y, ux, uy, speed_mps = run[W.RUN_X], run[W.RUN_Y], run[W.RUN_EAST], run[W.RUN_NORTH], run[W.RUN_SPEED]
    x0, y0, worst, weight = run[W.RUN_TO_X], run[W.RUN_TO_Y], run[W.RUN_WORST], run[W.RUN_WEIGHT]
    radius_m, closing_m = scene.radius[i, j], closing(i, j, scene)
    root, free, square = radius_m + scene.tuning.margin_cap_m, 0, x0 * x0 + y0 * y0
    worth = (root + 2.0 * closing_m) * (root + 2.0 * closing_m)
    if square > worth:
        free = int((math.sqrt(square) - root) / closing_m)
    if _is_past(k, x, y, worst, own, radius_m, pursuit):
        return pursuit.samples
    stride = _stride(k, free, pursuit)
    k += stride
    ax, ay = own[k, 0] - x, own[k, 1] - y
    if lead == 1:
        vx, vy = (own[k, 0] - own[k - stride, 0]) / stride, (own[k, 1] - own[k - stride, 1]) / stride
        ax, ay = _aim(x0, y0, vx, vy, speed_mps * sample_s, pursuit.ahead)
    time_s, new_speed = stride * sample_s, speed_mps
    if k <= pursuit.adverse:
        ux, uy, rudder = _turn_towards(ux, uy, ax, ay, scene.turns[stride - 1, 0], scene.turns[stride - 1, 1])
        new_speed = _speed_after(j, speed_mps, _fastest_mps(j, scene) * (1.0 - loss * rudder), time_s, scene)
    way = 0.5 * (speed_mps + new_speed) * time_s
    x, y = x + way * ux, y + way * uy
    x1, y1 = own[k, 0] - x, own[k, 1] - y
    for _ in range(stride):
        weight *= pursuit.fade
    run[W.RUN_X], run[W.RUN_Y], run[W.RUN_EAST], run[W.RUN_NORTH], run[W.RUN_SPEED] = x, y, ux, uy, new_speed
    run[W.RUN_TO_X], run[W.RUN_TO_Y], run[W.RUN_WEIGHT] = x1, y1, weight
    run[W.RUN_WORST] = _faded(worst, weight, radius_m, x0, y0, x1, y1)
    return k


@lean_kernel
def _run_pursuers(i: int, j: int, slot: int, rudder: int, pursuit: Pursuit, floor_m: float, scene: Scene) -> float:
    """Return the margin, m, from opponent j with this rudder: the worse of steering for the boat and leading it.

    Negative margins fade with the time until they occur. A graze far off matters less than a ramming soon, since
    pursuers rarely play as well as assumed. The search stops once the margin is below the floor. The cap is common to
    all, because a pursuer's strides depend on it, and must not depend on who is checked before. Both rollouts advance
    in turns: a processor overlaps work that does not depend on what comes just before.
    """
    runs, last, loss = scene.runs, pursuit.samples, scene.boats.granted_loss[j] * RUDDERS[rudder + 1]
    _note_turns(j, rudder, scene)
    for lead in range(2):
        _begin_run(j, runs[lead], scene.path[slot], scene)
    k, ahead = 0, 0
    while k < last or ahead < last:
        if k < last:
            k = _move_on(k, 0, i, j, slot, loss, pursuit, scene)
        if ahead < last:
            ahead = _move_on(ahead, 1, i, j, slot, loss, pursuit, scene)
        if min(runs[0, W.RUN_WORST], runs[1, W.RUN_WORST]) < floor_m:
            break
    worst_m = min(runs[0, W.RUN_WORST], runs[1, W.RUN_WORST])
    if not pursuit.to_table or worst_m < floor_m:
        return worst_m
    for lead in range(2):
        value_m = margin_at_full_thrust(i, j, slot, runs[lead], scene)
        worst_m = min(worst_m, value_m * runs[lead, W.RUN_WEIGHT] if value_m < 0.0 else value_m)
    return worst_m


@lean_kernel
def clear_of_pursuer(i: int, j: int, slot: int, floor_m: float, scene: Scene) -> float:
    """Return the margin, m, of boat i on the path in ``slot`` from opponent j, which pursues with its assumed turn.

    It is the worst of several pursuers: steering at the boat or for the meeting point, turning hard or gently. The
    rudder that last came below its floor is checked first. Pursuers are followed until the boat's thrust is full, and
    then for as long as such a boat needs to get away. If the pair has a table, the table covers what follows once
    thrust is full; for a boat with several pursuers (see `value_function.find_several_pursuers`) not before
    ``boats.joint_samples``.
    """
    boats, sample = scene.boats, int(scene.full_thrust[slot, FULL_THRUST_SAMPLE])
    to_table = sample >= 0 and tabled(i, j, scene)
    closely = boats.pursuit_samples[i] + boats.thrust_samples[i]
    if sample >= 0:
        closely = min(closely, sample + boats.pursuit_samples[i])
    lasts = closely + (0 if to_table else boats.chase_samples[i, j])
    if to_table and beyond_table(i, j, slot, scene):
        return scene.tuning.margin_cap_m
    if not to_table and _never_near(i, j, slot, lasts, scene):
        return scene.tuning.margin_cap_m
    pursuit, worst_m = _pursuit_of(i, j, slot, lasts, closely, to_table, scene), FAR
    rudders = len(RUDDERS) - 1 if boats.granted_loss[j] > FORGOTTEN_LOSS else 1
    first = min(scene.first_rudder[i, j], rudders - 1)
    for number in range(rudders):
        rudder = _first_then_rest(first, number)
        worst_m = min(worst_m, _run_pursuers(i, j, slot, rudder, pursuit, floor_m, scene))
        if worst_m < floor_m:
            scene.first_rudder[i, j] = rudder
            break
    return worst_m


@lean_kernel
def _first_then_rest(first: int, number: int) -> int:
    """Return entry ``number`` of the list 0, 1, 2, ... with ``first`` moved to its front."""
    if number == 0:
        return first
    return number if number > first else number - 1


@lean_kernel
def _note(margin_m: float, j: int, slot: int, scene: Scene) -> None:
    """Note a margin from boat j if it is the least."""
    if margin_m < scene.pursuit_margin_m[slot]:
        scene.pursuit_margin_m[slot], scene.pursuer[slot] = margin_m, j


@lean_kernel
def _clear_of_opponent(i: int, j: int, slot: int, level_m: float, least_m: float, scene: Scene) -> bool:
    """Note the worst that opponent j may do; return False if it is below its floor, given by target, level and least.

    For a boat with several pursuers, j is also rolled out for a while and looked up from there. On a manoeuvre on which
    thrust never becomes full, such a boat counts as lost.
    """
    target_m = scene.pursuit_target_m[i, j]
    floor_m, by_table = max(least_m, min(target_m, level_m)), table_answers(i, j, slot, scene)
    if by_table:
        margin_m = worst_at_once(i, j, slot, scene)
        scene.table_m[slot] = min(scene.table_m[slot], margin_m)
        scene.refused_by_table[slot] = scene.refused_by_table[slot] or margin_m < target_m
    else:
        margin_m = clear_of_pursuer(i, j, slot, floor_m, scene)
    scene.pursuit_margins_m[slot, j] = margin_m
    _note(margin_m, j, slot, scene)
    if not margin_m >= floor_m or not by_table or not scene.several_pursuers[i]:
        return margin_m >= floor_m
    floor_m, margin_m = max(least_m, min(scene.joint_target_m[i], level_m)), -scene.radius[i, j]
    if scene.full_thrust[slot, FULL_THRUST_SAMPLE] >= 0.0:
        margin_m = clear_of_pursuer(i, j, slot, floor_m, scene)
    scene.joint_m[slot] = min(scene.joint_m[slot], margin_m)
    _note(margin_m, j, slot, scene)
    return margin_m >= floor_m


@lean_kernel
def _falls_short(i: int, slot: int, scene: Scene) -> bool:
    """Return whether a margin against pursuers on the path in ``slot`` is below the required one."""
    short = scene.several_pursuers[i] and not scene.joint_m[slot] >= scene.joint_target_m[i]
    for j in range(scene.ours.shape[0]):
        short = short or not scene.pursuit_margins_m[slot, j] >= scene.pursuit_target_m[i, j]
    return short


@lean_kernel
def _may_harm(i: int, j: int, scene: Scene) -> bool:
    """Return whether boat j is an opponent that counts as a pursuer of boat i."""
    team, near = scene.boats.team, j != i and scene.neighbours[i, j] and not scene.inside_separation[i, j]
    return near and not scene.ours[j] and team[i] != team[j] and may_pursue(j, scene)


@lean_kernel
def falls_short_at_once(i: int, slot: int, level_m: float, least_m: float, scene: Scene) -> bool:
    """Return whether `worst_pursuer` would stop by what tables report of the place in ``slot``, whatever the path."""
    for j in range(scene.ours.shape[0]):
        if _may_harm(i, j, scene) and table_answers(i, j, slot, scene):
            floor_m = max(least_m, min(scene.pursuit_target_m[i, j], level_m))
            if worst_at_once(i, j, slot, scene) < floor_m:
                return True
    return False


@lean_kernel
def worst_pursuer(i: int, slot: int, level_m: float, least_m: float, scene: Scene) -> None:
    """Find the margin from each pursuer (``scene.pursuit_margins_m[slot]``); lower that in ``slot`` where it is worse.

    A path whose pursuers are fully known is not checked again: they depend on no teammate's manoeuvre, nor on the
    targets.

    Where a path violates its required margin (``scene.violates_pursuers``) below the level, or below the least, the
    search stops: no more need be known. The opponent that came there last is checked first, so that most manoeuvres
    that fail cost little.

    ``scene.refused_by_table[slot]``: the margin is violated by what a table reports of the first place where the boat
    is looked up, and by nothing worse. One step ahead (ahead = 1) that place is the same for all manoeuvres: none does
    better.
    """
    if not scene.pursuers_known[slot]:
        scene.pursuers_known[slot], scene.refused_by_table[slot], scene.pursuer[slot] = True, False, -1
        scene.pursuit_margins_m[slot, :], scene.joint_m[slot] = FAR, FAR
        scene.table_m[slot], scene.pursuit_margin_m[slot] = FAR, FAR
        first = scene.first_pursuer[i]
        for number in range(scene.ours.shape[0]):
            j = _first_then_rest(first, number)
            if not _may_harm(i, j, scene):
                continue
            if not _clear_of_opponent(i, j, slot, level_m, least_m, scene):
                scene.first_pursuer[i], scene.pursuers_known[slot] = j, False
                break
        if not scene.pursuit_margin_m[slot] >= scene.table_m[slot]:
            scene.refused_by_table[slot] = False
    scene.violates_pursuers[slot] = _falls_short(i, slot, scene)
    if scene.pursuit_margin_m[slot] < scene.clear[slot, MARGIN]:
        scene.clear[slot, MARGIN], scene.active[slot] = scene.pursuit_margin_m[slot], scene.pursuer[slot]
