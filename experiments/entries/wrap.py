"""Zips to hand in: an entry behind the shield, and a learned network as an entry."""

from __future__ import annotations

import hashlib
import io
import json
import os
import sys
import textwrap
import zipfile
from collections.abc import Iterable, Mapping
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
from steerclear.env.config import PRESETS, GameConfig
from steerclear.policies.entrants.learned.network import Network, arrays_of
from steerclear.policies.submissions.made_for import ABOUT_FILE, MadeFor
from steerclear.policies.submissions.stage import ENTRY_FILE, WORKING_DIR, Stage
from steerclear.shield.exceptions import ConfigError

from ..result_files import make_folder_of, told_settings
from .check import check_entry
from .package import code, data, game_spec, renamed
from .team import EntryTeam

TEMPLATE = Path(__file__).parent / "shielded_solution.txt"
LEARNED = Path(__file__).parent.parent / "templates" / "learned_solution.py.txt"
PREFIX = "steerclear_"
"""Of private packages' names; the rest tells one content from another, so that two zips can meet in one process."""
MARKS = ("team_shield.py", "crew.py")
"""What tells a shielded zip: a module of its package, the second until 0.8."""
ANSWER_S = 30.0
"""Time an entry has to be built when it is tried, s."""
TRIED_S = 10.0
"""Length of the game an entry is tried in, s."""
EPOCH = (2020, 1, 1, 0, 0, 0)


def wrap_entry(entry: str, out: Path, preset: str, shield: dict[str, Any]) -> dict[str, Any]:
    """Write a shielded zip of an entry that plays, and try that it loads.

    Returns:
        What the keys of "entry wrap" describe, and as ``tried`` what `check.check_entry` found of the entry: a shield
        would hide that it gave nothing usable.
    """
    if out.suffix != ".zip":
        raise ConfigError(f"--out is {out}; give the name of a zip, such as shielded.zip")
    spec = game_spec(preset, shield)
    stage = Stage(entry)
    try:
        if any(path for mark in MARKS for path in stage.folder.glob(f"{PREFIX}*/{mark}")):
            raise ConfigError(f"{entry} is shielded already; wrap the entry that it was made of")
        tried = check_entry(entry, preset, TRIED_S, ANSWER_S)
        package, files = shielded_files(spec, preset, own_files(stage.folder))
        write_zip(out, files)
    finally:
        stage.close()
    try:
        EntryTeam(str(out), ANSWER_S).close()
    except BaseException:
        out.unlink(missing_ok=True)
        raise
    return {
        "tried": tried,
        "entry": entry,
        "zip": str(out),
        "bytes": out.stat().st_size,
        "package": package,
        "preset": preset,
        "shield": spec["shield"],
    }


def shielded_files(spec: dict[str, Any], preset: str, own: Mapping[str, Path]) -> tuple[str, dict[str, bytes | Path]]:
    """Name of the private package, which hangs on all that is in the zip, and the zip's files by name.

    Args:
        spec: of `package.game_spec`.
        preset: rules of the game that they are of.
        own: the entry's files by name.
    """
    shield = spec["shield"]
    made = MadeFor(preset, spec["decision_s"], tuple(spec["platforms"]), shield["separation_m"], told_settings(shield))
    words = (
        f"For preset {preset}, a decision every {made.decision_s:g} s. The shield keeps {made.separation_m:g} m, "
        f"profile {shield['profile']}; all its settings are in {ABOUT_FILE}."
    )
    plain: dict[str, bytes] = {name: text.encode() for name, text in code().items()}
    plain |= data(spec["platforms"])
    plain["facts.json"] = json.dumps(spec).encode()
    digest = hashlib.sha256()
    for name, content in sorted({**plain, **{f"../{name}": path.read_bytes() for name, path in own.items()}}.items()):
        digest.update(f"{name} {len(content)}\0".encode() + content)
    package = PREFIX + digest.hexdigest()[:12]
    files: dict[str, bytes | Path] = {
        f"{package}/{name}": renamed(content.decode(), package).encode() if name.endswith(".py") else content
        for name, content in plain.items()
    }
    entry = f"unshielded_{package.removeprefix(PREFIX)}"
    files |= {f"{entry}.py" if name == ENTRY_FILE else name: path for name, path in own.items()}
    text = TEMPLATE.read_text(encoding="utf-8").replace("OWN_MODULES", repr(own_modules(own)))
    text = text.replace("ENTRY_FILE", f"{entry}.py").replace("ENTRY_NAME", entry).replace("PACKAGE", package)
    text = text.replace("ABOUT", textwrap.fill(words, 100))
    return package, {**files, ENTRY_FILE: text.encode(), ABOUT_FILE: made.to_bytes()}


def own_files(folder: Path) -> dict[str, Path]:
    """The entry's own files by their names in its folder."""
    files: dict[str, Path] = {}
    for place, folders, names in os.walk(folder, followlinks=True):
        folders[:] = sorted(one for one in folders if one not in ("__pycache__", WORKING_DIR))
        for name in sorted(names):
            files[(Path(place) / name).relative_to(folder).as_posix()] = Path(place) / name
    return files


def own_modules(own: Iterable[str]) -> list[str]:
    """Names by which an entry may import what lies beside its ``solution.py``, Python's own left out."""
    paths = [PurePosixPath(name) for name in own if name.endswith(".py") and name != ENTRY_FILE]
    found = {path.parts[0].removesuffix(".py") for path in paths if len(path.parts) <= 2}
    return sorted(found - set(sys.stdlib_module_names))


def write_zip(out: Path, files: dict[str, Any]) -> None:
    """Write a zip of files, given by path or content; never leaves half of one under its name."""
    part = out.with_name(out.name + ".part")
    try:
        make_folder_of(out)
        with zipfile.ZipFile(part, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as packed:
            for name, content in files.items():
                raw = content.read_bytes() if isinstance(content, Path) else content
                info = zipfile.ZipInfo(name, EPOCH)
                info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, 0o644 << 16
                packed.writestr(info, raw)
        part.replace(out)
    except OSError as error:
        raise ConfigError(f"{out} cannot be written ({error}); give another place with --out") from error
    finally:
        part.unlink(missing_ok=True)


def write_submission(network: Network, path: Path) -> Path:
    """Write a network as a competition entry: a zip with ``solution.py`` and its weights, which needs numpy only."""
    if network.kind == "raids":
        raise ConfigError("raids look at the whole game, which no entry is told; play them here, as weights:FILE")
    if network.kind != "discrete":
        raise ConfigError("an entry for the competition sends action numbers; train with actions: discrete")
    where = f"It learned in preset {network.preset}. " if network.preset else ""
    about = f"{where}There is no shield in it: ``steerclear entry wrap`` puts one round it."
    content = io.BytesIO()
    np.savez_compressed(content, **arrays_of(network))
    files = {ENTRY_FILE: LEARNED.read_text(encoding="utf-8").replace("ABOUT", about).encode()}
    if network.preset in PRESETS:
        files[ABOUT_FILE] = MadeFor(network.preset, GameConfig.preset(network.preset).decision_s).to_bytes()
    write_zip(path, {**files, "weights.npz": content.getvalue()})
    return path
