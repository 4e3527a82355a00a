"""Settings of the whole process: what foreign code changes in them is its own, and gone while other code runs."""

from __future__ import annotations

import builtins
import contextlib
import decimal
import gc
import json
import locale
import logging
import math
import os
import random
import signal
import sys
import threading
import time
import warnings
from collections.abc import Callable
from typing import Any

import numpy as np

Part = tuple[Callable[[], Any], Callable[[Any], None]]
"""How a setting is read and written."""
PATCHED = (builtins, json, math, os, random, sys, threading, time, warnings, np, np.random)
"""Modules whose names foreign code may have given another meaning; names it added stay."""
DECIMAL = ("prec", "rounding", "Emin", "Emax", "capitals", "clamp")
_NAMED = ("INT", "TERM", "HUP", "QUIT", "ALRM", "PROF", "USR1", "USR2", "CHLD", "PIPE", "ABRT", "FPE", "SEGV", "CONT")
SIGNALS = [getattr(signal, f"SIG{name}") for name in _NAMED if hasattr(signal, f"SIG{name}")]


class Settings:
    """One owner's settings of the process: `enter` before its code runs, `leave` when it is done."""

    def __init__(self) -> None:
        self._own: list[Any] = [None] * len(PARTS)
        self._outer: list[Any] = []

    def enter(self) -> None:
        """Remember what others have set, and put in place what the owner had changed."""
        self._outer = [_read(part) for part in PARTS]
        _write(self._own)

    def leave(self) -> None:
        """Remember what the owner has changed, and put back what others have set."""
        now = [_read(part) for part in PARTS]
        self._own = [_difference(value, outer) for value, outer in zip(now, self._outer, strict=True)]
        _write(self._outer)


def _difference(value: Any, outer: Any) -> Any:
    """What is to be written for a value to be had where the other is; None: nothing."""
    if isinstance(value, Names) and isinstance(outer, Names):
        changed = [
            {} if mine == theirs else {name: item for name, item in mine.items() if theirs.get(name) is not item}
            for mine, theirs in zip(value, outer, strict=True)
        ]
        return Names(changed) if any(changed) else None
    with contextlib.suppress(Exception):  # arrays have no one answer: changed
        return None if bool(value == outer) else value
    return value


class Names(list[dict[str, Any]]):
    """What the names of `PATCHED` mean, module by module."""


def _read(part: Part) -> Any:
    with contextlib.suppress(Exception):
        return part[0]()
    return None


def _write(values: list[Any]) -> None:
    for part, value in zip(PARTS, values, strict=True):
        if value is not None:
            with contextlib.suppress(Exception):  # one that cannot be put back must not keep the others
                part[1](value)


def _changed(to: Any, items: Any, keep: bool = False) -> None:
    """Give a mapping other items, touching only what differs; ``keep``: leave those that were added."""
    if not keep:
        for name in [name for name in to if name not in items]:
            del to[name]
    for name, value in items.items():
        if name not in to or to[name] is not value:
            to[name] = value


def _names() -> Names:
    return Names(dict(vars(module)) for module in PATCHED)


def _set_names(values: Names) -> None:
    for module, names in zip(PATCHED, values, strict=True):
        if vars(module) != names:
            _changed(vars(module), names, keep=True)


def _environment() -> dict[Any, Any]:
    return dict(_variables())


def _set_environment(values: dict[Any, Any]) -> None:
    if values == _variables():
        return
    zone = os.environ.get("TZ")
    encoded = values and isinstance(next(iter(values)), bytes)
    _changed(os.environ, {os.fsdecode(k): os.fsdecode(v) for k, v in values.items()} if encoded else values)
    if os.environ.get("TZ") != zone and hasattr(time, "tzset"):
        time.tzset()


def _variables() -> Any:
    """The environment as it is kept, encoded: quicker to copy and compare."""
    return getattr(os.environ, "_data", os.environ)


def _lists() -> list[list[Any]]:
    return [list(sys.path), list(sys.meta_path), list(sys.path_hooks), list(warnings.filters)]


def _set_lists(values: list[list[Any]]) -> None:
    for kept, items in zip((sys.path, sys.meta_path, sys.path_hooks, warnings.filters), values, strict=True):
        if kept != items:
            kept[:] = items
    warnings._filters_mutated() if hasattr(warnings, "_filters_mutated") else None


