"""The private package of a shielded zip: file names and contents."""

from __future__ import annotations

import ast
import json
from collections.abc import Iterable
from dataclasses import asdict
from functools import cache
from pathlib import Path

from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.tables.files import find_table, load_table
from steerclear.shield.tables.settings import OtherMay

from .sources import ONBOARD, ROOT, STAND_INS, Source, sources
from .translate import compiled_names, small_functions, translate

ONBOARD_NAME = f"{ROOT}.experiments.entries.onboard"
CREW = ("crew", "state")
"""Modules of `onboard` that lie at the private package's top."""


@cache
def code() -> dict[str, str]:
    """Sources by path inside the package, with ``steerclear`` for its name."""
    found = sources()
    compiled = {
        name: compiled_names(ast.parse(source.path.read_text())) if name not in STAND_INS else {"copy_row"}
        for name, source in found.items()
    }
    short = {
        name: small_functions(ast.parse(source.path.read_text()))
        for name, source in found.items()
        if name not in STAND_INS
    }
    files = {f"{part}/__init__.py": "" for source in found.values() for part in _folders(source)}
    for source in found.values():
        if source.name in STAND_INS:
            files[f"{source.inside}.py"] = (ONBOARD / f"{STAND_INS[source.name]}.py").read_text()
        elif not source.is_package or source.name.count(".") > 1:
            inside = f"{source.inside}/__init__" if source.is_package else source.inside
            files[f"{inside}.py"] = translate(source, compiled, short)
    files["__init__.py"] = '"""The safety shield of steerclear, as plain Python. BSD-3-Clause."""\n'
    for name in CREW:
        files[f"{name}.py"] = (ONBOARD / f"{name}.py").read_text()
    return files


def _folders(source: Source) -> list[str]:
    parts = source.inside.split("/")
    return ["/".join(parts[: k + 1]) for k in range(len(parts) - (0 if source.is_package else 1))]


def renamed(text: str, package: str) -> str:
    """A source whose imports of the shield are of the private package."""
    return text.replace(f"from {ONBOARD_NAME}.", f"from {package}.").replace(f"from {ROOT}.", f"from {package}.")


def data(platforms: Iterable[str | Platform]) -> dict[str, bytes]:
    """Boats and value tables by path inside the package.

    Raises:
        ConfigError: a boat has no value table that can be read where the shield looks for one.
    """
    kinds = sorted({get_platform(name) for name in platforms}, key=lambda kind: kind.name)
    packed = json.dumps([asdict(kind) for kind in kinds])
    files = {"shield/platforms/platforms.json": packed.encode()}
    for own in kinds:
        for other in kinds:
            path = _table(own, other)
            if path is not None:
                files[f"shield/tables/shipped/{path.name}"] = path.read_bytes()
    return files


def _table(own: Platform, other: Platform) -> Path | None:
    path = find_table(own.name, other.name, OtherMay.WORST_CASE)
    if path is None:
        return None
    try:
        load_table(own, other)
    except TableError as error:
        raise ConfigError(str(error)) from error
    return path
