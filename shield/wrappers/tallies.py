"""What happened to learners: events of a decision, and totals of a game."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..decision import Reason
from ..jit import Array, BoolArray

TEAM_EVENTS = ("captures", "grabs", "tags", "captures_against", "grabs_against", "tags_against")
"""Events of both teams; each learner of a team has its team's numbers."""
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
        step: (8, B, n) counts of the decision under way, in the order of `EVENTS`.
        totals: the same of the games under way.
        reward: (B, n) their rewards so far.
        length: (B,) their decisions so far.
    """

    def __init__(self, core: Any, team: int, boats: Any) -> None:
        self._core, self._team, self._boats = core, team, boats
        shape = (core.n_games, len(boats))
        self.step = np.zeros((len(EVENTS), *shape))
        self.totals = np.zeros((len(EVENTS), *shape))
        self.reward = np.zeros(shape)
        self.length = np.zeros(core.n_games, np.int64)

    def begin_decision(self) -> None:
        """Count a new decision."""
        self.step[:] = 0.0

    def count(self, going: BoolArray, changed: BoolArray) -> None:
        """Count one game step of the games that go on (B,); ``changed`` (B, n): the shield's changes."""
        events, own = self._core.events, self._team
        for k in range(3):
            self.step[k] += (events[:, own, k] * going)[:, None]
            self.step[k + 3] += (events[:, 1 - own, k] * going)[:, None]
        self.step[6] += self._core.new_collisions[:, self._boats] * going[:, None]
        self.step[7] += changed & going[:, None]

    def end_decision(self, rewards: Array) -> None:
        """Add the decision to its games."""
        self.totals += self.step
        self.reward += rewards
        self.length += 1

    def forget(self, games: Any) -> None:
        """Begin the games (B,) bool anew."""
        self.totals[:, games] = 0.0
        self.reward[games] = 0.0
        self.length[games] = 0

    def flat_step(self) -> dict[str, Array]:
        """Counts (L,) of the last decision by name."""
        return {name: self.step[k].reshape(-1).copy() for k, name in enumerate(EVENTS)}

    def flat_totals(self) -> dict[str, Array]:
        """Counts (L,) of the games under way by name, with ``r`` reward and ``l`` decisions."""
        totals = {name: self.totals[k].reshape(-1).copy() for k, name in enumerate(EVENTS)}
        return {"r": self.reward.reshape(-1).copy(), "l": np.repeat(self.length, len(self._boats)), **totals}


def changed_by(shield: Any, boats: Any, shape: tuple[int, int]) -> BoolArray:
    """(B, n) which of the boats' commands the shield changed at its last decision."""
    if shield is None:
        return np.zeros(shape, np.bool_)
    changed: BoolArray = ~np.isin(shield.reason[:, boats], UNCHANGED)
    return changed
