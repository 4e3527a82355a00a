"""The one way the oracle's functions are compiled."""

from steerclear.shield.jit import kernel as compiled

__all__ = ["compiled"]
