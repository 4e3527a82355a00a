"""`PositionGuard`: positions that cannot be: jumps, and ones that stand still while the boat moves."""

from __future__ import annotations

import math

JUMP_M = 3.0
"""Beyond where the boat was heading, plus `JUMP_MPS` for each second since, is a jump."""
JUMP_MPS = 3.0
SETTLED_S = 2.0
SETTLED_AFTER = 5
"""After a jump, positions that hold together for `SETTLED_S` and so many messages are believed."""
FROZEN_M = 0.25
"""A position that stays the same to the last digit while the boat's own speed takes it this far is frozen."""

Position = tuple[float, float]


class PositionGuard:
    """Says of each position of one boat whether it is believed.

    Attributes:
        jumped_m: how far the last jump was, m.
    """

    def __init__(self) -> None:
        self.jumped_m = 0.0
        self._believed: _Fix | None = None
        self._candidate: _Fix | None = None
        self._candidates = 0
        self._candidate_since_s = 0.0
        self._repeated: Position | None = None
        self._run_m = 0.0
        self._repeated_s = 0.0

    def refuse(self, position: Position, velocity: Position, time_s: float) -> str:
        """Why a position is not believed: "frozen", "jump", or empty when it is; "moved": believed after a jump.

        Args:
            position: m, in any fixed frame.
            velocity: the boat's own, same frame, m/s.
            time_s: when it was true.
        """
        if self._is_frozen(position, velocity, time_s):
            return "frozen"
        fix = _Fix(position, velocity, time_s)
        if self._believed is None or self._believed.leads_to(fix):
            self._believed, self._candidate = fix, None
            return ""
        self.jumped_m = self._believed.miss_m(fix)
        if not self._settles(fix):
            return "jump"
        self._believed, self._candidate = fix, None
        return "moved"

    def _is_frozen(self, position: Position, velocity: Position, time_s: float) -> bool:
        if position != self._repeated:
            self._repeated, self._run_m = position, 0.0
        else:
            self._run_m += math.hypot(*velocity) * max(0.0, time_s - self._repeated_s)
        self._repeated_s = time_s
        return self._run_m > FROZEN_M

    def _settles(self, fix: _Fix) -> bool:
        if self._candidate is None or not self._candidate.leads_to(fix):
            self._candidates, self._candidate_since_s = 0, fix.time_s
        self._candidate = fix
        self._candidates += 1
        return self._candidates >= SETTLED_AFTER and fix.time_s - self._candidate_since_s >= SETTLED_S


class _Fix:
    """Where a boat was and where it went."""

    def __init__(self, position: Position, velocity: Position, time_s: float) -> None:
        self.position, self.velocity, self.time_s = position, velocity, time_s

    def leads_to(self, later: _Fix) -> bool:
        """Whether a boat there may be at the later one."""
        return self.miss_m(later) <= JUMP_M + JUMP_MPS * max(0.0, later.time_s - self.time_s)

    def miss_m(self, later: _Fix) -> float:
        """How far the later one is from where the mean of both velocities leads, m."""
        dt = max(0.0, later.time_s - self.time_s)
        return math.hypot(
            *(
                q - p - 0.5 * (u + v) * dt
                for p, q, u, v in zip(self.position, later.position, self.velocity, later.velocity, strict=True)
            )
        )
