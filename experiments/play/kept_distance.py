"""The distance that a shield keeps in a game: what it must not be above, and what is said where it is small."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.shield import ShieldConfig
from steerclear.shield.exceptions import ConfigError


def counted_m(game: GameConfig) -> float:
    """Distance at which a game counts collisions, m: the largest of any two boats."""
    radii_m = game.agent_radius_m
    return 2.0 * max(radii_m) if isinstance(radii_m, tuple) else 2.0 * radii_m


def check_shield(settings: Mapping[str, Any], game: GameConfig) -> ShieldConfig:
    """The settings of a shield that fit a game, checked before it is played.

    Raises:
        ConfigError: a setting is unknown or out of range, or a distance that the field has no room for.
    """
    config = ShieldConfig.of(**settings)
    shorter_m = min(game.env_bounds_m)
    if config.separation_m > shorter_m:
        raise ConfigError(
            f"separation_m is {config.separation_m:g} m, more than the shorter side of the field, {shorter_m:g} m: "
            f"no boats there can keep it; give {shorter_m:g} m at most"
        )
    return config


def words_of_less(kept_m: float, game: GameConfig) -> str:
    """What to say of a shield that keeps less than the distance at which its game counts collisions; else nothing."""
    if kept_m >= counted_m(game) - 1e-9:
        return ""
    return (
        f"the shield keeps {kept_m:g} m (separation_m), but this game counts collisions at {counted_m(game):g} m: "
        "such hits it does not prevent"
    )
