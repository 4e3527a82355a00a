"""Conversion of arrays from callers to one type and layout, or an error; warnings about likely mistakes of units.

Other kinds of arrays would be compiled anew, and whole numbers would round.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

import numpy as np

from .exceptions import FleetError
from .jit import Array, BoolArray, IntArray

_LOG = logging.getLogger(__name__)

LARGEST_WHOLE = 2**53
"""Whole numbers given as floats are exact up to here."""

MOST_RAD = 10.0
"""Headings beyond this are probably not radians: a turn and a half, plus rounding."""

_said: set[str] = set()


class NoNumbersError(ValueError):
    """A value holds no numbers; the text says why, for the caller's message."""


def numbers(value: Any, bools: bool = False) -> Array:
    """Return numbers of any kind as float64, C order, aligned, writeable; an array of this kind is returned itself.

    Args:
        value: numbers, in lists, arrays, tensors; None is NaN.
        bools: accept True and False as 1 and 0; otherwise they are an error: a mask in place of a speed is a mistake.

    Raises:
        NoNumbersError: it holds something else: texts, complex numbers, masked values, rows of unlike length.
    """
    if type(value) is np.ndarray and value.dtype == np.float64 and value.flags.carray:
        return value
    found = _plain(value)
    if not bools and (found.dtype == np.bool_ or holds_bools(value)):
        raise NoNumbersError("some are True or False")
    return np.require(found, np.float64, ["C", "A", "W"])


def truths(value: Any) -> BoolArray:
    """Return True or False of each entry, laid out likewise; 0 and 1 are accepted.

    Raises:
        NoNumbersError: an entry is neither, such as NaN.
    """
    if type(value) is np.ndarray and value.dtype == np.bool_ and value.flags.carray:
        return value
    found = numbers(value, bools=True)
    if not ((found == 0.0) | (found == 1.0)).all():
        raise NoNumbersError(f"a value that is neither True nor False: {_short(found)}")
    yes: BoolArray = found == 1.0
    return yes


def whole_numbers(value: Any) -> IntArray:
    """Return whole numbers as int64, laid out likewise, exact.

    Raises:
        NoNumbersError: an entry is a fraction, not finite or beyond what int64 (as a float: 2^53) holds.
    """
    if type(value) is np.ndarray and value.dtype == np.int64 and value.flags.carray:
        return value
    found = _plain(value)
    if found.dtype.kind == "f" and not (np.isfinite(found).all() and (found == np.round(found)).all()):
        raise NoNumbersError(f"a value that is not a whole number: {_short(found)}")
    most = LARGEST_WHOLE if found.dtype.kind == "f" else np.iinfo(np.int64).max
    if found.dtype.kind in "fu" and (np.abs(found) > most).any():
        raise NoNumbersError(f"a number too large to be told from its neighbours: {_short(found)}")
    return np.require(found, np.int64, ["C", "A", "W"])


_SORTS: dict[Callable[[Any], Any], str] = {numbers: "numbers", truths: "True or False", whole_numbers: "whole numbers"}


def shaped(name: str, value: Any, shape: tuple[int | None, ...], brought: Callable[[Any], Any] = numbers) -> Any:
    """Return an array of that shape (None matches any length), as compiled code takes it.

    An empty list fits any shape whose first length may be 0.

    Raises:
        FleetError: it is not such an array; ``name`` says which argument.
    """
    expected = tuple("n" if size is None else size for size in shape)
    try:
        array = brought(value)
    except NoNumbersError as error:
        raise FleetError(
            f"{name} is not an array of {_SORTS[brought]} ({error}); give one of shape {expected}"
        ) from None
    if array.shape == (0,) and shape[0] in (None, 0):
        array = array.reshape(0, *(size or 0 for size in shape[1:]))
    if array.ndim != len(shape) or any(w not in (None, g) for w, g in zip(shape, array.shape, strict=True)):
        raise FleetError(f"{name} has shape {array.shape}; expected {expected}")
    return array


def holds_bools(value: Any) -> bool:
    """Return whether an entry is True or False (Python, numpy or tensor), at any depth of lists and tuples."""
    if type(value) in (list, tuple):
        return any(map(holds_bools, value))
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":
        return any(map(holds_bools, value.flat))
    return isinstance(value, bool) or str(getattr(value, "dtype", None)) in ("bool", "torch.bool")


def _plain(value: Any) -> np.ndarray:
    """Return an array of a numeric type."""
    try:
        found = np.asarray(_without_gradient(value))
        if np.ma.is_masked(value):
            raise NoNumbersError("some values are masked; fill them in")
        if found.dtype.kind == "O":
            if any(isinstance(entry, (str, bytes)) for entry in found.flat):
                raise NoNumbersError("some are texts")
            found = np.array([np.nan if entry is None else float(entry) for entry in found.flat]).reshape(found.shape)
    except NoNumbersError:
        raise
    except Exception as error:  # foreign objects may raise anything
        raise NoNumbersError(_short(error)) from None
    if found.dtype.kind not in "iufb":
        raise NoNumbersError(f"they are {'texts' if found.dtype.kind in 'US' else found.dtype}")
    return found


def _without_gradient(value: Any) -> Any:
    """Return a tensor's numbers, from any device and without its gradient, in lists too; anything else unchanged."""
    if type(value) in (list, tuple):
        return [_without_gradient(entry) for entry in value]
    if not hasattr(value, "detach"):
        return value
    plain = value.detach().cpu()
    return (plain.double() if plain.is_floating_point() else plain).numpy()  # numpy knows no bfloat16


def _short(what: object, length: int = 120) -> str:
    text = " ".join(str(what.tolist() if isinstance(what, np.ndarray) else what).split())
    return text if len(text) <= length else text[: length - 1] + "…"


def say_once(topic: str, words: str) -> None:
    """Log a warning the first time a topic comes up in this process."""
    if topic not in _said:
        _said.add(topic)
        _LOG.warning(words)


def hint_at_degrees(what: str, heading_rad: Array, remedy: str) -> None:
    """Warn once if headings in rad look like degrees."""
    largest = np.abs(heading_rad).max(initial=0.0, where=np.isfinite(heading_rad))
    if largest > MOST_RAD:
        turns = largest / (2.0 * np.pi)
        say_once(what, f"{what} holds {largest:g} rad, {turns:.3g} turns; if these are degrees {remedy}")
