"""All errors that the package raises on bad input, as one tree. Each message names the remedy."""

from __future__ import annotations


class SteerclearError(Exception):
    """Base of all errors this package raises on purpose."""


class CallError(SteerclearError, TypeError):
    """A function or constructor was called with an unknown keyword, or without an argument that it needs."""


class ConfigError(SteerclearError, ValueError):
    """A setting is unknown, misspelt or out of range."""


class PlatformError(ConfigError):
    """A platform is unknown or its parameters make no sense."""


class FleetError(SteerclearError, ValueError):
    """The state or the commands handed to the shield have the wrong shape or a value that cannot be used."""


class GameError(SteerclearError, ValueError):
    """A game setting, action or initial state that the rules do not allow."""


class PolicyError(SteerclearError, ValueError):
    """A policy is unknown, cannot be loaded, or returned something that is not a command."""


class TraceError(SteerclearError, ValueError):
    """A recorded game cannot be read or lacks an array."""


class SolverError(SteerclearError, RuntimeError):
    """A QP backend is missing or cannot be used."""


class TableError(SteerclearError, ValueError):
    """A reachability value table is missing, damaged, made for other boats, or cannot be solved."""


class BridgeError(SteerclearError, RuntimeError):
    """Base of errors between the shield and boats."""


class LinkError(BridgeError):
    """A boat's link cannot be opened, is lost, or does not answer in time."""


class LinkRefused(LinkError):
    """The boat's autopilot answered no: a mode, arming, a parameter or an unsigned packet."""


class FleetFileError(ConfigError):
    """A FLEET.yaml has an unknown key, a value out of range, or boats that contradict each other."""


class FeedError(SteerclearError, ValueError):
    """A packet of the position or game feed does not have the specified format."""


class LogError(SteerclearError, ValueError):
    """A black-box log cannot be read, is cut off before its first decision, or is of another version."""
