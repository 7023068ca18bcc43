"""Calling C functions by address, and handing groups of arrays through an address.

`call_int(address, (arguments...))` is a plain C call. `pack` writes down once
where the arrays of a NamedTuple (of NamedTuples) lie; compiled code behind an address takes
the integer it returns and sees the whole group through `view`. In compiled code a group
is that one integer, however many arrays it has: an array is built where it is named. (A Numba
NamedTuple of 80 arrays is some 500 words that every call copies.)
"""

from __future__ import annotations

import ctypes
import functools
import typing
from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

import numpy as np
from llvmlite import ir
from numba import types
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed, lower_getattr_generic
from numba.core.typing.templates import AttributeTemplate, infer_getattr
from numba.extending import intrinsic, lower_builtin, register_model, type_callable
from numba.np.unsafe.ndarray import to_fixed_tuple

from mbsim.core.array_items import DATA, describe
from mbsim.core.memory import floats_at

_Made = TypeVar("_Made")
#: Where an array's object has the pointer to its data, behind the head that all objects have; NumPy
#: promises the place to C (PyArrayObject_fields), whose macro PyArray_DATA reads there.
_DATA, _data_at = object.__basicsize__, ctypes.c_void_p.from_address
_WORD = ir.IntType(64)
#: An intrinsic is called without the typing context that it is declared with.
_intrinsic: Callable[[Callable[..., Any]], Callable[..., Any]] = intrinsic
#: The first numbers of an array as a tuple: of the array and how many, which is constant.
as_tuple: Callable[..., tuple[float, ...]] = to_fixed_tuple
_lowers_fields: Callable[..., Callable[[_Made], _Made]] = lower_getattr_generic
_lowers: Callable[..., Callable[[_Made], _Made]] = lower_builtin


class GroupType(types.Type):
    """A packed NamedTuple class in compiled code: the address of its table."""

    def __init__(self, group: type) -> None:
        self.group = group
        name = f"Group({group.__module__}.{group.__qualname__})"
        super().__init__(name=name)

    @functools.cached_property
    def fields(self) -> dict[str, tuple[Any, int]]:
        """Numba type and first word in the table of every field, from the annotations."""
        found: dict[str, tuple[Any, int]] = {}
        word = 0
        for name, hint in typing.get_type_hints(self.group, include_extras=True).items():
            if hasattr(hint, "__metadata__"):
                dtype, ndim = hint.__metadata__[:2]
                found[name] = types.Array(getattr(types, dtype), ndim, "C"), word
                word += 1 + ndim
            else:
                inner = GroupType(hint)
                found[name] = inner, word
                word += inner.words
        return found

    @property
    def words(self) -> int:
        """Length of the group's table: a pointer and a shape for each array."""
        kinds = [kind for kind, _ in self.fields.values()]
        return sum(k.words if isinstance(k, GroupType) else 1 + k.ndim for k in kinds)


@register_model(GroupType)
class _GroupModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, _WORD)  # type: ignore[no-untyped-call]


@infer_getattr
class _GroupAttribute(AttributeTemplate):
    key = GroupType

    def generic_resolve(self, group: GroupType, name: str) -> Any:  # type: ignore[override]
        return group.fields[name][0] if name in group.fields else None


def _constant_word(builder: Any, table: Any, word: int) -> Any:
    """Return a word of a table, which nothing changes: it is read once, not after every store."""
    read = builder.load(builder.gep(table, [ir.Constant(_WORD, word)]))
    read.set_metadata("invariant.load", builder.module.add_metadata([]))
    return read


@_lowers_fields(GroupType)
def _lower_field(context: Any, builder: Any, group: Any, value: Any, name: str) -> Any:
    """Return a field of a packed group: the table of an inner group, or the array."""
    target, word = group.fields[name]
    if isinstance(target, GroupType):
        return builder.add(value, ir.Constant(_WORD, 8 * word))
    table = builder.inttoptr(value, _WORD.as_pointer())
    read = [_constant_word(builder, table, word + k) for k in range(1 + target.ndim)]
    data = builder.inttoptr(read[0], context.get_data_type(target.dtype).as_pointer())
    array = describe(context, builder, target, data, read[1:])
    return impl_ret_borrowed(context, builder, target, array)


