"""Judging one boat's side of a breach.

Looking back from the breach, own commands may begin to differ at any step of the last T seconds at which the pair is
apart. The tracks of all others stay as they were. The breach is avoidable when, from one of those steps on, some
sequence of commands keeps the radius from every boat until the pair was apart again, and a settle time longer. A third
boat that is inside the radius when the commands begin is another breach, already under way: it is left out until it
was apart in the record, and kept clear of from then on.

Between two steps with no entry in between, whoever can still avoid from the later one can also avoid from the earlier
one, by following the recorded track. So the latest such step is found by growing leads and bisection.

Where commands take effect late, the states that they can change begin so much later; where a current carries the
boats, all of this happens in the frame of the water (see `motion`).
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .boat import Array
from .checks import Case, checked
from .motion import AT_ONCE, Motion
from .question import ROUNDING_M, Question
from .settings import Level, Settings
from .verdict import Outcome, Verdict

DEFAULT = Settings()


def judge(
    states: Any,
    boats: Any,
    own: int,
    step: int,
    radius_m: float,
    dt_s: float = 0.1,
    other: int | None = None,
    settings: Settings = DEFAULT,
    motion: Motion = AT_ONCE,
) -> Verdict:
    """Decide whether a boat could have avoided a breach.

    Args:
        states: (T+1, n, 11) state rows of all boats; index k after k steps.
        boats: parameters of the n boats: `Boat`s or the simulator's rows (n, 38).
        own: index of the boat that is judged.
        step: index of the first state inside the radius.
        radius_m: separation radius, m; at exactly the radius is inside.
        dt_s: length of a step.
        other: the boat it came too close to; the nearest at ``step`` when left out.
        settings: how far to look and how finely to search.
        motion: current and delay of the record.

    Raises:
        OracleError: the record, boats or numbers cannot be judged, or there is no breach at ``step``.
    """
    case = checked(states, boats, own, step, radius_m, dt_s, other)
    gaps = np.hypot(*np.moveaxis(case.tracks - case.states[:, None, own, :2], -1, 0))
    end = _end_of(gaps[:, case.partner], case.radius_m, step, settings, dt_s)
    first = max(0, step - round(settings.look_back_s / dt_s))
    delay = motion.delay_of(own, case.states.shape[1])
    changed = min(step, first + delay)  # the first state that the first command looked at changes
    inside = gaps <= case.radius_m + ROUNDING_M
    asked = _question(case, own, inside, end, dt_s, settings, motion)
    facts = {"own": own, "other": case.other, "step": step, "radius_m": case.radius_m, "end_step": end}
    facts["looked_back_s"] = (step - first) * dt_s
    if inside[:step, case.partner].all():
        return Verdict(**facts, outcome=Outcome.STARTED_INSIDE, **_nothing(True, 0))
    for low, high in reversed(_runs(inside[changed:step], case.partner, changed)):
        latest, exhausted = _latest(asked, low, high)
        if latest is not None:
            return _avoidable(asked, facts, latest, delay, exhausted, motion)
    return Verdict(**facts, outcome=Outcome.UNAVOIDABLE, **_nothing(asked.exhausted, asked.searches))


def _question(
    case: Case, own: int, inside: NDArray[np.bool_], end: int, dt_s: float, settings: Settings, motion: Motion
) -> Question:
    """Ask in the frame of the water."""
    way = motion.way_m(len(case.states), dt_s)
    rows = case.states[:, own].copy()
    rows[:, :2] -= way
    tracks = case.tracks - way[:, None]
    return Question(rows, case.numbers, tracks, inside, end, case.radius_m, dt_s, case.top_mps, settings)


def _latest(asked: Question, low: int, high: int) -> tuple[int | None, bool]:
    """Find the latest step of [low, high] from which the breach can be avoided.

    Returns:
        The step, None when there is none; whether the search that failed after it was exhausted.
    """
    best, failed = _bracket(asked, low, high, asked.settings.quick, growth=2)
    if best is None:
        best, failed = _bracket(asked, low, high, asked.settings.full, growth=4)
        if best is None:
            return None, asked.exhausted
    else:
        best, failed = _bisect(asked, best, failed, asked.settings.quick)
        best, failed = _press_on(asked, best, high)
    best, failed = _bisect(asked, best, failed, asked.settings.full)
    if failed > high:
        return best, True
    return best, asked.failures[failed, asked.settings.full]


def _bracket(asked: Question, low: int, high: int, level: Level, growth: int) -> tuple[int | None, int]:
    """Multiply the lead until a search succeeds: the step it began at, and the latest one tried before."""
    failed, lead = high + 1, 0
    while True:
        begin = max(low, high - lead)
        if asked.answer(begin, level):
            return begin, failed
        if begin == low:
            return None, low
        failed, lead = begin, growth * lead + growth - 1


def _press_on(asked: Question, best: int, high: int) -> tuple[int, int]:
    """From a success of the quick search go later with the full one, in growing strides, until it fails."""
    stride = 1
    while best < high:
        begin = min(high, best + stride)
        if not asked.answer(begin, asked.settings.full):
            return best, begin
        best, stride = begin, 2 * stride
    return best, high + 1


def _bisect(asked: Question, best: int, failed: int, level: Level) -> tuple[int, int]:
    while failed - best > 1:
        middle = (best + failed) // 2
        if asked.answer(middle, level):
            best = middle
        else:
            failed = middle
    return best, failed


def _avoidable(
    asked: Question, facts: dict[str, Any], latest: int, delay: int, exhausted: bool, motion: Motion
) -> Verdict:
    plan, last = asked.plans[latest], latest - delay
    way = motion.way_m(latest + len(plan.path_m), asked.dt_s)[latest:]
    return Verdict(
        **facts,
        outcome=Outcome.AVOIDABLE,
        last_step=last,
        last_preventable_s=(facts["step"] - last) * asked.dt_s,
        plan=replace(plan, path_m=plan.path_m + way),
        exhausted=exhausted,
        searches=asked.searches,
    )


def _nothing(exhausted: bool, searches: int) -> dict[str, Any]:
    return {
        "last_step": None,
        "last_preventable_s": None,
        "plan": None,
        "exhausted": exhausted,
        "searches": searches,
    }


def _end_of(gap_m: Array, radius_m: float, step: int, settings: Settings, dt_s: float) -> int:
    """Index of the last state that counts: the breach's last, and the settle time, within the record."""
    longest = step + round(settings.longest_s / dt_s)
    apart = np.flatnonzero(gap_m[step : longest + 1] > radius_m)
    over = step + int(apart[0]) if apart.size else longest
    return min(len(gap_m) - 1, over + round(settings.settle_s / dt_s))


def _runs(inside: NDArray[np.bool_], partner: int, first: int) -> list[tuple[int, int]]:
    """Stretches of steps with the pair apart and no other boat entering, as (first, last) indices of the record.

    Args:
        inside: (steps, m) whether each boat is within the radius.
        partner: column of the boat the breach is with.
        first: index of the first of these steps in the record.
    """
    entered = np.zeros(len(inside), dtype=np.bool_)
    entered[1:] = (inside[1:] & ~inside[:-1]).any(axis=1)
    runs: list[tuple[int, int]] = []
    for k in np.flatnonzero(~inside[:, partner]) + first:
        if runs and runs[-1][1] == k - 1 and not entered[k - first]:
            runs[-1] = (runs[-1][0], int(k))
        else:
            runs.append((int(k), int(k)))
    return runs
