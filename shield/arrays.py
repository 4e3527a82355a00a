"""Arrays as compiled code takes them: whatever is handed over becomes one type and one layout, or is refused."""

from __future__ import annotations

from typing import Any

import numpy as np

from .jit import Array, BoolArray, IntArray

LARGEST_WHOLE = 2**53
"""Whole numbers given as floats are exact up to here."""

_NUMERIC = "iufb"
_BOOLS = ("bool", "torch.bool")


class NoNumbersError(ValueError):
    """What was given holds no numbers; its text says why, for the message of whoever asked."""


def numbers(value: Any, bools: bool = False) -> Array:
    """Numbers of any kind as an array that compiled code knows: float64, C order, aligned, writeable.

    Such an array is handed on as it is; of any other (lists, tensors, whole numbers, float32, strided or read-only
    views) a copy is made. Compiled code would be compiled anew for each other kind, and would round in whole numbers.

    Args:
        value: numbers.
        bools: True and False are 1 and 0; else they are no numbers: a mask or a flag in the place of a speed or heading
            is a mistake.

    Raises:
        NoNumbersError: it holds something else: texts, complex numbers, masked values, rows of unlike length.
    """
    if type(value) is np.ndarray and value.dtype == np.float64 and value.flags.carray:
        return value
    found = _plain(value)
    if not bools and (found.dtype == np.bool_ or holds_bools(value)):
        raise NoNumbersError("some are True or False")
    return np.require(found, np.float64, ["C", "A", "W"])


def holds_bools(value: Any) -> bool:
    """Whether an entry is True or False, Python's, numpy's or a tensor's, at any depth of lists and tuples."""
    if type(value) in (list, tuple):
        return any(map(holds_bools, value))
    if isinstance(value, np.ndarray) and value.dtype.kind == "O":
        return any(map(holds_bools, value.flat))
    return isinstance(value, bool) or str(getattr(value, "dtype", None)) in _BOOLS


def truths(value: Any) -> BoolArray:
    """True or False of each entry, laid out likewise; 0 and 1 will do.

    Raises:
        NoNumbersError: an entry is neither, as NaN.
    """
    if type(value) is np.ndarray and value.dtype == np.bool_ and value.flags.carray:
        return value
    found = numbers(value, bools=True)
    if not ((found == 0.0) | (found == 1.0)).all():
        raise NoNumbersError(f"a value that is neither True nor False: {_short(found)}")
    yes: BoolArray = found == 1.0
    return yes


def whole_numbers(value: Any) -> IntArray:
    """Whole numbers as int64, laid out likewise, exact.

    Raises:
        NoNumbersError: an entry is a fraction, not finite or beyond what int64 (as a float: 2^53) holds.
    """
    if type(value) is np.ndarray and value.dtype == np.int64 and value.flags.carray:
        return value
    found = _plain(value)
    if found.dtype.kind == "f" and found.size:
        if not (np.isfinite(found).all() and (found == np.round(found)).all()):
            raise NoNumbersError(f"a value that is not a whole number: {_short(found)}")
        if np.abs(found).max() > LARGEST_WHOLE:
            raise NoNumbersError(f"a number too large to be told from its neighbours: {_short(found)}")
    if found.dtype.kind == "u" and found.size and found.max() > np.iinfo(np.int64).max:
        raise NoNumbersError(f"a number beyond 64 bits: {_short(found)}")
    return np.require(found, np.int64, ["C", "A", "W"])


def _plain(value: Any) -> np.ndarray:
    """An array of a numeric type."""
    try:
        found = np.asarray(_without_gradient(value))
        if np.ma.is_masked(value):
            raise NoNumbersError("some values are masked; fill them in")
        if found.dtype.kind == "O":
            found = _of_objects(found)
    except NoNumbersError:
        raise
    except Exception as error:  # what is handed over may be anything, and raise anything
        raise NoNumbersError(_short(error)) from None
    if found.dtype.kind not in _NUMERIC:
        raise NoNumbersError(f"they are {'texts' if found.dtype.kind in 'US' else found.dtype}")
    return found


def _of_objects(found: np.ndarray) -> np.ndarray:
    """Python's own numbers, as large whole ones; None is NaN."""
    entries = [_without_gradient(entry) for entry in found.flat]
    if any(isinstance(entry, (str, bytes)) for entry in entries):
        raise NoNumbersError("some are texts")
    if entries and all(isinstance(entry, int) for entry in entries):
        if any(abs(entry) > np.iinfo(np.int64).max for entry in entries):
            raise NoNumbersError(f"a number beyond 64 bits: {_short(entries)}")
        return np.array(entries, np.int64).reshape(found.shape)
    return np.array([np.nan if entry is None else float(entry) for entry in entries]).reshape(found.shape)


def _without_gradient(value: Any) -> Any:
    """A tensor's numbers, wherever they are and whatever belongs to them, in lists too; anything else as it is."""
    if type(value) in (list, tuple):
        return [_without_gradient(entry) for entry in value]
    if not hasattr(value, "detach"):
        return value
    plain = value.detach().cpu()
    if plain.is_floating_point():
        plain = plain.double()  # numpy knows no bfloat16
    return plain.numpy()


def _short(what: object, length: int = 120) -> str:
    text = " ".join(str(what.tolist() if isinstance(what, np.ndarray) else what).split())
    return text if len(text) <= length else text[: length - 1] + "…"
