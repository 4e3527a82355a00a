"""Named tuples of arrays that compiled code reads through their address.

numba hands a named tuple to a function field by field, of every array its pointer, shape and strides: for the tuples of
a decision some six hundred numbers, at every call. A shared tuple is one address. Its fields read the same, in Python
and in compiled functions, which compile and run the faster for it.

The copy behind the address holds no references: whoever hands a shared tuple to compiled code keeps it alive meanwhile.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
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

    The fields stay what they are; what arrays among them hold may change.
    """

    __slots__ = ("_address", "_copy", "_tuple", "_type")  # fields of named tuples never begin with an underscore

    def __init__(self, row: Any) -> None:
        self._tuple = row
        self._type = SharedType(typeof(row))
        self._copy = np.frombuffer(_tuple_bytes(self._type.row, row), np.uint8).copy()
        self._address = int(self._copy.ctypes.data)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._tuple, name)

    def __iter__(self) -> Iterator[Any]:
        return iter(self._tuple)

    def __reduce__(self) -> tuple[Any, ...]:
        return Shared, (self._tuple,)  # a copy has an address of its own


def share(row: Row) -> Row:
    """A `Shared` tuple of these fields; whatever only reads fields takes it for the tuple itself."""
    return cast(Row, Shared(row))


class SharedType(types.Type):
    """numba's type of a shared tuple: ``row`` is that of the tuple."""

    def __init__(self, row: Any) -> None:
        self.row = row
        digest = hashlib.sha256(str(row).encode()).hexdigest()[:12]  # symbols hold the names of all arguments
        super().__init__(name=f"Shared({row.instance_class.__name__}, {digest})")


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
    """A value as compiled code keeps it in memory; its arrays name no owner, so that nobody counts references to them.

    Written here and not by compiled code, whose disk cache would hold every tuple ever shared.

    Raises:
        TypeError: it is none of an array, a float, an int, a bool, or a tuple of such.
    """
    if isinstance(of, types.Array):
        nobody = (0, 0)
        words = (*nobody, value.size, value.itemsize, value.ctypes.data, *value.shape, *value.strides)
        return np.array(words, np.int64).tobytes()
    if isinstance(of, types.BaseTuple):
        return _tuple_bytes(of, value)
    if isinstance(of, SharedType):
        return np.int64(value._address).tobytes()
    if of in (types.float64, types.int64, types.boolean):
        return np.asarray(value, str(of).replace("boolean", "bool")).tobytes()
    raise TypeError(f"{of} cannot be shared; give arrays, floats, ints, bools, and tuples of them")


def _tuple_bytes(of: Any, value: Any) -> bytes:
    """The fields one after another, each at the place the compiler gives it."""
    context = cpu_target.target_context
    form, data = context.get_value_type(of), context.target_data
    whole = bytearray(form.get_abi_size(data))
    for k, (kind, item) in enumerate(zip(of.types, value, strict=True)):
        content = _bytes_of(kind, item)
        if isinstance(form, ir.ArrayType):  # a tuple of one kind
            start = k * form.element.get_abi_size(data)
        else:
            start = form.get_element_offset(data, k)
        whole[start : start + len(content)] = content
    return bytes(whole)
