"""Masks of actions: which candidate commands a shield would let pass as they are, in this step.

A mask says what passes now, each boat's candidate beside its team-mates' candidates of the same number; it says nothing
of later steps or of other combinations. The shield stays behind it, and is what keeps boats apart.
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any

import numpy as np

from ..commands import Commands
from ..decision import Reason
from ..exceptions import ConfigError, FleetError
from ..fleet import Fleet
from ..jit import Array, BoolArray

UNCHANGED = (int(Reason.PASSED), int(Reason.NOT_COVERED))


def safe_of_fleet(shield: Any, fleet: Fleet, actions: Sequence[Commands], surroundings: Any = None) -> BoolArray:
    """Which of k candidate commands pass (n, k); the shield's memory is left alone.

    Args:
        shield: the `Shield` whose decisions.
        fleet: all boats seen now, n of them.
        actions: k candidates, each a command of every boat.
        surroundings: as of `Shield.decide`.

    Raises:
        FleetError: no candidates, or as `Shield.decide`.
    """
    if isinstance(actions, Commands) or not len(actions):
        raise FleetError("actions are one Commands or none; give a list of them, one for each candidate")
    found = np.zeros((len(fleet), len(actions)), np.bool_)
    twin, before = deepcopy(shield), None
    for k, candidate in enumerate(actions):
        kept = {name: array.copy() for name, array in twin.remembered.items()} if before is None else before
        found[:, k] = ~twin.decide(fleet, candidate, surroundings).intervened
        before = kept if _put_back(twin, kept) else None
        twin = twin if before is not None else deepcopy(shield)
    return found


def _put_back(shield: Any, kept: dict[str, Array]) -> bool:
    """Let a shield remember what it did; False where it has other boats now."""
    live = shield.remembered
    if live.keys() != kept.keys():
        return False
    if any(live[name].shape != array.shape for name, array in kept.items()):
        return False
    for name, array in kept.items():
        live[name][...] = array
    return bool(kept)


class BatchedMasks:
    """The same for B games at once: a copy of their shield decides k games for each.

    Args:
        shield: the `BatchedShield` of the games.
        candidates: k, also an attribute.

    Raises:
        ConfigError: no candidates.
    """

    def __init__(self, shield: Any, candidates: int) -> None:
        if candidates < 1:
            raise ConfigError(f"candidates is {candidates}; give one at least")
        self._shield, self.candidates = shield, candidates
        games = len(shield.reason) * candidates
        self._trial = type(shield)(
            shield.config, games, shield.platforms, shield.team, shield.surroundings, shield.flag_of
        )

    def safe(
        self, state: Array, actions: Array, ours: BoolArray, visiting: Any = None, driven: Any = None
    ) -> BoolArray:
        """Which candidates pass (B, n, k); the shield's memory is left alone.

        Args:
            state: (B, n, N_STATE), as all others as of `BatchedShield.decide`.
            actions: (B, n, k, 2) speed m/s and relative heading deg.
            ours: (B, n) boats to decide for; all candidates of others pass.
            visiting: (B, n), or None.
            driven: (B, n, 4), or None.

        Raises:
            FleetError: as `BatchedShield.decide`.
        """
        games, boats = self._shield.reason.shape
        if np.shape(actions) != (games, boats, self.candidates, 2):
            raise FleetError(f"actions has shape {np.shape(actions)}; expected {(games, boats, self.candidates, 2)}")
        remembered = self._shield.remembered
        for name, live in self._trial.remembered.items():
            live[...] = np.repeat(remembered[name], self.candidates, axis=0)
        wanted = np.asarray(actions, np.float64).transpose(0, 2, 1, 3).reshape(games * self.candidates, boats, 2)
        about = [None if one is None else np.repeat(one, self.candidates, axis=0) for one in (ours, visiting, driven)]
        self._trial.decide(np.repeat(state, self.candidates, axis=0), wanted, *about)
        passed = np.isin(self._trial.reason, UNCHANGED)
        found: BoolArray = passed.reshape(games, self.candidates, boats).transpose(0, 2, 1).copy()
        return found
