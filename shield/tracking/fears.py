"""For how long each boat is feared as an opponent: what the fleet says of it, else the settings."""

from __future__ import annotations

import math

import numpy as np

from ..config import ShieldConfig
from ..fleet import Fleet
from ..jit import Array, BoolArray, IntArray, kernel
from ..setup import fears_somebody
from ..work import Work

_NOBODY = np.zeros(0, np.bool_)
_NOTHING = np.zeros(0)


def note_fears(fleet: Fleet, config: ShieldConfig, work: Work) -> Array:
    """Write into ``work.fear_s`` how long each boat may do its worst, s; ``work.known`` are those foreseen.

    Returns:
        (n,) the same, s, as it is told: 0 for boats whose way is foreseen, NaN for those that are nobody's opponent.
    """
    told_s = np.empty(len(fleet))
    _note(
        fleet.team,
        fleet.controlled,
        work.known,
        _NOBODY if fleet.visiting is None else fleet.visiting,
        _NOTHING if fleet.adversary_s is None else fleet.adversary_s,
        fears_somebody(config),
        config.feared_s,
        config.visitor_feared_s,
        work.fear_s,
        told_s,
    )
    return told_s


@kernel
def _note(
    team: IntArray,
    controlled: BoolArray,
    known: BoolArray,
    visiting: BoolArray,
    said_s: Array,
    feared: bool,
    feared_s: float,
    visitor_s: float,
    fear_s: Array,
    told_s: Array,
) -> None:
    ours = _one_team_of(team, controlled)
    for i in range(team.shape[0]):
        time_s = 0.0
        if feared:
            time_s = visitor_s if visiting.shape[0] > 0 and visiting[i] else feared_s
            if said_s.shape[0] > 0 and not math.isnan(said_s[i]):
                time_s = said_s[i]
        fear_s[i] = time_s
        mate = controlled[i] or (ours >= 0 and team[i] == team[ours])
        told_s[i] = np.nan if mate else (0.0 if known[i] else time_s)


@kernel
def _one_team_of(team: IntArray, controlled: BoolArray) -> int:
    """A controlled boat, when all such are of one team; -1: there is none, or there are several teams."""
    first = -1
    for i in range(team.shape[0]):
        if controlled[i]:
            if first >= 0 and team[i] != team[first]:
                return -1
            if first < 0:
                first = i
    return first
