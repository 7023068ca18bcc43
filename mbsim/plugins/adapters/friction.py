"""The documented CFFSUB arguments on the inside of a compiled friction function.

Apart from `compiled`, so that the cache key of a user's function covers this and no more.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from mbsim.core import jit
from mbsim.core.address import as_tuple, vector_at
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import mark
from mbsim.core.rotation import vector
from mbsim.laws.abi import (
    AREA_IN,
    DFLAG,
    FRICTION_INPUTS,
    FRICTION_SIGNATURE,
    LOCI_IN,
    LOCJ_IN,
    MEMORY_OUT,
    NFORCE_IN,
    TIME_IN,
    X_IN,
    XDOT_IN,
)


def _adapt(function: Callable[..., Any], count: int) -> Any:
    """Return CFFSUB with `count` parameters as a C function that signals what it raises."""

    def entry(element: int, inputs: Pointer, par: Pointer, out: Pointer) -> int:
        a: F1 = vector_at(inputs, FRICTION_INPUTS)
        values = as_tuple(vector_at(par, count), count)
        result = vector_at(out, 5)
        code = 0
        try:
            force = function(
                element,
                a[TIME_IN],
                values,
                count,
                vector(a[LOCI_IN:]),
                vector(a[LOCJ_IN:]),
                vector(a[X_IN:]),
                vector(a[XDOT_IN:]),
                a[NFORCE_IN],
                int(a[DFLAG]),
                0,
                a[TIME_IN],
                a[AREA_IN],
            )
            if len(force) != 3:
                raise ValueError("not three")
            result[0] = force[0]
            result[1] = force[1]
            result[2] = 0.0
            result[3] = 0.0
            result[4] = force[2]
        except Exception:  # the only kind Numba can catch; `reproduce` finds out which
            code = Code.RAISED_COMPILED
        return code

    return entry


def _adapt_with_state(function: Callable[..., Any], count: int, states: int) -> Any:
    """Return CFFSUB that keeps so many numbers of its own as a C function."""

    def entry(element: int, inputs: Pointer, par: Pointer, out: Pointer) -> int:
        a: F1 = vector_at(inputs, FRICTION_INPUTS + states)
        values = as_tuple(vector_at(par, count), count)
        kept = as_tuple(a[FRICTION_INPUTS:], states)
        result = vector_at(out, MEMORY_OUT + states)
        code = 0
        try:
            force, new = function(
                element,
                a[TIME_IN],
                values,
                count,
                vector(a[LOCI_IN:]),
                vector(a[LOCJ_IN:]),
                vector(a[X_IN:]),
                vector(a[XDOT_IN:]),
                a[NFORCE_IN],
                int(a[DFLAG]),
                0,
                kept,
                a[TIME_IN],
                a[AREA_IN],
            )
            if len(force) != 3 or len(new) != states:
                raise ValueError("not as many")
            result[0] = force[0]
            result[1] = force[1]
            result[2] = 0.0
            result[3] = 0.0
            result[4] = force[2]
            # what it stores, if anything, nobody can tell; nor whether it sticks
            for k in range(5, MEMORY_OUT):
                result[k] = 0.0
            total = 0.0
            for k in range(states):
                result[MEMORY_OUT + k] = new[k]
                total += abs(new[k])
            if not math.isfinite(total):
                # found where forces are looked at
                result[0] = math.nan
        except Exception:  # as above
            code = Code.RAISED_COMPILED
        return code

    return entry


def friction_address(
    function: Callable[..., Any], callees: list[Any], count: int, states: int = 0
) -> int:
    """Return the address of a rewritten CFFSUB behind FRICTION_SIGNATURE."""
    # as Python: a division by zero raises, an index beyond the end too
    for each in (*callees, function):
        mark(each, error_model="python", boundscheck=True)
    if states:
        return jit.address(
            _adapt_with_state(function, count, states), FRICTION_SIGNATURE, allocates=True
        )
    return jit.address(_adapt(function, count), FRICTION_SIGNATURE, allocates=True)
