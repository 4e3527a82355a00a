"""`Sandbox`: while a submission's code runs, its folder is the working directory and its modules are importable.

This keeps submissions from meeting each other's files and modules. What they set for the whole process stays set, and
it is no protection against hostile code: games of the commands run submissions in processes of their own.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import sys
import uuid
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any


class Sandbox:
    """Working directory, import path and private modules of one submission.

    Two submissions may both have a ``utils.py``. When the code of one returns, the modules from its own folder are
    removed from ``sys.modules``. They are put back when its code runs again.

    Args:
        folder: the folder of the submission's files.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = str(folder)
        self._real = os.path.realpath(folder)
        self._own: dict[str, ModuleType] = {}
        self._names = importable_names(folder)

    @contextlib.contextmanager
    def active(self) -> Iterator[None]:
        """While inside, run code in the environment that the submission expects."""
        before = working_directory()
        displaced = self._displace()
        sys.modules.update(self._own)
        n_modules = len(sys.modules)
        if self.folder not in sys.path[:1]:
            sys.path.insert(0, self.folder)
        try:
            os.chdir(self.folder)
            yield
        finally:
            if before is not None:
                os.chdir(before)
            with contextlib.suppress(ValueError):
                sys.path.remove(self.folder)
            if len(sys.modules) != n_modules:
                self._collect()
            for name in self._own:
                sys.modules.pop(name, None)
            sys.modules.update(displaced)

    def _displace(self) -> dict[str, ModuleType]:
        """Remove from ``sys.modules`` what other code has loaded under names of the submission."""
        if not any(name in sys.modules for name in self._names):
            return {}
        taken = [name for name in sys.modules if name.partition(".")[0] in self._names]
        return {name: sys.modules.pop(name) for name in taken}

    def _collect(self) -> None:
        """Store the modules that came from the submission's folder."""
        for name, module in list(sys.modules.items()):
            if name not in self._own and self._is_own(module):
                self._own[name] = module

    def _is_own(self, module: Any) -> bool:
        known = getattr(module, "__dict__", {})  # not getattr: some modules make up any attribute
        places = [known.get("__file__"), *(known.get("__path__") or ())]
        return any(self._contains(place) for place in places if isinstance(place, str))

    def _contains(self, place: str) -> bool:
        return any(place.startswith(folder + os.sep) or place == folder for folder in (self.folder, self._real))

    def load(self, file: str) -> ModuleType:
        """Run a file of the folder as a module; call it inside `active`.

        The module is the top-level ``solution`` (its file's name) for ``import`` and for pickles. It is also part of a
        private package, so that ``from .helpers import x`` works.
        """
        stem = Path(file).stem
        package = ModuleType(f"submission_{uuid.uuid4().hex}")
        package.__path__ = [self.folder]
        spec = importlib.util.spec_from_file_location(f"{package.__name__}.{stem}", os.path.join(self.folder, file))
        if spec is None or spec.loader is None:
            raise ImportError(f"{file} is no Python file")
        module = importlib.util.module_from_spec(spec)
        own = {package.__name__: package, spec.name: module, stem: module}
        sys.modules.update(own)
        self._own.update(own)
        importlib.invalidate_caches()
        spec.loader.exec_module(module)
        return module


def importable_names(folder: Path) -> frozenset[str]:
    """Return the top-level names that ``import`` finds in a folder, without those of the standard library."""
    names = {path.stem for path in folder.glob("*.py")}
    names |= {path.parent.name for path in folder.glob("*/*.py")}
    return frozenset(names) - sys.stdlib_module_names


def working_directory() -> str | None:
    """Return the working directory, or None if it was removed."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None
