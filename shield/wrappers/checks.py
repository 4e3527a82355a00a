"""Whether a shield fits the game it is put on, and serves nobody else: it remembers the boats it decides for.

What a wrapper relies on is checked here, or taken from the game.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..config import ShieldConfig
from ..exceptions import ConfigError
from ..shield import Shield
from .game_facts import (
    GameFacts,
    check_step,
    facts_of_games,
    for_held_commands,
    warn_of_distances,
    with_distances,
)
from .readers import reader_of
from .reading import GameReader

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


def shield_for(shield: Any, reader: GameReader, team: int, held: bool = False) -> Any:
    """The shield, or one like it with the game's distances where nobody chose them, see `ShieldConfig`.

    With ``held`` it decides once for all the moves that the game makes of a policy's answer, else before each.

    A decider of the user's own, without settings, is taken as it is.

    Raises:
        ConfigError: the shield is for another step, or the game has settings that no shield can be built for.
    """
    facts = reader.facts()
    config = getattr(shield, "config", None)
    if not isinstance(config, ShieldConfig):
        return shield
    if held and facts.moves > 1:
        fitting = for_held_commands(config, facts)
    else:
        check_step(config, facts)
        fitting = config
    fitting = with_distances(fitting, facts, team)
    warn_of_distances(fitting, facts, team)
    if fitting is config or not isinstance(shield, Shield):
        return shield
    other = copy.copy(shield)
    Shield.__init__(other, fitting, shield.surroundings)
    return other


def words_of(shield: Any) -> str:
    """What a shield keeps, for whoever prints what it is wrapped round; its kind where it has no settings."""
    config = getattr(shield, "config", None)
    if not isinstance(config, ShieldConfig):
        return type(shield).__name__
    return f"Shield(separation_m={config.separation_m:g}, profile={config.profile!r}, dt_s={config.dt_s:g})"


def facts_now(reader: GameReader) -> GameFacts:
    """What the game is now; later changes of its arrays do not change it.

    Raises:
        ConfigError: it has settings that no shield can be built for.
    """
    facts = reader.facts()
    return facts._replace(radius_m=np.array(facts.radius_m), team=np.array(facts.team))


def check_unchanged(before: GameFacts, reader: GameReader) -> None:
    """Refuse a game that was set to something else in its middle: its shield foresees what it was when it began.

    Raises:
        ConfigError: it was, or has settings by now that no shield can be built for.
    """
    now = reader.facts()
    for name in GameFacts._fields:
        then, found = getattr(before, name), getattr(now, name)
        if then is not found and not np.array_equal(then, found):
            raise ConfigError(
                f"{name} of the game was {_words(then)} at its reset and is {_words(found)} now; reset() it"
            )


def _words(value: Any) -> str:
    return str(value.tolist() if isinstance(value, np.ndarray) else value)


def layers_of(env: Any) -> Iterator[Any]:
    """The environment and all it wraps, outermost first."""
    while env is not None:
        yield env
        inner = vars(env) if hasattr(env, "__dict__") else {}
        env = next((inner[name] for name in _INNER if inner.get(name) is not None), None)


def refuse_second(env: Any, kind: type, team: int, shield: Any) -> None:
    """Refuse an environment in which a wrapper of this kind shields the team already: both would mend its commands.

    So would be lost what a shield remembers of one team, if it decided for the other in between.

    Raises:
        ConfigError: there is one, or one of the other team with this very shield.
    """
    others = [layer for layer in layers_of(env) if isinstance(layer, kind)]
    if any(getattr(layer, "shield", None) is shield for layer in others):
        raise ConfigError("this shield serves the other team of this environment; give each team a Shield of its own")
    if any(getattr(layer, "team", None) == team for layer in others):
        side = ("blue", "red")[team]
        raise ConfigError(
            f"the {side} team of this environment has a shield already; wrap env.unwrapped, or shield the other team"
        )


def begin_serving(shield: Any) -> object:
    """Let a shield forget all, and return what shows that it serves whoever holds it; deciders of users' own too."""
    shield.reset()
    holder = object()
    if isinstance(shield, Shield):
        shield.serves = holder
    return holder


def check_serving(shield: Any, holder: object) -> None:
    """Refuse a shield that has begun to serve another team or game since; one that serves nobody serves the holder now.

    Raises:
        ConfigError: it has.
    """
    if not isinstance(shield, Shield):
        return
    if shield.serves is None:  # somebody reset it
        shield.serves = holder
    if shield.serves is not holder:
        raise ConfigError(
            "this shield has begun to serve another team or game since this one's reset; give each a Shield of its "
            "own, or reset() it between them"
        )