def _gather(group: tuple[Any, ...], found: list[np.ndarray[Any, Any]]) -> None:
    """Add the arrays of a group of groups in order of their fields."""
    for value in group:
        if isinstance(value, tuple):
            _gather(value, found)
        else:
            found.append(value)


def pack(group: NamedTuple) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return a table of where the arrays of `group` lie: data pointer, then shape, of each.

    The caller keeps the table and the group alive while its address is in use.
    """
    words: list[int] = []
    arrays: list[np.ndarray[Any, Any]] = []
    _gather(group, arrays)
    add = words.append
    for array in arrays:
        if not array.flags.c_contiguous:
            raise ValueError("a packed array must be C-contiguous")
        # `__array_interface__` and `ctypes` make objects for it, in ten times the time
        add(_data_at(id(array) + _DATA).value or 0)
        words += array.shape
    return np.array(words, dtype=np.int64)


@_intrinsic
def view(typingctx: Any, address: Any, group: Any) -> Any:
    """Return the group that `pack` wrote at `address`; `group` is the NamedTuple class."""
    target = GroupType(group.instance_class)
    return target(types.int64, group), lambda context, builder, signature, args: args[0]


def _call(result: Any, result_ir: Any, arguments: Any) -> Any:
    """Return signature and code of a C call; arrays go as data pointers."""
    signature = result(types.int64, arguments)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        address, packed = args
        values, kinds = [], []
        for position, kind in enumerate(arguments.types):
            value = builder.extract_value(packed, position)
            if isinstance(kind, types.Array):
                value = builder.extract_value(value, DATA)
            values.append(value)
            kinds.append(value.type)
        pointer = builder.inttoptr(address, ir.FunctionType(result_ir, kinds).as_pointer())
        return builder.call(pointer, values)

    return signature, codegen


@_intrinsic
def call_int(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns an int64."""
    return _call(types.int64, ir.IntType(64), arguments)


@_intrinsic
def call_float(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns a double."""
    return _call(types.float64, ir.DoubleType(), arguments)


_FLOATS = types.Array(types.float64, 1, "C")


def _array(context: Any, builder: Any, kind: Any, data: Any, shape: Any) -> Any:
    """Return what lies at a pointer as an array of a kind and `shape` that shares it."""
    target = context.get_data_type(kind.dtype).as_pointer()
    return describe(context, builder, kind, builder.bitcast(data, target), list(shape))


def _at(kind: Any) -> Any:
    """Return the code of an array of a kind at a pointer, its lengths being the arguments."""
    return lambda context, builder, signature, args: _array(
        context, builder, kind, args[0], args[1:]
    )


@_intrinsic
def vector_at(typingctx: Any, pointer: Any, count: Any) -> Any:
    """Return `count` numbers at a pointer as an array that shares them."""
    kind = types.Array(pointer.dtype, 1, "C")
    return kind(pointer, types.int64), _at(kind)


@_intrinsic
def table_at(typingctx: Any, pointer: Any, rows: Any, columns: Any) -> Any:
    """Return the numbers at a pointer as an array of rows and columns that shares them."""
    kind = types.Array(pointer.dtype, 2, "C")
    return kind(pointer, types.int64, types.int64), _at(kind)


@type_callable(floats_at)
def _type_of_floats(context: Any) -> Any:
    """Give compiled code its form of `floats_at`."""
    return lambda address, count: _FLOATS


@_lowers(floats_at, types.Number, types.Number)
def _floats_at(context: Any, builder: Any, signature: Any, args: Any) -> Any:
    """Return the doubles at an address that is a number."""
    kinds = zip(args, signature.args, strict=True)
    whole = [context.cast(builder, value, kind, types.int64) for value, kind in kinds]
    return _array(
        context, builder, _FLOATS, builder.inttoptr(whole[0], _WORD.as_pointer()), whole[1:]
    )
