"""The one way to compile functions here.

Machine code is made of each function that Python calls, with everything it calls, see `whole_program`, and stored on
disk. Fast-math stays off: results must be the same bits everywhere, and NaN tests must work.
"""

from __future__ import annotations

import hashlib
import logging
import os
import pickle
import sys
import tempfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
from numba.core import compiler, config
from numba.core.caching import NullCache
from numba.core.serialize import dumps
from numpy.typing import NDArray

LOG = logging.getLogger(__name__)
F = TypeVar("F", bound=Callable[..., Any])
Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]

COMPILE_NOTHING = ("shield/bridge", "shield/wrappers", "env/render", "policies/submissions", "policies/entrants")
"""Folders without compiled functions, or anything that these use: changes there do not recompile."""


def kernel(function: F) -> F:
    """Compile a function with numba: cached on disk, without the GIL, IEEE division (no ZeroDivisionError)."""
    return _compiled(function, counted=True)


def lean_kernel(function: F) -> F:
    """Compile a function that makes no arrays: its arguments stay the caller's and are not reference-counted."""
    return _compiled(function, counted=False)


def _compiled(function: F, counted: bool) -> F:
    if getattr(config, "DISABLE_JIT", False):
        return function
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": counted}
    if _whole_program() is None:
        return cast(F, numba.njit(**options)(function))
    options["nopython"] = True
    name = f"{function.__module__}.{function.__qualname__}.{function.__code__.co_firstlineno}"
    kept = _Kept(name, function.__code__.co_filename)
    return cast(F, _whole_program().Kernel(function, targetoptions=options, kept=kept))


@cache
def _whole_program() -> Any:
    """Return the module `whole_program`; None if this numba differs from the one it is written for."""
    try:
        from . import whole_program

        differs = whole_program.unlike()
    except (ImportError, AttributeError) as error:
        differs = str(error)
    if not differs:
        return whole_program
    _say(f"numba {numba.__version__} is not as expected ({differs}): all is compiled at every start, some minutes")
    return None


ROOT = Path(__file__).parent.parent


def _beside(file: str) -> Path | None:
    """Return the folder whose sources a function of that file may depend on besides the shield's; None: none."""
    if Path(file).is_relative_to(ROOT / "experiments"):
        return ROOT / "experiments"
    return None if Path(file).is_relative_to(ROOT) else Path(file).parent  # a user's barrier


@cache
def _stamp(beside: Path | None) -> str:
    """Return a digest of all that machine code may depend on, at import: sources, ``beside``, numba, the machine."""
    digest = hashlib.sha256(f"{numba.__version__} {sys.version}".encode())
    paths = {path for name in ("shield", "env", "policies") for path in (ROOT / name).rglob("*.py")}
    paths = {path for path in paths if not path.relative_to(ROOT).as_posix().startswith(COMPILE_NOTHING)}
    for path in sorted(paths | set(beside.rglob("*.py") if beside else ())):
        name = path.relative_to(ROOT) if path.is_relative_to(ROOT) else path
        try:
            digest.update(str(name).encode() + path.read_bytes())
        except OSError:  # it may change unseen: no stored code is found again
            digest.update(os.urandom(16))
    return digest.hexdigest()


@cache
def kept_in() -> Path | None:
    """Return the folder where machine code is stored; None: nowhere."""
    given = getattr(config, "CACHE_DIR", "")
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache").expanduser() / "steerclear"
    for place in [Path(given)] if given else [Path(__file__).parent / "__pycache__", home]:
        try:
            place.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=place).close()
        except OSError:
            continue
        return place
    _say("compiled code can be kept nowhere: a minute at every start; set NUMBA_CACHE_DIR to a folder for it")
    return None


class _Kept(NullCache):
    """Machine code on disk, one checksummed file each; failures never stop the program."""

    def __init__(self, name: str, file: str) -> None:
        self._name, self._stamp = name, _stamp(_beside(file))

    def _path(self, args: Any, context: Any) -> Path | None:
        about = repr((self._name, args, context.codegen().magic_tuple(), self._stamp))
        place = kept_in()
        return None if place is None else place / f"{self._name}.{hashlib.sha256(about.encode()).hexdigest()[:32]}.code"

    def load_overload(self, args: Any, context: Any) -> Any:
        """Return the code for some arguments; None if there is none."""
        try:
            path = self._path(args, context)
            sealed = b"" if path is None else path.read_bytes()
            if sealed and hashlib.sha256(sealed[32:]).digest() == sealed[:32]:
                context.refresh()  # installs the C functions that the code calls by name
                return compiler.CompileResult._rebuild(context, *pickle.loads(sealed[32:]))
            if path is not None:
                _say(f"compiled code in {path.parent} cannot be read, it is made anew")
        except FileNotFoundError:
            _say("steerclear compiles its machine code, once: about a minute (steerclear warm-up does it beforehand)")
        except Exception as error:  # damaged files may raise anything
            _say(f"compiled code cannot be read, it is made anew ({error!r})")
        return None

    def save_overload(self, args: Any, made: Any) -> None:
        """Store code: written to a temporary file, then moved into place at once."""
        try:
            path, content = self._path(args, made.target_context), dumps(made._reduce())
            if path is not None:
                with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
                    file.write(hashlib.sha256(content).digest() + content)
                os.replace(file.name, path)
        except Exception as error:  # the code itself is valid
            _say(f"compiled code cannot be kept ({error!r}): a minute at every start")


@cache
def _say(words: str) -> None:
    LOG.warning("%s", words)


@lean_kernel
def copy_row(to: Array, source: Array) -> None:
    """Copy a row of numbers, as long as ``source``."""
    for k in range(source.shape[0]):
        to[k] = source[k]
