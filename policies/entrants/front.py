"""`BatchFront`: a team that plays batches, in one game."""

from __future__ import annotations

import math
from typing import Any

from .plane import Order
from .play import EntrantTeam
from .sight import Sight


class BatchFront(EntrantTeam):
    """A thin front over the batch policy in ``_batch``, which subclasses set."""

    _batch: Any

    def begin(self, sight: Sight) -> None:
        """Begin the batch of one."""
        self._batch.reset(self.core, self.team, self.seed)

    def decide(self, sight: Sight) -> list[Order]:
        """What the batch commands."""
        commands = self._batch.act(self.core, self.team)[0].tolist()
        return [
            (speed, boat.heading + math.radians(turn)) for boat, (speed, turn) in zip(sight.own, commands, strict=True)
        ]
