"""How what a Force_Element gives changes with bodies and states, for implicit methods.

By the implicit function theorem, with A the residual by what is sought (`forces.force_element`),

    A dz + r_x dx + r_x' dx' + r_f df = 0,

df of states; where x' is a mean over h it goes with dx, as dx/h, and f with h dz. That axes of J
turn the force is counted, that they turn the rates is not: Newton's method is a little slower.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import RESIDUAL, SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.model import Residuals
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.forces.force_element import BEFORE, NOW, SHORT, find_unknowns, step_of, switches
from mbsim.dynamics.forces.residual_solver import (
    PART,
    ask,
    axes_of,
    back,
    difference,
    factor,
    fill_matrix,
    find_slopes,
    own_time,
    unknowns_of,
)
from mbsim.dynamics.linearization.stiffness import add_geometry, add_two_sided, lever, sides_of
from mbsim.laws.residual import DIFFERENTIAL, SWITCHING

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Tangent


@jitable
def fill_moves(scene: Scene, e: int) -> int:
    """Fill `moves` with the residual by x and x', where r is in `rows`; return a code."""
    R, na = scene.residuals, axes_of(scene, e)
    length, speed = scene.world.scale[SCALE_LENGTH], scene.world.scale[SCALE_SPEED]
    for k in range(na):
        turns = R.angle[R.first[e] + k] >= 0
        for part in range(2):
            at = 1 + part * na + k
            scale = (1.0 if turns else length) * (1.0 if part == 0 else speed / length)
            column = R.rise
            code = difference(scene, e, at, PART * (abs(R.given[at]) + scale), column)
            if code != 0:
                return code
            for i in range(unknowns_of(scene, e)):
                R.moves[part, i, k] = column[i]
    return 0


@jitable
def step_for_slopes(scene: Scene, t: float, e: int) -> float:
    """Return the step over which means are taken: at its begin, that of the last one."""
    kept = scene.state.residual[e]
    h = step_of(scene, t, kept[NOW])
    if not h > SHORT * own_time(scene):
        h = kept[NOW, 0] - kept[BEFORE, 0]
    return h if h > SHORT * own_time(scene) else 1e-6 * own_time(scene)


@jitable
def solve_slopes(scene: Scene, t: float, y: F1, e: int) -> float:
    """Fill `slopes` with what is sought by x, x' and states; return the step, or -1 - a code."""
    R, na, nu = scene.residuals, axes_of(scene, e), unknowns_of(scene, e)
    code = find_unknowns(scene, t, y, e)
    if code != 0:
        return -1.0 - code
    from_step = switches(scene, e)
    h = step_for_slopes(scene, t, e) if from_step else 1.0
    if (
        residual_here(scene, e) != 0
        or find_slopes(scene, e, True) != 0
        or fill_moves(scene, e) != 0
    ):
        return -1.0
    fill_matrix(scene, e, h)
    if not factor(R, nu):
        return -1.0
    for k in range(na):
        for part in range(2):
            for i in range(nu):
                R.step[i] = -R.moves[part, i, k]
                if from_step:
                    R.step[i] = -R.moves[0, i, k] - R.moves[1, i, k] / h if part == 0 else 0.0
            back(R, nu, R.step)
            for i in range(nu):
                R.slopes[part, i, k] = R.step[i]
    for k in range(nu):
        if R.kind[R.begin[e] + k] == DIFFERENTIAL:
            for i in range(nu):
                R.step[i] = -R.by[0, k, i]
            back(R, nu, R.step)
            for i in range(nu):
                R.slopes[2, i, k] = R.step[i]
    return h


@jitable
def residual_here(scene: Scene, e: int) -> int:
    """Keep r of what is given in `rows`; return a code."""
    R = scene.residuals
    code = ask(scene, e)
    for k in range(unknowns_of(scene, e)):
        R.rows[k] = R.out[k]
    return code


@jitable
def by_force(R: Residuals, u: int, i: int, part: int, k: int, h: float) -> float:
    """Return the derivative of f of unknown u, the i-th of its element, as `slopes` has it."""
    if R.kind[u] == DIFFERENTIAL:
        return 1.0 if part == 2 and i == k else 0.0
    return R.slopes[part, i, k] * (h if R.kind[u] == SWITCHING else 1.0)


@jitable
def add_residual_slopes(scene: Scene, T: Tangent, t: float, y: F1, f: int) -> None:  # noqa: C901
    """Add what the element of row f does; nothing where it cannot be solved there.

    Many branches because axes and states of one element share its levers.
    """
    R, P, L = scene.residuals, T.pattern, T.linear
    e, nb = int(scene.applied.par[f, 0]), len(scene.bodies.mass)
    h = solve_slopes(scene, t, y, e)
    add_geometry(scene, T, y, f, scene.applied.axes[f], 0)
    if h < 0.0:
        return
    na, nu = axes_of(scene, e), unknowns_of(scene, e)
    bi, bj = sides_of(scene, f)
    none, p, u = (0.0, 0.0, 0.0), marker_point(scene, y, R.i[e]), L.basis
    for k in range(na):
        n = marker_axis(scene, R.axis[R.first[e] + k], 2)
        turns = R.angle[R.first[e] + k] >= 0
        for side in range(2):
            b = bi if side == 0 else bj
            lever(scene, L, y, b, p, none if turns else n, n if turns else none, u[side, k])
    for i in range(na):
        unknown = R.begin[e] + i
        for k in range(na):
            by_x = by_force(R, unknown, i, 0, k, h)
            by_rate = by_force(R, unknown, i, 1, k, h)
            if by_x != 0.0:
                add_two_sided(P, L.K, nb, bi, bj, -by_x, u[:, i], u[:, k])
            if by_rate != 0.0:
                add_two_sided(P, L.D, nb, bi, bj, -by_rate, u[:, i], u[:, k])
    first = len(scene.equations.program)
    for k in range(nu):
        z = R.state[R.begin[e] + k]
        if z < 0:
            continue
        for side in range(2):
            b, sign = (bi, 1.0) if side == 0 else (bj, -1.0)
            if b == nb:
                continue
            for i in range(na):
                size = -sign * by_force(R, R.begin[e] + i, i, 2, k, h)
                for q in range(u.shape[2]):
                    L.column[first + z, b, q] += size * u[side, i, q]
                    L.row[first + z, b, q] += sign * R.slopes[0, k, i] * u[side, i, q]
                    L.row_rate[first + z, b, q] += sign * R.slopes[1, k, i] * u[side, i, q]
        for other in range(nu):
            column = R.state[R.begin[e] + other]
            if column >= 0:
                L.slopes[z, column] += R.slopes[2, k, other]


@jitable
def add_all_residual_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> None:
    """Add what all elements do; the slopes of states have been filled."""
    for f in range(len(scene.applied.form)):
        if scene.applied.form[f] == RESIDUAL:
            add_residual_slopes(scene, T, t, y, f)
