"""Named tuples of arrays that compiled code reads through their address.

numba passes a named tuple to a function field by field: for the tuples of a decision some six hundred numbers per
call. A shared tuple is one address of eight-byte words. Its fields read the same in Python and in compiled functions.
The words hold no references: the caller must keep a shared tuple alive while compiled code uses it, and no compiled
function may return an array of one.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, models, register_model, typeof_impl, unbox

Row = TypeVar("Row")
WORD = ir.IntType(64)


class Shared:
    """A named tuple and the words that compiled code reads, made by `share`; arrays stay in place."""

    def __init__(self, row: Any) -> None:
        row = row._make(share(value) if isinstance(value, tuple) else value for value in row)
        kinds, words = zip(*map(_words, row), strict=True)
        places = np.cumsum([0, *map(len, words)]).tolist()
        kept = np.array([word for each in words for word in each], np.int64)
        of = _TYPES.setdefault((type(row), kinds), SharedType(type(row), kinds, places))
        self.__dict__.update(row._asdict(), _tuple=row, _type=of, _kept=kept, _address=kept.ctypes.data)

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name} of a shared tuple stays what it is; write into its array")

    def __getattr__(self, name: str) -> Any:
        if "_tuple" not in self.__dict__:  # read before it is set
            raise AttributeError(name)
        return getattr(self._tuple, name)

    def __repr__(self) -> str:
        return f"shared {self._tuple!r}"

    def __iter__(self) -> Iterator[Any]:
        return iter(self._tuple)

    def __reduce__(self) -> tuple[Any, ...]:
        return Shared, (self._tuple,)  # a copy gets its own address


def share(row: Row) -> Row:
    """Return a `Shared` tuple of arrays, float64, int64, bool and tuples of them; others are a TypeError."""
    return cast(Row, Shared(row))


def type_of(row: Any) -> SharedType:
    """Return numba's type of a shared tuple."""
    kind: SharedType = row._type
    return kind


class SharedType(types.Type):
    """numba's type of a shared tuple; its name, which symbols hold, tells classes and fields apart."""

    def __init__(self, of: Any, kinds: tuple[Any, ...], places: list[int]) -> None:
        self.fields = {name: (kind, place) for name, kind, place in zip(of._fields, kinds, places, strict=False)}
        digest = hashlib.sha256(f"{of.__module__}.{of.__qualname__} {self.fields}".encode()).hexdigest()[:12]
        super().__init__(name=f"Shared({of.__name__}, {digest})")


_TYPES: dict[Any, SharedType] = {}


def _words(value: Any) -> tuple[Any, list[int]]:
    """Return numba's type of a field and the words it takes; an array's as in numba, without an owner."""
    if isinstance(value, Shared):
        return value._type, [value._address]
    if isinstance(value, np.ndarray):
        return typeof(value), [0, 0, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides]
    if isinstance(value, float):
        return types.float64, list(struct.unpack("q", struct.pack("d", value)))
    if isinstance(value, (bool, np.bool_, int, np.int64)):
        return types.boolean if isinstance(value, (bool, np.bool_)) else types.int64, [int(value)]
    raise TypeError(f"{value!r} cannot be shared; give arrays, float64, int64, bool, and tuples of them")


@typeof_impl.register(Shared)
def _typeof_shared(value: Shared, context: Any) -> SharedType:
    return value._type


@register_model(SharedType)
class _SharedModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: SharedType) -> None:
        super().__init__(manager, of, WORD.as_pointer())


@unbox(SharedType)  # type: ignore[untyped-decorator]
def _unbox_shared(of: SharedType, value: Any, native: Any) -> NativeValue:
    number = native.pyapi.object_getattr_string(value, "_address")
    address = native.pyapi.long_as_voidptr(number)
    native.pyapi.decref(number)
    return NativeValue(native.builder.bitcast(address, WORD.as_pointer()))


@infer_getattr
class _SharedFields(AttributeTemplate):
    key = SharedType

    def generic_resolve(self, of: SharedType, name: str) -> Any:  # type: ignore[override]
        return of.fields[name][0] if name in of.fields else None


@lower_getattr_generic(SharedType)  # type: ignore[untyped-decorator]
def _read_field(context: Any, builder: Any, of: SharedType, pointer: Any, name: str) -> Any:
    kind, place = of.fields[name]
    word = builder.gep(pointer, [ir.Constant(WORD, place)], inbounds=True)
    value = builder.load(builder.bitcast(word, context.get_value_type(kind).as_pointer()))
    value.set_metadata("invariant.load", builder.module.add_metadata([]))  # fields never change
    return impl_ret_borrowed(context, builder, kind, value)
