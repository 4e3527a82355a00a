"""Compiled functions of the experiments."""

from steerclear.shield.jit import kernel

__all__ = ["kernel"]
