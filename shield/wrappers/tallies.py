"""Counts of what happened to learners: events of a decision, totals of a game."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..decision import Reason
from ..jit import Array, BoolArray

TEAM_EVENTS = ("captures", "grabs", "tags", "captures_against", "grabs_against", "tags_against")
"""Events of a team and of its opponents; every learner of a team has its team's numbers."""
OWN_EVENTS = ("hits", "interventions")
"""New collisions of the boat itself, and game steps in which the shield changed its command."""
EVENTS = (*TEAM_EVENTS, *OWN_EVENTS)
UNCHANGED = (int(Reason.PASSED), int(Reason.NOT_COVERED))


class Tallies:
    """Counts for L = games * boats learners, in decisions and in games.

    Args:
        core: the games.
        team: number of the learners' team.
        boats: numbers of its boats.

    Attributes:
        step: (8, B, n) counts of the current decision, in the order of `EVENTS`.
        totals: the same, of the current games.
        reward: (B, n) rewards so far.
        length: (B,) decisions so far.
    """

    def __init__(self, core: Any, team: int, boats: Any) -> None:
        self._core, self._team, self._boats = core, team, boats
        shape = (core.n_games, len(boats))
        self.step = np.zeros((len(EVENTS), *shape))
        self.totals = np.zeros((len(EVENTS), *shape))
        self.reward = np.zeros(shape)
        self.length = np.zeros(core.n_games, np.int64)

    def begin_decision(self) -> None:
        """Begin the counts of a new decision."""
        self.step[:] = 0.0

    def count(self, going: BoolArray, changed: BoolArray) -> None:
        """Count one game step of the games ``going`` (B,); ``changed`` (B, n) are commands changed by the shield."""
        events, own = self._core.events, self._team
        for k in range(3):
            self.step[k] += (events[:, own, k] * going)[:, None]
            self.step[k + 3] += (events[:, 1 - own, k] * going)[:, None]
        self.step[6] += self._core.new_collisions[:, self._boats] * going[:, None]
        self.step[7] += changed & going[:, None]

    def end_decision(self, rewards: Array) -> None:
        """Add the current decision to the games' totals."""
        self.totals += self.step
        self.reward += rewards
        self.length += 1

    def forget(self, games: Any) -> None:
        """Reset the totals of games (B,) bool."""
        self.totals[:, games] = 0.0
        self.reward[games] = 0.0
        self.length[games] = 0

    def flat_step(self) -> dict[str, Array]:
        """Return counts (L,) of the last decision by name."""
        return {name: self.step[k].reshape(-1).copy() for k, name in enumerate(EVENTS)}

    def flat_totals(self) -> dict[str, Array]:
        """Return counts (L,) of the current games by name, with ``r`` reward and ``l`` decisions."""
        totals = {name: self.totals[k].reshape(-1).copy() for k, name in enumerate(EVENTS)}
        return {"r": self.reward.reshape(-1).copy(), "l": np.repeat(self.length, len(self._boats)), **totals}


def changed_by(shield: Any, boats: Any, shape: tuple[int, int]) -> BoolArray:
    """Return (B, n) which of the boats' commands the shield changed in its last decision."""
    if shield is None:
        return np.zeros(shape, np.bool_)
    changed: BoolArray = ~np.isin(shield.reason[:, boats], UNCHANGED)
    return changed
