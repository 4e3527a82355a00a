"""The worst encounters of a run: found, and played again for a replay."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..replay_html import write_replay
from .campaign import Cell
from .families import draw
from .guards import NONE, SHIELD
from .play import play
from .replays import records_of
from .scenes import Conditions
from .tally import Columns
from .verdicts import side_name

MOST_WORST = 10
FAR_M = 1e4
"""A certificate beyond this, m, says that nobody is near."""


def worst_encounters(columns: Mapping[Cell, Columns], most: int = MOST_WORST) -> list[dict[str, Any]]:
    """The worst encounters of all cells with a shield: avoidable breaches first, then the closest.

    Without such a cell, those with another guard, or with none.
    """
    shields = [cell for cell in columns if cell.guard.partition(":")[0] == SHIELD]
    cells = shields or [cell for cell in columns if cell.guard != NONE] or list(columns)
    found = []
    for cell in cells:
        values = columns[cell]
        order = np.lexsort((values["closest_m"], -values["avoidable"]))[:most]
        found += [
            {
                "guard": cell.guard,
                "own": cell.own,
                "other": cell.other,
                "family": cell.family,
                "number": int(values["number"][k]),
                "variant": int(values["variant"][k]),
                "closest_m": float(values["closest_m"][k]),
                "breaches": int(values["breaches_teammate"][k] + values["breaches_opponent"][k]),
                "avoidable": int(values["avoidable"][k]),
                "last_preventable_s": _finite(values["last_preventable_s"][k]),
                "responsible": side_name(values["responsible"][k]),
                "start_certificate_m": _finite(values["start_certificate_m"][k]),
            }
            for k in order
        ]
    return sorted(found, key=lambda entry: (-entry["avoidable"], entry["closest_m"]))[:most]


def _finite(value: float) -> float | None:
    return float(value) if abs(value) < FAR_M else None


def replay_worst(worst: Sequence[Mapping[str, Any]], conditions: Conditions, seed: int, path: Path) -> Path:
    """Play encounters again, with their guard and without, into one replay."""
    records = []
    for entry in worst:
        scenes = draw(entry["family"], entry["own"], entry["other"], conditions, seed, entry["number"], 1)
        scenes = scenes.take([entry["variant"]])
        name = f"{entry['family']} {entry['number']}, {entry['own']} and {entry['other']}"
        guards = dict.fromkeys((entry["guard"], NONE))
        records += records_of([(play(scenes, guard, conditions), guard) for guard in guards], 0, name)
    return write_replay(records, path, title="The worst encounters")
