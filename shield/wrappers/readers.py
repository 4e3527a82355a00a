"""Which reader reads an environment: ours, a real Pyquaticus one's, or a registered one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from ..exceptions import ConfigError
from ..foreign import load_others
from .mctf import MctfReader
from .pyquaticus import PyquaticusReader
from .reading import GameReader

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


game_reader(lambda env: hasattr(env, "players") and hasattr(env, "flag_homes"))(PyquaticusReader)
game_reader(lambda env: hasattr(env, "core") and hasattr(env, "command_filter"))(MctfReader)
