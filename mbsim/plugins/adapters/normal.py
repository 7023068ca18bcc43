"""CNFSUB in compiled Python, C and Fortran behind the internal signature of normal laws.

A file of its own, as `friction` and `library` are, for the cache's sake. The parameters
of such a law begin with an address: of its inputs (`laws.user_normal`), or of a `NormalCall`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from mbsim.core import jit
from mbsim.core.address import as_tuple, call_int, vector_at, view
from mbsim.core.arrays import F1, I1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import compiled_form, jitable, mark
from mbsim.core.memory import floats_at
from mbsim.laws.abi import NORMAL_SIGNATURE
from mbsim.laws.user_normal import (
    AREA,
    EVALUATE,
    ID,
    LOCI,
    LOCJ,
    MODE,
    NI,
    NJ,
    NORMAL_INPUTS,
    TIME,
    begin,
    keep,
    question,
    questions,
)


class NormalCall(NamedTuple):
    """What a call of a library's CNFSUB needs; one a contact."""

    address: I1  # (1,) of the user's function
    whole: Annotated[npt.NDArray[np.int32], "int32", 1]  # id, npar, dflag, iflag
    par: F1  # (npar,) a copy: what the function writes there is gone at the next call
    inputs: F1  # (NORMAL_INPUTS,)
    gap: F1  # (4,) gap, its rate, its second derivative (0), area
    result: F1  # (8,) what it returns, with room for a function that returns too much


@jitable
def prepare(call: NormalCall, values: F1, depth: float, rate: float) -> None:
    """Write down what one question to a library is."""
    for k in range(len(call.par)):
        call.par[k] = values[k]
    call.whole[0], call.whole[1] = int(call.inputs[ID]), len(call.par)
    call.whole[2], call.whole[3] = int(call.inputs[MODE] != EVALUATE), 0
    call.gap[0], call.gap[1], call.gap[2] = -depth, -rate, 0.0
    call.gap[3] = call.inputs[AREA]
    call.result[0] = np.nan


def call_c(depth: float, rate: float, par: Pointer, out: Pointer) -> int:
    """CNFSUB in C.

    Its arguments are id, time, par, npar, loci, ni, locj, nj, gap, gapdot, gapdotdot, dflag,
    iflag, result.
    """
    call: NormalCall = view(np.int64(vector_at(par, 1)[0]), NormalCall)
    result, at, gap, whole = vector_at(out, 3), call.inputs, call.gap, call.whole
    values = vector_at(par, 1 + len(call.par))[1:]
    begin(result, depth)
    for k in range(questions(at, depth)):
        d, r = question(k, depth, rate)
        prepare(call, values, d, r)
        # the function returns nothing, and nobody looks at what `call_int` takes for its result
        call_int(
            call.address[0],
            (whole[0:], at[TIME:], call.par, whole[1:], at[LOCI:], at[NI:], at[LOCJ:], at[NJ:],
             gap[0:], gap[1:], gap[2:], whole[2:], whole[3:], call.result),
        )  # fmt: skip
        keep(result, k, depth, call.result[0])
    return 0


def call_fortran(depth: float, rate: float, par: Pointer, out: Pointer) -> int:
    """As `call_c`, with AREA before DFLAG."""
    call: NormalCall = view(np.int64(vector_at(par, 1)[0]), NormalCall)
    result, at, gap, whole = vector_at(out, 3), call.inputs, call.gap, call.whole
    values = vector_at(par, 1 + len(call.par))[1:]
    begin(result, depth)
    for k in range(questions(at, depth)):
        d, r = question(k, depth, rate)
        prepare(call, values, d, r)
        call_int(
            call.address[0],
            (whole[0:], at[TIME:], call.par, whole[1:], at[LOCI:], at[NI:], at[LOCJ:], at[NJ:],
             gap[0:], gap[1:], gap[2:], gap[3:], whole[2:], whole[3:], call.result),
        )  # fmt: skip
        keep(result, k, depth, call.result[0])
    return 0


def only_one(result: Any) -> float:
    """Return the force that a function gave as a number, or as a list of one."""
    raise NotImplementedError  # `_only_one` is its compiled form


@compiled_form(only_one)
def _only_one(result: Any) -> Callable[[Any], float]:
    from numba import types

    # Numba compares annotations too: a lambda, which has none, is not taken
    def from_number(result: Any) -> float:
        return float(result)

    if isinstance(result, (types.Number, types.Boolean)):
        return from_number

    def from_list(result: Any) -> float:
        if len(result) != 1:
            raise ValueError("not one")
        return float(result[0])

    return from_list


def _adapt(function: Callable[..., Any], count: int) -> Any:
    """Return CNFSUB with `count` parameters as a C function that signals what it raises."""
    wide = count + 1  # with the address ahead of them

    def entry(depth: float, rate: float, par: Pointer, out: Pointer) -> int:
        row = as_tuple(vector_at(par, wide), wide)
        at, values = floats_at(row[0], NORMAL_INPUTS), row[1:]
        result = vector_at(out, 3)
        begin(result, depth)
        code = 0
        try:
            for k in range(questions(at, depth)):
                d, r = question(k, depth, rate)
                force = function(
                    int(at[ID]),
                    at[TIME],
                    values,
                    count,
                    (at[LOCI], at[LOCI + 1], at[LOCI + 2]),
                    (at[NI], at[NI + 1], at[NI + 2]),
                    (at[LOCJ], at[LOCJ + 1], at[LOCJ + 2]),
                    (at[NJ], at[NJ + 1], at[NJ + 2]),
                    -d,
                    -r,
                    0.0,
                    int(at[MODE] != EVALUATE),
                    0,
                    at[TIME],
                    at[AREA],
                )
                keep(result, k, depth, only_one(force))
        except Exception:  # the only kind Numba can catch; the interpreted twin finds out which
            code = Code.USER_NORMAL_FAILED
        return code

    return entry


def normal_address(function: Callable[..., Any], callees: list[Any], count: int) -> int:
    """Return the address of a rewritten CNFSUB behind NORMAL_SIGNATURE."""
    for each in (*callees, function):
        mark(each, error_model="python", boundscheck=True)
    return jit.address(_adapt(function, count), NORMAL_SIGNATURE, allocates=True)
