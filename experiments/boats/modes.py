"""Modes of the autopilot and what each makes the boat do without a pilot."""

from __future__ import annotations

from enum import IntEnum


class Mode(IntEnum):
    """Modes by the autopilot's own numbers."""

    MANUAL = 0
    ACRO = 1
    STEERING = 3
    HOLD = 4
    LOITER = 5
    AUTO = 10
    RTL = 11
    SMART_RTL = 12
    GUIDED = 15


NEEDS_POSITION = frozenset({Mode.LOITER, Mode.AUTO, Mode.RTL, Mode.SMART_RTL, Mode.GUIDED})
"""Modes that cannot be entered before the position is known."""

NOT_OFFERED = frozenset({Mode.AUTO, Mode.RTL, Mode.SMART_RTL})
"""Modes that need a mission or a path back, which these boats do not have."""
