"""How marker forces change with displacements and velocities: more of K and D.

Apart from `applied_slopes`, so that only scenes that have them compile them. A kind's own slopes
are by what I does as seen from J, along J's axes (`forces.catalog`); that these axes turn is added
here.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import WRENCH
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2, F3, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point
from mbsim.dynamics.contact.forces import velocity_at
from mbsim.dynamics.forces.wrenches import fill_motion
from mbsim.dynamics.linearization.stiffness import (
    add_geometry,
    add_one_sided,
    add_two_sided,
    lever,
    sides_of,
)

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Pattern, Tangent


@jitable
def add_marker_rate(scene: Scene, T: Tangent, y: F1, f: int, e: V3, factor: float, u: F2) -> None:
    """Add how the rate along J's axis e, at I's origin p, changes with poses.

    theta_I . (arm x (e x w_I)) + theta_J . (e x v) - h . (dp - dx_J), h = e x w_J, x_J J's cg.
    """
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    i, work = scene.applied.i[f], scene.work
    both = sides_of(scene, f)
    bi, bj = both
    p, none = marker_point(scene, y, i), (0.0, 0.0, 0.0)
    v = sub(velocity_at(scene, y, bi, p), velocity_at(scene, y, bj, p))
    h = cross(e, vector(work.w[bj]))
    if bi < nb:
        lever(scene, L, y, bi, p, scale(-1.0, h), none, L.rise)
        turned = cross(marker_arm(scene, i), cross(e, vector(work.w[bi])))
        for k in range(3):
            L.rise[k] += turned[k]
        add_one_sided(P, L, nb, both, bi, factor, u)
    if bj < nb:
        lever(scene, L, y, bj, position(scene, y, bj), h, cross(e, v), L.rise)
        add_one_sided(P, L, nb, both, bj, factor, u)


@jitable
def add_marker_spin(scene: Scene, T: Tangent, f: int, e: V3, factor: float, u: F2) -> None:
    """Add how the spin about J's axis e changes as that turns: theta_J . (e x w)."""
    bi, bj = sides_of(scene, f)
    turned = cross(e, sub(vector(scene.work.w[bi]), vector(scene.work.w[bj])))
    for k in range(3):
        T.linear.rise[k] = turned[k]
        T.linear.rise[3 + k] = 0.0
    if bj < len(scene.bodies.mass):
        both = (bi, bj)
        add_one_sided(T.pattern, T.linear, len(scene.bodies.mass), both, bj, factor, u)


@jitable
def fill_units(scene: Scene, T: Tangent, y: F1, f: int) -> None:
    """Fill `basis` with the wrenches of unit forces along J's axes and unit torques about them."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    none, p = (0.0, 0.0, 0.0), marker_point(scene, y, i)
    for side in range(2):
        for k in range(6):
            e = marker_axis(scene, j, k % 3)
            force, torque = (e, none) if k < 3 else (none, e)
            row = T.linear.basis[side, k]
            lever(scene, T.linear, y, bi if side == 0 else bj, p, force, torque, row)


@jitable
def add_column(
    P: Pattern, blocks: F3, nb: int, both: tuple[int, int], slopes: F2, k: int, basis: F3
) -> None:
    """Add column k of the slopes by one component of displacement or velocity."""
    for r in range(6):
        if slopes[r, k] != 0.0:
            u, v = basis[:, r], basis[:, k]
            add_two_sided(P, blocks, nb, both[0], both[1], -slopes[r, k], u, v)


@jitable
def add_marker_force_slopes(scene: Scene, T: Tangent, y: F1, f: int) -> None:
    """Add a marker force."""
    P, L, nb, applied = T.pattern, T.linear, len(scene.bodies.mass), scene.applied
    j, both, table = applied.j[f], sides_of(scene, f), scene.work.slopes
    fill_motion(scene, y, f)
    call_int(applied.slopes[f], (scene.work.motion, applied.par[f], table))
    fill_units(scene, T, y, f)
    K, D = table[:6], table[6:]
    for k in range(6):
        e = marker_axis(scene, j, k % 3)
        add_column(P, L.D, nb, both, D, k, L.basis)
        if k < 3:
            add_column(P, L.K, nb, both, K, k, L.basis)
        for r in range(6):
            if D[r, k] == 0.0:
                continue
            if k < 3:
                add_marker_rate(scene, T, y, f, e, -D[r, k], L.basis[:, r])
            else:
                add_marker_spin(scene, T, f, e, -D[r, k], L.basis[:, r])
        if k >= 3:
            add_column(P, L.K, nb, both, K, k, L.basis)
    add_geometry(scene, T, y, f, j, 0)


@jitable
def add_marker_forces_slopes(scene: Scene, T: Tangent, y: F1) -> None:
    """Add all of them."""
    for f in range(len(scene.applied.form)):
        if scene.applied.form[f] == WRENCH:
            add_marker_force_slopes(scene, T, y, f)
