"""Named tuples of arrays that compiled code reads through their address.

numba hands a named tuple to a function field by field, of every array its pointer, shape and strides: for the tuples of
a decision some six hundred numbers, at every call. A shared tuple is one address. Its fields read the same, in Python
and in compiled functions, which compile and run the faster for it.

The copy behind the address holds no references: whoever hands a shared tuple to compiled code keeps it alive meanwhile,
and no compiled function returns an array of one, or a part of it: it would not keep it alive.
"""

from __future__ import annotations

import hashlib
import struct
from collections.abc import Iterator
from functools import cache
from typing import Any, TypeVar, cast

import numpy as np
from llvmlite import ir
from numba import typeof, types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.registry import cpu_target
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import NativeValue, models, register_model, typeof_impl, unbox

Row = TypeVar("Row")


class Shared:
    """A named tuple and the copy of its fields that compiled code reads; made by `share`.

    The fields stay what they are: what its arrays hold may change, not their shape, size or place, and compiled code
    does not see when one is made read-only.
    """

    __slots__ = ("_address", "_copy", "_tuple", "_type")  # fields of named tuples never begin with an underscore

    def __init__(self, row: Any) -> None:
        self._tuple = row
        self._type = SharedType(typeof(row))
        self._copy = np.frombuffer(_bytes_of(self._type.row, row), np.uint8).copy()
        self._address = int(self._copy.ctypes.data)

    def __getattr__(self, name: str) -> Any:
        if name in self.__slots__:  # asked for before there is one
            raise AttributeError(name)
        return getattr(self._tuple, name)

    def __repr__(self) -> str:
        return f"shared {self._tuple!r}"

    def __iter__(self) -> Iterator[Any]:
        return iter(self._tuple)

    def __reduce__(self) -> tuple[Any, ...]:
        return Shared, (self._tuple,)  # a copy has an address of its own


def share(row: Row) -> Row:
    """A `Shared` tuple of these fields; whatever only reads fields by name takes it for the tuple itself.

    It has no length and no index, and is equal to itself only.

    Raises:
        TypeError: a field is not an array, a float64, an int64, a bool, or a tuple or shared tuple of such.
    """
    return cast(Row, Shared(row))


class SharedType(types.Type):
    """numba's type of a shared tuple: ``row`` is that of the tuple."""

    def __init__(self, row: Any) -> None:
        self.row = row
        digest = hashlib.sha256(_full_name(row).encode()).hexdigest()[:12]  # symbols hold the names of all arguments
        super().__init__(name=f"Shared({row.instance_class.__name__}, {digest})")

    @property
    def key(self) -> Any:
        """What makes it the same type as another."""
        return self.row


def _full_name(of: Any) -> str:
    """A type told with the classes and field names of all tuples in it, which numba's own name leaves out."""
    if isinstance(of, SharedType):
        return f"shared {_full_name(of.row)}"
    if not isinstance(of, types.BaseTuple):
        return str(of)
    tuple_type: Any = of
    names = tuple_type.fields if isinstance(of, types.BaseNamedTuple) else range(len(tuple_type.types))
    fields = ", ".join(f"{name}: {_full_name(kind)}" for name, kind in zip(names, tuple_type.types, strict=True))
    of_class = getattr(of, "instance_class", tuple)
    return f"{of_class.__module__}.{of_class.__qualname__}({fields})"


@typeof_impl.register(Shared)
def _typeof_shared(value: Shared, context: Any) -> SharedType:
    return value._type


@register_model(SharedType)
class _SharedModel(models.PrimitiveModel):
    def __init__(self, manager: Any, of: SharedType) -> None:
        super().__init__(manager, of, manager.lookup(of.row).get_value_type().as_pointer())


@unbox(SharedType)  # type: ignore[untyped-decorator]
def _unbox_shared(of: SharedType, value: Any, native: Any) -> NativeValue:
    number = native.pyapi.object_getattr_string(value, "_address")
    address = native.pyapi.long_as_voidptr(number)
    native.pyapi.decref(number)
    pointer = native.builder.bitcast(address, native.context.get_value_type(of))
    return NativeValue(pointer, is_error=cgutils.is_not_null(native.builder, native.pyapi.err_occurred()))


@infer_getattr
class _SharedFields(AttributeTemplate):
    key = SharedType

    def generic_resolve(self, of: SharedType, name: str) -> Any:  # type: ignore[override]
        return of.row.types[of.row.fields.index(name)] if name in of.row.fields else None


@lower_getattr_generic(SharedType)  # type: ignore[untyped-decorator]
def _read_field(context: Any, builder: Any, of: SharedType, pointer: Any, name: str) -> Any:
    place = of.row.fields.index(name)
    value = builder.load(cgutils.gep_inbounds(builder, pointer, 0, place))
    value.set_metadata("invariant.load", builder.module.add_metadata([]))  # fields stay what they are
    return impl_ret_borrowed(context, builder, of.row.types[place], value)


def _bytes_of(of: Any, value: Any) -> bytes:
    """A value as compiled code keeps it in memory.

    Written here and not by compiled code, whose disk cache would hold every tuple ever shared.

    Raises:
        TypeError: it is none of an array, a float64, an int64, a bool, or a tuple or shared tuple of such.
    """
    if isinstance(of, types.Array):
        return _array_bytes(of, value)
    if isinstance(of, SharedType):
        return struct.pack("q", value._address)
    if isinstance(of, types.BaseTuple):
        tuple_type: Any = of
        size, places = _places(of)
        whole = bytearray(size)
        for (start, length), kind, item in zip(places, tuple_type.types, value, strict=True):
            content = _bytes_of(kind, item)
            if len(content) != length:
                raise TypeError(f"numba gives {length} bytes to {kind}, not {len(content)}: its memory is not known")
            whole[start : start + length] = content
        return bytes(whole)
    if of not in _NUMBERS:
        raise TypeError(f"{of} cannot be shared; give arrays, float64, int64, bool, and tuples of them")
    return struct.pack(_NUMBERS[of], value)


_NUMBERS = {types.float64: "d", types.int64: "q", types.boolean: "?"}


def _array_bytes(of: Any, array: Any) -> bytes:
    """An array's place, shape and strides. It names no owner, so that nobody counts references to it."""
    known = {
        "meminfo": (0,),
        "parent": (0,),
        "nitems": (array.size,),
        "itemsize": (array.itemsize,),
        "data": (array.ctypes.data,),
        "shape": array.shape,
        "strides": array.strides,
    }
    fields = cpu_target.target_context.data_model_manager[of]._fields
    if set(fields) != set(known):
        raise TypeError(f"numba lays arrays out as {', '.join(fields)}: this version of it is not known")
    words = [word for name in fields for word in known[name]]
    return struct.pack(f"{len(words)}q", *words)


@cache
def _places(of: Any) -> tuple[int, tuple[tuple[int, int], ...]]:
    """Bytes of a tuple in memory, and where each of its fields begins and how many it has."""
    context = cpu_target.target_context
    form, data = context.get_value_type(of), context.target_data
    lengths = [context.get_value_type(kind).get_abi_size(data) for kind in of.types]
    if isinstance(form, ir.ArrayType):  # a tuple of one kind
        starts = [k * length for k, length in enumerate(lengths)]
    else:
        starts = [form.get_element_offset(data, k) for k in range(len(lengths))]
    return form.get_abi_size(data), tuple(zip(starts, lengths, strict=True))
