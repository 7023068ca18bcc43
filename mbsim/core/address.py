"""Calling C functions by address, and handing groups of arrays through an address.

`call_int(address, (arguments...))` is a plain C call. `pack` writes down once
where the arrays of a NamedTuple (of NamedTuples) lie; compiled code behind an address takes
the integer it returns and sees the whole group through `view`. In compiled code a group
is that one integer, however many arrays it has: an array is built where it is named. (A Numba
NamedTuple of 80 arrays is some 500 words that every call copies.)

What only compiled code can do has its form in `core.address_forms`.
"""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple, NoReturn

import numpy as np

#: Where an array's object has the pointer to its data, behind the head that all objects have; NumPy
#: promises the place to C (PyArrayObject_fields), whose macro PyArray_DATA reads there.
_DATA, _data_at = object.__basicsize__, ctypes.c_void_p.from_address


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


def _only_compiled() -> NoReturn:
    raise NotImplementedError("only compiled code can do this")


def view(address: int, group: Any) -> Any:
    """Return the group that `pack` wrote at `address`; `group` is the NamedTuple class."""
    _only_compiled()


def call_int(address: int, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns an int64."""
    _only_compiled()


def call_float(address: int, arguments: Any) -> Any:
    """Call the C function at `address` with a tuple of arguments; it returns a double."""
    _only_compiled()


def vector_at(pointer: Any, count: int) -> Any:
    """Return `count` numbers at a pointer as an array that shares them."""
    _only_compiled()


def table_at(pointer: Any, rows: int, columns: int) -> Any:
    """Return the numbers at a pointer as an array of rows and columns that shares them."""
    _only_compiled()


def as_tuple(array: Any, count: int) -> tuple[float, ...]:
    """Return the first `count` numbers of an array as a tuple; `count` is constant."""
    _only_compiled()
