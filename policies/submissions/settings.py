"""Settings of the whole process that a submission's answers hang on: each finds its own, and others theirs.

Games of the commands run submissions in processes of their own, where nothing they set concerns anybody else.
"""

from __future__ import annotations

import contextlib
import os
import random
import sys
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

Part = tuple[Callable[[], Any], Callable[[Any], object]]
"""How a setting is read and written."""


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
