"""The safety shield: nominal heading and speed in, filtered heading and speed out."""

from .commands import Commands
from .config import ShieldConfig
from .decision import Decision, Decisions, Reason
from .exceptions import SteerclearError
from .fleet import Fleet
from .shield import Shield
from .surroundings import Surroundings

__all__ = [
    "Commands",
    "Decision",
    "Decisions",
    "Fleet",
    "Reason",
    "Shield",
    "ShieldConfig",
    "SteerclearError",
    "Surroundings",
]
