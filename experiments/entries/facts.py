"""What a shielded zip is told of its game and its shield."""

from __future__ import annotations

from dataclasses import fields
from typing import Any

from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_points
from steerclear.shield.exceptions import ConfigError
from steerclear.shield.platforms import get_platform
from steerclear.shield.wrappers.mctf import surroundings_of

from ..play.kept_distance import check_shield


def facts_for(preset: str, shield: dict[str, Any]) -> dict[str, Any]:
    """The entries of `onboard.state.Facts`, fit for JSON.

    Args:
        preset: rules of the game.
        shield: settings of the shield that are not the default; its step is the game's.

    Raises:
        ConfigError: an unknown preset, one whose global state is not told in metres, or a bad setting.
    """
    config = GameConfig.preset(preset)
    if not config.shows_disabled:
        raise ConfigError(
            f"rules {preset} normalise the global state, which a shielded zip reads in metres; give --preset mctf2026"
        )
    core = BatchedMctf(config, 1)
    rules = core.rules
    move_s = float(rules.decision_s) / config.decision_steps
    times = {"dt_s": float(rules.decision_s), "move_s": move_s if config.decision_steps > 1 else None}
    settings = check_shield({**times, **shield}, config)
    if settings.barriers:
        names = ", ".join(settings.barriers)
        raise ConfigError(f"a shielded zip cannot carry registered barriers ({names}); wrap without them")
    kinds = config.platforms if isinstance(config.platforms, (tuple, list)) else (config.platforms,) * core.n_boats
    stops = [list(map(list, surroundings_of(core, team).stops)) for team in range(2)]
    return {
        "agent_ids": list(config.agent_ids),
        "platforms": [get_platform(kind).name for kind in kinds],
        "size": [float(core.field.size[0]), float(core.field.size[1])],
        "marks": rules.corner_marks.tolist(),
        "ends": rules.corners.tolist(),
        "untag_m": config.corner_radius_m,
        "oob_share": config.oob_speed_frac,
        "tag_share": config.tag_speed_frac,
        "power_s": float(rules.power_length * rules.decision_s),
        "decision_s": float(rules.decision_s),
        "points": {name: list(map(float, point)) for name, point in field_points(core.field.size).items()},
        "stops": stops,
        "shield": {entry.name: getattr(settings, entry.name) for entry in fields(settings)},
    }
