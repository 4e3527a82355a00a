"""A shield asked once in several game steps: cheap while learning, and no guarantee between.

The shield's proof holds for a decision in every game step. Here it is a teacher only: what it said is held as a course
and speed until it is asked again. Evaluations always ask it in every game step.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from steerclear.shield.jit import Array
from steerclear.shield.platforms import layout as L


class SeldomAsked:
    """A command filter that asks another in the first game step of a decision and every so many after it.

    Args:
        batch: the games; from now on its filter is this one.
        every: game steps between questions.
    """

    def __init__(self, batch: Any, every: int) -> None:
        self._ask, self._boats, self._every = batch._filter, batch.boats, every
        self._moved, self._step = 0, batch.step
        batch._filter, batch.step = self, self._decide

    def _decide(self, *args: Any) -> Any:
        """A step of the games: each decision begins with a question."""
        self._moved = 0
        return self._step(*args)

    def __call__(self, core: Any, commands: Array) -> Array:
        """Commands (B, n, 2) to obey."""
        heading_deg = core.state[:, self._boats, L.HEADING]
        if self._moved % self._every == 0:
            answer = np.array(self._ask(core, commands))
            self._speed_mps = answer[:, self._boats, 0].copy()
            self._course_deg = heading_deg + answer[:, self._boats, 1]
        else:
            answer = np.array(commands)
            answer[:, self._boats, 0] = self._speed_mps
            answer[:, self._boats, 1] = (self._course_deg - heading_deg + 180.0) % 360.0 - 180.0
        self._moved += 1
        return answer
