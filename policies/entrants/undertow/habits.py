"""Opponents that keep a habit, known ahead of time, and who stays at home to guard the flag."""

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

COME_M = 3.0
"""An opponent so far beyond the dividing line is no guard, m."""
ROAMS_SHARE, QUIET_S = 0.3, 15.0
"""Nor is one so near to the line, in shares of the way from there to its flag, while none of ours has been within
`LURE_M` of the line or beyond it for so long, s: a guard goes back to its flag."""
LURE_M = 1.0

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
            row = foe.x, foe.y, wrap(foe.heading), float(foe.tagged), float(foe.on_side)
            self._looks[number] = [*self._looks[number], row][-KEPT:]
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


class Watch:
    """Who has been where.

    Attributes:
        habits: of the opponents.
        nobody: none stays at home, as was remembered of the game.
    """

    def __init__(self, sight: Sight) -> None:
        self.habits, self.nobody = Habits(len(sight.foes)), False
        self._left, self._numbers = set[int](), range(len(sight.foes))
        self._lured_s = sight.time

    def look(self, sight: Sight) -> bool:
        """Note who is where; whether habits were looked at."""
        if any(boat.x > sight.line - LURE_M for boat in sight.own):
            self._lured_s = sight.time
        near = sight.line - COME_M
        roams = sight.line + ROAMS_SHARE * (sight.base[0] - sight.line)
        quiet = sight.time - self._lured_s > QUIET_S
        self._left |= {
            n for n, foe in enumerate(sight.foes) if foe.x < near or (quiet and foe.x < roams and not foe.tagged)
        }
        return self.habits.look(sight)

    @property
    def unguarded(self) -> bool:
        """Whether every opponent has left its flag at some time, or keeps a habit whoever comes."""
        return self.nobody or all(number in self._left or self.habits.settled(number) for number in self._numbers)

    @property
    def timed(self) -> bool:
        """Whether some opponent keeps a habit."""
        return any(self.habits.settled(number) for number in self._numbers)
