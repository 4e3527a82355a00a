"""Judging a breach from both sides, and who is responsible.

Responsible is who had the last clear chance: each boat is judged with the other's actual track held fixed, and the boat
whose last preventable step is the later one let the last chance pass, by the command of that step. When both had their
last chance within one step of each other, both are responsible. Where commands take effect late, it is the moments at
which they had to be given that are compared. When the game itself drove that boat in that step (a
tagged boat on its way home), the game is. When neither could have avoided it, neither is; a pair that was inside when
the record began is a matter of the start.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from .boat import as_boats
from .checks import check_states
from .errors import OracleError
from .judge import DEFAULT, judge
from .motion import AT_ONCE, Motion
from .settings import Settings
from .verdict import BreachVerdict, Outcome, Responsible, Verdict

Progress = Callable[[int, int], None]
"""Called with the number of breaches judged and the number there are."""


def judge_breach(
    states: Any,
    boats: Any,
    pair: tuple[int, int],
    step: int,
    radius_m: float,
    dt_s: float = 0.1,
    driven: Any = None,
    settings: Settings = DEFAULT,
    motion: Motion = AT_ONCE,
) -> BreachVerdict:
    """Judge a breach from both sides.

    Args:
        states: see `judge`; as ``boats``, ``step``, ``radius_m``, ``dt_s`` and ``settings``.
        boats: see `judge`.
        pair: the two boats.
        step: index of the first state inside the radius.
        radius_m: separation radius, m.
        dt_s: length of a step, s.
        driven: (T, n) bool, whether the game drove the boat in step k -> k+1; None when it never did.
        settings: see `judge`.
        motion: see `judge`.

    Raises:
        OracleError: see `judge`, or ``driven`` has another shape.
    """
    table = check_states(states)
    chosen = as_boats(boats, table.shape[1])
    game = _driven(driven, table.shape)
    first, second = pair
    verdicts = [
        judge(table, chosen, own, step, radius_m, dt_s, other, settings, motion)
        for own, other in ((first, second), (second, first))
    ]
    return BreachVerdict(step, verdicts[0], verdicts[1], _responsible(verdicts[0], verdicts[1], game))


def judge_breaches(
    states: Any,
    boats: Any,
    breaches: Iterable[Any],
    radius_m: float,
    dt_s: float = 0.1,
    driven: Any = None,
    settings: Settings = DEFAULT,
    progress: Progress = lambda done, total: None,
    motion: Motion = AT_ONCE,
) -> list[BreachVerdict]:
    """Judge many breaches of one record.

    Args:
        states: see `judge_breach`; as the rest.
        boats: see `judge_breach`.
        breaches: rows (step, boat a, boat b, ...); further columns are ignored.
        radius_m: separation radius, m.
        dt_s: length of a step, s.
        driven: see `judge_breach`.
        settings: see `judge`.
        progress: called after each breach with the number judged and the number of all.
        motion: see `judge`.
    """
    rows = [tuple(int(value) for value in row[:3]) for row in breaches]
    verdicts = []
    for done, (step, a, b) in enumerate(rows, start=1):
        verdicts.append(judge_breach(states, boats, (a, b), step, radius_m, dt_s, driven, settings, motion))
        progress(done, len(rows))
    return verdicts


def _driven(driven: Any, shape: tuple[int, ...]) -> np.ndarray:
    if driven is None:
        return np.zeros((shape[0] - 1, shape[1]), dtype=np.bool_)
    marks = np.asarray(driven)
    if marks.shape != (shape[0] - 1, shape[1]) or marks.dtype != np.bool_:
        raise OracleError(
            f"driven is {marks.dtype} of shape {marks.shape}; give bool of shape {(shape[0] - 1, shape[1])}, "
            "one row per step"
        )
    return marks


def _responsible(first: Verdict, second: Verdict, driven: np.ndarray) -> Responsible:
    if first.outcome is Outcome.STARTED_INSIDE or second.outcome is Outcome.STARTED_INSIDE:
        return Responsible.START
    if first.last_step is None and second.last_step is None:
        return Responsible.NEITHER
    lasts = [-2 if verdict.last_step is None else verdict.last_step for verdict in (first, second)]
    late = [verdict for verdict, last in zip((first, second), lasts, strict=True) if last >= max(lasts) - 1]
    free = [v for v in late if v.last_step is not None and not driven[v.last_step, v.own]]
    if not free:
        return Responsible.GAME
    if len(free) == 2:
        return Responsible.BOTH
    return Responsible.FIRST if free[0] is first else Responsible.SECOND
