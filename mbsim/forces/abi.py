"""The internal signatures of applied forces, and what puts a kind behind an address.

Scalar   int64 f(int64 what, double x, double rate, const double *par, const double kept[3],
                 int64 law, const double *law_par, double *law_out, double *out)
         `what` is a `formula.Asked`. FORCE: force, stored energy, lost power, dF/dx and dF/dx',
         which are no numbers of kinds without slopes; SIDE: on which side of its switches it is;
         COMMIT: slider, mode, energy lost
Wrench   int64 f(const double motion[12], const double *par, double out[8])
         out: force and torque on I along J's axes, stored energy, lost power
Slopes   int64 f(const double motion[12], const double *par, double out[12][6])
         out: K and D, see `forces.catalog`

`motion` is a `formula.Motion`: d, theta, v, w; `kept` a `formula.Kept`; `law` the address of a
normal law, or 0. The result is 0. Numbers that are not finite are found by the caller.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Sequence
from typing import Any

from mbsim.core import jit
from mbsim.core.address import call_int, table_at, vector_at
from mbsim.core.arrays import F1, V2, V3, Pointer
from mbsim.core.jitable import compiled_form, jitable
from mbsim.core.signature import FLOAT, INT, POINTER
from mbsim.forces.catalog import FORCES, Switched, Wrench
from mbsim.forces.formula import Asked, Kept, Motion, ask

SIGNATURE = INT(POINTER, POINTER, POINTER)
SCALAR_SIGNATURE = INT(INT, FLOAT, FLOAT, POINTER, POINTER, INT, POINTER, POINTER, POINTER)
#: Slopes that have not been compiled yet, by the address of their wrench.
_SLOPES: dict[int, Any] = {}


@jitable
def motion_in(a: F1) -> Motion:
    """Return the `Motion` that lies in the numbers of array `a`."""
    return Motion((a[0], a[1], a[2]), (a[3], a[4], a[5]), (a[6], a[7], a[8]), (a[9], a[10], a[11]))


@compiled_form(ask)
def _ask(law: Any, depth: Any, rate: Any) -> Any:
    """Give compiled code its form of `ask`, where a law is address, constants and room."""

    def compiled(law: Any, depth: Any, rate: Any) -> Any:
        address, par, out = law
        if call_int(address, (depth, rate, par, out)) != 0:
            return math.nan, math.nan, math.nan
        return out[0], out[1], out[2]

    return compiled


def _adapt_scalar(force: Callable[..., Any], slopes: Callable[..., Any], count: int) -> Any:
    """Return a formula of `count` constants without branches as a C function."""

    def entry(
        what: int,
        x: float,
        rate: float,
        par: Pointer,
        kept: Pointer,
        law: int,
        law_par: Pointer,
        law_out: Pointer,
        out: Pointer,
    ) -> int:
        result, given = vector_at(out, 5), vector_at(par, count)
        size, stored, lost = force(x, rate, given)
        result[0] = size
        result[1] = stored
        result[2] = lost
        by_x, by_rate = slopes(x, rate, given)
        result[3] = by_x
        result[4] = by_rate
        return 0

    return entry


def _no_slopes(x: float, rate: float, par: Sequence[float], kept: Kept, law: Any) -> V2:
    return math.nan, math.nan


def _no_memory(x: float, rate: float, par: Sequence[float], kept: Kept) -> V3:
    return 0.0, 0.0, 0.0


def _adapt_switched(form: Switched, count: int) -> Any:
    """Return a formula of `count` constants with branches as a C function."""
    force, side = form.force, form.side
    slopes = jitable(_no_slopes) if form.slopes is None else form.slopes
    commit = jitable(_no_memory) if form.commit is None else form.commit

    def entry(
        what: int,
        x: float,
        rate: float,
        par: Pointer,
        kept: Pointer,
        law: int,
        law_par: Pointer,
        law_out: Pointer,
        out: Pointer,
    ) -> int:
        result, given, before = vector_at(out, 5), vector_at(par, count), vector_at(kept, 3)
        now, own = Kept(before[0], before[1], before[2]), (law, law_par, vector_at(law_out, 3))
        if what == Asked.SIDE:
            result[0] = side(x, rate, given, now, own)
        elif what == Asked.COMMIT:
            slider, mode, lost = commit(x, rate, given, now)
            result[0] = slider
            result[1] = mode
            result[2] = lost
        else:
            size, stored, lost = force(x, rate, given, now, own)
            result[0] = size
            result[1] = stored
            result[2] = lost
            by_x, by_rate = slopes(x, rate, given, now, own)
            result[3] = by_x
            result[4] = by_rate
        return 0

    return entry


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
def formula_address(name: str, count: int) -> int:
    """Return the address of the formula of a kind, which takes `count` constants."""
    form: Any = FORCES[name].form
    if isinstance(form, Wrench):
        address = jit.address(_adapt_wrench(form.wrench, count), SIGNATURE)
        _SLOPES[address] = _adapt_slopes(form.slopes, count)
        return address
    if isinstance(form, Switched):
        return jit.address(_adapt_switched(form, count), SCALAR_SIGNATURE)
    return jit.address(_adapt_scalar(form.force, form.slopes, count), SCALAR_SIGNATURE)


def slopes_address(wrench: int) -> int:
    """Return the address of the slopes that belong to the wrench at an address."""
    return jit.address(_SLOPES[wrench], SIGNATURE)
