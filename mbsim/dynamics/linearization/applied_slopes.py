"""How forces between markers change with displacements and velocities: more of K and D.

Expressions give exact derivatives, limits are asked at neighbouring arguments. Where forces look at
reactions, and press friction in joints, these are taken as they are.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import (
    AXIS_FORCE,
    AXIS_TORQUE,
    DRY_TURN,
    LINE_FORCE,
    MARKER_FORCE,
    RESIDUAL,
    SCALE_LENGTH,
    SCALE_SPEED,
    SLIDE_LIMIT,
    TURN_LIMIT,
    VECTOR_FORCE,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.markers import marker_axis, marker_point, marker_velocity
from mbsim.dynamics.forces.applied import along_axis, along_line, along_slide, at_limit
from mbsim.dynamics.forces.dry_friction import STIFFNESS, dry_motion, dry_now, is_dry
from mbsim.dynamics.linearization.blocks import couple
from mbsim.dynamics.linearization.expression_slopes import add_program_slopes
from mbsim.dynamics.linearization.stiffness import (
    PART,
    PART_OF_SPEED,
    PUSH,
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
    for f in range(len(scene.applied.kind)):
        i, j = sides_of(scene, f)
        if i < nb and j < nb and i != j and not couple(P, i, j):
            return False
        # whose axes a force is along
        axes = (
            scene.applied.axes[f] if scene.applied.kind[f] == VECTOR_FORCE else scene.applied.j[f]
        )
        along = scene.markers.body[axes]
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
    rows = T.linear.basis[:, 1]
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
        u = fill_unit(scene, T, y, f, e if k < 3 else none, none if k < 3 else e, 0)
        add_program_slopes(scene, T, t, y, f, program, u)
    add_geometry(scene, T, y, f, scene.applied.axes[f], 0)


@jitable
def limit_slopes(scene: Scene, f: int, x: float, rate: float) -> V2:
    """Return dF/dx and dF/dx' of a limit."""
    step = PUSH * max(abs(x), 1e-3 * scene.world.scale[SCALE_LENGTH])
    fast = PART_OF_SPEED * scene.world.scale[SCALE_SPEED] + PART * abs(rate)
    by_x = at_limit(scene, f, x + step, rate)[0] - at_limit(scene, f, x - step, rate)[0]
    by_rate = at_limit(scene, f, x, rate + fast)[0] - at_limit(scene, f, x, rate - fast)[0]
    return by_x / (2.0 * step), by_rate / (2.0 * fast)


@jitable
def add_scalar_slopes(scene: Scene, T: Tangent, t: float, y: F1, f: int) -> None:
    """Add a force along a line, along an axis or about one."""
    P, L, nb, kind = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.kind[f]
    bi, bj = sides_of(scene, f)
    none, x, rate = (0.0, 0.0, 0.0), 0.0, 0.0
    if kind == LINE_FORCE:
        n, x, rate = along_line(scene, y, f)
    elif kind == AXIS_FORCE:
        n = marker_axis(scene, scene.applied.j[f], 2)
    elif kind == SLIDE_LIMIT:
        n, x, rate = along_slide(scene, y, f)
    else:
        n, x, rate = along_axis(scene, f)
    turns = kind == AXIS_TORQUE or kind == TURN_LIMIT
    u = fill_unit(scene, T, y, f, none if turns else n, n if turns else none, 1)
    if kind == SLIDE_LIMIT or kind == TURN_LIMIT:
        by_x, by_rate = limit_slopes(scene, f, x, rate)
    elif scene.applied.program[f] >= 0:
        add_program_slopes(scene, T, t, y, f, scene.applied.program[f], u)
        by_x, by_rate = 0.0, 0.0
    else:
        by_x, by_rate = -scene.applied.par[f, 0], -scene.applied.par[f, 1]
    if by_x != 0.0:
        add_two_sided(P, L.K, nb, bi, bj, by_x, u, u)
    line = kind == LINE_FORCE
    if by_rate != 0.0:
        add_two_sided(P, L.D, nb, bi, bj, by_rate, u, u)
        if not turns:
            add_rate_by_pose(scene, T, f, u, by_rate, n)
        if not line:
            add_axis_rate(scene, T, f, by_rate, n, u, turns)
        elif x > 0.0:
            add_turning_rate(scene, T, y, f, by_rate, n, x, u)
    add_geometry(scene, T, y, f, -1 if line else scene.applied.j[f], 1)
    if line and x > 0.0:
        # the line turns: F/d across it
        tension = dot(vector(scene.work.applied[f]), n) / x
        a = cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0))
        a = scale(1.0 / norm(a), a)
        for e in (a, cross(n, a)):
            u = fill_unit(scene, T, y, f, e, none, 1)
            add_two_sided(P, L.K, nb, bi, bj, tension, u, u)


@jitable
def add_dry_slopes(scene: Scene, T: Tangent, y: F1, f: int) -> None:
    """Add dry friction: a spring where it sticks, in slip nothing but that its axis turns."""
    n, x, _ = dry_motion(scene, y, f)
    none, turns = (0.0, 0.0, 0.0), scene.applied.kind[f] == DRY_TURN
    _, gives = dry_now(scene, f, x)
    if gives == 0.0 and scene.applied.equation[f] >= 0:
        return
    if gives == 0.0:
        u = fill_unit(scene, T, y, f, none if turns else n, n if turns else none, 0)
        bi, bj = sides_of(scene, f)
        k = scene.applied.par[f, STIFFNESS]
        add_two_sided(T.pattern, T.linear.K, len(scene.bodies.mass), bi, bj, -k, u, u)
    add_geometry(scene, T, y, f, scene.applied.j[f], 0)


@jitable
def add_applied_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> int:
    """Add what forces between markers do, but for marker forces and friction in joints."""
    for f in range(len(scene.applied.kind)):
        kind = scene.applied.kind[f]
        if kind == VECTOR_FORCE:
            add_vector_slopes(scene, T, t, y, f)
        elif is_dry(kind):
            add_dry_slopes(scene, T, y, f)
        elif kind != MARKER_FORCE and kind != RESIDUAL and scene.applied.connection[f] < 0:
            add_scalar_slopes(scene, T, t, y, f)
    return 0
