"""Calling C functions by address, and handing groups of arrays through an address.

`call_int(address, (arguments...))` costs about two nanoseconds. `pack` writes down once
where the arrays of a NamedTuple (of NamedTuples) lie; compiled code behind an
address takes the integer it returns and has the whole group back by `unpack`.
"""

from __future__ import annotations

import typing
from typing import Any, NamedTuple

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.imputils import impl_ret_borrowed
from numba.extending import intrinsic
from numba.np import arrayobj


def group_type(group: type) -> types.Type:
    """Return the Numba type of a NamedTuple class from its annotations."""
    hints = typing.get_type_hints(group, include_extras=True)
    fields = []
    for hint in hints.values():
        if hasattr(hint, "__metadata__"):
            dtype, ndim = hint.__metadata__
            fields.append(types.Array(getattr(types, dtype), ndim, "C"))
        else:
            fields.append(group_type(hint))
    return types.NamedTuple(fields, group)


def _leaves(group: NamedTuple) -> list[np.ndarray[Any, Any]]:
    """Return the arrays of a group of groups in order of their fields."""
    found: list[np.ndarray[Any, Any]] = []
    for value in group:
        found.extend(_leaves(value) if isinstance(value, tuple) else [value])
    return found


def pack(group: NamedTuple) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Return a table of where the arrays of `group` lie: data pointer, then shape, of each.

    The caller keeps the table and the group alive while its address is in use.
    """
    words: list[int] = []
    for array in _leaves(group):
        if not array.flags.c_contiguous:
            raise ValueError("a packed array must be C-contiguous")
        words.append(array.ctypes.data)
        words.extend(array.shape)
    return np.array(words, dtype=np.int64)


@intrinsic
def unpack(typingctx: Any, address: Any, group: Any) -> Any:
    """Return the group that `pack` wrote at `address`; `group` is the NamedTuple class."""
    target = group_type(group.instance_class)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        word = ir.IntType(64)
        table = builder.inttoptr(args[0], word.as_pointer())
        position = 0

        def read() -> Any:
            nonlocal position
            slot = builder.gep(table, [ir.Constant(word, position)])
            position += 1
            return builder.load(slot)

        def build(numba_type: Any) -> Any:
            if isinstance(numba_type, types.Array):
                itemsize = context.get_abi_sizeof(context.get_data_type(numba_type.dtype))
                array = arrayobj.make_array(numba_type)(context, builder)
                data = builder.inttoptr(read(), array.data.type)
                shape = [read() for _ in range(numba_type.ndim)]
                strides = [ir.Constant(word, itemsize)]
                for length in reversed(shape[1:]):
                    strides.insert(0, builder.mul(strides[0], length))
                arrayobj.populate_array(
                    array,
                    data=data,
                    shape=cgutils.pack_array(builder, shape),
                    strides=cgutils.pack_array(builder, strides),
                    itemsize=ir.Constant(word, itemsize),
                    meminfo=None,
                )
                return array._getvalue()
            values = [build(field) for field in numba_type.types]
            return context.make_tuple(builder, numba_type, values)

        return impl_ret_borrowed(context, builder, target, build(target))

    return target(types.int64, group), codegen


def _call(result: Any, result_ir: Any, arguments: Any) -> Any:
    """Return signature and code of a C call; arrays go as data pointers."""
    signature = result(types.int64, arguments)

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        address, packed = args
        values, kinds = [], []
        for position, kind in enumerate(arguments.types):
            value = builder.extract_value(packed, position)
            if isinstance(kind, types.Array):
                value = arrayobj.make_array(kind)(context, builder, value=value).data
            values.append(value)
            kinds.append(value.type)
        pointer = builder.inttoptr(address, ir.FunctionType(result_ir, kinds).as_pointer())
        return builder.call(pointer, values)

    return signature, codegen


@intrinsic
def call_int(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns an int64."""
    return _call(types.int64, ir.IntType(64), arguments)


@intrinsic
def call_float(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns a double."""
    return _call(types.float64, ir.DoubleType(), arguments)
