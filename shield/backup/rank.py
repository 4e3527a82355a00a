"""What a backup manoeuvre is worth: what it keeps, in the order of what matters, and then by how much."""

from __future__ import annotations

from typing import NamedTuple

from ..barriers.boats import worst_clearance
from ..barriers.clearance import FAR, MARGIN, SAMPLE
from ..barriers.pursuit import falls_short_at_once, worst_pursuer
from ..barriers.static import clear_of_near_obstacles, clear_of_static
from ..jit import lean_kernel
from ..workspace import Scene

NOTHING, BOATS, OBSTACLES, OPPONENTS, ALL = range(5)
"""What is kept, each with all before it: clear of teammates and of opponents that hold their course; of obstacles near
in time; what must be kept from all boats, whatever they are granted; what must be kept from static constraints."""

SPARE_SCORE = 1e-3
"""Worth of a metre to spare from boats beside one that static constraints are short of."""

LATER_SCORE_M = 1e-3
"""Worth, m, of a sample more before a path is deepest in an obstacle, or where a barrier gives no margin at all."""

SAME_M = 1e-6
"""Worths that differ by no more, m, are alike: rounding, which differs from place to place, decides between none."""


class Rank(NamedTuple):
    """What a manoeuvre is worth; more is better, entry by entry.

    Attributes:
        satisfied: the last thing it satisfies, `NOTHING` to `ALL`.
        score_m: decides between those that keep as much, m: of `NOTHING` and `OBSTACLES` the least margin from boats,
            of `BOATS` that from obstacles, of `OPPONENTS` that from static constraints less what must be kept, and of
            `ALL` what is to spare from boats.
    """

    satisfied: int
    score_m: float


WORST = Rank(NOTHING, -1e9)
"""No more than any manoeuvre is worth."""


@lean_kernel
def better(rank: Rank, best: Rank) -> bool:
    """Whether a rank is above another by more than rounding."""
    return rank.satisfied > best.satisfied or (
        rank.satisfied == best.satisfied and rank.score_m > best.score_m + SAME_M
    )


@lean_kernel
def score_of(i: int, scene: Scene) -> Rank:
    """Rank of the manoeuvre boat i has."""
    return Rank(scene.satisfied[i], scene.score_m[i])


@lean_kernel
def level_to_beat(best: Rank) -> float:
    """Margin against pursuers, m, at which a manoeuvre short of what it must keep is no better than the best."""
    if best.satisfied > OBSTACLES:
        return FAR
    return best.score_m if best.satisfied == OBSTACLES else -FAR


@lean_kernel
def least_to_beat(best: Rank) -> float:
    """Margin, m, below which a manoeuvre is no better than the best, whatever else it keeps."""
    return best.score_m + SAME_M if best.satisfied == ALL else -FAR


@lean_kernel
def is_no_better(i: int, slot: int, best: Rank, scene: Scene) -> bool:
    """Whether a manoeuvre of boat i in ``slot`` is no better than the best, whatever its path, by what tables tell."""
    least_m = least_to_beat(best)
    return scene.tuning.margin_cap_m < least_m or falls_short_at_once(i, slot, level_to_beat(best), least_m, scene)


@lean_kernel
def _skip_pursuers(slot: int, scene: Scene) -> None:
    """Margins against pursuers of a path of which they do not matter: none is better than that from the others."""
    margin = scene.clear[slot, MARGIN]
    scene.threat_m[slot], scene.threats_m[slot, :], scene.joint_m[slot] = margin, margin, FAR
    scene.refused_by_table[slot], scene.pursuers_known[slot] = False, False


@lean_kernel
def _rank_if_clear(i: int, slot: int, scene: Scene) -> Rank:
    """Rank of a path that keeps what must be kept from all boats, by static constraints and the margin in ``slot``."""
    if not scene.static_known[slot]:
        scene.static_known[slot], scene.static_by[slot] = (
            True,
            clear_of_static(i, slot, scene, scene.static_clear[slot]),
        )
    to_spare_m = scene.static_clear[slot, MARGIN] - scene.static_target_m[i]
    spare_m = min(scene.clear[slot, MARGIN], scene.tuning.margin_cap_m)
    return Rank(ALL, spare_m) if to_spare_m >= 0.0 else Rank(OPPONENTS, to_spare_m + SPARE_SCORE * spare_m)


@lean_kernel
def score_path(i: int, slot: int, best: Rank, scene: Scene) -> Rank:
    """Rank of the path in ``slot`` for boat i; work is cut short once it cannot exceed ``best``.

    What is certain comes before what is feared: teammates and opponents that hold their course first, obstacles near
    in time second (who is stopped is caught), pursuing opponents third; then all static constraints, and last room to
    spare. The clearance told is from all boats, whatever the rank hangs on.
    """
    scene.spent[0] += scene.cost[i]
    clear = scene.clear[slot]
    least_m = least_to_beat(best)
    worst_clearance(i, slot, scene, best.score_m if best.satisfied == NOTHING else max(0.0, least_m))
    if not clear[MARGIN] >= 0.0:
        _skip_pursuers(slot, scene)
        return Rank(NOTHING, clear[MARGIN])
    touched = clear_of_near_obstacles(i, slot, scene, 0.0, scene.spare2)
    if not scene.spare2[MARGIN] >= 0.0:
        rank = Rank(BOATS, scene.spare2[MARGIN] + LATER_SCORE_M * scene.spare2[SAMPLE])
        if better(rank, best):
            worst_pursuer(i, slot, -FAR, -FAR, scene)
        else:
            _skip_pursuers(slot, scene)
        scene.refused_by_table[slot], scene.bound[slot] = False, touched
        return rank
    sure_m, short = clear[MARGIN], scene.violates_known[slot]
    if short and not better(Rank(OBSTACLES, sure_m), best):
        _skip_pursuers(slot, scene)
        return Rank(OBSTACLES, sure_m)
    if best.satisfied > OBSTACLES:  # what static constraints say is found sooner than what pursuers may do
        rank = _rank_if_clear(i, slot, scene)
        if not better(rank, best):
            _skip_pursuers(slot, scene)
            return rank
    worst_pursuer(i, slot, level_to_beat(best), least_m, scene)
    if short or scene.violates_pursuers[slot]:
        return Rank(OBSTACLES, min(sure_m, scene.threat_m[slot]) if short else scene.threat_m[slot])
    rank = _rank_if_clear(i, slot, scene)
    if rank.satisfied < ALL:
        scene.bound[slot] = scene.static_by[slot]
    return rank


@lean_kernel
def all_satisfy(least: int, scene: Scene) -> bool:
    """Whether every boat of ours keeps at least that much."""
    ours = scene.ours
    keep = True
    for i in range(ours.shape[0]):
        keep = keep and (not ours[i] or scene.satisfied[i] >= least)
    return keep
