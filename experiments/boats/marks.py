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


@dataclass(frozen=True)
class Mark:
    """One boat at one step.

    Attributes:
        steered: whether a policy or a commander whom it obeys steers it.
        faults: kinds of faults that act on it.
        commanded: whether it obeys a commander.
    """

    steered: bool
    faults: tuple[str, ...] = ()
    commanded: bool = False


class Marks:
    """The marks of all boats, step by step."""

    def __init__(self) -> None:
        self._rows: list[tuple[Mark, ...]] = []
        self._last_commanded = 0
        self._kept: dict[Mark, Mark] = {}

    def add(self, marks: Sequence[Mark]) -> None:
        """Those of the step that was just moved."""
        self._rows.append(tuple(self._kept.setdefault(mark, mark) for mark in marks))
        if any(mark.commanded for mark in marks):
            self._last_commanded = len(self._rows)

    def commanded(self, n_boats: int) -> Array:
        """(T, n) bool: whether each boat obeyed a commander."""
        rows = [[mark.commanded for mark in row] for row in self._rows]
        return np.array(rows, dtype=np.bool_).reshape(-1, n_boats)

    def of(self, step: int, boats: Sequence[int]) -> dict[str, Any]:
        """Entries of a breach at a step (1 the first that was moved) between boats, see `boats_keys.SIM_BOATS`."""
        recent = self._rows[max(0, step - round(RECENT_S / STEP_S)) : step]
        faults = {kind for row in recent for boat in boats for kind in row[boat].faults}
        return {
            "unsteered_s": [self._unsteered_s(step, boat) for boat in boats],
            "faults": sorted(faults),
            "after_run": 0 < self._last_commanded < step,
        }

    def _unsteered_s(self, step: int, boat: int) -> float:
        for back, row in enumerate(reversed(self._rows[:step])):
            if row[boat].steered:
                return round(back * STEP_S, 3)
        return round(step * STEP_S, 3)
