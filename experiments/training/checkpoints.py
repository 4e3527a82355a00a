"""Checkpoints: one ``.npz`` each, whole or not at all, read without running code."""

from __future__ import annotations

import json
import zipfile
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from steerclear.env.whole_file import whole_file
from steerclear.policies.entrants.learned.network import Network
from steerclear.policies.entrants.learned.sb3_file import network_of_tensors
from steerclear.shield.exceptions import ConfigError

FOLDER, KEEP = "checkpoints", 2
_UNUSABLE = (KeyError, ValueError, TypeError, IndexError)
_DAMAGED = (zipfile.BadZipFile, KeyError, ValueError, OSError, EOFError, zlib.error)


def write_checkpoint(folder: Path, number: int, facts: dict[str, Any], arrays: dict[str, np.ndarray]) -> Path:
    """Write a checkpoint, then forget all but the last `KEEP`.

    Raises:
        ConfigError: it cannot be written.
    """
    path = folder / FOLDER / f"{number:08d}.npz"
    names = list(arrays)
    with whole_file(path, ConfigError) as part, part.open("wb") as file:
        content = {f"a{k}": arrays[name] for k, name in enumerate(names)}
        np.savez(file, facts=np.array(json.dumps({**facts, "names": names})), **content)
    for old in checkpoints_in(folder)[:-KEEP]:
        old.unlink(missing_ok=True)
    return path


def is_checkpoint(path: Path) -> bool:
    """Whether a file is a checkpoint of a training, and not weights or something else."""
    try:
        with zipfile.ZipFile(path) as archive:
            return "facts.npy" in archive.namelist()
    except _DAMAGED:
        return False


def network_in(path: Path) -> Network:
    """The actor that a checkpoint holds, as weights to play.

    Raises:
        ConfigError: it is damaged, or holds only one network of two.
    """
    facts, arrays = read_checkpoint(path)
    at = "policy/"
    tensors = {name.removeprefix(at): array for name, array in arrays.items() if name.startswith(at)}
    try:
        settings = facts["settings"]
        if settings["options"]:
            raise ConfigError(
                f"{path} holds one network of two; go on with the training (--resume), which writes both to final.npz"
            )
        card = {"trained_with": "steerclear train", "preset": settings["preset"], "source": path.name}
        return network_of_tensors(tensors, settings["net"]["activation"], None, card)
    except ConfigError:
        raise  # a kind of ValueError; says already what to do
    except _UNUSABLE as error:
        raise ConfigError(f"{path} holds no network this version can play ({type(error).__name__}: {error})") from error


def checkpoints_in(folder: Path) -> list[Path]:
    """Checkpoints, the oldest first."""
    return sorted((folder / FOLDER).glob("[0-9]*.npz"))


def read_checkpoint(path: Path) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Facts and arrays of a checkpoint.

    Raises:
        ConfigError: it is cut short or none.
    """
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as found:
            facts = json.loads(str(found["facts"]))
            return facts, {name: found[f"a{k}"] for k, name in enumerate(facts.pop("names"))}
    except _DAMAGED as error:
        why = " ".join(str(error).split())[:120] or type(error).__name__
        raise ConfigError(f"{path} is no whole checkpoint ({why}); delete it to go on from the one before") from error
