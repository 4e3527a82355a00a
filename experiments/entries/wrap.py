"""Zips to hand in: an entry behind the shield, and a learned network as an entry.

A shielded zip holds the shield's own sources, stand-ins, boats, tables and facts of a game beside the entry.
"""

from __future__ import annotations

import hashlib
import io
import json
import os
import sys
import textwrap
import zipfile
from collections.abc import Iterable, Mapping
from dataclasses import asdict, fields
from functools import cache
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import steerclear.shield
from steerclear.env.config import PRESETS, GameConfig
from steerclear.env.core import BatchedMctf
from steerclear.env.field import field_points
from steerclear.policies.entrants.learned.network import Network, arrays_of
from steerclear.policies.submissions.made_for import ABOUT_FILE, MadeFor
from steerclear.policies.submissions.stage import ENTRY_FILE, WORKING_DIR, Stage
from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.tables.files import find_table, load_table
from steerclear.shield.tables.settings import OtherMay
from steerclear.shield.wrappers.mctf import surroundings_of

from ..play.spec import check_shield
from ..result_files import make_folder_of, told_settings
from .check import check_entry
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
