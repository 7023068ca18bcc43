"""What a user's normal law is given beside depth and rate, and what it is asked.

A normal law has the signature (depth, rate, parameters) -> force, force at rate 0, stored energy.
A user's CNFSUB takes more than that and gives the force alone. The rest of what it takes lies in
an array of NORMAL_INPUTS numbers, one a contact, which `contact.forces` fills; force at rate 0 and
stored energy are asked of it only where somebody looks for depths, times or step lengths
(EXPLORE). In the equations of motion all its work counts as dissipated: what it stores, if
anything, nobody can tell.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from mbsim.core.arrays import F1, V2
from mbsim.core.jitable import jitable

# places in the array: LOCI, NI, LOCJ, NJ take three numbers each
MODE, TIME, LOCI, NI, LOCJ, NJ, DEPTH, RATE, ID, PYTHON, AREA = (
    0,
    1,
    2,
    5,
    8,
    11,
    14,
    15,
    16,
    17,
    18,
)
NORMAL_INPUTS = 19

# what is asked: forces on bodies, how they change with depth and rate, or more; dflag but for the
# first
EVALUATE, SLOPES, EXPLORE = 0.0, 1.0, 2.0


# Gauss-Legendre on (0, 1), three points: exact for forces up to depth^5
_AWAY = 0.5 * math.sqrt(0.6)
_NODES = (0.5 - _AWAY, 0.5, 0.5 + _AWAY)
_WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)


@jitable
def questions(inputs: Sequence[float] | F1, depth: float) -> int:
    """Return at how many depths and rates the law is asked."""
    if not depth > 0.0:
        return 0
    return 5 if inputs[MODE] == EXPLORE else 1


@jitable
def question(k: int, depth: float, rate: float) -> V2:
    """Return the depth and rate of question k: as given, at rate 0, then on the way there."""
    if k == 0:
        return depth, rate
    if k == 1:
        return depth, 0.0
    return _NODES[k - 2] * depth, 0.0


@jitable
def begin(out: F1, depth: float) -> None:
    """Set the law's three results to 0, or to nan where the depth is."""
    for k in range(3):
        out[k] = 0.0 * depth


@jitable
def keep(out: F1, k: int, depth: float, force: float) -> None:
    """Add the answer to question k to the law's results."""
    if k < 2:
        out[k] = force
    else:
        out[2] += _WEIGHTS[k - 2] * depth * force
