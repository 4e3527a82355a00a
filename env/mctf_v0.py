"""Version 0 of the environment, as PettingZoo names it: ``from steerclear.env import mctf_v0``."""

from __future__ import annotations

from typing import Any

from .config import GameConfig
from .mctf import MctfEnv


def parallel_env(config: GameConfig | str | None = None, **kwargs: Any) -> MctfEnv:
    """Return the game as a PettingZoo ``ParallelEnv``; arguments as for `MctfEnv`."""
    return MctfEnv(config, **kwargs)
