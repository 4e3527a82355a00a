"""A safety filter made of the reachability value tables alone, to compare the shield with on the same encounters."""

from .guard import NAME, SETTINGS, ReachGuard, check_settings

__all__ = ["NAME", "SETTINGS", "ReachGuard", "check_settings"]
