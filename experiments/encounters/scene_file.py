"""Encounters as JSON files that play exactly again: every number is written in full."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.shield.exceptions import ConfigError

from ..result_files import read_json, write_json
from .scene_check import check_scenes
from .scenes import Conditions, Scenes

FORMAT = 1
_ARRAYS = ("state", "script", "goals", "current", "noise_seed", "number")


def scene_content(scenes: Scenes, conditions: Conditions, **notes: Any) -> dict[str, Any]:
    """What a scene file holds; infinite times are written as null, ``notes`` are kept beside it."""
    arrays = {name: _plain(getattr(scenes, name).tolist()) for name in _ARRAYS}
    named = {"family": scenes.family, "platforms": list(scenes.platforms), "team": scenes.team.tolist()}
    field = None if scenes.field is None else list(scenes.field)
    rest = {"field": field, "length_s": scenes.length_s, "conditions": conditions.as_dict()}
    return {"format": FORMAT, **named, **rest, **arrays, **notes}


def write_scene(path: Path, scenes: Scenes, conditions: Conditions, **notes: Any) -> Path:
    """Write scenes.

    Raises:
        ConfigError: the file cannot be written.
    """
    write_json(path, scene_content(scenes, conditions, **notes))
    return path


def read_scene(path: Path) -> tuple[Scenes, Conditions]:
    """Read what `write_scene` wrote.

    Raises:
        ConfigError: the file cannot be read or is no scene; the message says what is wrong.
    """
    content = read_json(path, "a scene", "give a file that `steerclear attack` wrote")
    try:
        return scenes_of(content)
    except (LookupError, TypeError, ValueError, AttributeError, ArithmeticError, RecursionError, MemoryError) as error:
        why = str(error) if isinstance(error, ConfigError) else f"{type(error).__name__}: {error}"
        raise ConfigError(f"{path} is no scene ({why}); give a file that `steerclear attack` wrote") from None


def scenes_of(content: Mapping[str, Any]) -> tuple[Scenes, Conditions]:
    """Scenes and conditions of what a scene file holds.

    Raises:
        ConfigError: another format, or arrays that do not fit together.
        KeyError: something is missing.
    """
    if content["format"] != FORMAT:
        raise ConfigError(f"the scene has format {content['format']}; this version reads {FORMAT}")
    kinds = {"noise_seed": np.uint64, "number": np.int64}
    arrays = {name: np.array(_full(content[name]), dtype=kinds.get(name, np.float64)) for name in _ARRAYS}
    scenes = Scenes(
        family=str(content["family"]),
        platforms=tuple(content["platforms"]),
        team=np.array(content["team"], dtype=np.int64),
        field=None if content["field"] is None else tuple(map(float, content["field"])),
        length_s=float(content["length_s"]),
        **arrays,
    )
    check_scenes(scenes)
    return scenes, Conditions(**content["conditions"])


def _plain(value: Any) -> Any:
    if isinstance(value, list):
        return [_plain(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _full(value: Any) -> Any:
    if isinstance(value, list):
        return [_full(item) for item in value]
    return math.inf if value is None else value
