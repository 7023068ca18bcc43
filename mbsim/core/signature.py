"""Signatures of C functions, written as calls of types: ``INT(INT, FLOAT, POINTER)``.

They name what Numba's types of these names are, and are there without Numba: a run that finds its
code compiled does not import it.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, NamedTuple


class Kind(NamedTuple):
    """The type of an argument or a result."""

    name: str  # an expression of Numba's types
    c: Any  # how `ctypes` passes it

    def __call__(self, *arguments: Kind) -> Signature:
        """Return the signature of a function of these arguments with such a result."""
        return Signature(self, arguments)


class Signature(NamedTuple):
    """What a C function returns and takes."""

    result: Kind
    arguments: tuple[Kind, ...]

    def __str__(self) -> str:
        return f"{self.result.name}({', '.join(kind.name for kind in self.arguments)})"

    @property
    def form(self) -> Any:
        """What `ctypes` calls and makes such functions by."""
        return ctypes.CFUNCTYPE(self.result.c, *(kind.c for kind in self.arguments))

    def at(self, address: int) -> Callable[..., Any]:
        """Return the C function at an address, for Python; it runs without Python's lock."""
        found: Callable[..., Any] = self.form(address)
        return found


INT = Kind("int64", ctypes.c_int64)
FLOAT = Kind("float64", ctypes.c_double)
#: double *
POINTER = Kind("CPointer(float64)", ctypes.c_void_p)
#: double _Complex *
COMPLEX_POINTER = Kind("CPointer(complex128)", ctypes.c_void_p)
