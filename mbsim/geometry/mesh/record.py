"""The numbers of a contact patch, and of the pieces of surface that it is made of.

With psi the depth below a surface in the field of its body, A the first body I and B the second
one J, a piece of I's surface inside J has psi = psi_J and outward normal n_I, a piece of J's inside
I has psi_I and n_J. Both count half (w = 1/2); on a plane only the pieces of I, whole (w = 1).
Positions are relative to one origin near the patch, in the axes in which it is measured.
"""

from __future__ import annotations

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale

#: Largest psi [L]; sum w integral of psi dA [L^3], and of psi r dA (3) [L^4]; the field's force on
#: I, sum w (-integral of psi_J n_I dA + integral of psi_I n_J dA) (3) [L^3], and its torque on I
#: about the origin (3) [L^4]; the area as a vector, sum w (-integral of n_I dA + integral of n_J
#: dA) (3) [L^2]; the volume of the overlap [L^3]; the potential U [L^4], of which the force is the
#: slope: the sum of w integral of psi dV over the overlap (on a plane: `plane`, of two meshes:
#: `prism`); sum w integral of psi r r' dA (xx, yy, zz, xy, yz, zx) [L^5].
PATCH_NUMBERS = 23
PEAK, PRESSURE, MOMENT, PUSH, TWIST, AREA_VECTOR, VOLUME, POTENTIAL = 0, 1, 2, 5, 8, 11, 14, 15
SPREAD = 16
#: Largest psi that reached the inner end of a layer: the depth of the overlap is not known there.
BEYOND = 22

#: Integrals over a polygon in the coordinates of its triangle: of 1, psi, psi u, psi v, psi^2,
#: psi u^2, psi u v, psi v^2; largest psi.
SUMS = 9
OF_ONE, OF_PSI, OF_PSI_U, OF_PSI_V, OF_SQUARE, OF_UU, OF_UV, OF_VV, MOST = range(SUMS)


@jitable
def add_piece(patch: F1, sums: F1, r: V3, e1: V3, e2: V3, side: float, share: float) -> None:
    """Add a polygon of a triangle to a patch.

    `r` is the triangle's first corner from the origin, `e1`, `e2` are its edges from there; `side`
    is 1 for a triangle of I, -1 of J; `share` its w. The volume comes from the divergence of r / 3,
    so the sum over pieces of I and J is whole, whatever w is. The potential is added elsewhere.
    """
    n = cross(e1, e2)
    first = add(scale(sums[OF_PSI], r), add(scale(sums[OF_PSI_U], e1), scale(sums[OF_PSI_V], e2)))
    twist = cross(first, n)
    size = share * norm(n)
    patch[PEAK] = max(patch[PEAK], sums[MOST])
    patch[PRESSURE] += size * sums[OF_PSI]
    for k in range(3):
        patch[MOMENT + k] += size * first[k]
        patch[PUSH + k] -= side * share * n[k] * sums[OF_PSI]
        patch[TWIST + k] -= side * share * twist[k]
        patch[AREA_VECTOR + k] -= side * share * n[k] * sums[OF_ONE]
    for k in range(6):
        i = k if k < 3 else k - 3
        j = k if k < 3 else (k - 2 if k < 5 else 0)
        # integral of psi (r + u e1 + v e2)_i (r + u e1 + v e2)_j; `first` holds r once
        patch[SPREAD + k] += size * (
            first[i] * r[j] + r[i] * (first[j] - sums[OF_PSI] * r[j])
            + sums[OF_UU] * e1[i] * e1[j] + sums[OF_VV] * e2[i] * e2[j]
            + sums[OF_UV] * (e1[i] * e2[j] + e2[i] * e1[j])
        )  # fmt: skip
    patch[VOLUME] += dot(r, n) * sums[OF_ONE] / 3.0


@jitable
def add_patch(total: F1, part: F1) -> None:
    """Add a part of a patch to it."""
    total[PEAK] = max(total[PEAK], part[PEAK])
    for k in range(PRESSURE, BEYOND):
        total[k] += part[k]
    total[BEYOND] = max(total[BEYOND], part[BEYOND])
