"""`RolloutGuard`: gatekeeper or PL-CBF, in the place where the shield stands in a batch of games."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError, FleetError
from steerclear.shield.fleet import LARGEST
from steerclear.shield.jit import Array, BoolArray
from steerclear.shield.platforms import Platform

from ..batch_guard import BatchGuard
from ..textbook.inputs import input_limits
from .games import decide_games
from .paths import N_PLAN, NO_PLAN, Setup
from .settings import PICKS, GatekeeperSettings, LibrarySettings, Settings, library, read_settings, switch_steps

GATEKEEPER, GATEKEEPER_WORST, PL_CBF = "gatekeeper", "gatekeeper-worst", "pl-cbf"
KINDS: dict[str, type[Settings]] = {
    GATEKEEPER: GatekeeperSettings,
    GATEKEEPER_WORST: GatekeeperSettings,
    PL_CBF: LibrarySettings,
}
NAMES = tuple(KINDS)
STEP_S = 0.1
"""Step that settings are checked with while no run's is known, s."""


def check_settings(name: str, given: Mapping[str, Any], dt_s: float = STEP_S) -> Settings:
    """Settings of the guard of that name.

    Raises:
        ConfigError: an unknown name or key, or a value out of bounds.
    """
    if name not in KINDS:
        raise ConfigError(f"unknown filter {name!r}; choose one of {', '.join(NAMES)}")
    return read_settings(name, KINDS[name], given, dt_s)


class RolloutGuard(BatchGuard):
    """Commands of B games of the same fleet, filtered by gatekeeper or PL-CBF.

    Reasons: 0 passed bit for bit, 1 changed (gatekeeper: the backup begins now), 2 gatekeeper: no candidate is valid
    and the committed trajectory goes on; PL-CBF: its program has no answer and the boat follows the mode taken.
    ``certificate_m`` is the least clearance of what is committed, or the value of the mode taken, m; inf where nobody
    is within reach. Fixed things and the field's edge are not kept clear of.

    Args:
        name: one of `NAMES`; ``gatekeeper-worst`` takes opponents to fill the disc they can reach at top speed.
        config: settings; separation, buffer, position error and step are used.
        games: number of games B.
        platforms: platforms of the n boats.
        team: team of the n boats.
        settings: of the filter, by key.

    Raises:
        ConfigError: unknown name or setting, a fleet that does not fit, or a delay, which these filters know nothing
            of.
    """

    def __init__(
        self,
        name: str,
        config: ShieldConfig,
        games: int,
        platforms: tuple[str | Platform, ...],
        team: tuple[int, ...],
        settings: Mapping[str, Any] | None = None,
    ) -> None:
        read = check_settings(name, settings or {}, config.dt_s)
        super().__init__(name, config, games, platforms, team)
        self._setup = _setup(name, config, self._platforms, team, read)
        self._plan = np.full((*self.reason.shape, N_PLAN), NO_PLAN)

    def reset(self, mask: BoolArray | None = None) -> None:
        """Forget the committed trajectories of the games in ``mask`` (B,), or of all."""
        super().reset(mask)
        self._plan[slice(None) if mask is None else mask] = NO_PLAN

    def _check(self, state: Array, wanted: Array, ours: BoolArray) -> None:
        super()._check(state, wanted, ours)
        if not (np.abs(wanted[ours.astype(bool)]) <= LARGEST).all():
            raise FleetError(f"a wanted command is not finite or beyond {LARGEST:g}; give a speed and a heading")

    def _decide(self, state: Array, wanted: Array, ours: BoolArray) -> None:
        kept = self._plan, self.sent, self.reason, self.certificate_m
        decide_games(self._setup, self.name == PL_CBF, state, wanted, ours, *kept)


def _setup(name: str, config: ShieldConfig, platforms: list[Platform], team: tuple[int, ...], read: Settings) -> Setup:
    dt_s, is_library = config.dt_s, isinstance(read, LibrarySettings)
    return Setup(
        params=np.array([kind.pack() for kind in platforms]),
        limits=np.array([input_limits(kind, dt_s).pack() for kind in platforms]),
        team=np.array(team, dtype=np.int64),
        library=library(),
        switches=switch_steps(dt_s if isinstance(read, LibrarySettings) else read.switch_s, dt_s),
        steps=max(1, round(read.horizon_s / dt_s)),
        radius_m=config.separation_m + config.buffer_m + 2.0 * config.position_error_m,
        dt_s=dt_s,
        worst=name == GATEKEEPER_WORST,
        alpha_per_s=read.alpha_per_s if isinstance(read, LibrarySettings) else 0.0,
        pick=PICKS[read.pick] if is_library else 0,
    )


def make_guard(
    name: str,
    config: ShieldConfig,
    games: int,
    platforms: tuple[str | Platform, ...],
    team: tuple[int, ...],
    settings: Mapping[str, Any] | None = None,
) -> RolloutGuard:
    """The filter of that name; see `RolloutGuard`."""
    return RolloutGuard(name, config, games, tuple(platforms), tuple(team), settings)
