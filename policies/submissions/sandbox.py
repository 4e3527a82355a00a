"""`Sandbox`: while a submission's code runs, its folder is the working directory and its modules are importable.

Settings of the whole process that its answers hang on are its own, too: what it changes is put back when its code
returns. This keeps submissions from meeting each other's files, modules and settings. It is no protection against
hostile code; games of the commands run submissions in processes of their own.
"""

from __future__ import annotations

import contextlib
import importlib.util
import os
import random
import sys
import uuid
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

Part = tuple[Callable[[], Any], Callable[[Any], object]]
"""How a setting is read and written."""


class Sandbox:
    """Working directory, import path and private modules of one submission.

    Two submissions may both have a ``utils.py``: what each imports from its own folder is taken out of ``sys.modules``
    when its code returns, and put back when its code runs again.

    Args:
        folder: where the submission's files are.
        alone: whether the process is the submission's, so that its settings are nobody else's.
    """

    def __init__(self, folder: Path, alone: bool = False) -> None:
        self._settings = None if alone else Settings()
        self.folder = str(folder)
        self._real = os.path.realpath(folder)
        self._own: dict[str, ModuleType] = {}
        self._names = importable_names(folder)

    @contextlib.contextmanager
    def active(self) -> Iterator[None]:
        """Run code as the submission expects to be run."""
        before = working_directory()
        if self._settings is not None:
            self._settings.enter()
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
            if self._settings is not None:
                self._settings.leave()
            if len(sys.modules) != n_modules:
                self._collect()
            for name in self._own:
                sys.modules.pop(name, None)
            sys.modules.update(displaced)

    def _displace(self) -> dict[str, ModuleType]:
        """Take out of ``sys.modules`` what other code loaded under names that the submission has too."""
        if not any(name in sys.modules for name in self._names):
            return {}
        taken = [name for name in sys.modules if name.partition(".")[0] in self._names]
        return {name: sys.modules.pop(name) for name in taken}

    def _collect(self) -> None:
        """Remember which modules came from the submission's folder."""
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

        The module is the top-level ``solution`` (its file's name) for ``import`` and for pickles, and at the same time
        part of a private package, so that ``from .helpers import x`` works too.
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
    """Top-level names that ``import`` finds in a folder, but for those of the standard library."""
    names = {path.stem for path in folder.glob("*.py")}
    names |= {path.parent.name for path in folder.glob("*/*.py")}
    return frozenset(names) - sys.stdlib_module_names


def working_directory() -> str | None:
    """The working directory, or None when it was removed."""
    try:
        return os.getcwd()
    except FileNotFoundError:
        return None


class Settings:
    """One owner's settings of the process: `enter` before its code runs, `leave` when it is done."""

    def __init__(self) -> None:
        self._own: list[Any] = [None] * len(PARTS)
        self._outer: list[Any] = []

    def enter(self) -> None:
        """Remember what others have set, and put in place what the owner had changed."""
        self._outer = [read() for read, _ in PARTS]
        _write(self._own)

    def leave(self) -> None:
        """Remember what the owner has set, and put back what others have set."""
        self._own = [read() for read, _ in PARTS]
        _write(self._outer)


def _write(values: list[Any]) -> None:
    for (_, write), value in zip(PARTS, values, strict=True):
        if value is not None:
            with contextlib.suppress(Exception):  # one that cannot be put back must not keep the others
                write(value)


def _set_environment(values: dict[str, str]) -> None:
    if values != dict(os.environ):
        os.environ.clear()
        os.environ.update(values)


def _lists() -> list[list[Any]]:
    return [list(sys.path), list(warnings.filters)]


def _set_lists(values: list[list[Any]]) -> None:
    both: tuple[Any, Any] = (sys.path, warnings.filters)
    for kept, items in zip(both, values, strict=True):
        if kept != items:
            kept[:] = items


def _chance() -> tuple[Any, ...]:
    return random.getstate(), np.random.get_state()  # noqa: NPY002 (the global ones that foreign code draws from)


def _set_chance(values: tuple[Any, ...]) -> None:
    random.setstate(values[0])
    np.random.set_state(values[1])  # noqa: NPY002


def _torch() -> Any:
    """PyTorch's settings; None as long as nobody has loaded it."""
    torch = sys.modules.get("torch")
    if torch is None or not hasattr(torch, "get_rng_state"):
        return None
    return torch.get_default_dtype(), torch.get_num_threads(), torch.is_grad_enabled(), torch.get_rng_state()


def _set_torch(values: Any) -> None:
    torch: Any = sys.modules["torch"]
    dtype, threads, grad, state = values
    torch.set_default_dtype(dtype)
    if torch.get_num_threads() != threads:
        torch.set_num_threads(threads)
    torch.set_grad_enabled(grad)
    torch.set_rng_state(state)


PARTS: tuple[Part, ...] = (
    (lambda: dict(os.environ), _set_environment),
    (_lists, _set_lists),
    (np.geterr, lambda values: np.seterr(**values)),
    (_chance, _set_chance),
    (_torch, _set_torch),
)
