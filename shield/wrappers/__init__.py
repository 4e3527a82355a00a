"""Wrappers that put the shield around policies and environments."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from .games_shield import games_shield
from .parallel import ShieldedParallelEnv
from .policy import ShieldedCallable, ShieldedTeamPolicy
from .team_batch import TeamBatch
from .vector_gym import MctfVectorEnv

if TYPE_CHECKING:
    from .vector_sb3 import MctfVecEnv as MctfVecEnv

__all__ = [
    "MctfVectorEnv",
    "ShieldedCallable",
    "ShieldedParallelEnv",
    "ShieldedTeamPolicy",
    "TeamBatch",
    "games_shield",
]


def __getattr__(name: str) -> Any:
    """`MctfVecEnv`, imported only when it is asked for: Stable-Baselines3 is an extra."""
    if name != "MctfVecEnv":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    try:
        from .vector_sb3 import MctfVecEnv
    except ModuleNotFoundError as error:
        raise ImportError(f"MctfVecEnv needs {error.name}; install the extra: pip install '.[train]'") from error
    return MctfVecEnv
