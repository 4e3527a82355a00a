"""The forward model: a batch of games set to the live one, and what plans are worth in it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from steerclear.env.core import BatchedMctf
from steerclear.shield.jit import Array, IntArray
from steerclear.shield.platforms import layout as L

from ... import rollout as R
from ..sight import docks_of

STEP_S = 0.2
"""Step of the forward model, s: twice the game's, which costs a tenth of a metre over a plan and halves the time."""


@dataclass(frozen=True)
class Weights:
    """What a plan is worth, to one team; distances count per field width.

    The paper's team played for captures, progress and contacts of team-mates; its row has the fewest collisions.
    """

    capture: float = 10.0
    grab: float = 3.0
    tag: float = 2.0
    mate_hit: float = 6.0
    foe_hit: float = 3.0
    near_mate: float = 0.05
    out: float = 4.0
    progress: float = 2.0


class ForwardModel:
    """Plays plans from where the live game stands.

    Args:
        core: the live game.
        rollouts: games at once.
        move_s: time a macro-action is held, s.
        weights: what plans are worth.
    """

    def __init__(self, core: BatchedMctf, rollouts: int, move_s: float, weights: Weights) -> None:
        config = core.config
        # decisions of several steps are played as they are: their relative headings are held through them
        step_s = config.dt_s if config.decision_steps > 1 else max(STEP_S, config.dt_s)
        self._live, self._weights = core, weights
        self._batch = BatchedMctf(config.replace(dt_s=step_s), n_games=rollouts, seed=0)
        self._repeats = max(round(move_s / (step_s * config.decision_steps)), 1)
        n = core.n_boats
        self._wanted, self._commands = np.zeros((rollouts, n, 2)), np.zeros((rollouts, n, 2))
        self._touching, self._counted = np.zeros((rollouts, n, n)), np.zeros((rollouts, R.N_COUNTED))

    def play(self, plans: IntArray) -> None:
        """Roll out (B, n, H) plans from the live game's state."""
        for name, live in self._live.games._asdict().items():
            getattr(self._batch.games, name)[:] = live[0]
        R.roll_out(
            self._batch.rules, self._batch.games, plans, self._repeats, self._wanted, self._commands, self._touching,
            self._counted,
        )  # fmt: skip

    def worth(self, team: int, boat: int) -> Array:
        """(B,) what the plans just played are worth to a team, a boat of which is being planned for."""
        w, c, sign = self._weights, self._counted, 1.0 if team == 0 else -1.0
        events = sign * (w.capture * c[:, R.CAPTURES] + w.grab * c[:, R.GRABS] + w.tag * c[:, R.TAGS])
        costs = w.mate_hit * c[:, R.MATE_HITS_BLUE + team] + w.near_mate * c[:, R.NEAR_BLUE + team]
        costs = costs + w.foe_hit * c[:, R.FOE_HITS] + w.out * c[:, R.OUT_BLUE + team]
        return np.asarray(events - costs + w.progress * self._progress(team, boat))

    def _progress(self, team: int, boat: int) -> Array:
        """(B,) how near the boat ends to what it is after, 1 at it: the flag, or with it the own side."""
        games, rules = self._batch.games, self._batch.rules
        place = games.state[:, boat][:, [L.X, L.Y]]
        carrying = games.has_flag[:, boat] | games.is_tagged[:, boat]
        back = home_of(self._live, team, boat)
        aim = np.where(carrying[:, None], back, games.flag_position[:, 1 - team])
        return np.asarray(1.0 - np.linalg.norm(place - aim, axis=1) / rules.size[0])


def home_of(core: BatchedMctf, team: int, boat: int) -> Array:
    """Where a boat takes the flag, m: the nearest dock from where it is now, else the base."""
    docks = np.array(docks_of(core, team)).reshape(-1, 2)
    if not len(docks):
        return np.asarray(core.flag_home[team])
    place = core.state[0, boat, [L.X, L.Y]]
    return np.asarray(docks[int(np.linalg.norm(docks - place, axis=1).argmin())])
