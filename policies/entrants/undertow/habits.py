"""Opponents that repeat their motion and can be predicted, and opponents that guard the flag at home."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..observation import Boat, Observation
from ..plane import wrap

SAMPLE_S = 1.0
"""Time between two samples."""
KEPT = 90
"""Samples that are stored."""
ALIKE_M, RAD_M, FRESH = 3.0, 4.0, 3
"""Samples are alike below so many m; a turn of 1 rad counts as `RAD_M`. The last `FRESH` ones are not compared."""
LEAD, BROKEN_M = 5, 6.0
"""An opponent farther than `BROKEN_M` from its place predicted `LEAD` samples ago has broken its habit, m."""
PROVEN, WARY = 15, 45
"""Right predictions that make a habit, and how many more for each wrong one so far. An opponent that leaves its way
once gives several wrong predictions, and is not relied on for most of a game.
"""
TAGGED, HOME = 3, 4
"""Columns of a sample after x, y, m, and heading, rad: it is tagged; it is on its own side."""

COME_M = 3.0
"""An opponent this far beyond the dividing line is no guard."""
ROAMS_SHARE, QUIET_S = 0.3, 15.0
"""Limits for an opponent that is no guard: near the line (share of the way to its flag), and time, s.

It is no guard if it is this near while no own boat has been within `LURE_M` of the line or beyond it for this time. A
guard would have returned to its flag.
"""
LURE_M = 1.0

Track = NDArray[np.float64]
"""Prediction of an opponent at the next samples, (samples, 3): x, y, m, and 1 if it is on its own side and untagged."""


class Habits:
    """Past motion of each opponent, and whether it repeats it.

    A sample of an opponent is compared with earlier ones, and the opponent is predicted to repeat what followed then.
    An opponent with many right predictions on its own side is relied on: it does the same whatever we do. One that
    steers at our boats soon deviates from its prediction, and is then not relied on for long.

    Args:
        foes: number of opponents.
    """

    def __init__(self, foes: int) -> None:
        self._looks: list[list[tuple[float, ...]]] = [[] for _ in range(foes)]
        self._expected: list[list[Track | None]] = [[] for _ in range(foes)]
        self._kept, self._breaks = [0] * foes, [0] * foes
        self._next_s = -np.inf

    def look(self, obs: Observation) -> bool:
        """Store a sample if one is due; return whether it was."""
        if obs.time < self._next_s - 1e-6:
            return False
        self._next_s = obs.time + SAMPLE_S
        for number, foe in enumerate(obs.foes):
            self._compare(number, foe)
            row = foe.x, foe.y, wrap(foe.heading), float(foe.tagged), float(foe.on_side)
            self._looks[number] = [*self._looks[number], row][-KEPT:]
            self._expected[number] = [*self._expected[number], self._again(number, LEAD)][-LEAD:]
        return True

    def settled(self, number: int) -> bool:
        """Return whether an opponent has kept its habit for long enough."""
        return self._kept[number] >= PROVEN

    def track(self, number: int, looks: int) -> Track | None:
        """Return the prediction of a settled opponent at the next samples.

        None if it is not settled or no earlier sample is like the last one.
        """
        return self._again(number, looks) if self.settled(number) else None

    def _compare(self, number: int, foe: Boat) -> None:
        """Compare an opponent's place, on its own side, with the prediction `LEAD` samples ago."""
        expected, looks = self._expected[number], self._looks[number][-LEAD:]
        at_home = foe.on_side and all(look[HOME] > 0.0 for look in looks)
        if not at_home or len(expected) < LEAD or expected[0] is None:
            return
        self._kept[number] += 1
        if np.hypot(*(expected[0][LEAD - 1, :2] - foe.at)) > BROKEN_M:
            self._breaks[number] += 1
            self._kept[number] = -WARY * self._breaks[number]

    def _again(self, number: int, looks: int) -> Track | None:
        """Return what followed the sample most like the last one, repeated from there on."""
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
    """Record of where the opponents have been.

    Attributes:
        habits: of the opponents.
        nobody: no opponent stays at home, according to a restored memory.
    """

    def __init__(self, obs: Observation) -> None:
        self.habits, self.nobody = Habits(len(obs.foes)), False
        self._left, self._numbers = set[int](), range(len(obs.foes))
        self._lured_s = obs.time

    def look(self, obs: Observation) -> bool:
        """Note where all boats are; return whether habits were sampled."""
        if any(boat.x > obs.line - LURE_M for boat in obs.own):
            self._lured_s = obs.time
        near = obs.line - COME_M
        roams = obs.line + ROAMS_SHARE * (obs.base[0] - obs.line)
        quiet = obs.time - self._lured_s > QUIET_S
        self._left |= {
            n for n, foe in enumerate(obs.foes) if foe.x < near or (quiet and foe.x < roams and not foe.tagged)
        }
        return self.habits.look(obs)

    @property
    def unguarded(self) -> bool:
        """Whether every opponent has left its flag at some time, or repeats its motion whoever comes."""
        return self.nobody or all(number in self._left or self.habits.settled(number) for number in self._numbers)

    @property
    def timed(self) -> bool:
        """Whether some opponent has a habit."""
        return any(self.habits.settled(number) for number in self._numbers)
