"""What an entry imports, read from its files without running them."""

from __future__ import annotations

import ast
import importlib.util
import sys
from dataclasses import dataclass
from pathlib import Path

from steerclear.policies.submissions.stage import Stage


@dataclass(frozen=True)
class Imports:
    """Names of modules, each once, in order of the alphabet.

    Attributes:
        needed: packages beyond Python's own and the entry's own files.
        missing: those of them that are not installed here.
        unread: files that are no Python this interpreter reads.
    """

    needed: tuple[str, ...]
    missing: tuple[str, ...]
    unread: tuple[str, ...]


def imports_of(path: str | Path) -> Imports:
    """Read what the files of a submission import."""
    stage = Stage(path)
    try:
        files = sorted(file for file in stage.folder.rglob("*.py") if "working_dir" not in file.parts)
        own = {file.stem for file in files} | {part for file in files for part in file.relative_to(stage.folder).parts}
        found = {str(file.relative_to(stage.folder)): _imported(file) for file in files}
    finally:
        stage.close()
    names = {name for some in found.values() for name in some or ()}
    needed = sorted(names - own - set(sys.stdlib_module_names))
    unread = [file for file, some in found.items() if some is None]
    return Imports(tuple(needed), tuple(name for name in needed if not _is_here(name)), tuple(unread))


def _imported(file: Path) -> set[str] | None:
    """Top names of the modules that a file imports; None where it cannot be read."""
    try:
        tree = ast.parse(file.read_bytes())
    except (SyntaxError, ValueError, RecursionError, MemoryError, OSError):
        return None
    names: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            names.add(node.module.split(".")[0])
    return names


def _is_here(name: str) -> bool:
    """Whether a module can be imported here, without importing it."""
    try:
        return importlib.util.find_spec(name) is not None
    except (ImportError, ValueError):
        return False
