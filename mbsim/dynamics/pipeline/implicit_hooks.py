"""The hooks of implicit methods, and those of derivatives of joints and forces."""

from __future__ import annotations

from mbsim.arrays.codes import FORM
from mbsim.arrays.hooks import ContactSlopes, FaceSlopes, Hook, failure_or
from mbsim.arrays.scene import Scene
from mbsim.compile_model.tangent import Tangent
from mbsim.core.address import vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.dynamics.linearization.applied_slopes import add_applied_slopes
from mbsim.dynamics.linearization.connection_slopes import (
    add_joint_frictions_slopes,
    add_marker_forces_slopes,
    add_multi_point_slopes,
)
from mbsim.dynamics.linearization.contact_slopes import (
    add_contacts_slopes,
    add_moves_of_centre,
    add_region_stiffness,
    couple_contacts,
    resist_tilting,
)
from mbsim.dynamics.linearization.element_slopes import add_all_residual_slopes
from mbsim.dynamics.linearization.expression_slopes import add_motion_rows, fill_state_slopes
from mbsim.dynamics.linearization.mechanism import add_bends, linearise
from mbsim.dynamics.linearization.newton_matrix import factor, solve


def _linearise(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The mechanism linearised where it has just been evaluated."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    return failure_or(scene, linearise(scene, T, t, h, vector_at(a, n), vector_at(b, n)))


def _factor(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The matrix of real coefficients."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    for k in range(4):
        T.real.c[0, k] = a[k]
    return failure_or(scene, factor(scene, T, T.real, h))


def _solve(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The correction of a residual."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    return failure_or(scene, solve(scene, T, T.real, vector_at(a, n), vector_at(b, n)))


def _factor_pair(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The matrix of complex coefficients."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    for k in range(3):
        T.pair.c[0, k] = complex(a[2 * k], a[2 * k + 1])
    T.pair.c[0, FORM] = a[6]
    return failure_or(scene, factor(scene, T, T.pair, h))


def _solve_pair(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """The correction of a complex residual: real parts, then imaginary ones."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    given, found = T.pair.r[0], T.pair.r[1]
    for k in range(n):
        given[k] = complex(a[k], a[n + k])
    code = solve(scene, T, T.pair, given, found)
    for k in range(n):
        b[k] = found[k].real
        b[n + k] = found[k].imag
    return failure_or(scene, code)


@jitable
def placed(context: int, y: Pointer) -> tuple[Scene, Tangent, F1]:
    """Return the scene and the tangent that stand behind `context`, and y as an array."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    return scene, T, vector_at(y, scene.rows.y.shape[1])


def slopes(context: int, t: float, y: Pointer) -> int:
    """The derivatives of forces between markers and of states' slopes."""
    scene, T, a = placed(context, y)
    code = add_applied_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def slopes_with_marker_forces(context: int, t: float, y: Pointer) -> int:
    """The same, of marker forces too."""
    scene, T, a = placed(context, y)
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    fill_state_slopes(scene, T, t, a)
    return code


def slopes_with_joint_friction(context: int, t: float, y: Pointer) -> int:
    """The same, of friction in joints instead."""
    scene, T, a = placed(context, y)
    code = add_applied_slopes(scene, T, t, a)
    add_joint_frictions_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


@jitable
def add_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> int:
    """Add the derivatives of all forces between two markers and of states' slopes; return 0."""
    code = add_applied_slopes(scene, T, t, y)
    add_marker_forces_slopes(scene, T, y)
    add_joint_frictions_slopes(scene, T, t, y)
    fill_state_slopes(scene, T, t, y)
    return code


def slopes_with_both(context: int, t: float, y: Pointer) -> int:
    """The same, of both."""
    scene, T, a = placed(context, y)
    return add_slopes(scene, T, t, a)


def residual_slopes(context: int, t: float, y: Pointer) -> int:
    """The derivatives of all forces between two markers, elements among them, and of slopes."""
    scene, T, a = placed(context, y)
    code = add_slopes(scene, T, t, a)
    add_all_residual_slopes(scene, T, t, a)
    return code


def all_slopes(context: int, t: float, y: Pointer) -> int:
    """The same, of forces of several markers too."""
    scene, T, a = placed(context, y)
    add_multi_point_slopes(scene, T, a)
    code = add_slopes(scene, T, t, a)
    add_all_residual_slopes(scene, T, t, a)
    return code


def slopes_of_contacts(context: int, what: int, t: float, h: float, y: Pointer) -> int:
    """The derivatives of contacts."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    if what == ContactSlopes.COUPLE:
        return 0 if couple_contacts(scene, T.pattern) else Code.NO_ROOM
    return add_contacts_slopes(scene, T, t, h, vector_at(y, scene.rows.y.shape[1]))


def slopes_of_faces(context: int, what: int, s: int, a: float, b: float, y: Pointer) -> float:
    """The derivatives of a flat face that is one incident; a, b are as its functions say."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    state = vector_at(y, scene.rows.y.shape[1])
    if what == FaceSlopes.STIFFNESS:
        return add_region_stiffness(scene, T, state, s, a, b)
    if what == FaceSlopes.TILTING:
        resist_tilting(scene, T, state, s)
    else:
        add_moves_of_centre(scene, T, state, s, a)
    return 0.0


def bend(context: int, t: float, y: Pointer) -> int:
    """How the forces of equations turn with the bodies."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    add_bends(scene, T, t, vector_at(y, scene.rows.y.shape[1]))
    return 0


def bend_and_drive(context: int, t: float, y: Pointer) -> int:
    """The same, and the rows of motions of velocities and accelerations."""
    scene, T, a = placed(context, y)
    add_bends(scene, T, t, a)
    add_motion_rows(scene, T, t, a)
    return 0


#: By their names in `Problem`; those of a method that solves with complex coefficients as well.
HOOKS = {"linearise": _linearise, "factor": _factor, "solve": _solve}
PAIR_HOOKS = {"factor_pair": _factor_pair, "solve_pair": _solve_pair}
