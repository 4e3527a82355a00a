"""No registered barriers: a zip has no compiler, and nobody who could register one."""

from __future__ import annotations

from typing import Any

from steerclear.shield.exceptions import ConfigError

MOST_VALUES = 1


def get_barrier(name: str) -> Any:
    """Refuse it.

    Raises:
        ConfigError: always.
    """
    raise ConfigError(f"a shielded zip cannot carry barrier {name!r}; leave it out of the shield's settings")


def address_of(barrier: Any) -> int:
    """Refuse it, as above."""
    return int(get_barrier(str(barrier)))


def call(*given: Any) -> float:
    """Refuse it, as above."""
    return float(get_barrier(str(given)))
