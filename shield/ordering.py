"""The order in which boats are decided for: by their names, wherever they stand in the fleet.

Manoeuvres are found one boat at a time, so an order there must be. By names the same boats get the same commands, bit
for bit, in whatever order a fleet lists them.
"""

from __future__ import annotations

import re
from dataclasses import replace
from functools import lru_cache

import numpy as np

from .commands import Commands
from .decision import Decisions
from .fleet import Fleet
from .jit import IntArray

_MAY_BE_GIVEN = ("age_s", "position_error_m", "driven", "visiting", "adversary_s")
_NUMBER = re.compile(r"([0-9]+)")


@lru_cache(maxsize=256)
def order_of(names: tuple[str, ...]) -> IntArray | None:
    """Indices (n,) of boats by their names, numbers in them by their size; None where they are in order."""
    order = np.array(sorted(range(len(names)), key=lambda i: (_parts(names[i]), i)), dtype=np.int64)
    if (order == np.arange(len(names))).all():
        return None
    order.setflags(write=False)
    return order


def _parts(name: str) -> list[tuple[bool, int, str, str]]:
    """A name as what it is compared by: texts and the numbers between them, of any length."""
    parts = []
    for k, part in enumerate(_NUMBER.split(name)):
        digits = part.lstrip("0") if k % 2 else ""
        parts.append((bool(k % 2), len(digits), digits, part))
    return parts


def ordered(fleet: Fleet, wanted: Commands, order: IntArray) -> tuple[Fleet, Commands]:
    """Fleet and commands with their boats in that order."""
    rows = [int(i) for i in order]
    boats = replace(
        fleet,
        state=fleet.state[order],
        team=fleet.team[order],
        platforms=tuple(fleet.platforms[i] for i in rows),
        controlled=fleet.controlled[order],
        names=tuple(fleet.names[i] for i in rows),
        **{name: value[order] for name in _MAY_BE_GIVEN if (value := getattr(fleet, name)) is not None},
    )
    return boats, replace(wanted, values=wanted.values[order])


def as_given(decisions: Decisions, fleet: Fleet, wanted: Commands, order: IntArray) -> Decisions:
    """Decisions about ordered boats for the fleet as it was given."""
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    bound = decisions.bound[place]
    missing, cut_short = decisions.no_table, decisions.cut_short
    return replace(
        decisions,
        fleet=fleet,
        wanted=wanted,
        sent=replace(wanted, values=decisions.sent.values[place]),
        intervened=decisions.intervened[place],
        reason=decisions.reason[place],
        certificate_m=decisions.certificate_m[place],
        slack_m=decisions.slack_m[place],
        bound=np.where(bound >= 0, order[bound], bound),
        no_table=None if missing is None else missing[np.ix_(place, place)],
        cut_short=None if cut_short is None else cut_short[place],
        feared_s=None if decisions.feared_s is None else decisions.feared_s[place],
    )
