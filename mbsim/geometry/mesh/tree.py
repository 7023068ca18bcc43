"""Walks through the tree of boxes of a packed mesh (`model.surface`)."""

from __future__ import annotations

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.model.surface import AT_LEAVES, LEVELS

#: Nodes that wait at once: more than a tree of 2^52 leaves has levels.
WAITING = 64


@jitable
def leaf_range(mesh: F1, node: int) -> tuple[int, int]:
    """Return the first triangle of a leaf and the first behind it."""
    at = int(mesh[AT_LEAVES]) + node - (1 << int(mesh[LEVELS]))
    return int(mesh[at]), int(mesh[at + 1])


@jitable
def lowest(mesh: F1, at: int, n: V3) -> float:
    """Return the least height along n of the box whose six numbers begin at `at`."""
    centre = mesh[at] * n[0] + mesh[at + 1] * n[1] + mesh[at + 2] * n[2]
    half = mesh[at + 3] * abs(n[0]) + mesh[at + 4] * abs(n[1]) + mesh[at + 5] * abs(n[2])
    return centre - half


@jitable
def box_square(mesh: F1, at: int, c: V3) -> float:
    """Return the squared distance of c from the box whose six numbers begin at `at`."""
    x = max(0.0, abs(c[0] - mesh[at]) - mesh[at + 3])
    y = max(0.0, abs(c[1] - mesh[at + 1]) - mesh[at + 4])
    z = max(0.0, abs(c[2] - mesh[at + 2]) - mesh[at + 5])
    return x * x + y * y + z * z
