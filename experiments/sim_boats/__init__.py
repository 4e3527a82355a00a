"""Boats without boats: simulated hulls behind real MAVLink sockets."""

from .fleet import SimFleet
from .settings import LATER_FIRMWARE, AutopilotSettings, Firmware, RadioSettings, SimBoat, Water

__all__ = ["LATER_FIRMWARE", "AutopilotSettings", "Firmware", "RadioSettings", "SimBoat", "SimFleet", "Water"]
