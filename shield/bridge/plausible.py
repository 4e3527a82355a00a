"""Whether a fix can be true: finite, of a boat's size of values, and reachable from the last one.

A jump is refused at first. A boat that keeps saying the same new place is believed in the end: receivers do settle on
a better fix, and a track that never comes back would be worse. Not as long as somebody else sees it elsewhere.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

FARTHEST_M = 1e5
"""Positions farther from the field's corner than this are faults."""

SPEED_SHARE, SPEED_MORE_MPS = 2.0, 1.0
"""Speeds beyond this share of the platform's top plus this much are faults: current and wind give less."""

JUMP_M = 3.0
"""Differences from where the boat must be that no receiver's noise explains, m."""

MOVED_M, FROZEN_M = 0.05, 0.6
"""A position that moved less than the first while the boat's speed says it ran the second is frozen, m."""

UNDER_WAY_MPS = 0.2
"""Slower boats may well stay where they are: noise of the speed is no way run."""

BELIEVED_AFTER_S = 2.0
"""A new place told consistently for this long is believed, s."""


@dataclass(frozen=True)
class Fix:
    """Where a boat was: position m, speed m/s, heading rad, when, s, and how wrong the place may be as told, m."""

    x_m: float
    y_m: float
    heading_rad: float
    speed_mps: float
    fixed_s: float
    error_m: float = 0.0

    def after(self, time_s: float) -> tuple[float, float]:
        """Position at another time on the same course, m."""
        way = self.speed_mps * (time_s - self.fixed_s)
        return self.x_m + way * math.sin(self.heading_rad), self.y_m + way * math.cos(self.heading_rad)


class Gate:
    """Lets fixes of one boat through, or says why not.

    Args:
        fastest_mps: top speed of its platform, m/s.
    """

    def __init__(self, fastest_mps: float) -> None:
        self._fastest = SPEED_SHARE * fastest_mps + SPEED_MORE_MPS
        self._last: Fix | None = None
        self._still: Fix | None = None
        self._newest_s = -math.inf
        self._run_m = 0.0
        self._doubted: Fix | None = None
        self._doubted_since_s = 0.0

    def refuse(self, fix: Fix, witness: Fix | None = None) -> str:
        """Why this fix is not taken; empty: it is taken.

        Args:
            fix: what is told.
            witness: where somebody else lately saw the boat; None: nobody did. It never refuses a fix that goes on
                from the last one taken: it may be the one that is wrong.
        """
        text = self._impossible(fix) or self._frozen(fix)
        if text:
            return text
        if self._doubted is not None and self._is_contradicted(fix, witness):
            self._doubted, self._doubted_since_s = fix, fix.fixed_s
            return "position jumped, and the feed sees it elsewhere"
        if self._last is None or self._near(self._last, fix):
            self._last, self._doubted = fix, None
            return ""
        return self._doubt(fix, self._last)

    def _impossible(self, fix: Fix) -> str:
        values = (fix.x_m, fix.y_m, fix.heading_rad, fix.speed_mps, fix.fixed_s)
        if not all(math.isfinite(value) for value in values):
            return "a value is not finite"
        if math.hypot(fix.x_m, fix.y_m) > FARTHEST_M:
            return f"position ({fix.x_m:.0f}, {fix.y_m:.0f}) m is nowhere near the field"
        if abs(fix.speed_mps) > self._fastest:
            return f"speed {fix.speed_mps:.1f} m/s is beyond the boat"
        return ""

    def _frozen(self, fix: Fix) -> str:
        """Whether the position stays although the boat is under way; its time stamps may be fresh all the same."""
        still = self._still
        if still is None or math.hypot(fix.x_m - still.x_m, fix.y_m - still.y_m) > MOVED_M:
            self._still, self._run_m = fix, 0.0
        elif fix.fixed_s > self._newest_s and abs(fix.speed_mps) > UNDER_WAY_MPS:
            self._run_m += abs(fix.speed_mps) * min(fix.fixed_s - self._newest_s, 1.0)
        self._newest_s = max(self._newest_s, fix.fixed_s)
        return f"position frozen while it runs {abs(fix.speed_mps):.1f} m/s" if self._run_m > FROZEN_M else ""

    def _is_contradicted(self, fix: Fix, witness: Fix | None) -> bool:
        """Whether a witness sees the boat elsewhere, and its own last fix says nothing else."""
        if witness is None or _agree(witness, fix):
            return False
        return self._last is None or not _agree(self._last, fix)

    def _near(self, before: Fix, fix: Fix) -> bool:
        """Whether the boat can have come from there, whatever it did on the way."""
        seconds = abs(fix.fixed_s - before.fixed_s)
        x, y = before.after(fix.fixed_s)
        return math.hypot(fix.x_m - x, fix.y_m - y) <= JUMP_M + 2.0 * self._fastest * min(seconds, BELIEVED_AFTER_S)

    def _doubt(self, fix: Fix, last: Fix) -> str:
        if self._doubted is None or not self._near(self._doubted, fix):
            self._doubted_since_s = fix.fixed_s
        self._doubted = fix
        if fix.fixed_s - self._doubted_since_s >= BELIEVED_AFTER_S:
            self._last, self._doubted = fix, None
            return ""
        x, y = last.after(fix.fixed_s)
        return f"position jumped {math.hypot(fix.x_m - x, fix.y_m - y):.0f} m"


def _agree(witness: Fix, fix: Fix) -> bool:
    """Whether a fix is of the place where the boat was seen, as well as that is known."""
    x, y = witness.after(fix.fixed_s)
    return math.hypot(fix.x_m - x, fix.y_m - y) <= JUMP_M + witness.error_m
