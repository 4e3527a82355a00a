"""Opponents that keep a habit: who circles, patrols or drives home is known ahead of time."""

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
"""So many right expectations make a habit, and so many more for each that was wrong by then: one that leaves its way
once is wrong at several looks, and so is not relied on for most of a game."""
TAGGED, HOME = 3, 4
"""Columns of a look: after x, y, m, and heading, rad, whether it is tagged, and on its own side."""

Track = NDArray[np.float64]
"""What an opponent does at the next looks, (looks, 3): x, y, m, and 1 where it is on its own side and not tagged."""


class Habits:
    """What each opponent did, and whether it does it again.

    A look at an opponent is likened to earlier ones, and it is expected to go on as it did then, over and over. One
    that is often right on the opponent's own side is relied on: it does the same whatever we do. Who sails at our boats
    is soon somewhere else than expected, and is not relied on for long after that.

    Args:
        foes: how many opponents there are.
    """

    def __init__(self, foes: int) -> None:
        self._looks: list[list[tuple[float, ...]]] = [[] for _ in range(foes)]
        self._expected: list[list[Track | None]] = [[] for _ in range(foes)]
        self._kept, self._breaks = [0] * foes, [0] * foes
        self._next_s = -np.inf

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
        """What a settled opponent will do at the next looks; None where it is not, or stands as never before."""
        return self._again(number, looks) if self.settled(number) else None

    def _compare(self, number: int, foe: Boat) -> None:
        """Hold where it is, on its own side, against what was expected `LEAD` looks ago."""
        expected, looks = self._expected[number], self._looks[number][-LEAD:]
        at_home = foe.on_side and all(look[HOME] > 0.0 for look in looks)
        if not at_home or len(expected) < LEAD or expected[0] is None:
            return
        self._kept[number] += 1
        if np.hypot(*(expected[0][LEAD - 1, :2] - foe.at)) > BROKEN_M:
            self._breaks[number] += 1
            self._kept[number] = -WARY * self._breaks[number]

    def _again(self, number: int, looks: int) -> Track | None:
        """What followed the look most like the last one, repeated from there on."""
        seen = np.array(self._looks[number])
        if len(seen) <= FRESH:
            return None
        now, past = seen[-1], seen[:-FRESH]
        turn = np.abs((past[:, 2] - now[2] + np.pi) % (2.0 * np.pi) - np.pi)
        off = np.hypot(past[:, 0] - now[0], past[:, 1] - now[1]) + RAD_M * turn
        off[past[:, TAGGED] != now[TAGGED]] = np.inf
        best = len(off) - 1 - int(np.argmin(off[::-1]))
        if off[best] > ALIKE_M:
            return None
        then = seen[best + 1 + np.arange(looks) % (len(seen) - 1 - best)]
        found: Track = np.column_stack([then[:, :2], then[:, HOME] * (1.0 - then[:, TAGGED])])
        return found


def _row(foe: Boat) -> tuple[float, ...]:
    return foe.x, foe.y, wrap(foe.heading), float(foe.tagged), float(foe.on_side)
