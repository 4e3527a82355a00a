"""What a function of foreign code can be called with, found before the game instead of in every step of it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from typing import Any


def call_fault(function: Callable[..., Any], arguments: Sequence[str]) -> str | None:
    """Why a function cannot be called with so many arguments and answer at once; None when it can.

    Args:
        function: as it is called, bound.
        arguments: their names, for the text.
    """
    if inspect.iscoroutinefunction(function) or inspect.isgeneratorfunction(function):
        return "is a coroutine or generator, which answers nothing when it is called; return the action"
    if inspect.isasyncgenfunction(function):
        return "is an asynchronous generator; return the action"
    try:
        signature = inspect.signature(function)
    except Exception:  # built-in functions tell nothing; foreign ones may raise anything
        return None
    try:
        signature.bind(*arguments)
    except TypeError:
        return f"takes {_listed(signature)}, and is called with ({', '.join(arguments)})"
    return None


def _listed(signature: inspect.Signature) -> str:
    named = [
        f"{entry.name}=" if entry.kind == entry.KEYWORD_ONLY else entry.name for entry in signature.parameters.values()
    ]
    return f"({', '.join(named)})"
