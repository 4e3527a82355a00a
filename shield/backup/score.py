"""The lexicographic score of a backup manoeuvre: which constraints it satisfies, then by what margin."""

from __future__ import annotations

from typing import NamedTuple

from ..barriers.boats import worst_clearance
from ..barriers.clearance import FAR, MARGIN, SAMPLE
from ..barriers.pursuit import falls_short_at_once, worst_pursuer
from ..barriers.static import clear_of_near_obstacles, clear_of_static
from ..jit import lean_kernel
from ..workspace import Scene

CLEAR_OF_NONE, CLEAR_OF_KNOWN, CLEAR_OF_OBSTACLES, CLEAR_OF_BOATS, CLEAR_OF_ALL = range(5)
"""Levels of a score, each with all before it: clear of teammates and of opponents that hold their course; clear of
obstacles near in time; the required margins from all boats, pursuers included; those from static constraints."""

SPARE_SCORE = 1e-3
"""Weight of a metre to spare from boats, relative to a metre by which static constraints are violated."""

LATER_SCORE_M = 1e-3
"""Score, m, of one more sample before a path is deepest in an obstacle, or where a barrier gives no margin."""

SAME_M = 1e-6
"""Scores that differ by no more, m, are equal, so that rounding, which varies with the place, decides nothing."""


class Score(NamedTuple):
    """Score of a manoeuvre; more is better, entry by entry.

    Attributes:
        satisfied: the last level that is satisfied, `CLEAR_OF_NONE` to `CLEAR_OF_ALL`.
        score_m: decides within a level, m. For `CLEAR_OF_NONE` and `CLEAR_OF_OBSTACLES`: the least margin from boats.
            For `CLEAR_OF_KNOWN`: the margin from obstacles. For `CLEAR_OF_BOATS`: the margin from static constraints
            less the required one. For `CLEAR_OF_ALL`: the margin to spare from boats.
    """

    satisfied: int
    score_m: float


WORST = Score(CLEAR_OF_NONE, -1e9)
"""A score that every manoeuvre reaches."""


@lean_kernel
def better(score: Score, best: Score) -> bool:
    """Return whether a score exceeds another by more than rounding."""
    return score.satisfied > best.satisfied or (
        score.satisfied == best.satisfied and score.score_m > best.score_m + SAME_M
    )


@lean_kernel
def score_of(i: int, scene: Scene) -> Score:
    """Return the score of boat i's present manoeuvre."""
    return Score(scene.satisfied[i], scene.score_m[i])


@lean_kernel
def level_to_beat(best: Score) -> float:
    """Return the margin against pursuers, m, at which a manoeuvre that violates it is no better than the best."""
    if best.satisfied > CLEAR_OF_OBSTACLES:
        return FAR
    return best.score_m if best.satisfied == CLEAR_OF_OBSTACLES else -FAR


@lean_kernel
def least_to_beat(best: Score) -> float:
    """Return the margin, m, below which a manoeuvre is no better than the best, whatever else it satisfies."""
    return best.score_m + SAME_M if best.satisfied == CLEAR_OF_ALL else -FAR


@lean_kernel
def is_no_better(i: int, slot: int, best: Score, scene: Scene) -> bool:
    """Return whether any path of a manoeuvre in ``slot`` scores no better than the best, by value tables alone."""
    least_m = least_to_beat(best)
    return scene.tuning.margin_cap_m < least_m or falls_short_at_once(i, slot, level_to_beat(best), least_m, scene)


@lean_kernel
def _skip_pursuers(slot: int, scene: Scene) -> None:
    """Set margins of a path whose pursuers do not matter: none exceeds the margin from the other boats."""
    margin = scene.clear[slot, MARGIN]
    scene.pursuit_margin_m[slot], scene.pursuit_margins_m[slot, :], scene.joint_m[slot] = margin, margin, FAR
    scene.refused_by_table[slot], scene.pursuers_known[slot] = False, False


@lean_kernel
def _score_if_clear(i: int, slot: int, scene: Scene) -> Score:
    """Return the score of a path that satisfies all margins from boats, by static and boats' margins in ``slot``."""
    if not scene.static_known[slot]:
        scene.static_known[slot] = True
        scene.static_by[slot] = clear_of_static(i, slot, scene, scene.static_clear[slot])
    to_spare_m = scene.static_clear[slot, MARGIN] - scene.static_target_m[i]
    spare_m = min(scene.clear[slot, MARGIN], scene.tuning.margin_cap_m)
    if to_spare_m >= 0.0:
        return Score(CLEAR_OF_ALL, spare_m)
    return Score(CLEAR_OF_BOATS, to_spare_m + SPARE_SCORE * spare_m)


@lean_kernel
def score_path(i: int, slot: int, best: Score, scene: Scene) -> Score:
    """Score the path in ``slot`` for boat i; stop early once it cannot exceed ``best``.

    Certain constraints come before adversarial ones: first teammates and opponents that hold their course, then
    obstacles near in time (a stopped boat is caught), then pursuing opponents, then all static constraints, last the
    margin to spare. The reported clearance is from all boats, whatever decides the score.
    """
    scene.spent[0] += scene.cost[i]
    clear = scene.clear[slot]
    least_m = least_to_beat(best)
    worst_clearance(i, slot, scene, best.score_m if best.satisfied == CLEAR_OF_NONE else max(0.0, least_m))
    if not clear[MARGIN] >= 0.0:
        _skip_pursuers(slot, scene)
        return Score(CLEAR_OF_NONE, clear[MARGIN])
    touched = clear_of_near_obstacles(i, slot, scene, 0.0, scene.scratch_clear)
    if not scene.scratch_clear[MARGIN] >= 0.0:
        score = Score(CLEAR_OF_KNOWN, scene.scratch_clear[MARGIN] + LATER_SCORE_M * scene.scratch_clear[SAMPLE])
        if better(score, best):
            worst_pursuer(i, slot, -FAR, -FAR, scene)
        else:
            _skip_pursuers(slot, scene)
        scene.refused_by_table[slot], scene.active[slot] = False, touched
        return score
    sure_m, short = clear[MARGIN], scene.violates_predicted[slot]
    if short and not better(Score(CLEAR_OF_OBSTACLES, sure_m), best):
        _skip_pursuers(slot, scene)
        return Score(CLEAR_OF_OBSTACLES, sure_m)
    if best.satisfied > CLEAR_OF_OBSTACLES:  # what static constraints say is found sooner than what pursuers may do
        score = _score_if_clear(i, slot, scene)
        if not better(score, best):
            _skip_pursuers(slot, scene)
            return score
    worst_pursuer(i, slot, level_to_beat(best), least_m, scene)
    if short or scene.violates_pursuers[slot]:
        pursuit_m = scene.pursuit_margin_m[slot]
        return Score(CLEAR_OF_OBSTACLES, min(sure_m, pursuit_m) if short else pursuit_m)
    score = _score_if_clear(i, slot, scene)
    if score.satisfied < CLEAR_OF_ALL:
        scene.active[slot] = scene.static_by[slot]
    return score


@lean_kernel
def all_satisfy(least: int, scene: Scene) -> bool:
    """Return whether every own boat satisfies at least that level."""
    ours = scene.ours
    keep = True
    for i in range(ours.shape[0]):
        keep = keep and (not ours[i] or scene.satisfied[i] >= least)
    return keep
