"""Compiled forms of `core.address` and `core.memory`; imported when something is compiled."""

from __future__ import annotations

import functools
import typing
from collections.abc import Callable
from typing import Any, TypeVar

from llvmlite import ir
from numba import types
from numba.core.datamodel import models
from numba.core.imputils import impl_ret_borrowed, lower_builtin, lower_getattr_generic
from numba.core.typing.templates import (
    AttributeTemplate,
    infer,
    infer_getattr,
    infer_global,
    make_intrinsic_template,
)
from numba.extending import register_model, type_callable
from numba.np.unsafe.ndarray import to_fixed_tuple

from mbsim.core import address
from mbsim.core.array_items import DATA, describe
from mbsim.core.memory import floats_at

_Made = TypeVar("_Made")
_WORD = ir.IntType(64)
_lowers_fields: Callable[..., Callable[[_Made], _Made]] = lower_getattr_generic
_lowers: Callable[..., Callable[[_Made], _Made]] = lower_builtin


def _is_intrinsic(of: Callable[..., Any]) -> Callable[[Callable[..., Any]], None]:
    """Let compiled code have an intrinsic in the place of a function.

    What is decorated returns signature and code, as that of `numba.extending.intrinsic` does, which
    would make an object of its own of it: one that is only there with Numba.
    """

    def give(definition: Callable[..., Any]) -> None:
        template: Any = make_intrinsic_template(
            of, definition, of.__name__, prefer_literal=False, kwargs={}
        )
        infer(template)
        infer_global(of, types.Function(template))

    return give


_is_intrinsic(address.as_tuple)(to_fixed_tuple._defn)


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


@_is_intrinsic(address.view)
def _view(typingctx: Any, address: Any, group: Any) -> Any:
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


@_is_intrinsic(address.call_int)
def _call_int(typingctx: Any, address: Any, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns an int64."""
    return _call(types.int64, ir.IntType(64), arguments)


@_is_intrinsic(address.call_float)
def _call_float(typingctx: Any, address: Any, arguments: Any) -> Any:
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


@_is_intrinsic(address.vector_at)
def _vector_at(typingctx: Any, pointer: Any, count: Any) -> Any:
    """Return `count` numbers at a pointer as an array that shares them."""
    kind = types.Array(pointer.dtype, 1, "C")
    return kind(pointer, types.int64), _at(kind)


@_is_intrinsic(address.table_at)
def _table_at(typingctx: Any, pointer: Any, rows: Any, columns: Any) -> Any:
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
