"""Where the stages of a derivative in a step of RADAU5 are looked for first.

The last step's polynomial through D and its stages D_i, i = 1, 2, 3, carried on to s = 1 + c_j r of
it, r = h / h_last, is off from stage j of the next step by

    h_last^4 D'''' (r^4 k_j - k_1 l_1(s) - k_2 l_2(s) + w(s) / 24) + O(h^5),

w(s) = s (s - c_1) (s - c_2) (s - 1) being what is left of a polynomial, l_i those that are 1 at c_i
and 0 at the other points of it, and k_j = -1/6 times the integral of (s - c_1) (s - c_2) (s - 1)
from 0 to c_j what a stage itself is off by. The last step shows what h^4 D'''' is: by how much its
last stage was not where it had been looked for.
Source: E. Hairer, G. Wanner, Solving ODEs II (1996), section IV.8, of the polynomial.
"""

from __future__ import annotations

import numpy as np

from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.integrators.radau5 import C
from mbsim.integrators.scheme import FRESH, LAST_STEP, Method
from mbsim.sensitivity.arrays import Variations

_LEFT = np.polynomial.Polynomial.fromroots(C).integ()
#: By how much stages are off, in h^4 D''''.
K = np.array([(_LEFT(0.0) - _LEFT(c)) / 6.0 for c in C])
#: A polynomial is carried on so far, and D'''' so far, in lengths of the last step.
FARTHEST, FAR = 10.0, 2.5
LAST = 2


@jitable
def goes_on(m: Method, h: float) -> bool:
    """Return whether the last step's polynomials say something of a step h from its end."""
    last = m.memory[LAST_STEP]
    return m.memory[FRESH] == 0.0 and last > 0.0 and h < FARTHEST * last


@jitable
def basis(s: float, j: int) -> float:
    """Return l of stage 0 or 1, the cubic that is 1 there, and 0 at 0, 1 and the other one."""
    c, other = C[j], C[1 - j]
    return s * (s - other) * (s - 1.0) / (c * (c - other) * (c - 1.0))


@jitable
def off_ahead(r: float, j: int) -> float:
    """Return by how much the polynomial is off at stage j of a step r times as long as the last."""
    s = 1.0 + C[j] * r
    left = s * (s - C[0]) * (s - C[1]) * (s - 1.0)
    return r**4 * K[j] - K[0] * basis(s, 0) - K[1] * basis(s, 1) + left / 24.0


@jitable
def rises(V: Variations, k: int, s: float, i: int) -> float:
    """Return how much derivative k rises from the last step's end to s >= 1 of its polynomial."""
    inner = V.dense[k, 2, i] + s * V.dense[k, 3, i]
    return s * (V.dense[k, 1, i] + (1.0 - s) * inner) - V.dense[k, 1, i]


@jitable
def predict(V: Variations, m: Method, h: float, k: int, z: F1) -> None:
    """Write the stages less D, (3, n), as the last step has them."""
    known = goes_on(m, h) and V.smooth[k] == 1
    if not known:
        V.bend_known[k] = 0
    r = h / m.memory[LAST_STEP] if goes_on(m, h) else 0.0
    for j in range(3):
        part = off_ahead(r, j) if V.bend_known[k] == 1 and r < FAR else 0.0
        for i in range(len(m.y)):
            z[j, i] = rises(V, k, 1.0 + C[j] * r, i) + part * V.bend[k, i] if r > 0.0 else 0.0


@jitable
def note_bend(V: Variations, m: Method, h: float, k: int, rise: F1) -> None:
    """Keep h^4 D'''' of a step, at whose end the derivative is `rise` more, for the next one."""
    V.bend_known[k] = 0
    if not goes_on(m, h) or V.smooth[k] == 0:
        return
    V.bend_known[k] = 1
    r = h / m.memory[LAST_STEP]
    part = r**4 / off_ahead(r, LAST)
    for i in range(len(m.y)):
        V.bend[k, i] = part * (rise[i] - rises(V, k, 1.0 + r, i))
