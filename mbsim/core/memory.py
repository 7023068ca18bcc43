"""Numbers behind an address that is itself kept as a number, in plain Python and compiled."""

from __future__ import annotations

import ctypes
from typing import Any

import numpy as np


def floats_at(address: float, count: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return `count` doubles at `address` as an array that shares them.

    Addresses of today's machines are below 2^53, so a float holds one exactly. Whoever took
    the address keeps the memory alive. `core.address` has the compiled form.
    """
    kind = ctypes.c_double * int(count)
    shared: Any = kind.from_address(int(address))
    return np.frombuffer(shared, dtype=np.float64)
