"""`games_shield`: the shield for one team in a batch of our own games, with their static constraints."""

from __future__ import annotations

from typing import Any

from ..batch import BatchedShield
from ..config import ShieldConfig
from ..exceptions import ConfigError
from ..game_facts import check_step, facts_of_games, warn_of_distances, with_distances
from ..same_games import platforms_of
from .mctf import surroundings_of
from .reading import team_number


def games_shield(
    core: Any, config: ShieldConfig | None = None, team: str | int = "blue", keep_out: bool = True
) -> BatchedShield:
    """Build the shield for a `BatchedMctf`: its boats, field edge, obstacles and the own flag's circle.

    Args:
        core: the games.
        config: settings; None takes the defaults, with the games' step and distances. Distances that nobody chose in
            it are the games', where those are larger.
        team: "blue" or "red", the team that will be shielded, see `BatchedShield.filter_for`.
        keep_out: keep clear of the own flag's circle; boats that enter it while the flag is home are stopped.

    Raises:
        ConfigError: unknown team, another step than the games', or a setting that a batch cannot honour.
    """
    if config is not None and not isinstance(config, ShieldConfig):
        raise ConfigError(
            f"config is a {type(config).__name__}; give a ShieldConfig, such as Shield.for_game(core).config"
        )
    number, facts = team_number(team), facts_of_games(core)
    settings = ShieldConfig.of(**facts.settings()) if config is None else with_distances(config, facts, number)
    check_step(settings, facts)
    warn_of_distances(settings, facts, number)
    around = surroundings_of(core, number, keep_out)
    return BatchedShield(settings, core.n_games, platforms_of(core), tuple(core.team.tolist()), around, number)
