"""The documented C and Fortran CFFSUB behind the internal signature of friction laws.

Compiled once for all libraries: where the user's function lies differs in every process, so it
comes as data. The parameters of such a law begin with the address of a packed `LibraryCall`.
Apart from `shared_library`, so that the cache key of this covers no more than it needs.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from mbsim.core.address import call_int, vector_at, view
from mbsim.core.arrays import F1, I1, Pointer
from mbsim.core.jitable import jitable
from mbsim.laws.abi import (
    AREA_IN,
    DFLAG,
    FRICTION_INPUTS,
    LOCI_IN,
    LOCJ_IN,
    NFORCE_IN,
    TIME_IN,
    X_IN,
    XDOT_IN,
)


class LibraryCall(NamedTuple):
    """What a call of a library's function needs beside the law's input; one a contact."""

    address: I1  # (1,) of the user's function
    whole: Annotated[npt.NDArray[np.int32], "int32", 1]  # id, npar, dflag, iflag
    par: F1  # (npar,) a copy: what the function writes there is gone at the next call
    result: F1  # (8,) what it returns, with room for a function that returns too much


@jitable
def begin_call(call: LibraryCall, element: int, values: F1, dflag: int) -> None:
    """Write down what a call is given; results that it leaves unset are found, as nan."""
    for k in range(len(call.par)):
        call.par[k] = values[k]
    call.whole[0], call.whole[1] = element, len(call.par)
    call.whole[2], call.whole[3] = dflag, 0
    for k in range(3):
        call.result[k] = np.nan


def call_c(element: int, inputs: Pointer, par: Pointer, out: Pointer) -> int:
    """CFFSUB(id, time, par, npar, loci, locj, x, xdot, nforce, dflag, iflag, result)."""
    call: LibraryCall = view(np.int64(vector_at(par, 1)[0]), LibraryCall)
    a, n = vector_at(inputs, FRICTION_INPUTS), len(call.par)
    whole, result = call.whole, call.result
    begin_call(call, element, vector_at(par, 1 + n)[1:], int(a[DFLAG]))
    # the function returns nothing, and nobody looks at what `call_int` takes for its result
    call_int(
        call.address[0],
        (whole[0:], a[TIME_IN:], call.par, whole[1:], a[LOCI_IN:], a[LOCJ_IN:], a[X_IN:],
         a[XDOT_IN:], a[NFORCE_IN:], whole[2:], whole[3:], result),
    )  # fmt: skip
    force = vector_at(out, 5)
    force[0], force[1], force[2], force[3], force[4] = result[0], result[1], 0.0, 0.0, result[2]
    return 0


def call_fortran(element: int, inputs: Pointer, par: Pointer, out: Pointer) -> int:
    """CFFSUB(ID, TIME, PAR, NPAR, LOCI, LOCJ, X, XDOT, NFORCE, AREA, DFLAG, IFLAG, RESULTS)."""
    call: LibraryCall = view(np.int64(vector_at(par, 1)[0]), LibraryCall)
    a, n = vector_at(inputs, FRICTION_INPUTS), len(call.par)
    whole, result = call.whole, call.result
    begin_call(call, element, vector_at(par, 1 + n)[1:], int(a[DFLAG]))
    call_int(
        call.address[0],
        (whole[0:], a[TIME_IN:], call.par, whole[1:], a[LOCI_IN:], a[LOCJ_IN:], a[X_IN:],
         a[XDOT_IN:], a[NFORCE_IN:], a[AREA_IN:], whole[2:], whole[3:], result),
    )  # fmt: skip
    force = vector_at(out, 5)
    force[0], force[1], force[2], force[3], force[4] = result[0], result[1], 0.0, 0.0, result[2]
    return 0
