"""Filters of the newest literature that try manoeuvres out on the boat's own model: gatekeeper and PL-CBF."""

from .guard import NAMES, RolloutGuard, check_settings

__all__ = ["NAMES", "RolloutGuard", "check_settings"]
