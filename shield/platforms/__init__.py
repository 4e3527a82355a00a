"""Platforms: models of hull and autopilot, their limits, and the autopilot's inverse."""

from . import layout
from .platform import Gains, Platform
from .registry import PLATFORMS, get_platform, known_platforms, register_platform
from .step import step_boat
from .usv import fresh_state

__all__ = [
    "PLATFORMS",
    "Gains",
    "Platform",
    "fresh_state",
    "get_platform",
    "known_platforms",
    "layout",
    "register_platform",
    "step_boat",
]
