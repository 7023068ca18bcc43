"""The hooks of implicit methods, and the door to the joint's and forces' derivatives.

The linearised mechanism stands behind a door of the scene, so its arrays are made only where a
method asks for them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types

from mbsim.arrays.scene import (
    BEND_DOOR,
    MARKER_FORCE,
    RESIDUAL,
    SLOPES_DOOR,
    TANGENT_DOOR,
    Scene,
)
from mbsim.compile_model.program_dependence import find_depends
from mbsim.compile_model.tangent import Tangent, make_tangent
from mbsim.core import jit
from mbsim.core.address import pack, vector_at, view
from mbsim.core.problem import HOOK, Problem
from mbsim.dynamics.linearization.connection_slopes import add_rubs_slopes
from mbsim.dynamics.linearization.marker_force_slopes import add_marker_forces_slopes
from mbsim.dynamics.linearization.mechanism import add_bends, linearise
from mbsim.dynamics.linearization.motion_slopes import add_motion_rows
from mbsim.dynamics.linearization.newton_matrix import factor, solve
from mbsim.dynamics.linearization.stiffness import add_applied_slopes, fill_state_slopes
from mbsim.dynamics.pipeline.force_hooks import open_jets

_VALUES = types.int64(types.int64, types.float64, types.CPointer(types.float64))


def _linearise(context, t, h, a, b):
    """The mechanism linearised where it has just been evaluated."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    n = scene.rows.y.shape[1]
    return float(linearise(scene, T, t, h, vector_at(a, n), vector_at(b, n)))


def _factor(context, t, h, a, b):
    """The matrix of real coefficients."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    for k in range(4):
        T.real.c[0, k] = a[k]
    return float(factor(scene, T, T.real, h))


def _solve(context, t, h, a, b):
    """The correction of a residual."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    n = scene.rows.y.shape[1]
    return float(solve(scene, T, T.real, vector_at(a, n), vector_at(b, n)))


def _factor_pair(context, t, h, a, b):
    """The matrix of complex coefficients."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    for k in range(3):
        T.pair.c[0, k] = complex(a[2 * k], a[2 * k + 1])
    T.pair.c[0, 3] = a[6]
    return float(factor(scene, T, T.pair, h))


def _solve_pair(context, t, h, a, b):
    """The correction of a complex residual: real parts, then imaginary ones."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    n = scene.rows.y.shape[1]
    given, found = T.pair.r[0], T.pair.r[1]
    for k in range(n):
        given[k] = complex(a[k], a[n + k])
    code = solve(scene, T, T.pair, given, found)
    for k in range(n):
        b[k] = found[k].real
        b[n + k] = found[k].imag
    return float(code)


def _slopes(context, t, y):
    """The derivatives of forces between markers and of states' slopes."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def _slopes_with_marker_forces(context, t, y):
    """The same, of marker forces too."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    fill_state_slopes(scene, T, t, a)
    return code


def _slopes_with_rubs(context, t, y):
    """The same, of friction in joints instead."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_rubs_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def _slopes_with_both(context, t, y):
    """The same, of both."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    code = add_applied_slopes(scene, T, t, a)
    add_marker_forces_slopes(scene, T, a)
    add_rubs_slopes(scene, T, t, a)
    fill_state_slopes(scene, T, t, a)
    return code


def _bend(context, t, y):
    """How the forces of equations turn with the bodies."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    add_bends(scene, T, t, vector_at(y, scene.rows.y.shape[1]))
    return 0


def _bend_and_drive(context, t, y):
    """The same, and the rows of motions of velocities and accelerations."""
    scene = view(context, Scene)
    T = view(scene.world.doors[TANGENT_DOOR], Tangent)
    a = vector_at(y, scene.rows.y.shape[1])
    add_bends(scene, T, t, a)
    add_motion_rows(scene, T, t, a)
    return 0


def _open_marker_forces(scene: Scene) -> None:
    """Let marker forces have their slopes."""
    from mbsim.forces.abi import slopes_address

    applied = scene.applied
    for f in np.flatnonzero(applied.kind == MARKER_FORCE):
        applied.slopes[f] = slopes_address(int(applied.law[f]))


def open_slopes(scene: Scene) -> None:
    """Open the doors of derivatives of forces and equations where there are some."""
    if len(scene.equations.program) > 0:
        driven = bool((scene.equations.level < 2).any())
        scene.world.doors[BEND_DOOR] = jit.address(_bend_and_drive if driven else _bend, _VALUES)
    if len(scene.applied.kind) == 0 and len(scene.states.program) == 0:
        return
    kinds = set(scene.applied.kind.tolist())
    rubs = bool((scene.applied.connection >= 0).any())
    hook = _slopes_with_rubs if rubs else _slopes
    if MARKER_FORCE in kinds:
        hook = _slopes_with_both if rubs else _slopes_with_marker_forces
        _open_marker_forces(scene)
    if RESIDUAL in kinds:
        from mbsim.dynamics.pipeline.element_hooks import residual_slopes as hook
    scene.world.doors[SLOPES_DOOR] = jit.address(hook, _VALUES)
    if len(scene.programs.start) > 1:
        open_jets(scene)


def implicit_hooks(scene: Scene, problem: Problem, pair: bool) -> tuple[Problem, Any]:
    """Return the problem with the hooks of an implicit method, and what must live with it.

    `pair`: the method solves with complex coefficients as well.
    """
    tangent = make_tangent(scene, find_depends(scene), pair)
    table = pack(tangent)
    scene.world.doors[TANGENT_DOOR] = int(table.ctypes.data)
    open_slopes(scene)
    if len(tangent.keeps.table) > 0:
        from mbsim.dynamics.linearization.memory_slopes import open_memory

        open_memory(scene, pair)
    hooks = {"linearise": _linearise, "factor": _factor, "solve": _solve}
    if pair:
        hooks |= {"factor_pair": _factor_pair, "solve_pair": _solve_pair}
    return (
        problem._replace(**{name: jit.address(hook, HOOK) for name, hook in hooks.items()}),
        (tangent, table),
    )
