"""The one way compiled functions are made here."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numba import njit, types
from numpy.typing import NDArray

from .compiled.kept_code import KeptCode

F = TypeVar("F", bound=Callable[..., Any])
Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


COMPILE_NOTHING = ("shield/bridge", "shield/wrappers", "env/render", "policies/submissions", "policies/entrants")
"""Folders that hold no compiled function, nor anything that one uses: changes there leave machine code as it is."""


@cache
def _tree_stamp() -> tuple[str, int]:
    """Stamp of all sources that may be compiled into one another, wherever they lie."""
    root = Path(__file__).parent.parent
    digest, files = hashlib.sha256(), 0
    for folder in ("shield", "env", "policies"):
        for path in sorted((root / folder).rglob("*.py")):
            name = path.relative_to(root).as_posix()
            if not name.startswith(COMPILE_NOTHING):
                digest.update(name.encode() + path.read_bytes())
                files += 1
    return digest.hexdigest(), files


def kernel(function: F) -> F:
    """Compile a function with numba: cached on disk, without the GIL, IEEE division (no ZeroDivisionError).

    Fast-math stays off: results must be the same bits everywhere, and NaN tests must work.
    """
    return _compiled(function, counted=True)


def lean_kernel(function: F) -> F:
    """The same for a function that makes no array: those it is handed stay its caller's, and are not counted.

    numba otherwise counts references at every call, to each array of each plain tuple (not of a `shared` one), which
    may cost more than the function does. Assigning a slice counts as making an array, see `copy_row`; compiling says
    so.
    """
    return _compiled(function, counted=False)


def _compiled(function: F, counted: bool) -> F:
    """Compile; numba's cache looks at a function's own file only, although callees of others are compiled into it.

    Its stamp is therefore replaced by one over all sources, so that no stale machine code is ever run.
    """
    options: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": counted}
    compiled: Any = njit(**options)(function)
    if hasattr(compiled, "get_call_template"):  # there is none where NUMBA_DISABLE_JIT is set
        compiled.get_call_template = _for_any_constant(compiled.get_call_template)
    compiled._cache = kept = KeptCode(function)
    kept.stamp = _tree_stamp()
    return cast(F, compiled)


def _for_any_constant(ask: Callable[..., Any]) -> Callable[..., Any]:
    """What a compiled caller asks for, without the values of constants: numba would compile anew for each of them."""

    def asked(args: Any, kws: Any) -> Any:
        return ask(tuple(map(types.unliteral, args)), {name: types.unliteral(kind) for name, kind in kws.items()})

    return asked


def kept_in() -> str:
    """Where machine code is kept, in words; empty: nowhere."""
    place = getattr(copy_row, "_cache").cache_path  # noqa: B009 (a dispatcher's; the type is the function's)
    root = Path(__file__).parent.parent
    if place is None:
        return ""
    if Path(place).is_relative_to(root):
        return f"{root}, in the __pycache__ folders"
    return str(Path(place).parent)


@lean_kernel
def copy_row(to: Array, source: Array) -> None:
    """Copy a row of numbers, as long as ``source``."""
    for k in range(source.shape[0]):
        to[k] = source[k]
