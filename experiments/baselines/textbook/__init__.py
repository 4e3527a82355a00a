"""Filters from the literature, to compare the shield with on the same encounters: one file each, and one loop."""

from .barrier import Barrier
from .guard import BARRIERS, NAMES, TextbookGuard

__all__ = ["BARRIERS", "NAMES", "Barrier", "TextbookGuard"]
