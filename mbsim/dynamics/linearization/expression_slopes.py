"""How expressions and motions change with bodies and states.

Expressions exactly, or by differences of user subroutines. Rows of motions that hold no
displacements by differences, as about O: of C v with poses, of C a + s(q, v) with poses and
velocities; a, the accelerations, as they are in body axes. What a motion is to be counts too,
where it depends on the state.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import JET_SLOPE, SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.scene import Scene
from mbsim.compile_model.instructions import OP, RESULT, ROW, USER
from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import cross, sub, vector
from mbsim.dynamics.bodies.kinematics import place_body, position
from mbsim.dynamics.constraints.equations import GAMMA, MISMATCH, fill_equation, tree_index
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.tree import origin
from mbsim.dynamics.expressions.jets import run, value
from mbsim.dynamics.expressions.slopes import A_STATE, DIRECTIONS, POSES
from mbsim.dynamics.expressions.subroutines import user_result
from mbsim.dynamics.linearization.stiffness import PUSH, add_product, sides_of

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Tangent

#: Differences of poses [part of the length, rad] and of velocities (likewise, a time).
_PUSH = 1e-7


@jitable
def pushed(scene: Scene, y: F1, body: int, direction: int, size: float) -> None:
    """Change one number of pose or velocity of a body in y, where `direction` is as in slopes."""
    at = BODY_SIZE * body
    axis = direction % 3
    if direction < 3:
        y[at + axis] += size
    elif direction < POSES:
        # half a turn of the quaternion, global: q + (0, e) q size/2
        w, x, yy, z = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
        half = 0.5 * size
        if axis == 0:
            rise = (-x, w, -z, yy)
        elif axis == 1:
            rise = (-yy, z, w, -x)
        else:
            rise = (-z, -yy, x, w)
        for k in range(4):
            y[at + 3 + k] += half * rise[k]
    elif direction < 9:
        y[at + 7 + axis] += size
    else:
        R = scene.work.R[body]
        for k in range(3):
            y[at + 10 + k] += size * R[axis, k]
    place_body(scene, y, body)


@jitable
def keep_spin(scene: Scene, y: F1, body: int, axis: int, size: float) -> None:
    """Change the angular velocity in body axes so that a turn of the body leaves it as it is."""
    R, at = scene.work.R[body], BODY_SIZE * body + 10
    w = (y[at], y[at + 1], y[at + 2])
    change = cross((R[axis, 0], R[axis, 1], R[axis, 2]), w)
    for k in range(3):
        y[at + k] -= size * change[k]


@jitable
def value_anew(scene: Scene, t: float, y: F1, program: int) -> float:
    """Return the value of a program, where a subroutine is called for each of its results."""
    programs = scene.programs
    for at in range(programs.quick_start[program], programs.quick_start[program + 1]):
        code = programs.quick[at]
        if code[OP] == USER and code[RESULT] > 0:
            # which only reads what a call for the first result has left
            user_result(scene, t, y, code[ROW], 0, 0)
    return value(scene, t, y, program)


@jitable
def program_rise(
    scene: Scene, T: Tangent, t: float, y: F1, program: int, body: int, row: F1
) -> None:
    """Fill the derivatives of a program by the displacement (6) and velocity (6) of a body.

    Both as spatial vectors about O of the body: angular, linear.
    """
    at = BODY_SIZE * body
    for direction in range(DIRECTIONS):
        if T.depends.user[program] == 1:
            size = PUSH * (1.0 if direction % POSES >= 3 else scene.world.scale[SCALE_LENGTH])
            if direction >= POSES:
                size *= scene.world.scale[SCALE_SPEED] / scene.world.scale[SCALE_LENGTH]
            before = value_anew(scene, t, y, program)
            kept = (y[at], y[at + 1], y[at + 2], y[at + 3], y[at + 4], y[at + 5], y[at + 6])
            speed = (y[at + 7], y[at + 8], y[at + 9], y[at + 10], y[at + 11], y[at + 12])
            if 3 <= direction < POSES:
                keep_spin(scene, y, body, direction - 3, size)
            pushed(scene, y, body, direction, size)
            rise = (value_anew(scene, t, y, program) - before) / size
            for k in range(7):
                y[at + k] = kept[k]
            for k in range(6):
                y[at + 7 + k] = speed[k]
            place_body(scene, y, body)
        else:
            run(scene, t, y, program, body, direction)
            rise = scene.programs.stack[0, JET_SLOPE]
        # (linear, angular) to (angular, linear)
        row[(direction // POSES) * POSES + (direction % POSES + 3) % POSES] = rise
    r = vector(T.linear.r[body])
    for part in range(2):
        first = part * POSES
        linear = (row[first + 3], row[first + 4], row[first + 5])
        moment = cross(r, linear)
        for k in range(3):
            row[first + k] += moment[k]


@jitable
def add_program_slopes(
    scene: Scene, T: Tangent, t: float, y: F1, f: int, program: int, u: F2
) -> None:
    """Add d(value)/d(bodies and states) times the wrench u of its unit on the bodies of force f."""
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    i, j = sides_of(scene, f)
    for at in range(T.depends.body_start[program], T.depends.body_start[program + 1]):
        b = T.depends.body[at]
        program_rise(scene, T, t, y, program, b, L.rise)
        for side in range(2):
            a = i if side == 0 else j
            if a < nb:
                sign = 1.0 if side == 0 else -1.0
                add_product(L.K[P.block[a, b]], sign, u[side], L.rise[0:6])
                add_product(L.D[P.block[a, b]], sign, u[side], L.rise[6:12])
    first = len(scene.equations.program)
    for at in range(T.depends.state_start[program], T.depends.state_start[program + 1]):
        z = T.depends.state[at]
        rise = state_rise(scene, T, t, y, program, z)
        for side in range(2):
            a = i if side == 0 else j
            if a < nb:
                for k in range(6):
                    L.column[first + z, a, k] += (rise if side == 0 else -rise) * u[side, k]


@jitable
def state_rise(scene: Scene, T: Tangent, t: float, y: F1, program: int, z: int) -> float:
    """Return the derivative of a program by state z."""
    at = scene.states.offset[z]
    if T.depends.user[program] == 0:
        run(scene, t, y, program, A_STATE, at)
        return scene.programs.stack[0, JET_SLOPE]
    before, kept = value_anew(scene, t, y, program), y[at]
    size = PUSH * max(abs(kept), scene.states.scale[z])
    y[at] = kept + size
    rise = (value_anew(scene, t, y, program) - before) / size
    y[at] = kept
    return rise


@jitable
def fill_state_slopes(scene: Scene, T: Tangent, t: float, y: F1) -> None:
    """Fill how the slopes of the user's own states change with bodies and with each other."""
    L, first = T.linear, len(scene.equations.program)
    for z in range(len(scene.states.program)):
        program = scene.states.program[z]
        for other in range(len(scene.states.program)):
            L.slopes[z, other] = 0.0
        for at in range(T.depends.body_start[program], T.depends.body_start[program + 1]):
            b = T.depends.body[at]
            program_rise(scene, T, t, y, program, b, L.rise)
            for k in range(6):
                L.row[first + z, b, k] = L.rise[k]
                L.row_rate[first + z, b, k] = L.rise[6 + k]
        for at in range(T.depends.state_start[program], T.depends.state_start[program + 1]):
            other = T.depends.state[at]
            L.slopes[z, other] = state_rise(scene, T, t, y, program, other)


