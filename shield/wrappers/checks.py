"""Whether a shield fits the game it is put on; what a wrapper relies on is checked here, or taken from the game."""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

from ..config import ShieldConfig
from ..exceptions import ConfigError
from ..game_facts import check_step, facts_of_games, told_distances, with_distances
from ..shield import Shield
from .reading import GameReader, reader_of

_INNER = ("env", "aec_env", "par_env")
"""Where PettingZoo's wrappers and conversions keep what they wrap."""


def settings_of(game: Any) -> dict[str, float]:
    """Settings of a shield for a game: its step and distances, see `Shield.for_game`.

    Raises:
        ConfigError: no game that can be read, or one with settings that no shield can be built for.
    """
    if hasattr(game, "core") or not hasattr(game, "n_games"):
        return reader_of(game).facts().settings()
    return facts_of_games(game).settings()


def shield_for(shield: Any, reader: GameReader, team: int) -> Any:
    """The shield, or one like it with the game's distances where nobody chose them, see `ShieldConfig`.

    A decider of the user's own, without settings, is taken as it is.

    Raises:
        ConfigError: the shield is for another step, or the game has settings that no shield can be built for.
    """
    facts = reader.facts()
    config = getattr(shield, "config", None)
    if not isinstance(config, ShieldConfig):
        return shield
    check_step(config, facts)
    fitting = with_distances(config, facts, team)
    told_distances(fitting, facts, team)
    if fitting is config or not isinstance(shield, Shield):
        return shield
    other = copy.copy(shield)
    Shield.__init__(other, fitting, shield.surroundings)
    return other


def layers_of(env: Any) -> Iterator[Any]:
    """The environment and all it wraps, outermost first."""
    while env is not None:
        yield env
        inner = vars(env) if hasattr(env, "__dict__") else {}
        env = next((inner[name] for name in _INNER if inner.get(name) is not None), None)


def refuse_second(env: Any, kind: type, team: int) -> None:
    """Refuse an environment in which a wrapper of this kind shields the team already: both would mend its commands.

    Raises:
        ConfigError: there is one.
    """
    if any(isinstance(layer, kind) and getattr(layer, "team", None) == team for layer in layers_of(env)):
        side = ("blue", "red")[team]
        raise ConfigError(
            f"the {side} team of this environment has a shield already; wrap env.unwrapped, or shield the other team"
        )
