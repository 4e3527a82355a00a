"""Version 0 of the environment, in PettingZoo's fashion: ``from steerclear.env import mctf_v0``."""

from __future__ import annotations

from typing import Any

from .config import GameConfig
from .mctf import MctfEnv


def parallel_env(config: GameConfig | str | None = None, **kwargs: Any) -> MctfEnv:
    """The game as a PettingZoo ``ParallelEnv``; arguments as `MctfEnv`."""
    return MctfEnv(config, **kwargs)
