"""How forces between markers change with displacements and velocities: more of K and D.

Expressions and most formulas give exact derivatives, others are asked at neighbouring arguments.
Where forces look at reactions, and press friction in joints, these are taken as they are.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mbsim.arrays.codes import (
    AXIS_FORCE_AT_I,
    AXIS_TORQUE,
    LINE_FORCE,
    MULTI_POINT,
    OF_POINTS,
    POINTS,
    RESIDUAL,
    SCALE_LENGTH,
    SCALE_SPEED,
    VECTOR_FORCE,
    WRENCH,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.markers import marker_axis, marker_point, marker_velocity
from mbsim.dynamics.forces.applied import by_formula, displacement
from mbsim.dynamics.linearization.blocks import couple
from mbsim.dynamics.linearization.expression_slopes import add_program_slopes
from mbsim.dynamics.linearization.stiffness import (
    ACROSS_ROW,
    PART,
    PART_OF_SPEED,
    PUSH,
    UNIT_ROW,
    add_axis_rate,
    add_geometry,
    add_rate_by_pose,
    add_two_sided,
    fill_unit,
    lever,
    sides_of,
)

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Pattern, Tangent


@jitable
def couple_applied(scene: Scene, P: Pattern, T: Tangent) -> bool:
    """Couple the bodies between which forces act, and those that they look at."""
    nb = len(scene.bodies.mass)
    for f in range(len(scene.applied.form)):
        i, j = sides_of(scene, f)
        if i < nb and j < nb and i != j and not couple(P, i, j):
            return False
        if scene.applied.form[f] == MULTI_POINT:
            for k in range(int(scene.applied.par[f, POINTS])):
                other = sides_of(scene, int(scene.applied.par[f, OF_POINTS + k]))[0]
                if i < nb and other < nb and i != other and not couple(P, i, other):
                    return False
        # whose axes a force is along
        along = scene.markers.body[scene.applied.axes[f]]
        for a in (i, j):
            if a < nb and along < nb and a != along and not couple(P, a, along):
                return False
        for k in range(7):
            program = scene.applied.program[f] if k == 6 else scene.applied.components[f, k]
            if program < 0:
                continue
            for at in range(T.depends.body_start[program], T.depends.body_start[program + 1]):
                b = T.depends.body[at]
                for a in (i, j):
                    if a < nb and a != b and not couple(P, a, b):
                        return False
    return True


@jitable
def add_turning_rate(
    scene: Scene, T: Tangent, y: F1, f: int, by_rate: float, n: V3, d: float, u: F2
) -> None:
    """Add how the rate changes as the line turns: (v across)/d . (dP_I - dP_J)."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    across = scale(1.0 / d, sub(v, scale(dot(v, n), n)))
    rows = T.linear.basis[:, ACROSS_ROW]
    none = (0.0, 0.0, 0.0)
    lever(scene, T.linear, y, bi, marker_point(scene, y, i), across, none, rows[0])
    lever(scene, T.linear, y, bj, marker_point(scene, y, j), across, none, rows[1])
    nb = len(scene.bodies.mass)
    add_two_sided(T.pattern, T.linear.K, nb, bi, bj, by_rate, u, rows)


@jitable
def add_vector_slopes(scene: Scene, T: Tangent, t: float, y: F1, f: int) -> None:
    """Add a vector force by expressions."""
    none = (0.0, 0.0, 0.0)
    for k in range(6):
        program = scene.applied.components[f, k]
        if program < 0:
            continue
        e = marker_axis(scene, scene.applied.axes[f], k % 3)
        fill_unit(scene, T, y, f, e if k < 3 else none, none if k < 3 else e, 0)
        u = T.linear.basis[:, UNIT_ROW]
        add_program_slopes(scene, T, t, y, f, program, u)
    add_geometry(scene, T, y, f, scene.applied.axes[f], 0)


@jitable
def force_at(scene: Scene, f: int, x: float, rate: float) -> float:
    """Return F of the formula of scalar force f."""
    by_formula(scene, f, x, rate)
    return scene.work.wrench[0]


@jitable
def formula_slopes(scene: Scene, f: int, x: float, rate: float) -> V2:
    """Return dF/dx and dF/dx' of the formula of scalar force f, by differences if it has none."""
    by_formula(scene, f, x, rate)
    by_x, by_rate = scene.work.wrench[3], scene.work.wrench[4]
    if not math.isnan(by_x):
        return by_x, by_rate
    step = PUSH * max(abs(x), 1e-3 * scene.world.scale[SCALE_LENGTH])
    fast = PART_OF_SPEED * scene.world.scale[SCALE_SPEED] + PART * abs(rate)
    by_x = force_at(scene, f, x + step, rate) - force_at(scene, f, x - step, rate)
    by_rate = force_at(scene, f, x, rate + fast) - force_at(scene, f, x, rate - fast)
    return by_x / (2.0 * step), by_rate / (2.0 * fast)


@jitable
def add_scalar_slopes(scene: Scene, T: Tangent, t: float, y: F1, f: int) -> None:
    """Add a force along a line, along an axis or about one."""
    P, L, nb, form = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.form[f]
    bi, bj = sides_of(scene, f)
    none, at_j = (0.0, 0.0, 0.0), 0 if form == AXIS_FORCE_AT_I else 1
    n, x, rate = displacement(scene, y, f)
    turns, line = form == AXIS_TORQUE, form == LINE_FORCE
    fill_unit(scene, T, y, f, none if turns else n, n if turns else none, at_j)
    u = T.linear.basis[:, UNIT_ROW]
    if scene.applied.program[f] >= 0:
        add_program_slopes(scene, T, t, y, f, scene.applied.program[f], u)
        by_x, by_rate = 0.0, 0.0
    else:
        by_x, by_rate = formula_slopes(scene, f, x, rate)
    if by_x != 0.0:
        add_two_sided(P, L.K, nb, bi, bj, by_x, u, u)
    if by_rate != 0.0:
        add_two_sided(P, L.D, nb, bi, bj, by_rate, u, u)
        if T.linear.stressed[0] == 1:
            if not turns:
                add_rate_by_pose(scene, T, f, u, by_rate, n)
            if not line:
                add_axis_rate(scene, T, f, by_rate, n, u, turns)
            elif x > 0.0:
                add_turning_rate(scene, T, y, f, by_rate, n, x, u)
    add_geometry(scene, T, y, f, -1 if line else scene.applied.axes[f], at_j)
    if line and x > 0.0:
        # the line turns: F/d across it
        tension = dot(vector(scene.work.applied[f]), n) / x
        if T.linear.stressed[0] == 0:
            # what pulls holds the line, what pushes lets it buckle
            tension = min(tension, 0.0)
        a = cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0))
        a = scale(1.0 / norm(a), a)
        for e in (a, cross(n, a)):
            fill_unit(scene, T, y, f, e, none, 1)
            u = T.linear.basis[:, UNIT_ROW]
            add_two_sided(P, L.K, nb, bi, bj, tension, u, u)


@jitable
def add_applied_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> int:
    """Add what forces between markers do, but for wrenches and friction in joints."""
    for f in range(len(scene.applied.form)):
        form = scene.applied.form[f]
        if form == VECTOR_FORCE:
            add_vector_slopes(scene, T, t, y, f)
        elif form == WRENCH or form == RESIDUAL or form == MULTI_POINT:
            continue
        elif scene.applied.connection[f] < 0:
            add_scalar_slopes(scene, T, t, y, f)
    return 0
