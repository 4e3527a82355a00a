"""Reading a game: how the shield gets absolute positions and commands out of an environment object.

Positions come from the environment itself, never from observations: those are relative, rounded and may be normalised.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from typing import Any, Protocol, TypeVar

from ..exceptions import ConfigError
from ..fleet import Fleet
from ..foreign import load_others
from ..jit import Array
from ..surroundings import Surroundings
from .game_facts import GameFacts


class GameReader(Protocol):
    """What the wrappers need to know of an environment."""

    agent_ids: tuple[str, ...]
    takes_pairs_only: bool
    """Whether, once a boat has had a (speed, relative heading) pair, all its actions must be pairs."""

    def facts(self) -> GameFacts:
        """Step and sizes.

        Raises:
            ConfigError: the game has settings that no shield can be built for.
        """

    def filtering(self, safe: Callable[[Array], Array]) -> AbstractContextManager[None]:
        """While inside, commands (n, 2) pass ``safe`` before the boats move; afterwards the game is as it was."""

    def check_answers(self, agent_ids: Sequence[str]) -> None:
        """Check that the game plays what a shield around a policy answers, one command a step.

        Raises:
            ConfigError: it does not.
        """

    def moment(self) -> float:
        """Time of the game, s: it is another after every step."""

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """All boats now; controlled are those of ``team`` that the shield can decide for."""

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """(n, 2) speed m/s and relative heading deg of the actions, as the game plays them; missing boats stop.

        Raises:
            GameError: an action is none, or of no boat of the game.
        """

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """The actions in a form the environment itself takes; those it takes already are the very same objects."""

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Field edge, obstacles and (with ``keep_out``) the own flag's circle."""


GROUP = "steerclear.readers"
"""Entry points of this group name modules of other packages in which readers are registered."""
Build = TypeVar("Build", bound=Callable[[Any], GameReader])
_REGISTERED: dict[Callable[[Any], bool], Callable[[Any], GameReader]] = {}


def game_reader(fits: Callable[[Any], bool]) -> Callable[[Build], Build]:
    """Register a reader: put above its class, or a function that builds one from the environment.

    Args:
        fits: whether an environment, without its wrappers, is one that this reader reads.
    """

    def register(build: Build) -> Build:
        _REGISTERED[fits] = build
        return build

    return register


def reader_of(env: Any) -> GameReader:
    """The reader for an environment; registered ones are asked first, the latest before the others.

    Raises:
        ConfigError: nobody reads it.
    """
    load_others(GROUP)
    base = getattr(env, "unwrapped", env)
    for fits, build in reversed(_REGISTERED.items()):
        if fits(base):
            return build(base)
    raise ConfigError(
        f"cannot read a game from {type(base).__name__}; give an MctfEnv or a Pyquaticus env, or register a GameReader "
        "for yours (steerclear.shield.wrappers.game_reader), or wrap a function: Shield(...).wrap(f, read=...), where "
        "read turns what f sees into a Fleet"
    )
