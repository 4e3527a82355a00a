"""What held simulated boats, step by step: whether somebody steered them, and the faults that acted on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.shield.jit import Array

from .hull import STEP_S

RECENT_S = 5.0
"""A fault counts for what happens so long after it, s."""

LEFT_S = 2.0
"""A boat is left in order when it is in HOLD so soon after the last command it obeyed, s: while HOLD is asked for, 4 s,
that may time out, after 3 s. A boat whose runner died stays in GUIDED, or its failsafe holds it later."""


@dataclass(frozen=True)
class Mark:
    """One boat at one step.

    Attributes:
        steered: whether a policy or a commander whom it obeys steers it.
        faults: kinds of faults that act on it.
        commanded: whether it obeys a commander.
        held: whether its autopilot is in HOLD, as the end of a run leaves it.
    """

    steered: bool
    faults: tuple[str, ...] = ()
    commanded: bool = False
    held: bool = False


class Marks:
    """The marks of all boats, step by step."""

    def __init__(self) -> None:
        self._rows: list[tuple[Mark, ...]] = []
        self._last_commanded: dict[int, int] = {}
        self._kept: dict[Mark, Mark] = {}

    def add(self, marks: Sequence[Mark]) -> None:
        """Those of the step that was just moved."""
        self._rows.append(tuple(self._kept.setdefault(mark, mark) for mark in marks))
        self._last_commanded |= {boat: len(self._rows) for boat, mark in enumerate(marks) if mark.commanded}

    def commanded(self, n_boats: int) -> Array:
        """(T, n) bool: whether each boat obeyed a commander."""
        rows = [[mark.commanded for mark in row] for row in self._rows]
        return np.array(rows, dtype=np.bool_).reshape(-1, n_boats)

    def of(self, step: int, boats: Sequence[int]) -> dict[str, Any]:
        """Entries of a breach at a step (1 the first that was moved) between boats, see `docs_keys.SIM_BOATS`."""
        recent = self._rows[max(0, step - round(RECENT_S / STEP_S)) : step]
        faults = {kind for row in recent for boat in boats for kind in row[boat].faults}
        return {
            "unsteered_s": [self._unsteered_s(step, boat) for boat in boats],
            "faults": sorted(faults),
            "after_run": self._is_over(step) and all(map(self._is_left, boats)),
        }

    def _is_over(self, step: int) -> bool:
        """Whether boats had been commanded, and none is at that step or later."""
        return 0 < max(self._last_commanded.values(), default=0) < step

    def _is_left(self, boat: int) -> bool:
        """Whether a boat was left in order by whoever commanded it; also one that nobody ever commanded."""
        last = self._last_commanded.get(boat)
        return last is None or any(row[boat].held for row in self._rows[last : last + round(LEFT_S / STEP_S)])

    def _unsteered_s(self, step: int, boat: int) -> float:
        for back, row in enumerate(reversed(self._rows[:step])):
            if row[boat].steered:
                return round(back * STEP_S, 3)
        return round(step * STEP_S, 3)
