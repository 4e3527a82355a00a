"""The game: rules, boats, observations, presets and pictures."""

from . import mctf_v0
from .config import GameConfig, RewardWeights
from .core import BatchedMctf
from .mctf import MctfEnv
from .view import GameView

__all__ = ["BatchedMctf", "GameConfig", "GameView", "MctfEnv", "RewardWeights", "mctf_v0"]
