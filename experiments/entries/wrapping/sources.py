"""Which of the shield's modules a shielded zip needs, and where their sources are."""

from __future__ import annotations

import ast
import importlib
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType

import steerclear.shield

ROOT = "steerclear"
SHIELD = f"{ROOT}.shield"
ROOTS = (f"{SHIELD}.shield", f"{SHIELD}.actions", f"{SHIELD}.tracking.driving", f"{SHIELD}.words")
"""Modules that the crew of a zip uses; `sources` adds what these import."""
STAND_INS = {
    f"{SHIELD}.jit": "jit",
    f"{SHIELD}.shared": "shared",
    f"{SHIELD}.barriers.pointer": "barriers",
    f"{SHIELD}.barriers.registry": "barriers",
    f"{SHIELD}.filter.program": "program",
    f"{SHIELD}.platforms.registry": "registry",
}
"""Modules that need a compiler or packages which may not be there, and those of `onboard` in their places."""
FOLDER = Path(steerclear.shield.__file__).parent
ONBOARD = Path(__file__).parent.parent / "onboard"


@dataclass(frozen=True)
class Source:
    """A module of the package.

    Attributes:
        name: full name.
        path: its file.
        inside: path in the zip's private package, without suffix, such as ``shield/flow``.
        is_package: whether it is a package's ``__init__``.
    """

    name: str
    path: Path
    inside: str
    is_package: bool

    def module(self) -> ModuleType:
        """The module itself, for the values of its constants."""
        return importlib.import_module(self.name)

    def imports(self, node: ast.ImportFrom) -> str:
        """Full name of the module that a relative import in it is from."""
        package = self.name if self.is_package else self.name.rpartition(".")[0]
        parts = package.split(".")[: len(package.split(".")) - node.level + 1]
        return ".".join([*parts, *([node.module] if node.module else [])])


def source_of(name: str) -> Source | None:
    """The source of a module of the shield; None where there is no such module."""
    if name != SHIELD and not name.startswith(f"{SHIELD}."):
        return None
    place = FOLDER.joinpath(*name.split(".")[2:])
    inside = place.relative_to(FOLDER.parent).as_posix()
    if (place / "__init__.py").is_file():
        return Source(name, place / "__init__.py", inside, True)
    file = place.with_suffix(".py")
    return Source(name, file, inside, False) if file.is_file() else None


def sources() -> dict[str, Source]:
    """All modules that `ROOTS` need when they are imported, by name, stand-ins' own places among them."""
    found: dict[str, Source] = {}
    todo = list(ROOTS)
    while todo:
        name = todo.pop()
        source = None if name in found else source_of(name)
        if source is None:
            continue
        found[name] = source
        if name not in STAND_INS:
            todo += _imported(source)
    return found


def _imported(source: Source) -> list[str]:
    """Names of modules that are imported with a module; packages above it need none of theirs."""
    names = []
    for node in ast.parse(source.path.read_text()).body:
        if isinstance(node, ast.ImportFrom) and node.level:
            base = source.imports(node)
            names += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    return names
