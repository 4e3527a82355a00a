"""`RolloutGuard`: gatekeeper or PL-CBF, in the place where the shield stands in a batch of games."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from steerclear.shield.config import ShieldConfig
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import Platform

from ..batch_guard import BatchGuard, Games
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

    columns, forgotten = N_PLAN, NO_PLAN

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
        self._setup = self._make_setup(read, team)

    def _decide(self, games: Games) -> None:
        decide_games(self._setup, self.name == PL_CBF, games)

    def _make_setup(self, read: Settings, team: tuple[int, ...]) -> Setup:
        dt_s, library_s = self.config.dt_s, read if isinstance(read, LibrarySettings) else None
        return Setup(
            params=self.params,
            limits=np.array([input_limits(kind, dt_s) for kind in self._platforms]),
            team=np.array(team, dtype=np.int64),
            library=library(),
            switches=switch_steps(dt_s if isinstance(read, LibrarySettings) else read.switch_s, dt_s),
            steps=max(1, round(read.horizon_s / dt_s)),
            radius_m=self.radius_m,
            dt_s=dt_s,
            worst=self.name == GATEKEEPER_WORST,
            alpha_per_s=library_s.alpha_per_s if library_s else 0.0,
            pick=PICKS[library_s.pick] if library_s else 0,
        )
