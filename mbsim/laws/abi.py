"""The one internal signature of laws, and the adapters that put a law behind an address.

Normal law      int64 f(double depth, double rate, const double *par, double out[3])
                out: force [F], force at rate 0 [F], stored energy [F L] (LOAD, ELASTIC, ENERGY)
Friction law    int64 f(int64 id, const double *in, const double *par, double *out)
                in: the FRICTION_INPUTS fields of `FrictionInput` in order, then the law's memory;
                out: Fx, Fy, Mx, My, Tz on I; of a law with memory then the energy stored, mode,
                branch, size and unit, and from MEMORY_OUT on its new memory and rates of that

`id` is the Force_Contact's. The result is 0, or a code that stops the run: 1 says that an
interpreted user function raised (the guard in `plugins` holds the exception), 2 that a
compiled one did. Results that are not finite are found by the caller, for every law alike.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from mbsim.core import jit
from mbsim.core.address import as_tuple, vector_at
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.rotation import vector
from mbsim.core.signature import FLOAT, INT, POINTER
from mbsim.laws.catalog import FrictionInput, FrictionLaw, NormalLaw

#: Results of a normal law.
LOAD, ELASTIC, ENERGY = range(3)

FRICTION_INPUTS = 28
#: Where the fields of `FrictionInput` begin in the numbers that a friction law is given.
TIME_IN, STEP_IN, X_IN, XDOT_IN, ROLLING_IN, NFORCE_IN = 0, 1, 2, 5, 8, 10
AREA_IN, RADIUS_IN, LOCI_IN, LOCJ_IN = 11, 12, 13, 16
#: Those that only derivatives and laws with memory look at.
DFLAG, FROZEN, NORMAL_STIFFNESS, SLIPPING_MASS, SLIDING_LIMIT, GROWTH = range(19, 25)
NORMAL_RATE, LIMIT_RATE, STIFFNESS_RATE = range(25, FRICTION_INPUTS)
#: Fields of a law's output before its memory.
FORCE_X_OUT, FORCE_Y_OUT, TORQUE_X_OUT, TORQUE_Y_OUT, TORQUE_Z_OUT = range(5)
STORED_OUT, MODE_OUT, BRANCH_OUT, SIZE_OUT, UNIT_OUT, MEMORY_OUT = range(5, 11)

NORMAL_SIGNATURE = INT(FLOAT, FLOAT, POINTER, POINTER)
FRICTION_SIGNATURE = INT(INT, POINTER, POINTER, POINTER)


@jitable
def friction_input(a: F1) -> FrictionInput:
    """Return the `FrictionInput` that lies in the numbers of array `a`."""
    return FrictionInput(
        a[TIME_IN],
        a[STEP_IN],
        vector(a[X_IN:]),
        vector(a[XDOT_IN:]),
        (a[ROLLING_IN], a[ROLLING_IN + 1]),
        a[NFORCE_IN],
        a[AREA_IN],
        a[RADIUS_IN],
        vector(a[LOCI_IN:]),
        vector(a[LOCJ_IN:]),
        a[DFLAG],
        a[FROZEN],
        a[NORMAL_STIFFNESS],
        a[SLIPPING_MASS],
        a[SLIDING_LIMIT],
        a[GROWTH],
        a[NORMAL_RATE],
        a[LIMIT_RATE],
        a[STIFFNESS_RATE],
    )


def _adapt_normal(law: Callable[..., Any], count: int) -> Any:
    """Return a normal law of `count` constants as a C function."""

    def entry(depth: float, rate: float, par: Pointer, out: Pointer) -> int:
        values = as_tuple(vector_at(par, count), count)
        result = vector_at(out, 3)
        force, elastic, stored = law(depth, rate, *values)
        result[0] = force
        result[1] = elastic
        result[2] = stored
        return 0

    return entry


def _adapt_friction(force: Callable[..., Any], count: int) -> Any:
    """Return `force` of `count` parameters as a C function."""

    def entry(element: int, inputs: Pointer, par: Pointer, out: Pointer) -> int:
        values = as_tuple(vector_at(par, count), count)
        result = vector_at(out, 5)
        given = friction_input(vector_at(inputs, FRICTION_INPUTS))
        fx, fy, mx, my, tz = force(given, *values)
        result[0] = fx
        result[1] = fy
        result[2] = mx
        result[3] = my
        result[4] = tz
        return 0

    return entry


def _adapt_with_memory(force: Callable[..., Any], count: int, memory: int, carried: int) -> Any:
    """Return `force` of `count` parameters and so many numbers of memory as a C function."""
    given = memory + carried

    def entry(element: int, inputs: Pointer, par: Pointer, out: Pointer) -> int:
        values = as_tuple(vector_at(par, count), count)
        a = vector_at(inputs, FRICTION_INPUTS + memory)
        kept = as_tuple(a[FRICTION_INPUTS:], memory)
        result = vector_at(out, MEMORY_OUT + given)
        found, new = force(friction_input(a), kept, *values)
        for k in range(MEMORY_OUT):
            result[k] = found[k]
        for k in range(given):
            result[MEMORY_OUT + k] = new[k]
        return 0

    return entry


@functools.cache
def normal_address(law: NormalLaw) -> int:
    """Return the address of a normal law behind `NORMAL_SIGNATURE`."""
    return jit.address(_adapt_normal(law.law, len(law.takes)), NORMAL_SIGNATURE)


@functools.cache
def friction_address(law: FrictionLaw) -> int:
    """Return the address of a friction law behind `FRICTION_SIGNATURE`."""
    count = len(law.parameters)
    if law.memory:
        adapted = _adapt_with_memory(law.force, count, law.memory, law.carried)
    else:
        adapted = _adapt_friction(law.force, count)
    return jit.address(adapted, FRICTION_SIGNATURE)
