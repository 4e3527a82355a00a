"""Moments at which raids go to a phase or take the flag, for games of a training to begin with.

A raid ends in a capture more often the nearer to one it begins: of games that begin as usual hardly any second teaches
how a flag is brought home (Salimans and Chen, "Learning Montezuma's Revenge from a Single Demonstration", 2018).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from steerclear.policies.entrants.learned.raids import RaidsBatch
from steerclear.policies.entrants.undertow.raid import Phase, Raid
from steerclear.policies.entrants.undertow.shape import NAMES
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import layout as L

from .config import RaidsConfig
from .env import core_of, pool_of, set_tags, shield_of
from .opponents import Pool

PLACE = (
    "state",
    "previous_position",
    "error_is_float32",
    "is_tagged",
    "is_disabled",
    "has_flag",
    "oob",
    "on_side",
    "driven",
    "tagging_cooldown_s",
    "touching",
    "contact",
    "flag_position",
    "flag_taken",
)
"""Arrays of a game that say how it stands; clocks, scores and random numbers are the new game's own."""
TURNED = (L.RUDDER, L.HEADING_ERROR, L.HEADING_INTEGRAL, L.TURN_RATE)
"""Numbers of a boat's state that change their sign in a mirror."""
KINDS = ("bait", "drag", "run", "flag", "alone", "alone_flag")
"""What a raid goes on to at a moment: its phases, and that it has taken the flag; the last two of boats alone."""


Moment = tuple[dict[str, Array], list[float], int, str]
"""Arrays of `PLACE`, what the raid remembered, number in `KINDS`, name of the opponent."""


@dataclass(frozen=True)
class StartStates:
    """K moments.

    Attributes:
        games: by name of `PLACE`, each (K, ...) as in `steerclear.env.arrays.Games`.
        memory: (K, 7) what the raid remembered, see `Raid.memory`.
        kind: (K,) number in `KINDS`.
        opponent: (K,) names.
    """

    games: Mapping[str, Array]
    memory: Array
    kind: Array
    opponent: Array

    @staticmethod
    def of(found: Sequence[Moment], shares: Sequence[float]) -> StartStates:
        """Some moments, one at least of each kind that has a share.

        Raises:
            ConfigError: of some kind there is none.
        """
        kinds = [moment[2] for moment in found]
        missing = [name for number, name in enumerate(KINDS) if shares[number] and number not in kinds]
        if missing:
            raise ConfigError(
                f"no raid came to {missing[0]!r} in the games recorded; give more games, longer ones (max_time_s), "
                "or 0 as its share (options.shares)"
            )
        places, memory, _, opponents = zip(*found, strict=True)
        games = {name: np.array([place[name] for place in places]) for name in PLACE}
        return StartStates(games, np.array(memory, float), np.array(kinds), np.array(opponents, object))


class Recorder(RaidsBatch):
    """Raids of the script's numbers, changed at random, and the moments at which they go on.

    Args:
        interval: game steps for which a decision is held.
        spread: deviation of the numbers, in units of `shape.LIMITS`.
        seed: of the draws.
        pool: of the opponents.

    Attributes:
        found: so far.
    """

    def __init__(self, interval: int, spread: float, seed: int, pool: Pool) -> None:
        self.network, self.name, self._team = _Drawn(interval, spread, seed), "recorder", -1  # type: ignore[assignment]
        self.found: list[Moment] = []
        self._pool = pool

    def _asks(self, game: int) -> bool:
        before = self._stood[game]
        asks = super()._asks(game)
        raid = self.raids[game]
        by_numbers = raid.phase > Phase.GATHER and raid.passage is None  # habits that a passage rests on are not kept
        if self._stood[game] != before and by_numbers:
            place = {name: getattr(self._core.games, name)[game].copy() for name in PLACE}
            kind = KINDS.index("flag") if raid.held else raid.phase - 1
            if raid.unguarded:
                kind = KINDS.index("alone_flag" if raid.held else "alone")
            memory = raid.memory(float(self._core.time_s[game]))
            self.found.append((place, memory, kind, self._pool.playing[game]))
        return asks


