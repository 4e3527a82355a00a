"""Competition submissions: folders or zips with a ``solution.py``, run unchanged."""

from .loader import load_submission

__all__ = ["load_submission"]
