"""What a backup manoeuvre is worth: one number, in the order of what matters."""

from __future__ import annotations

from ..barriers.boats import worst_clearance
from ..barriers.clearance import FAR, MARGIN
from ..barriers.opponents import worst_pursuer
from ..barriers.static import clear_of_near_obstacles, clear_of_static, share_before_touch
from ..jit import BoolArray, lean_kernel
from ..scene import Scene
from ..work import Work

PAIR_SAFE = 1e3
"""Rank from which a manoeuvre keeps clear of everybody, whatever they are granted, and of static constraints."""

SPARE_WORTH = 1e-3
"""Rank of a metre to spare from boats; a manoeuvre short of static constraints is worth less than any that is not."""

STATIC_LOST = 500.0
"""Rank from which it keeps clear of all boats and of obstacles near in time, but not of all static constraints."""

STRAIGHT_SAFE = 100.0
"""Rank from which it keeps clear of team-mates, of opponents that hold their course and of obstacles near in time, but
not of pursuers."""

STRAIGHT_BASE = 300.0
"""Rank of such a manoeuvre with no margin to the pursuers; the (negative) margin is added."""

OBSTACLE_BASE = 50.0
"""Rank of a pursued boat's manoeuvre that touches an obstacle at the end of a half turn's time; sooner, its share of it
counts. Of another boat's that hardly touches one; deeper, less."""

LATER_WORTH = 0.1
"""Rank of the share of a half turn's time before a touch, for a boat that nobody pursues: 2 cm of depth."""

DEEP_M = 10.0
"""Depth in an obstacle, m, at whose half rank begins to fall off more slowly; it never ends, behind walls."""


@lean_kernel
def _level_to_beat(best: float) -> float:
    """Margin against pursuers, m, at which a manoeuvre short of what it must keep is no better than the best."""
    if best >= STATIC_LOST:
        return FAR
    return best - STRAIGHT_BASE if best >= STRAIGHT_SAFE else -FAR


@lean_kernel
def _ask_no_pursuers(slot: int, work: Work) -> None:
    """Margins against pursuers of a path of which they do not matter: none is better than that from the others."""
    margin = work.clear[slot, MARGIN]
    work.threat_m[slot], work.threats_m[slot, :], work.joint_m[slot] = margin, margin, FAR
    work.sealed[slot], work.pursuers_known[slot] = False, False


@lean_kernel
def _rank_touching(i: int, slot: int, share: float, best: float, scene: Scene) -> float:
    """Rank of a path that touches an obstacle after that share of a half turn's time.

    A boat that is pursued had better be stopped late: who is stopped is caught. Among manoeuvres that touch at the same
    time, as all do of a boat that is too near already and cannot but come nearer, the one that goes least deep is worth
    more; of a boat that nobody pursues, always, and the later touch decides between those that are as deep. Through a
    wall the depth is how far behind it the manoeuvre goes, which is least for the one that meets it most gently.
    """
    work = scene.work
    touched = clear_of_near_obstacles(i, slot, scene, work.spare2)
    depth_m = -work.spare2[MARGIN]
    shallow = 1.0 - depth_m / DEEP_M if depth_m < 0.5 * DEEP_M else 0.25 * DEEP_M / depth_m
    rank = OBSTACLE_BASE * shallow + LATER_WORTH * share
    if work.pursued[i]:
        rank = OBSTACLE_BASE * share + shallow
    if rank <= best:
        return rank
    worst_pursuer(i, slot, scene, -FAR)
    work.bound[slot] = touched
    return rank


@lean_kernel
def rank_path(i: int, slot: int, best: float, scene: Scene) -> float:
    """Rank of the path in ``slot`` for boat i; work is cut short once it cannot exceed ``best``.

    What is certain comes before what is feared: keeping clear of team-mates and of opponents that hold their course
    first, of obstacles near in time second, of pursuing opponents third; then of all static constraints, and last room
    to spare. Of a manoeuvre that fails at the first the rank is the margin itself, m. The clearance told is from all
    boats, whatever the rank hangs on.
    """
    tuning, work = scene.tuning, scene.work
    work.spent[0] += work.cost[i]
    clear = work.clear[slot]
    floor = best if best < STRAIGHT_SAFE else 0.0
    worst_clearance(i, slot, scene, min(floor, 0.0))
    work.static[slot, MARGIN] = FAR
    if clear[MARGIN] < 0.0:
        _ask_no_pursuers(slot, work)
        return clear[MARGIN]
    share = share_before_touch(i, slot, scene)
    if share < 1.0:
        _ask_no_pursuers(slot, work)
        return _rank_touching(i, slot, share, best, scene)
    sure = clear[MARGIN]
    short = work.short[slot]
    if short and STRAIGHT_BASE + sure <= best:
        _ask_no_pursuers(slot, work)
        return STRAIGHT_BASE + sure
    worst_pursuer(i, slot, scene, _level_to_beat(best))
    if short or work.fails[slot]:
        least = min(sure, work.threat_m[slot]) if short else work.threat_m[slot]
        return max(STRAIGHT_SAFE, STRAIGHT_BASE + least)
    nearest = clear_of_static(i, slot, scene, work.static[slot])
    to_spare_m = work.static[slot, MARGIN] - work.static_target_m[i]
    spare = SPARE_WORTH * min(clear[MARGIN], tuning.margin_cap_m)
    if to_spare_m >= 0.0:
        return PAIR_SAFE + spare
    work.bound[slot] = nearest
    return max(STATIC_LOST, PAIR_SAFE + to_spare_m - SPARE_WORTH * tuning.margin_cap_m) + spare


@lean_kernel
def worst_rank(ours: BoolArray, work: Work) -> float:
    """Least rank of any boat of ours."""
    least = 2.0 * PAIR_SAFE
    for i in range(ours.shape[0]):
        if ours[i]:
            least = min(least, work.rank[i])
    return least