class _Drawn:
    """Stands for a network: the script's numbers and some noise."""

    def __init__(self, interval: int, spread: float, seed: int) -> None:
        self.interval, self._spread, self._rng = interval, spread, np.random.default_rng([seed, 12])

    def outputs(self, seen: Array, roles: Array) -> Array:
        """Units (N, n)."""
        return self._spread * self._rng.normal(size=(len(seen), len(NAMES)))


def recorded(config: RaidsConfig, spread: float, seed: int) -> list[Moment]:
    """Moments of as many games as a training plays at once, with its rules and shield, against its opponents."""
    stage = config.stages[0]
    core = core_of(config, config.games, seed, stage)
    set_tags(core, stage)
    core.reset(seed=seed)
    foe = pool_of(config.model_copy(update={"seed": seed}), stage)
    recorder = Recorder(config.interval, spread, seed, foe)
    recorder.reset(core, 0, seed)
    foe.reset(core, 1, seed + 1)
    shielded = config.shielded_training and stage.shielded
    command_filter = shield_of(config, core, stage=stage).filter_for(0) if shielded else None
    commands = np.zeros((core.n_games, core.n_boats, 2))
    own, others = np.flatnonzero(core.team == 0), np.flatnonzero(core.team == 1)
    while not (core.terminated | core.truncated).all():
        commands[:, own], commands[:, others] = recorder.act(core, 0), foe.act(core, 1)
        core.step(commands, command_filter)
    return recorder.found


class BeginInRaids:
    """Stands for a core's ``reset``: games begin at moments of raids, half of them mirrored.

    Args:
        core: the games; from now on they begin so.
        moments: to draw from.
        shares: how often each of `KINDS` comes.
        seed: of the draws.

    Attributes:
        drawn: (B,) the moment each game began with.
        mirrored: (B,) whether it was mirrored.
    """

    def __init__(self, core: Any, moments: StartStates, shares: Sequence[float], seed: int) -> None:
        self._core, self._reset, self.moments = core, core.reset, moments
        self._shares = np.array(shares) / np.sum(shares)
        self._of_kind = [np.flatnonzero(moments.kind == number) for number in range(len(KINDS))]
        self._rng = np.random.default_rng([seed, 11])
        self.drawn, self.mirrored = np.zeros(core.n_games, np.int64), np.zeros(core.n_games, np.bool_)
        core.reset = self

    def __call__(self, mask: BoolArray | None = None, seed: int | None = None) -> Any:
        """As `BatchedMctf.reset`."""
        self._reset(mask=mask, seed=seed)
        for game in np.flatnonzero(np.ones(self._core.n_games, np.bool_) if mask is None else mask):
            self._begin(int(game))
        return self._core.observe()

    def _begin(self, game: int) -> None:
        fit = self._of_kind[self._rng.choice(len(KINDS), p=self._shares)]
        self.drawn[game] = fit[self._rng.integers(fit.size)]
        for name, array in self.moments.games.items():
            getattr(self._core.games, name)[game] = array[self.drawn[game]]
        self.mirrored[game] = self._rng.random() < 0.5
        if self.mirrored[game]:
            mirror(self._core, game)

    def remind(self, raid: Raid, game: int) -> None:
        """Let a raid go on where the moment of its game was taken."""
        memory = self.moments.memory[self.drawn[game]].tolist()
        raid.remember(memory, float(self._core.time_s[game]), bool(self.mirrored[game]))


def mirror(core: Any, game: int) -> None:
    """Turn a game's south and north round."""
    games, height_m = core.games, core.config.env_bounds_m[1]
    state = games.state[game]
    state[:, L.Y] = height_m - state[:, L.Y]
    state[:, L.HEADING] = (360.0 - state[:, L.HEADING]) % 360.0 - 180.0
    state[:, TURNED] *= -1.0
    games.previous_position[game, :, 1] = height_m - games.previous_position[game, :, 1]
    games.flag_position[game, :, 1] = height_m - games.flag_position[game, :, 1]