@jitable
def acceleration_along(scene: Scene, L: Linear, y: F1, e: int) -> float:
    """Return C times the accelerations of the bodies, which stay as they are."""
    eq, sweep, total = scene.equations, scene.sweep, 0.0
    for term in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
            if k < 0:
                continue
            b, G = scene.tree.body[k], sweep.G[term, 6 * side : 6 * side + 6]
            force = (G[3], G[4], G[5])
            arm = sub(position(scene, y, b), origin(scene, y, k))
            torque = sub((G[0], G[1], G[2]), cross(arm, force))
            for i in range(3):
                # what pushes the body beside joints is in its force already
                pull = L.force[b, i] + scene.work.force[b, i]
                total += force[i] * pull / scene.bodies.mass[b] + torque[i] * sweep.a[k, i]
    return total


@jitable
def held_value(scene: Scene, L: Linear, t: float, y: F1, e: int) -> float:
    """Return the velocity or acceleration that equation e holds, less what it is to be."""
    fill_equation(scene, t, y, e)
    if scene.equations.level[e] == 1:
        return scene.sweep.rate[e, MISMATCH]
    return scene.sweep.rate[e, GAMMA] + acceleration_along(scene, L, y, e)


@jitable
def drive_by(scene: Scene, L: Linear, t: float, y: F1, row: int, e: int, b: int) -> None:
    """Fill the rows of equation e for body b."""
    at, rise = BODY_SIZE * b, L.rise
    kept = (y[at], y[at + 1], y[at + 2], y[at + 3], y[at + 4], y[at + 5], y[at + 6])
    speed = (y[at + 7], y[at + 8], y[at + 9], y[at + 10], y[at + 11], y[at + 12])
    for direction in range(DIRECTIONS):
        size = _PUSH * (1.0 if direction % POSES >= 3 else scene.world.scale[SCALE_LENGTH])
        if direction >= POSES:
            size *= scene.world.scale[SCALE_SPEED] / scene.world.scale[SCALE_LENGTH]
        change = 0.0
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            if 3 <= direction < POSES:
                keep_spin(scene, y, b, direction - 3, sign * size)
            pushed(scene, y, b, direction, sign * size)
            change += sign * held_value(scene, L, t, y, e)
            for k in range(7):
                y[at + k] = kept[k]
            for k in range(6):
                y[at + 7 + k] = speed[k]
            place_body(scene, y, b)
        # (linear, angular) to (angular, linear)
        rise[(direction // POSES) * POSES + (direction % POSES + 3) % POSES] = change / (2.0 * size)
    r = vector(L.r[b])
    for part in range(2):
        first = part * POSES
        moment = cross(r, (rise[first + 3], rise[first + 4], rise[first + 5]))
        for k in range(3):
            rise[first + k] += moment[k]
    for k in range(POSES):
        L.row[row, b, k] = rise[k]
        L.row_rate[row, b, k] = rise[POSES + k]
    if scene.equations.level[e] == 0:
        # accelerations in body axes turn along: (theta x alpha) . torque
        C = L.column[row, b]
        torque = sub((C[0], C[1], C[2]), cross(r, (C[3], C[4], C[5])))
        turned = cross(vector(scene.sweep.a[scene.tree.of_body[b]]), torque)
        for k in range(3):
            L.row[row, b, k] += turned[k]


@jitable
def slip_row(scene: Scene, L: Linear, row: int, e: int) -> None:
    """Fill the row of slip in a contact that is held: its gradient, where it is now."""
    eq = scene.equations
    for term in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
            if k >= 0:
                for i in range(POSES):
                    L.row_rate[row, scene.tree.body[k], i] += scene.sweep.G[term, 6 * side + i]


@jitable
def add_motion_rows(scene: Scene, T: Tangent, t: float, y: F1) -> None:
    """Fill the rows of all motions in use that hold velocities or accelerations."""
    eq = scene.equations
    for row in range(active_count(scene)):
        e = eq.active[row]
        if eq.level[e] == 2:
            continue
        if eq.slot[e] >= 0:
            slip_row(scene, T.linear, row, e)
            continue
        for term in range(eq.first[e], eq.first[e + 1]):
            for side in range(2):
                k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
                if k >= 0:
                    drive_by(scene, T.linear, t, y, row, e, scene.tree.body[k])
        fill_equation(scene, t, y, e)
