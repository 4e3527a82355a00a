"""Filters from the literature, to compare the shield with on the same encounters."""

from .guard import TextbookGuard, make_guard
from .parameters import NAMES, Gains

__all__ = ["NAMES", "Gains", "TextbookGuard", "make_guard"]
