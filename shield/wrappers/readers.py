"""Readers: how the shield gets absolute positions and commands from an environment.

Positions come from the environment itself. Observations are relative, rounded and may be normalised.
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
    """Whether a boat that has played a (speed, relative heading) pair must play pairs from then on."""

    def facts(self) -> GameFacts:
        """Return step and sizes.

        Raises:
            ConfigError: the game has settings that no shield can be built for.
        """

    def filtering(self, safe: Callable[[Array], Array]) -> AbstractContextManager[None]:
        """While inside, commands (n, 2) pass ``safe`` before the boats move. The game is restored afterwards."""

    def check_answers(self, agent_ids: Sequence[str]) -> None:
        """Check that the game accepts the answers of a shield around a policy: one command per step.

        Raises:
            ConfigError: it does not.
        """

    def moment(self) -> float:
        """Return the game's time, s. It must change in every step."""

    def fleet(self, team: int, shield_autopilot: bool) -> Fleet:
        """Return all boats. Controlled are those of ``team`` that the shield can decide for."""

    def commands(self, actions: Mapping[str, Any]) -> Array:
        """Return the commands (n, 2) of the actions, as the game plays them: speed m/s, relative heading deg.

        Boats without an action stop.

        Raises:
            GameError: an action is invalid, or is for no boat of the game.
        """

    def playable(self, actions: Mapping[str, Any]) -> dict[str, Any]:
        """Return the actions in a form the environment accepts; those that it accepts already are the same objects."""

    def surroundings(self, team: int, keep_out: bool) -> Surroundings:
        """Return field edge, obstacles and (with ``keep_out``) the own flag's circle."""


_MEMBERS = ("agent_ids", "takes_pairs_only", *(name for name in vars(GameReader) if not name.startswith("_")))
GROUP = "steerclear.readers"
"""Entry-point group of other packages: each entry names a module that registers readers."""
Build = TypeVar("Build", bound=Callable[[Any], GameReader])
_REGISTERED: dict[Callable[[Any], bool], Callable[[Any], GameReader]] = {}


def game_reader(fits: Callable[[Any], bool]) -> Callable[[Build], Build]:
    """Register a reader: decorates its class, or a function that builds one from the environment.

    Args:
        fits: returns whether this reader reads an environment, given without its wrappers.

    Raises:
        ConfigError: ``fits`` is no such function: the decorator stands without brackets.
    """
    if isinstance(fits, type) or not callable(fits):
        found = f"the class {fits.__name__}" if isinstance(fits, type) else repr(fits)
        raise ConfigError(
            f"game_reader was given {found}, not fits=; write @game_reader(fits=lambda env: isinstance(env, MyEnv)) "
            "above the reader's class"
        )

    def register(build: Build) -> Build:
        _REGISTERED[fits] = build
        return build

    return register


def reader_of(env: Any) -> GameReader:
    """Return the reader for an environment. The reader registered last is tried first.

    Raises:
        ConfigError: no reader fits, or one lacks a member of `GameReader` or names boats that the game does not have.
    """
    load_others(GROUP)
    base = getattr(env, "unwrapped", env)
    for fits, build in reversed(_REGISTERED.items()):
        if fits(base):
            reader = build(base)
            check_members(reader)
            return reader
    raise ConfigError(
        f"cannot read a game from {type(base).__name__}; give an MctfEnv or a Pyquaticus env, or register a GameReader "
        "for yours (steerclear.shield.wrappers.game_reader), or wrap a function: Shield(...).wrap(f, read=...), where "
        "read turns what f sees into a Fleet"
    )


def check_members(reader: Any) -> None:
    """Refuse a reader without a member of `GameReader`, or with one of another kind.

    Raises:
        ConfigError: see above.
    """
    who = f"the reader {type(reader).__name__}"
    missing = sorted(name for name in _MEMBERS if not hasattr(reader, name))
    if missing:
        raise ConfigError(f"{who} has no {', '.join(missing)}; see GameReader")
    for name in _MEMBERS[2:]:
        if not callable(getattr(reader, name)):
            raise ConfigError(f"{name} of {who} is {getattr(reader, name)!r}; define it as a method, see GameReader")
    if not isinstance(reader.takes_pairs_only, bool):
        raise ConfigError(f"takes_pairs_only of {who} is {reader.takes_pairs_only!r}; give True or False")
    ids: Any = reader.agent_ids
    listed = isinstance(ids, tuple | list) and all(isinstance(agent, str) for agent in ids)
    if not listed or not ids or len(set(ids)) < len(ids):
        raise ConfigError(f"agent_ids of {who} is {ids!r}; give the names of all boats, each once, as a tuple")
