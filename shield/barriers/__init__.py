"""Barriers h, one a file: margins, m, that are >= 0 while a boat on its backup manoeuvre keeps clear.

Others can be registered, see `register_barrier`.
"""

from .registry import Barrier, register_barrier

__all__ = ["Barrier", "register_barrier"]
