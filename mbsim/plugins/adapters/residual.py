"""The arguments of a residual on the inside of its compiled function.

A file of its own, as `friction` is, for the cache's sake.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from mbsim.core import jit
from mbsim.core.address import as_tuple, vector_at
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import mark
from mbsim.laws.abi import FRICTION_SIGNATURE


def _adapt(function: Callable[..., Any], count: int, axes: int, unknowns: int) -> Any:
    """Return a residual with `count` parameters as a C function that signals what it raises."""
    first = 1 + 2 * axes
    size = first + 2 * unknowns

    def entry(element: int, given: Pointer, par: Pointer, out: Pointer) -> int:
        a: F1 = vector_at(given, size)
        values = as_tuple(vector_at(par, count), count)
        x = as_tuple(a[1:], axes)
        xdot = as_tuple(a[1 + axes :], axes)
        f = as_tuple(a[first:], unknowns)
        fdot = as_tuple(a[first + unknowns :], unknowns)
        result = vector_at(out, unknowns)
        code = 0
        try:
            # as every function of users' it is given time and area of contact: here is none
            found = function(x, xdot, f, fdot, a[0], values, a[0], 0.0)
            if len(found) != unknowns:
                raise ValueError("not as many")
            for k in range(unknowns):
                result[k] = found[k]
        except Exception:  # the only kind Numba can catch; the interpreted twin says which
            code = Code.RAISED_COMPILED
        return code

    return entry


def residual_address(
    function: Callable[..., Any], callees: list[Any], count: int, axes: int, unknowns: int
) -> int:
    """Return the address of a rewritten residual behind FRICTION_SIGNATURE."""
    for each in (*callees, function):
        mark(each, error_model="python", boundscheck=True)
    return jit.address(_adapt(function, count, axes, unknowns), FRICTION_SIGNATURE, allocates=True)
