"""`make_guard`: a filter of the literature, in the place where the shield stands in a batch of games."""

from __future__ import annotations

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.fleet import LARGEST
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import Platform

from ..batch_guard import BatchGuard
from .barriers import PARABOLIC
from .filters import decide_games
from .inputs import input_limits
from .parameters import INFLATION, KINDS, NAMES, Gains, gains_of
from .rows import Setup


class TextbookGuard(BatchGuard):
    """Commands of B games of the same fleet, filtered as the literature does.

    Reasons: 0 passed bit for bit, 1 changed, 2 the program had no answer and was relaxed (the command may then be
    the wanted one, where no input helps), 3 not even the relaxed program was solved: the boat is told to stop.
    ``certificate_m`` is the distance to the nearest boat less the radius kept, m.

    Args:
        name: one of `NAMES`.
        config: settings; separation, buffer, position error and step are used.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        gains: gains for all boats; None takes those of each platform.

    Raises:
        ConfigError: unknown name, a fleet that does not fit, or a delay, which these filters know nothing of.
    """

    def __init__(
        self,
        name: str,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        gains: Gains | None = None,
    ) -> None:
        if name not in KINDS:
            raise ConfigError(f"unknown filter {name!r}; choose one of {', '.join(NAMES)}")
        super().__init__(name, config, games, platforms, team)
        kinds, widened = self._platforms, INFLATION if KINDS[name] == PARABOLIC else 1.0
        radius_m = widened * (config.separation_m + config.buffer_m + 2.0 * config.position_error_m)
        self._setup = Setup(
            kind=KINDS[name],
            gains=np.array([(gains or gains_of(name, kind.name)).pack(radius_m) for kind in kinds]),
            radius_m=radius_m,
            dt_s=config.dt_s,
            params=np.array([kind.pack() for kind in kinds]),
            limits=np.array([input_limits(kind, config.dt_s).pack() for kind in kinds]),
        )

    def _check(self, state: Array, wanted: Array, ours: BoolArray) -> None:
        super()._check(state, wanted, ours)
        if not (np.abs(wanted[ours.astype(bool)]) <= LARGEST).all():
            raise FleetError(f"a wanted command is not finite or beyond {LARGEST:g}; give a speed and a heading")

    def _decide(self, state: Array, wanted: Array, ours: BoolArray) -> None:
        decide_games(self._setup, state, wanted, ours, self.sent, self.reason, self.certificate_m)


def make_guard(
    name: str, config: ShieldConfig, games: int, platforms: tuple[str | Platform, ...], team: tuple[int, ...]
) -> TextbookGuard:
    """The filter of that name; see `TextbookGuard`."""
    return TextbookGuard(name, config, games, tuple(platforms), tuple(team))
