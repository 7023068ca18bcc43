"""The hooks of implicit methods, and those of derivatives of joints and forces.

The linearised mechanism stands behind a hook of the scene, so its arrays are made only where a
method asks for them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from mbsim.arrays.hooks import Hook, failure_or
from mbsim.arrays.scene import WRENCH, Scene
from mbsim.compile_model.program_dependence import find_depends
from mbsim.compile_model.tangent import Tangent, make_tangent
from mbsim.core.address import pack, vector_at, view
from mbsim.core.problem import Problem, addresses
from mbsim.dynamics.linearization.applied_slopes import add_applied_slopes
from mbsim.dynamics.linearization.connection_slopes import add_rubs_slopes
from mbsim.dynamics.linearization.expression_slopes import fill_state_slopes
from mbsim.dynamics.linearization.marker_force_slopes import add_marker_forces_slopes
from mbsim.dynamics.linearization.mechanism import add_bends, linearise
from mbsim.dynamics.linearization.motion_slopes import add_motion_rows
from mbsim.dynamics.linearization.newton_matrix import factor, solve
from mbsim.dynamics.pipeline.hook_table import Method, fill


def _linearise(context, t, h, a, b):
    """The mechanism linearised where it has just been evaluated."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    return failure_or(scene, linearise(scene, T, t, h, vector_at(a, n), vector_at(b, n)))


def _factor(context, t, h, a, b):
    """The matrix of real coefficients."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    for k in range(4):
        T.real.c[0, k] = a[k]
    return failure_or(scene, factor(scene, T, T.real, h))


def _solve(context, t, h, a, b):
    """The correction of a residual."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    n = scene.rows.y.shape[1]
    return failure_or(scene, solve(scene, T, T.real, vector_at(a, n), vector_at(b, n)))


def _factor_pair(context, t, h, a, b):
    """The matrix of complex coefficients."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    for k in range(3):
        T.pair.c[0, k] = complex(a[2 * k], a[2 * k + 1])
    T.pair.c[0, 3] = a[6]
    return failure_or(scene, factor(scene, T, T.pair, h))


def _solve_pair(context, t, h, a, b):
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


def slopes(context, t, y):
    """The derivatives of forces between markers and of states' slopes."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def slopes_with_marker_forces(context, t, y):
    """The same, of marker forces too."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    fill_state_slopes(scene, T, t, a)
    return code


def slopes_with_rubs(context, t, y):
    """The same, of friction in joints instead."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_rubs_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def slopes_with_both(context, t, y):
    """The same, of both."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    add_rubs_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def bend(context, t, y):
    """How the forces of equations turn with the bodies."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    add_bends(scene, T, t, vector_at(y, scene.rows.y.shape[1]))
    return 0


def bend_and_drive(context, t, y):
    """The same, and the rows of motions of velocities and accelerations."""
    scene = view(context, Scene)
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    add_bends(scene, T, t, a)
    add_motion_rows(scene, T, t, a)
    return 0


def _find_slopes(scene: Scene) -> None:
    """Let wrenches have their slopes."""
    from mbsim.forces.abi import slopes_address

    applied = scene.applied
    for f in np.flatnonzero(applied.form == WRENCH):
        applied.slopes[f] = slopes_address(int(applied.formula[f]))


def implicit_hooks(scene: Scene, problem: Problem, pair: bool) -> tuple[Problem, Any]:
    """Return the problem with the hooks of an implicit method, and what must live with it.

    `pair`: the method solves with complex coefficients as well.
    """
    tangent = make_tangent(scene, find_depends(scene), pair)
    table = pack(tangent)
    scene.world.hooks[Hook.TANGENT] = int(table.ctypes.data)
    _find_slopes(scene)
    fill(scene, Method(tangent, pair))
    hooks = {"linearise": _linearise, "factor": _factor, "solve": _solve}
    if pair:
        hooks |= {"factor_pair": _factor_pair, "solve_pair": _solve_pair}
    return problem._replace(**addresses(hooks)), (tangent, table)
