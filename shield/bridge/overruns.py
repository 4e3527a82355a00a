"""Keeping the rate: when the next turn is due, and how late turns were."""

from __future__ import annotations

import logging
import math

LOG = logging.getLogger(__name__)

TALK_EVERY_S = 10.0

LATE = 0.6
"""Part of a step that a turn may begin late by and still count as in its place."""


def left_out(gap_s: float, dt_s: float) -> int:
    """Turns that were left out between two that began so long after each other, s; a gap that is not finite: none.

    One that began late by up to `LATE` of a step is not taken for two.
    """
    return max(0, math.ceil(gap_s / dt_s - 1.0 - LATE)) if math.isfinite(gap_s) else 0


class Overruns:
    """Counts turns that began late or took longer than a step.

    Attributes:
        turns: so far.
        late: turns after which at least one due time was missed.
        missed: due times missed.
        worst_s: latest end of a turn after the next was due, s.

    Args:
        dt_s: step, s.
    """

    def __init__(self, dt_s: float) -> None:
        self._dt_s = dt_s
        self._told_s = float("-inf")
        self.turns = 0
        self.late = 0
        self.missed = 0
        self.worst_s = 0.0

    def next_due(self, due_s: float, now_s: float) -> float:
        """When the next turn is due after one due at ``due_s`` ended at ``now_s``.

        Turns keep to the grid of the start; missed ones are left out, not made up: two commands at once help nobody.
        """
        self.turns += 1
        due = due_s + self._dt_s
        if now_s <= due:
            return due
        missed = int((now_s - due) / self._dt_s) + 1
        self.late += 1
        self.missed += missed
        self.worst_s = max(self.worst_s, now_s - due)
        if now_s - self._told_s >= TALK_EVERY_S:
            self._told_s = now_s
            LOG.warning("the loop fell behind by %.0f ms; %d turns left out", 1e3 * (now_s - due), missed)
        return due + missed * self._dt_s
