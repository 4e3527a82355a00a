"""Wrappers that put the shield around policies and environments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ..extras import install_command
from .game_facts import GameFacts
from .games_shield import games_shield
from .parallel import ShieldedParallelEnv
from .policy import ShieldedCallable, ShieldedTeamPolicy
from .readers import GameReader, game_reader, reader_of
from .team_batch import TeamBatch
from .vector_gym import MctfVectorEnv

if TYPE_CHECKING:
    from .vector_sb3 import MctfVecEnv as MctfVecEnv

__all__ = [
    "GameFacts",
    "GameReader",
    "MctfVectorEnv",
    "ShieldedCallable",
    "ShieldedParallelEnv",
    "ShieldedTeamPolicy",
    "TeamBatch",
    "game_reader",
    "games_shield",
    "reader_of",
]


def __getattr__(name: str) -> Any:
    """Import `MctfVecEnv` on first use: it needs Stable-Baselines3, an optional dependency."""
    if name != "MctfVecEnv":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from .vector_sb3 import MctfVecEnv
    except ModuleNotFoundError as error:
        raise ImportError(f"MctfVecEnv needs {error.name}; install the extra: {install_command('train')}") from error
    return MctfVecEnv
