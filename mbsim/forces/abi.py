"""The internal signature of forces between markers, and what puts a kind behind an address.

Wrench   int64 f(const double motion[12], const double *par, double out[8])
         out: force and torque on I along J's axes, stored energy, lost power
Slopes   int64 f(const double motion[12], const double *par, double out[12][6])
         out: K and D, see `forces.catalog`

`motion` is a `catalog.Motion`: d, theta, v, w. The result is 0. Numbers that are not finite are
found by the caller.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from numba import types

from mbsim.core import jit
from mbsim.core.address import table_at, vector_at
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.forces.catalog import FORCES, Motion

_POINTER = types.CPointer(types.float64)
SIGNATURE = types.int64(_POINTER, _POINTER, _POINTER)
#: Slopes that have not been compiled yet, by the address of their wrench.
_SLOPES: dict[int, Any] = {}


@jitable
def motion_in(a: F1) -> Motion:
    """Return the `Motion` that lies in the numbers of array `a`."""
    return Motion((a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11]))


def _adapt_wrench(wrench: Callable[..., Any], count: int) -> Any:
    """Return a formula of `count` constants as a C function."""

    def entry(motion: Pointer, par: Pointer, out: Pointer) -> int:
        result = vector_at(out, 8)
        force, torque, stored, lost = wrench(
            motion_in(vector_at(motion, 12)), vector_at(par, count)
        )
        for k in range(3):
            result[k] = force[k]
            result[3 + k] = torque[k]
        result[6] = stored
        result[7] = lost
        return 0

    return entry


def _adapt_slopes(slopes: Callable[..., Any], count: int) -> Any:
    """Return slopes of `count` constants as a C function."""

    def entry(motion: Pointer, par: Pointer, out: Pointer) -> int:
        both = table_at(out, 12, 6)
        for i in range(12):
            for k in range(6):
                both[i, k] = 0.0
        slopes(motion_in(vector_at(motion, 12)), vector_at(par, count), both[:6], both[6:])
        return 0

    return entry


@functools.cache
def wrench_address(name: str, count: int) -> int:
    """Return the address of the wrench of a kind, which takes `count` constants."""
    kind = FORCES[name]
    address = jit.address(_adapt_wrench(kind.wrench, count), SIGNATURE)
    _SLOPES[address] = _adapt_slopes(kind.slopes, count)
    return address


def slopes_address(wrench: int) -> int:
    """Return the address of the slopes that belong to the wrench at an address."""
    return jit.address(_SLOPES[wrench], SIGNATURE)
