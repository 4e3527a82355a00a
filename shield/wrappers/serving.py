"""A shield remembers the boats it decides for, so it serves one team of one game between two resets."""

from __future__ import annotations

from typing import Any

from ..exceptions import ConfigError
from ..shield import Shield


def begin_serving(shield: Any) -> object:
    """Let a shield forget all, and return what shows that it serves whoever holds it; deciders of users' own too."""
    shield.reset()
    holder = object()
    if isinstance(shield, Shield):
        shield.serves = holder
    return holder


def check_serving(shield: Any, holder: object) -> None:
    """Refuse a shield that has begun to serve another team or game since; one that serves nobody serves the holder now.

    Raises:
        ConfigError: it has.
    """
    if not isinstance(shield, Shield):
        return
    if shield.serves is None:  # somebody reset it
        shield.serves = holder
    if shield.serves is not holder:
        raise ConfigError(
            "this shield has begun to serve another team or game since this one's reset; give each a Shield of its "
            "own, or reset() it between them"
        )
