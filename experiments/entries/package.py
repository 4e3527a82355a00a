"""The private package of a shielded zip: the shield's own sources as they are, a few stand-ins, boats and tables."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from functools import cache
from pathlib import Path

import steerclear.shield
from steerclear.shield.exceptions import ConfigError, TableError
from steerclear.shield.platforms import Platform, get_platform
from steerclear.shield.tables.files import find_table, load_table
from steerclear.shield.tables.settings import OtherMay

SHIELD = Path(steerclear.shield.__file__).parent
ONBOARD = Path(__file__).parent / "onboard"
LEFT_OUT = ("bridge", "root", "wrappers", "__init__.py")
"""Of the shield's folder: what no decision needs."""
STAND_INS = {
    "jit.py": "jit.py",
    "shared.py": "shared.py",
    "barriers/pointer.py": "pointer.py",
    "filter/program.py": "program.py",
    "platforms/registry.py": "registry.py",
}
"""Modules of the shield that need a compiler or other packages, and what takes their places."""
CREW = ("crew.py", "state.py")
"""Modules of `onboard` that lie at the private package's top."""


@cache
def code() -> dict[str, str]:
    """Sources by path inside the package, with ``steerclear`` for its name."""
    files = {"__init__.py": '"""The safety shield of steerclear, as plain Python. BSD-3-Clause."""\n'}
    files |= {name: (ONBOARD / name).read_text(encoding="utf-8") for name in CREW}
    files["shield/__init__.py"] = ""
    for path in sorted(SHIELD.rglob("*.py")):
        inside = path.relative_to(SHIELD)
        if inside.parts[0] not in LEFT_OUT:
            stand_in = STAND_INS.get(inside.as_posix())
            source = ONBOARD / "stand_ins" / stand_in if stand_in else path
            files[f"shield/{inside.as_posix()}"] = source.read_text(encoding="utf-8")
    return files


def renamed(text: str, package: str) -> str:
    """A module of `onboard` whose imports are of the private package."""
    own = text.replace("from steerclear.experiments.entries.onboard.", f"from {package}.")
    return own.replace("from steerclear.", f"from {package}.")


def data(platforms: Iterable[str | Platform]) -> dict[str, bytes]:
    """Boats and value tables by path inside the package.

    Raises:
        ConfigError: a boat has no value table that can be read where the shield looks for one.
    """
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
