"""Elements, rows and lengths of arrays in compiled code, in as few instructions as they take.

Numba copies an array's descriptor to memory to read a field of it, some thirty instructions for an
element, which LLVM then removes again: half of what is lowered are elements of arrays. Here fields
are taken from the descriptor itself. What is computed is the same; other indices are left to Numba.
"""

from __future__ import annotations

import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core.imputils import impl_ret_borrowed, impl_ret_untracked, lower_builtin, lower_getattr
from numba.np import arrayobj

_WORD = ir.IntType(64)
# places in an array's descriptor
_MEMINFO, _PARENT, _NITEMS, _ITEMSIZE, DATA, _SHAPE, _STRIDES = range(7)


def describe(context: Any, builder: Any, kind: Any, data: Any, shape: Any) -> Any:
    """Return a C-contiguous array of a kind at a pointer, which it shares; `shape` are words."""
    size = ir.Constant(_WORD, context.get_abi_sizeof(context.get_data_type(kind.dtype)))
    strides = [size]
    for length in reversed(shape[1:]):
        strides.insert(0, builder.mul(strides[0], length))
    target = context.get_value_type(kind)
    constant = [ir.Constant(part, ir.Undefined) for part in target.elements]
    constant[_MEMINFO] = ir.Constant(target.elements[_MEMINFO], None)
    constant[_PARENT] = ir.Constant(target.elements[_PARENT], None)
    constant[_ITEMSIZE] = size
    return _filled(builder, ir.Constant(target, constant), data, shape, strides)


def _filled(builder: Any, array: Any, data: Any, shape: Any, strides: Any) -> Any:
    """Return a descriptor with its pointer and its lengths."""
    count = shape[0]
    for length in shape[1:]:
        count = builder.mul(count, length, flags=["nsw"])
    array = builder.insert_value(array, count, _NITEMS)
    array = builder.insert_value(array, data, DATA)
    for k, (length, stride) in enumerate(zip(shape, strides, strict=True)):
        array = builder.insert_value(array, length, [_SHAPE, k])
        array = builder.insert_value(array, stride, [_STRIDES, k])
    return array


def _is_plain(context: Any, kind: Any, indices: Any) -> bool:
    """Return whether integers index a C-contiguous array and nobody asks for bounds."""
    return (
        type(kind) is types.Array
        and kind.layout == "C"
        and kind.aligned
        and 0 < len(indices) <= kind.ndim
        and all(isinstance(index, types.Integer) for index in indices)
        and not context.enable_boundscheck
    )


def _is_from_begin(index: Any) -> bool:
    """Return whether an index is known not to be counted from an array's end."""
    return (
        isinstance(index, ir.Constant) and isinstance(index.constant, int) and index.constant >= 0
    )


def _place(context: Any, builder: Any, kind: Any, array: Any, kinds: Any, indices: Any) -> Any:
    """Return the pointer to what indices name, and the array's lengths behind them."""
    lengths = [builder.extract_value(array, [_SHAPE, k]) for k in range(kind.ndim)]
    place = None
    for k, (index_kind, given) in enumerate(zip(kinds, indices, strict=True)):
        index = context.cast(builder, given, index_kind, types.intp)
        if (
            not (isinstance(index, ir.Constant) and isinstance(index.constant, int))
            or index.constant < 0
        ):
            index = arrayobj.fix_integer_index(context, builder, index_kind, given, lengths[k])
        if k + 1 < kind.ndim:
            step = lengths[k + 1]
            for length in lengths[k + 2 :]:
                step = builder.mul(step, length)
            index = builder.mul(index, step)
        place = index if place is None else builder.add(place, index)
    pointer = builder.gep(builder.extract_value(array, DATA), [place])
    return pointer, lengths[len(indices) :]


def _taken(context: Any, builder: Any, sig: Any, array: Any, kinds: Any, indices: Any) -> Any:
    """Return the element or the row that indices name."""
    kind = sig.args[0]
    pointer, lengths = _place(context, builder, kind, array, kinds, indices)
    if not lengths:
        item = arrayobj.load_item(context, builder, kind, pointer)
        return impl_ret_borrowed(context, builder, sig.return_type, item)
    first = kind.ndim - len(lengths)
    strides = [builder.extract_value(array, [_STRIDES, k]) for k in range(first, kind.ndim)]
    row = ir.Constant(context.get_value_type(sig.return_type), ir.Undefined)
    for field in (_MEMINFO, _PARENT, _ITEMSIZE):
        row = builder.insert_value(row, builder.extract_value(array, field), field)
    row = _filled(builder, row, pointer, lengths, strides)
    return impl_ret_borrowed(context, builder, sig.return_type, row)


def _get_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `array[integer]`."""
    kind, index = sig.args
    if not _is_plain(context, kind, (index,)):
        return arrayobj.getitem_arraynd_intp(context, builder, sig, args)
    return _taken(context, builder, sig, args[0], (index,), args[1:])


def _get_item_tuple(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `array[tuple]`."""
    kind, index = sig.args
    if not _is_plain(context, kind, index.types):
        return arrayobj.getitem_array_tuple(context, builder, sig, args)
    indices = [builder.extract_value(args[1], k) for k in range(len(index))]
    return _taken(context, builder, sig, args[0], index.types, indices)


def _set_item(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `array[integer or tuple] = value`."""
    kind, index, value_kind = sig.args
    array, given, value = args
    several = isinstance(index, types.BaseTuple)
    kinds = index.types if several else (index,)
    if len(kinds) != kind.ndim or not _is_plain(context, kind, kinds):
        return arrayobj.setitem_array(context, builder, sig, args)
    indices = [builder.extract_value(given, k) for k in range(len(index))] if several else [given]
    pointer, _ = _place(context, builder, kind, array, kinds, indices)
    value = context.cast(builder, value, value_kind, kind.dtype)
    arrayobj.store_item(context, builder, kind, value, pointer)
    return None


def _length(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Lower `len(array)`."""
    length = builder.extract_value(args[0], [_SHAPE, 0])
    return impl_ret_untracked(context, builder, sig.return_type, length)


def _shape(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """Lower `array.shape`."""
    return impl_ret_untracked(context, builder, kind, builder.extract_value(value, _SHAPE))


def install() -> None:
    """Put these before Numba's own, which are for all that has a buffer."""
    lower_builtin(operator.getitem, types.Array, types.Integer)(_get_item)
    lower_builtin(operator.getitem, types.Array, types.BaseTuple)(_get_item_tuple)
    lower_builtin(operator.setitem, types.Array, types.Integer, types.Any)(_set_item)
    lower_builtin(operator.setitem, types.Array, types.BaseTuple, types.Any)(_set_item)
    lower_builtin(len, types.Array)(_length)
    lower_getattr(types.Array, "shape")(_shape)
