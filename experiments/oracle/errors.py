"""What the oracle raises."""

from __future__ import annotations


class OracleError(ValueError):
    """A record, boat or setting that cannot be judged; the text names the remedy."""
