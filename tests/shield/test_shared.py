"""Shared tuples read in compiled code as the tuples do, and count no references."""

import copy
import gc
import pickle
import sys
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit, typeof
from numba.core.errors import TypingError
from steerclear.shield.jit import kernel, lean_kernel
from steerclear.shield.shared import Shared, share


class Inner(NamedTuple):
    """Numbers of every kind."""

    flag: bool
    count: int
    bytes_: np.ndarray


class Outer(NamedTuple):
    """A number, arrays of one and two dimensions, a tuple and a shared one."""

    speed: float
    row: np.ndarray
    table: np.ndarray
    inner: Inner
    shared: Inner


def read(of):
    """Sum of all there is, weighted, so that no two places count the same."""
    total = 3.0 * of.speed
    for i in range(of.row.shape[0]):
        total += (5.0 + i) * of.row[i]
    for i in range(of.table.shape[0]):
        for j in range(of.table.shape[1]):
            total += (7.0 + 11.0 * i + 13.0 * j) * of.table[i, j]
    total += 17.0 * of.inner.count + (23.0 if of.inner.flag else 0.0)
    total += 29.0 * of.shared.count + (31.0 if of.shared.flag else 0.0)
    for k in range(of.inner.bytes_.shape[0]):
        total += (37.0 + k) * of.inner.bytes_[k]
    for k in range(of.shared.bytes_.shape[0]):
        total += (41.0 + k) * of.shared.bytes_[k]
    return total


read_lean, read_counted = lean_kernel(read), kernel(read)


@lean_kernel
def fill(of, value):
    """Write into the arrays of a tuple."""
    of.row[0] = value
    of.table[1, 1] = value


@njit
def get_x(of):
    """One field."""
    return of.x


def outer(seed=0, rows=3, columns=4, of=Outer):
    """A tuple of drawn numbers, nothing shared but its last field."""
    draw = np.random.default_rng(seed)
    inner = [
        Inner(bool(draw.integers(2)), int(draw.integers(9)), draw.integers(0, 9, k).astype(np.uint8)) for k in (2, 3)
    ]
    return of(
        float(draw.normal()), draw.normal(size=rows), draw.normal(size=(rows, columns)), inner[0], share(inner[1])
    )


@settings(deadline=None, max_examples=60)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5), st.integers(0, 5))
def test_compiled_code_reads_what_python_reads(seed, rows, columns):
    plain = outer(seed, rows, columns)
    same = share(plain)
    assert read_lean(same) == read_counted(same) == read(same) == read(plain)


def test_what_compiled_code_writes_is_seen():
    plain = outer()
    fill(share(plain), 42.0)
    assert plain.row[0] == plain.table[1, 1] == 42.0


def test_arrays_live_as_long_as_what_shares_them():
    expected = read(outer(5))
    shared = share(outer(5))
    gc.collect()
    others = [np.full(k, np.nan) for k in (3, 12, 3, 12, 3, 12)]  # take the room of arrays that were let go
    assert read_lean(shared) == read_counted(shared) == expected
    assert all(np.isnan(other).all() for other in others)


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda shared: pickle.loads(pickle.dumps(shared))])
def test_copies_are_their_own(copied):
    expected, original = read(outer(6)), share(outer(6))
    twin = copied(original)
    assert read_lean(twin) == expected
    fill(twin, 42.0)
    assert twin.row[0] == 42.0
    assert read_lean(original) == expected
    del original
    gc.collect()
    assert read_lean(twin) == read(twin) != expected


def test_no_reference_is_gained_or_lost():
    plain = outer()
    shared = share(plain)
    arrays = [plain.row, plain.table, plain.inner.bytes_, plain.shared.bytes_]
    before = [sys.getrefcount(array) for array in arrays]
    for _ in range(50):
        read_lean(shared), read_counted(shared), share(plain)
    assert [sys.getrefcount(array) for array in arrays] == before


@pytest.mark.parametrize("value", ["text", 1j, None, [1.0], np.float32(1.0)])
def test_what_has_no_place_in_memory_is_refused(value):
    with pytest.raises(TypeError, match="cannot be shared"):
        share(Inner(True, 1, value))


class Array(NamedTuple):
    """One array."""

    a: np.ndarray


@kernel
def described(of):
    """All that compiled code knows of an array."""
    a = of.a
    return a.size, a.itemsize, a.nbytes, a.ndim, a.shape, a.strides, a.ctypes.data


DRAWN = np.arange(60.0).reshape(3, 4, 5)
FROZEN = np.arange(6.0)
FROZEN.setflags(write=False)


@pytest.mark.parametrize(
    "a",
    [
        DRAWN,
        np.asfortranarray(DRAWN),
        DRAWN[:, ::2, 1:],
        DRAWN[::-1],
        FROZEN,
        np.zeros((0, 3)),
        np.array(2.5),
        np.array([True, False]),
        np.arange(5, dtype=np.uint8),
        np.arange(5, dtype=np.int64)[::2],
    ],
    ids=["C", "Fortran", "strided", "reversed", "read-only", "empty", "no dimension", "bool", "bytes", "every other"],
)
def test_arrays_lie_where_they_lie(a):
    assert described(share(Array(a))) == (a.size, a.itemsize, a.nbytes, a.ndim, a.shape, a.strides, a.ctypes.data)


def test_tuples_of_one_name_are_told_apart():
    """Compiled code would read one's fields in the order of the other's."""

    def pair(first, second):
        return NamedTuple("Pair", [(first, float), (second, int)])

    of = [pair("x", "y")(1.0, 2), pair("y", "x")(1.0, 2)]
    assert [get_x(share(one)) for one in of] == [get_x(one) for one in of] == [1.0, 2.0]
    names = {typeof(share(one)).name for one in of}  # symbols are named by it
    assert len(names) == 2


def test_what_is_asked_before_it_is_made_is_an_error():
    blank = Shared.__new__(Shared)
    with pytest.raises(AttributeError, match="anything"):
        _ = blank.anything
    assert repr(share(Array(FROZEN))).startswith("shared Array(a=array(")


@kernel
def read_nothing(of):
    """Ask for a field that is not there."""
    return of.nothing


def test_a_field_that_is_not_there_is_an_error():
    shared = share(outer())
    with pytest.raises(TypingError, match="nothing"):
        read_nothing(shared)
    with pytest.raises(AttributeError, match="nothing"):
        _ = shared.nothing


def test_a_field_stays_what_it_is():
    """Compiled code would not see another array in its place."""
    shared_array = share(Array(FROZEN))
    with pytest.raises(AttributeError, match="write into its array"):
        shared_array.a = np.zeros(3)
