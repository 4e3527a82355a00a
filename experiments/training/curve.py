"""A training's curve as files: JSON always, Parquet where pyarrow is there, TensorBoard where that is."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from steerclear.env.whole_file import whole_file
from steerclear.shield.exceptions import ConfigError

from ..runs.provenance import machine, versions
from ..runs.store import told_settings, write_table
from .settings import TrainingSettings

CURVE, PARQUET_STEM = "curve.json", "curve"


def write_curve(folder: Path, rows: Sequence[dict[str, Any]], settings: TrainingSettings) -> None:
    """Write the curve.

    Raises:
        ConfigError: it cannot be written.
    """
    content = {
        "command": "train",
        "settings": told_settings(asdict(settings)),
        "rows": list(rows),
        "versions": versions(),
        "machine": machine(),
    }
    with whole_file(folder / CURVE, ConfigError) as part:
        part.write_text(json.dumps(content, indent=1), encoding="utf-8")
    if find_spec("pyarrow") is not None and rows:
        write_table(folder, [flat(row) for row in rows], PARQUET_STEM)
    _tensorboard(folder, rows)


def flat(row: dict[str, Any], before: str = "") -> dict[str, Any]:
    """A row with the names of nested values joined by dots."""
    out: dict[str, Any] = {}
    for name, value in row.items():
        out |= flat(value, f"{before}{name}.") if isinstance(value, dict) else {f"{before}{name}": value}
    return out


def _tensorboard(folder: Path, rows: Sequence[dict[str, Any]]) -> None:
    """All rows anew: so that a resumed training has one curve."""
    if find_spec("tensorboard") is None:
        return
    from torch.utils.tensorboard import SummaryWriter

    place = folder / "tensorboard"
    for old in place.glob("events.*"):
        old.unlink()
    with SummaryWriter(str(place)) as writer:
        for row in rows:
            for name, value in flat(row).items():
                if isinstance(value, (int, float)):
                    writer.add_scalar(name.replace(".", "/"), value, row["decisions"])
