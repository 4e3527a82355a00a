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
from numba.extending import NativeValue, intrinsic, models, register_model, typeof_impl, unbox

from .jit import kernel

Row = TypeVar("Row")


class Shared:
    """A named tuple and the copy of its fields that compiled code reads; made by `share`.

    The fields stay what they are; what arrays among them hold may change.
    """

    __slots__ = ("_address", "_copy", "_tuple", "_type")  # fields of named tuples never begin with an underscore

    def __init__(self, row: Any) -> None:
        self._tuple = row
        self._type = SharedType(typeof(row))
        self._copy = np.zeros(_bytes_of(self._type.row), np.uint8)
        self._address = int(self._copy.ctypes.data)
        _write(row, self._address)

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


def _bytes_of(row: Any) -> int:
    """Size of the copy of a tuple of that type."""
    context = cpu_target.target_context
    return int(context.get_abi_sizeof(context.get_value_type(row)))


def _uncounted(context: Any, builder: Any, of: Any, value: Any) -> Any:
    """A value whose arrays name no owner: nobody counts references to them."""
    if isinstance(of, types.Array):
        array = cgutils.create_struct_proxy(of)(context, builder, value=value)
        array.meminfo = ir.Constant(array.meminfo.type, None)
        array.parent = ir.Constant(array.parent.type, None)
        return array._getvalue()
    if isinstance(of, types.BaseTuple):
        items: Any = of
        for k, item in enumerate(items.types):
            bare = _uncounted(context, builder, item, builder.extract_value(value, k))
            value = builder.insert_value(value, bare, k)
    return value


@intrinsic
def _store(typing: Any, row: Any, address: Any) -> Any:
    """Write a tuple's fields to an address."""

    def lower(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        of = signature.args[0]
        pointer = builder.inttoptr(values[1], context.get_value_type(of).as_pointer())
        builder.store(_uncounted(context, builder, of, values[0]), pointer)
        return context.get_dummy_value()

    return types.none(row, types.uintp), lower


@kernel
def _write(row: Any, address: int) -> None:
    _store(row, address)  # type: ignore[call-arg]
