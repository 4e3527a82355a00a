"""Checkpoints: a model as Stable-Baselines3 saves it, and the state of the games; none of its pickles is read."""

from __future__ import annotations

import json
import zipfile
import zlib
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned.sb3_file import add_card
from steerclear.shield.exceptions import ConfigError

FOLDER, KEEP = "checkpoints", 2
FACTS, ARRAYS = "steerclear_training.json", "steerclear_games.npz"
_DAMAGED = (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError, zlib.error)


def write_model(model: Any, to: Path | BytesIO, card: dict[str, Any], facts: Any = None, arrays: Any = None) -> None:
    """Save a model with its card, and where facts are given with the state of a training; whole or not at all.

    Raises:
        ConfigError: it cannot be written.
    """
    file = BytesIO()
    model.save(file)
    add_card(file, card)
    if facts is not None:
        content = BytesIO()
        names = list(arrays)
        np.savez(content, **{f"a{k}": arrays[name] for k, name in enumerate(names)})
        with zipfile.ZipFile(file, "a") as archive:
            archive.writestr(FACTS, json.dumps({**facts, "names": names}))
            archive.writestr(ARRAYS, content.getvalue())
    if isinstance(to, BytesIO):
        to.write(file.getvalue())
    else:
        with whole_file(to, ConfigError) as part:
            part.write_bytes(file.getvalue())


def write_checkpoint(folder: Path, content: bytes) -> None:
    """Write a checkpoint, then forget all but the last `KEEP`.

    Raises:
        ConfigError: it cannot be written.
    """
    with zipfile.ZipFile(BytesIO(content)) as archive:
        number = json.loads(archive.read(FACTS))["rollouts"]
    with whole_file(folder / FOLDER / f"{number:08d}.zip", ConfigError) as part:
        part.write_bytes(content)
    for old in sorted((folder / FOLDER).glob("[0-9]*.zip"))[:-KEEP]:
        old.unlink(missing_ok=True)


def newest(folder: Path) -> Path | None:
    """The last checkpoint of a training; None where there is none.

    Raises:
        ConfigError: there are only those of an older version.
    """
    found = sorted((folder / FOLDER).glob("[0-9]*.zip"))
    if not found and any((folder / FOLDER).glob("[0-9]*.npz")):
        raise ConfigError(
            f"{folder} holds a training of 0.8.0 or before, which only that version goes on with; its best.npz and "
            "final.npz play here and can be the start of another (start), in another --out"
        )
    return found[-1] if found else None


def read_checkpoint(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Facts and arrays of a checkpoint.

    Raises:
        ConfigError: it is cut short or none.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            facts = json.loads(archive.read(FACTS))
            content = BytesIO(archive.read(ARRAYS))
        with np.load(content, allow_pickle=False) as found:
            return facts, {name: found[f"a{k}"] for k, name in enumerate(facts.pop("names"))}
    except _DAMAGED as error:
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise ConfigError(f"{path} is no whole checkpoint ({why}); delete it to go on from the one before") from error
