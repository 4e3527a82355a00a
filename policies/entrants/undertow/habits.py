"""Opponents that keep a habit: who circles, patrols or stands still whatever happens is known ahead of time."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..plane import wrap
from ..sight import Boat, Sight

SAMPLE_S = 1.0
"""Time between two looks, s."""
KEPT = 90
"""Looks that are remembered."""
ALIKE_M, RAD_M, FRESH = 3.0, 4.0, 3
"""Looks are alike below so many m, a turn of 1 rad counting as `RAD_M`; the last `FRESH` ones are not compared."""
LEAD, BROKEN_M = 5, 6.0
"""An opponent that is so far from where it was expected so many looks ago has broken its habit, m."""
PROVEN, WARY = 15, 45
"""So many right expectations make a habit, and so many more for each that was wrong."""

Track = NDArray[np.float64]
"""What an opponent does at the next looks, (looks, 3): x, y, m, and 1 where it is on its own side and not tagged."""
TAGGED, HOME = 3, 4


class Habits:
    """What each opponent did, and whether it does it again.

    A look is likened to earlier ones of the same opponent, and it is expected to go on as then, for ever. One that is
    not where it was expected, on its own side, sails at somebody: it is no longer relied on.
    """

    def __init__(self, foes: int) -> None:
        self._looks: list[list[tuple[float, ...]]] = [[] for _ in range(foes)]
        self._expected: list[list[Track | None]] = [[] for _ in range(foes)]
        self._kept = [0] * foes
        self._next_s = -np.inf
        self._breaks = [0] * foes

    def look(self, sight: Sight) -> bool:
        """Remember this moment, where it is time for it; whether it was."""
        if sight.time < self._next_s - 1e-6:
            return False
        self._next_s = sight.time + SAMPLE_S
        for number, foe in enumerate(sight.foes):
            self._compare(number, foe)
            self._looks[number] = [*self._looks[number], _row(foe)][-KEPT:]
            self._expected[number] = [*self._expected[number], self._again(number, LEAD)][-LEAD:]
        return True

    def settled(self, number: int) -> bool:
        """Whether an opponent has kept its habit for long enough."""
        return self._kept[number] >= PROVEN

    def track(self, number: int, looks: int) -> Track | None:
        """What an opponent that is settled will do at the next looks, see `Track`; None where it is not."""
        return self._again(number, looks) if self.settled(number) else None

    def _compare(self, number: int, foe: Boat) -> None:
        """Hold where it is, on its own side, against what was expected `LEAD` looks ago."""
        expected, looks = self._expected[number], self._looks[number][-LEAD:]
        there = foe.on_side and all(look[HOME] > 0.0 for look in looks)
        if not there or len(expected) < LEAD or expected[0] is None:
            return
        off_m = float(np.hypot(*(expected[0][LEAD - 1, :2] - foe.at)))
        self._kept[number] += 1
        if off_m > BROKEN_M:
            self._breaks[number] += 1
            self._kept[number] = -WARY * self._breaks[number]

    def _again(self, number: int, looks: int) -> Track | None:
        """What followed the look most like the last one."""
        seen = np.array(self._looks[number])
        if len(seen) <= FRESH:
            return None
        now, past = seen[-1], seen[:-FRESH]
        turn = np.abs((past[:, 2] - now[2] + np.pi) % (2.0 * np.pi) - np.pi)
        off = np.hypot(past[:, 0] - now[0], past[:, 1] - now[1]) + RAD_M * turn + 1e3 * (past[:, TAGGED] != now[TAGGED])
        best = len(off) - 1 - int(np.argmin(off[::-1]))
        if off[best] > ALIKE_M:
            return None
        period = len(seen) - 1 - best
        then = seen[best + 1 + np.arange(looks) % period]
        found: Track = np.column_stack([then[:, :2], then[:, HOME] * (1.0 - then[:, TAGGED])])
        return found


def _row(foe: Boat) -> tuple[float, ...]:
    return foe.x, foe.y, wrap(foe.heading), float(foe.tagged), float(foe.on_side)
