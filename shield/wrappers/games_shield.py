"""`games_shield`: the shield for one team in a batch of our own games, with their static obstacles."""

from __future__ import annotations

from typing import Any

from ..batch import BatchedShield
from ..config import ShieldConfig
from ..exceptions import ConfigError
from ..jit import Array, BoolArray
from .checks import team_number
from .driving import driven_boats
from .game_facts import check_same_games, facts_of_games, fitting, platforms_of, warn_of_distances
from .mctf import surroundings_of


def games_shield(
    core: Any,
    config: ShieldConfig | None = None,
    team: str | int = "blue",
    keep_out: bool = True,
    threads: int = 1,
) -> BatchedShield:
    """Build the shield for a `BatchedMctf`: its boats, field edge, obstacles and the own flag's circle.

    Args:
        core: the games.
        config: settings; None: the defaults, with the games' step and distances. The games' distances replace smaller
            ones that the user did not choose.
        team: "blue" or "red", the team to shield, see `BatchedShield.filter_for`.
        keep_out: keep clear of the own flag's circle; boats that enter it while the flag is home are stopped.
        threads: see `BatchedShield`.

    Raises:
        ConfigError: unknown team, another step than the games', or a setting that a batch does not support.
    """
    if config is not None and not isinstance(config, ShieldConfig):
        raise ConfigError(
            f"config is a {type(config).__name__}; give a ShieldConfig, such as Shield.for_game(core).config"
        )
    number, facts = team_number(team), facts_of_games(core)
    settings = fitting(ShieldConfig.of(**facts.settings()) if config is None else config, facts, number)
    around = surroundings_of(core, number, keep_out)
    return BatchedShield(settings, core.n_games, platforms_of(core), tuple(core.team.tolist()), around, number, threads)


def check_games(shield: BatchedShield, core: Any, team: int | None = None) -> None:
    """Check that the shield was built for these games; warn once if its distances are smaller than theirs."""
    check_same_games(core, len(shield.reason), shield.platforms, shield.team, shield.config.dt_s)
    warn_of_distances(shield.config, facts_of_games(core), team)


class GamesFilter:
    """The command filter of a shield for games, see `BatchedShield.filter_for`. Copying it copies the shield."""

    def __init__(self, shield: BatchedShield, team: int, shield_autopilot: bool) -> None:
        self.shield, self.team, self.shield_autopilot = shield, team, shield_autopilot
        self._checked: Any = None

    def __call__(self, core: Any, commands: Array) -> Array:
        """Return filtered commands (B, n, 2) for games that the shield was built for.

        Raises:
            ConfigError: the games are others, or the shield has begun to serve the other team.
        """
        if self._checked is not core:
            check_games(self.shield, core, self.team)
            self._checked = core
        if self.shield.serves not in (None, self.team):
            raise ConfigError("this shield has begun to serve the other team; build one for each, or reset() it")
        self.shield.serves = self.team
        return self.shield.decide(core.state, commands, *self._about(core))

    def _about(self, core: Any) -> tuple[BoolArray, BoolArray, Array | None]:
        """Return the boats to decide for, the boats on the other side, and rows of `Fleet.driven`."""
        ours = (core.team == self.team) & ~core.is_disabled
        ours = ours if self.shield_autopilot else ours & ~core.driven
        return ours, ~core.on_side, driven_boats(core)

    def safe_actions(self, core: Any, actions: Array) -> BoolArray:
        """Return which candidates (B, n, k, 2) would pass the shield in this step, (B, n, k); see `masks`."""
        ours, visiting, driven = self._about(core)
        return self.shield.safe_actions(core.state, actions, ours, visiting, driven)
