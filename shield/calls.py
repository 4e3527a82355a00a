"""Calls with wrong arguments, told in words that help, in place of Python's."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from typing import Any, TypeVar, cast

from .exceptions import CallError

Called = TypeVar("Called", bound=Callable[..., Any])


def checked_calls(hint: Callable[[str], str] | None = None) -> Callable[[Called], Called]:
    """Let wrong arguments of a function, or of a class's constructor, end in a `CallError` that names the right ones.

    Args:
        hint: says what to do about an unknown keyword; empty: the nearest known ones are named.
    """

    def decorate(target: Called) -> Called:
        if isinstance(target, type):
            cls: Any = target
            cls.__init__ = decorate(cls.__init__)
            return target

        @functools.wraps(target)
        def called(*args: Any, **given: Any) -> Any:
            try:
                return target(*args, **given)
            except TypeError as error:
                explain(error, target, args, given, hint)
                raise

        return cast(Called, called)

    return decorate


def explain(
    error: TypeError,
    function: Callable[..., Any],
    args: Sequence[Any],
    given: Mapping[str, Any],
    hint: Callable[[str], str] | None = None,
) -> None:
    """Raise a `CallError` if a function does not take these arguments; else the error came from within."""
    if isinstance(error, CallError):
        return
    signature = inspect.signature(function)
    try:
        signature.bind(*args, **given)
    except TypeError as fault:
        raise CallError(_words(function, signature, len(args), given, hint) or str(fault)) from None


def _words(
    function: Callable[..., Any],
    signature: inspect.Signature,
    count: int,
    given: Mapping[str, Any],
    hint: Callable[[str], str] | None,
) -> str:
    names = [name for name in signature.parameters if name not in ("self", "cls")]
    name = function.__qualname__.removesuffix(".__init__")
    count -= len(signature.parameters) - len(names)
    for word in given:
        if word not in names:
            near = get_close_matches(word, names, 2)
            told = (hint(word) if hint else "") or (
                f"did you mean {' or '.join(f'{one}=' for one in near)}?" if near else f"it takes {', '.join(names)}"
            )
            return f"{name} has no {word}=; {told}"
    positional = [one for one in names if signature.parameters[one].kind != inspect.Parameter.KEYWORD_ONLY]
    if count > len(positional):
        return f"{name} got {count} arguments without a name and takes ({', '.join(positional)}); name the others"
    empty = inspect.Parameter.empty
    here = {*positional[:count], *given}
    missing = [one for one in names if one not in here and signature.parameters[one].default is empty]
    return f"{name} was called without {', '.join(missing)}; it takes {', '.join(names)}" if missing else ""
