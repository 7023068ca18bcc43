"""How velocities and accelerations along motions change with poses and velocities of bodies.

Rows of the border for motions that hold no displacements, by differences, as about O: of C v with
poses, of C a + s(q, v) with poses and velocities; a, the accelerations, as they are in body axes.
What a motion is to be counts too, where it depends on the state.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import cross, sub, vector
from mbsim.dynamics.bodies.kinematics import place_body, position
from mbsim.dynamics.constraints.equations import GAMMA, MISMATCH, fill_equation, tree_index
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.tree import origin
from mbsim.dynamics.expressions.slopes import DIRECTIONS, POSES
from mbsim.dynamics.linearization.expression_slopes import keep_spin, pushed

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Tangent


#: Differences of poses [part of the length, rad] and of velocities (likewise, a time).
_PUSH = 1e-7


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
