"""Polygons cut from a triangle, in the triangle's own coordinates.

A point of a triangle a b c is a + u (b - a) + v (c - a). A linear function of the point is the
three numbers f0, fu, fv of f = f0 + fu u + fv v.
"""

from __future__ import annotations

from mbsim.core.arrays import F1, F2, V3
from mbsim.core.jitable import jitable
from mbsim.geometry.mesh.record import (
    MOST,
    OF_ONE,
    OF_PSI,
    OF_PSI_U,
    OF_PSI_V,
    OF_SQUARE,
    OF_UU,
    OF_UV,
    OF_VV,
)

#: Corners at most: 3, and one more for each of up to 5 cuts.
CORNERS = 8
#: Numbers of a corner: u, v, and what made the edge that begins there (0 to 2: the triangle's own
#: edge from corner k to the next; else the tag of the cut).
CORNER = 3


@jitable
def begin(work: F2, at: int) -> int:
    """Write the whole triangle into rows from `at` on; return its number of corners."""
    work[at, 0], work[at, 1], work[at, 2] = 0.0, 0.0, 0.0
    work[at + 1, 0], work[at + 1, 1], work[at + 1, 2] = 1.0, 0.0, 1.0
    work[at + 2, 0], work[at + 2, 1], work[at + 2, 2] = 0.0, 1.0, 2.0
    return 3


@jitable
def cut(work: F2, at: int, count: int, f: V3, tag: int, to: int) -> int:
    """Write the part of a convex polygon where f >= 0; return its number of corners.

    The polygon is in rows from `at` on, the part goes to those from `to` on.
    """
    kept = to
    after = f[0] + f[1] * work[at, 0] + f[2] * work[at, 1]
    for k in range(at, at + count):
        j = k + 1 if k + 1 < at + count else at
        here = after
        after = f[0] + f[1] * work[j, 0] + f[2] * work[j, 1]
        if here >= 0.0:
            for c in range(3):
                work[kept, c] = work[k, c]
            kept += 1
        if (here >= 0.0) != (after >= 0.0):
            part = here / (here - after)
            for c in range(2):
                work[kept, c] = work[k, c] + part * (work[j, c] - work[k, c])
            # an edge that goes out is followed by the cut, one that comes in goes on
            work[kept, 2] = tag if here >= 0.0 else work[k, 2]
            kept += 1
    return kept - to


@jitable
def integrate(work: F2, at: int, count: int, psi: V3, sums: F1) -> None:
    """Add the integrals of a polygon in rows from `at` on over du dv to `sums`, its largest psi."""
    u0, v0 = work[at, 0], work[at, 1]
    p0 = psi[0] + psi[1] * u0 + psi[2] * v0
    sums[MOST] = max(sums[MOST], p0)
    u1, v1 = work[at + 1, 0], work[at + 1, 1]
    p1 = psi[0] + psi[1] * u1 + psi[2] * v1
    sums[MOST] = max(sums[MOST], p1)
    for k in range(at + 2, at + count):
        u2, v2 = work[k, 0], work[k, 1]
        p2 = psi[0] + psi[1] * u2 + psi[2] * v2
        sums[MOST] = max(sums[MOST], p2)
        area = 0.5 * ((u1 - u0) * (v2 - v0) - (v1 - v0) * (u2 - u0))
        total = p0 + p1 + p2
        sums[OF_ONE] += area
        sums[OF_PSI] += area * total / 3.0
        u, v = u0 + u1 + u2, v0 + v1 + v2
        pu, pv = p0 * u0 + p1 * u1 + p2 * u2, p0 * v0 + p1 * v1 + p2 * v2
        sums[OF_PSI_U] += area / 12.0 * (total * u + pu)
        sums[OF_PSI_V] += area / 12.0 * (total * v + pv)
        # of a product of three linear functions: all products of sums, by 60
        uu, uv, vv = (
            u0 * u0 + u1 * u1 + u2 * u2,
            u0 * v0 + u1 * v1 + u2 * v2,
            v0 * v0 + v1 * v1 + v2 * v2,
        )
        puu = p0 * u0 * u0 + p1 * u1 * u1 + p2 * u2 * u2
        puv = p0 * u0 * v0 + p1 * u1 * v1 + p2 * u2 * v2
        pvv = p0 * v0 * v0 + p1 * v1 * v1 + p2 * v2 * v2
        part = area / 60.0
        sums[OF_UU] += part * (total * (u * u + uu) + 2.0 * (u * pu + puu))
        sums[OF_UV] += part * (total * (u * v + uv) + u * pv + v * pu + 2.0 * puv)
        sums[OF_VV] += part * (total * (v * v + vv) + 2.0 * (v * pv + pvv))
        sums[OF_SQUARE] += area / 12.0 * (total * total + p0 * p0 + p1 * p1 + p2 * p2)
        u1, v1, p1 = u2, v2, p2