def _limits() -> tuple[Any, ...]:
    return sys.getrecursionlimit(), sys.getswitchinterval(), gc.isenabled(), gc.get_threshold()


def _set_limits(values: tuple[Any, ...]) -> None:
    if values != _limits():
        sys.setrecursionlimit(values[0])
        sys.setswitchinterval(values[1])
        (gc.enable if values[2] else gc.disable)()
        gc.set_threshold(*values[3])


def _log() -> tuple[Any, ...]:
    loggers = [logging.root, *(one for one in logging.root.manager.loggerDict.values() if hasattr(one, "handlers"))]
    state = [(one, one.level, one.disabled, one.propagate, list(one.handlers), list(one.filters)) for one in loggers]
    return state, logging.root.manager.disable, logging.raiseExceptions


def _set_log(values: tuple[Any, ...]) -> None:
    known = {id(state[0]) for state in values[0]}
    for one in logging.root.manager.loggerDict.values():
        if isinstance(one, logging.Logger) and id(one) not in known:  # made since: as if nobody had set anything
            one.setLevel(logging.NOTSET)
            one.disabled, one.propagate = False, True
            one.handlers[:], one.filters[:] = [], []
    for one, level, disabled, propagate, handlers, filters in values[0]:
        if one.level != level:
            one.setLevel(level)  # forgets what was worked out from it
        one.disabled, one.propagate = disabled, propagate
        if one.handlers != handlers or one.filters != filters:
            one.handlers[:], one.filters[:] = handlers, filters
    if logging.root.manager.disable != values[1]:
        logging.disable(values[1])
    logging.raiseExceptions = values[2]


def _handlers() -> dict[Any, Any]:
    """Signal handlers; None where signals are not this thread's."""
    if threading.current_thread() is not threading.main_thread():
        raise RuntimeError("signals are the main thread's")
    return {number: signal.getsignal(number) for number in SIGNALS}


def _set_handlers(values: dict[Any, Any]) -> None:
    for number, handler in values.items():
        if handler is not None and signal.getsignal(number) is not handler:
            signal.signal(number, handler)


def _alarm() -> tuple[float, float]:
    return signal.getitimer(signal.ITIMER_REAL)


def _set_alarm(value: tuple[float, float]) -> None:
    if value != (0.0, 0.0) or _alarm() != (0.0, 0.0):
        signal.setitimer(signal.ITIMER_REAL, *value)


def _numbers() -> tuple[Any, ...]:
    context = decimal.getcontext()
    how = tuple(getattr(context, name) for name in DECIMAL), dict(context.traps)
    return np.geterr(), np.geterrcall(), np.get_printoptions(), how, locale.setlocale(locale.LC_ALL)


def _set_numbers(values: tuple[Any, ...]) -> None:
    if values == _numbers():
        return
    np.seterr(**values[0])
    np.seterrcall(values[1])
    np.set_printoptions(**{name: value for name, value in values[2].items() if name != "override_repr"})
    context = decimal.getcontext()
    for name, value in zip(DECIMAL, values[3][0], strict=True):
        setattr(context, name, value)
    context.traps.update(values[3][1])
    locale.setlocale(locale.LC_ALL, values[4])


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
    return (
        torch.get_default_dtype(),
        torch.get_num_threads(),
        torch.is_grad_enabled(),
        torch.are_deterministic_algorithms_enabled(),
        torch.get_rng_state(),
    )


def _set_torch(values: Any) -> None:
    torch: Any = sys.modules["torch"]
    dtype, threads, grad, exact, state = values
    torch.set_default_dtype(dtype)
    if torch.get_num_threads() != threads:
        torch.set_num_threads(threads)
    torch.set_grad_enabled(grad)
    if torch.are_deterministic_algorithms_enabled() != exact:
        torch.use_deterministic_algorithms(exact)
    torch.set_rng_state(state)


PARTS: tuple[Part, ...] = (
    (_names, _set_names),  # first: what it patched may be what the others are read and written with
    (_environment, _set_environment),
    (_lists, _set_lists),
    (_limits, _set_limits),
    (_log, _set_log),
    (_handlers, _set_handlers),
    (_alarm, _set_alarm),
    (_numbers, _set_numbers),
    (_chance, _set_chance),
    (_torch, _set_torch),
)
