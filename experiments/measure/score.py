"""The competition's two scores."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from steerclear.shield.exceptions import ConfigError

DEFAULT_PENALTY = 0.25
"""Weight of a collision: fits the competition's published results; its rules say 0.025. Always a setting."""


def check_penalty(penalty: float) -> float:
    """Return the weight of a collision.

    Raises:
        ConfigError: negative or not a finite number.
    """
    if not 0.0 <= penalty < float("inf"):
        raise ConfigError(f"--penalty must be a number >= 0; got {penalty}; the competition used 0.25 and 0.025")
    return penalty


def scores(counts: Mapping[str, Any], penalty: float = DEFAULT_PENALTY) -> dict[str, float]:
    """Score one team.

    Args:
        counts: `captures`, `grabs`, `tags` of the team, the same with `_against` of the other, `collisions`.
        penalty: weight of a collision in the primary score.

    Returns:
        ``primary`` = captures - captures_against - penalty * collisions,
        ``secondary`` = grabs + tags - grabs_against - tags_against.
    """
    return {
        "primary": counts["captures"] - counts["captures_against"] - penalty * counts["collisions"],
        "secondary": float(counts["grabs"] + counts["tags"] - counts["grabs_against"] - counts["tags_against"]),
    }
