"""Boats without boats: simulated hulls behind real MAVLink sockets."""

from .fleet import SimFleet
from .settings import AutopilotSettings, RadioSettings, SimBoat, Water

__all__ = ["AutopilotSettings", "RadioSettings", "SimBoat", "SimFleet", "Water"]
