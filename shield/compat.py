"""Features of later Pythons that 3.10 lacks: the only place for them, so that the rest is written for 3.11."""

from __future__ import annotations

import sys

if sys.version_info >= (3, 11):
    from enum import StrEnum
    from typing import Self
else:
    from enum import Enum
    from typing import Any

    class StrEnum(str, Enum):
        """An enumeration of texts that prints as its value."""

        __str__ = str.__str__
        __format__ = str.__format__

    Self = Any  # only a type checker reads it: annotations are not evaluated

__all__ = ["Self", "StrEnum"]
