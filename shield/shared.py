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
from collections.abc import Callable, Iterator
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

    def __init__(self, row: Any) -> None:
        of, write = _of_kind(row)
        copy = np.frombuffer(write(row), np.uint8).copy()
        own = {"_tuple": row, "_type": of, "_copy": copy, "_address": int(copy.ctypes.data)}
        self.__dict__.update(row._asdict() | own)  # fields of named tuples never begin with an underscore

    def __setattr__(self, name: str, value: Any) -> None:
        raise AttributeError(f"{name} of a shared tuple stays what it is; write into its array")

    def __getattr__(self, name: str) -> Any:
        if "_tuple" not in self.__dict__:  # asked for before there is one
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


class Called:
    """A compiled function of one shared tuple, without numba's look at what it is called with, which takes 3 us.

    Args:
        function: made by `jit.kernel`.
    """

    def __init__(self, function: Callable[[Any], None]) -> None:
        self._function: Any = function
        self._entries: dict[int, Callable[[Any], None]] = {}  # by type, of which there is one object of a kind

    def __call__(self, row: Any) -> None:
        """Call it with a shared tuple."""
        entry = self._entries.get(id(row._type))
        if entry is None:
            plain = not hasattr(self._function, "compile")  # where NUMBA_DISABLE_JIT is set
            entry = self._entries[id(row._type)] = self._function if plain else self._function.compile((row._type,))
        entry(row)


class SharedType(types.Type):
    """numba's type of a shared tuple: ``row`` is that of the tuple."""

    def __init__(self, row: Any) -> None:
        self.row = row
        digest = hashlib.sha256(_full_name(row).encode()).hexdigest()[:12]  # symbols hold the names of all arguments
        super().__init__(name=f"Shared({row.instance_class.__name__}, {digest})")

    @property
    def key(self) -> Any:
        """What makes it the same type as another; quick to compare, as every call of compiled code does."""
        return self.name, self.row.instance_class


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


_KINDS: dict[Any, tuple[SharedType, Writer]] = {}


def _of_kind(row: Any) -> tuple[SharedType, Writer]:
    """Type of a shared tuple of these fields, and its writer.

    numba, which takes a millisecond for fifty fields, is asked once for each kind of them.
    """
    kind = _kind(row)
    if kind not in _KINDS:
        of = typeof(row)
        _KINDS[kind] = SharedType(of), _writer(of)[0]
    return _KINDS[kind]


def _kind(value: Any) -> Any:
    """All that numba's type of a value hangs on."""
    if isinstance(value, np.ndarray):
        flags = value.flags
        return value.dtype, value.ndim, flags.c_contiguous, flags.f_contiguous, flags.writeable, flags.aligned
    if isinstance(value, Shared):
        return value._type
    return (type(value), *map(_kind, value)) if isinstance(value, tuple) else type(value)


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


Writer = Callable[[Any], bytes]
"""Turns a value into bytes as compiled code keeps it in memory; made once for a type, and quick.

Not compiled itself: the compiler's disk cache would hold every tuple ever shared.
"""

_NUMBERS = {types.float64: "d", types.int64: "q", types.boolean: "?"}
_ARRAY = ("meminfo", "parent", "nitems", "itemsize", "data", "shape", "strides")
_WORD = 8


def _writer(of: Any) -> tuple[Writer, int]:
    """Writer of values of a type, and how many bytes it writes.

    Raises:
        TypeError: it is none of an array, a float64, an int64, a bool, or a tuple or shared tuple of such.
    """
    if isinstance(of, types.Array):
        return _array_writer(of)
    if isinstance(of, SharedType):
        return (lambda value: struct.pack("q", value._address)), _WORD
    if isinstance(of, types.BaseTuple):
        return _tuple_writer(of)
    if of in _NUMBERS:
        form = struct.Struct(_NUMBERS[of])
        return form.pack, form.size
    raise TypeError(f"{of} cannot be shared; give arrays, float64, int64, bool, and tuples of them")


def _array_writer(of: Any) -> tuple[Writer, int]:
    """An array's place, shape and strides. It names no owner, so that nobody counts references to it."""
    fields = cpu_target.target_context.data_model_manager[of]._fields
    if fields != _ARRAY:
        raise TypeError(f"numba lays arrays out as {', '.join(fields)}: this version of it is not known")
    form, nobody = struct.Struct(f"{5 + 2 * of.ndim}q"), (0, 0)

    def write(array: Any) -> bytes:
        return form.pack(*nobody, array.size, array.itemsize, array.ctypes.data, *array.shape, *array.strides)

    return write, form.size


def _tuple_writer(of: Any) -> tuple[Writer, int]:
    """The fields one after another, each where the compiler has it."""
    context = cpu_target.target_context
    form, data = context.get_value_type(of), context.target_data
    size, parts = form.get_abi_size(data), []
    for k, kind in enumerate(of.types):
        write, length = _writer(kind)
        has = context.get_value_type(kind).get_abi_size(data)
        if has != length:
            raise TypeError(f"numba gives {has} bytes to {kind}, not {length}: its memory is not known")
        start = k * length if isinstance(form, ir.ArrayType) else form.get_element_offset(data, k)
        parts.append((start, start + length, write))

    def write_all(value: Any) -> bytes:
        whole = bytearray(size)
        for (start, end, write), item in zip(parts, value, strict=True):
            whole[start:end] = write(item)
        return bytes(whole)

    return write_all, size
