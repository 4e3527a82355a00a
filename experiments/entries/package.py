"""What a shielded zip holds beside the entry: the shield's own sources, stand-ins, boats, tables, facts of a game."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path
from typing import Any

import steerclear.shield
from steerclear.env.config import GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_points
from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.tables.files import find_table, load_table
from steerclear.shield.tables.settings import OtherMay
from steerclear.shield.wrappers.mctf import surroundings_of

from ..play.spec import check_shield

SHIELD = Path(steerclear.shield.__file__).parent
ONBOARD = Path(__file__).parent / "onboard"
LEFT_OUT = ("bridge", "root", "wrappers", "__init__.py")
"""Of the shield's folder: what no decision needs,"""
SHIPPED = ("wrappers/actions.py", "wrappers/driving.py")
"""but these."""
STAND_INS = {
    "jit.py": "jit.py",
    "shared.py": "shared.py",
    "barriers/pointer.py": "pointer.py",
    "filter/program.py": "program.py",
    "platforms/registry.py": "registry.py",
}
"""Modules of the shield that need a compiler or other packages, and what takes their places."""
ONBOARD_TOP = ("team_shield.py", "state.py")
"""Modules of `onboard` that lie at the private package's top."""


@cache
def code() -> dict[str, str]:
    """Sources by path inside the package, with ``steerclear`` for its name."""
    files = {"__init__.py": '"""The safety shield of steerclear, as plain Python. BSD-3-Clause."""\n'}
    files |= {name: (ONBOARD / name).read_text(encoding="utf-8") for name in ONBOARD_TOP}
    files["shield/__init__.py"] = files["shield/wrappers/__init__.py"] = ""
    for path in sorted(SHIELD.rglob("*.py")):
        inside = path.relative_to(SHIELD)
        if inside.parts[0] not in LEFT_OUT or inside.as_posix() in SHIPPED:
            stand_in = STAND_INS.get(inside.as_posix())
            source = ONBOARD / "stand_ins" / stand_in if stand_in else path
            files[f"shield/{inside.as_posix()}"] = source.read_text(encoding="utf-8")
    return files


def renamed(text: str, package: str) -> str:
    """A module of `onboard` whose imports are of the private package."""
    own = text.replace("from steerclear.experiments.entries.onboard.", f"from {package}.")
    return own.replace("from steerclear.", f"from {package}.")


def data(platforms: Iterable[str | Platform]) -> dict[str, bytes]:
    """Boats and value tables by path inside the package."""
    kinds = sorted({get_platform(name) for name in platforms}, key=lambda kind: kind.name)
    files = {"shield/platforms/platforms.json": json.dumps([asdict(kind) for kind in kinds]).encode()}
    for own in kinds:
        for other in kinds:
            path = find_table(own.name, other.name, OtherMay.WORST_CASE)
            if path is None:
                continue
            try:
                load_table(own, other)
            except TableError as error:
                raise ConfigError(str(error)) from error
            files[f"shield/tables/shipped/{path.name}"] = path.read_bytes()
    return files


def game_spec(preset: str, shield: dict[str, Any]) -> dict[str, Any]:
    """The entries of `onboard.state.GameSpec`, fit for JSON.

    Args:
        preset: rules of the game.
        shield: settings of the shield that are not the default; its step is the game's.
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
