"""Errors of logs that cannot be fitted."""

from __future__ import annotations

from steerclear.shield.exceptions import ConfigError


class FitError(ConfigError):
    """A log cannot be read, or it says too little of the boat; one line that names the remedy."""
