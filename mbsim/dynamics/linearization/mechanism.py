"""The mechanism linearised where it has just been evaluated: inertia, joints, forces.

About O of its tree (fixed while derivatives are taken), with the cg at r, the wrench of inertia
less that of forces is held by joints and equations:

    (N - T + r x f, f) = f_joint - sum of f_joint of children + G' lambda,
    N = J alpha + w x J w,   f = m a - F.

A joint's force does no work on its free directions, S f_joint = 0. These turn with the bodies, so
the variation of that has a part (S + dS) f: with e the axis of a direction on its owner, P its
point on the child, f = (n, F),

    dS . f = theta_owner . (e x (n + F x P)) + d_child . (e x F) + theta_child . (P x (e x F)).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mbsim.arrays.codes import (
    CHILD_AXIS,
    PARENT_AXIS,
    SCALE_LENGTH,
    TURN_AXIS,
    TURN_CROSS,
    TURN_FREE,
    TURN_ROOT,
)
from mbsim.arrays.hooks import ContactSlopes, Hook
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, rotate, sub, vector
from mbsim.dynamics.bodies.kinematics import place_body
from mbsim.dynamics.constraints.equations import fill_equation, tree_index
from mbsim.dynamics.constraints.folding import is_sticking
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.tree import child_axis, origin, parent_axis
from mbsim.dynamics.linearization.applied_slopes import couple_applied
from mbsim.dynamics.linearization.blocks import (
    COUPLINGS,
    STALE,
    couple,
    drop_fill,
    find_order,
    forget_pattern,
)
from mbsim.dynamics.linearization.expression_slopes import pushed

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Linear, Pattern, Tangent


#: Differences for the gradients of equations.
_PUSH = 1e-7


@jitable
def keep_bodies(scene: Scene, L: Linear, y: F1, dy: F1) -> None:
    """Keep where bodies are, how they move, and what inertia and joints do."""
    for b in range(len(scene.bodies.mass)):
        at, R, J = BODY_SIZE * b, scene.work.R[b], scene.bodies.inertia[b]
        for i in range(3):
            for j in range(3):
                L.R[b, i, j] = R[i, j]
            L.w[b, i] = y[at + 10 + i]
            L.spin[b, i] = scene.work.w[b, i]
            L.r[b, i] = scene.sweep.arm[scene.tree.of_body[b], i] if on_tree(scene, b) else 0.0
            L.force[b, i] = scene.bodies.mass[b] * dy[at + 7 + i] - scene.work.force[b, i]
        for i in range(4):
            L.q[b, i] = y[at + 3 + i]
        w, alpha = vector(L.w[b]), (dy[at + 10], dy[at + 11], dy[at + 12])
        N = rotate(R, add(rotate(J, alpha), cross(w, rotate(J, w))))
        for i in range(3):
            L.torque[b, i] = N[i]


@jitable
def on_tree(scene: Scene, b: int) -> bool:
    """Return whether body b is on a tree."""
    return scene.tree.of_body[b] >= 0


@jitable
def fill_joint_forces(scene: Scene, L: Linear) -> None:
    """Fill f: what each joint of the tree does to its child, about O."""
    tree, sweep = scene.tree, scene.sweep
    for k in range(len(tree.body)):
        b = tree.body[k]
        force = vector(L.force[b])
        moment = add(
            sub(vector(L.torque[b]), vector(scene.work.torque[b])), cross(vector(L.r[b]), force)
        )
        for i in range(3):
            L.f[k, i] = moment[i]
            L.f[k, 3 + i] = force[i]
    eq = scene.equations
    for row in range(active_count(scene)):
        e = eq.active[row]
        for term in range(eq.first[e], eq.first[e + 1]):
            for side in range(2):
                k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
                if k >= 0:
                    for i in range(6):
                        L.f[k, i] -= sweep.multiplier[row] * sweep.G[term, 6 * side + i]
    for k in range(len(tree.body) - 1, -1, -1):
        if tree.parent[k] >= 0:
            for i in range(6):
                L.f[tree.parent[k], i] += L.f[k, i]


@jitable
def write_turn(U: F2, q: int, e: V3, P: V3, f: F1, on_child: int) -> None:
    """Fill how S'f of a direction changes: a turn about axis e through P, which the child has."""
    n, F = (f[0], f[1], f[2]), (f[3], f[4], f[5])
    owner, point = cross(e, add(n, cross(F, P))), cross(e, F)
    about = cross(P, point)
    first = q if on_child == 1 else 6 + q
    for i in range(3):
        U[first, i] += owner[i]
        U[q, i] += about[i]
        U[q, 3 + i] += point[i]


@jitable
def fill_joint(scene: Scene, L: Linear, y: F1, k: int) -> None:
    """Fill directions of joint k of the tree, and how their product with its force changes."""
    tree, S, U, f = scene.tree, scene.sweep.S[k], L.U[k], L.f[k]
    for q in range(6):
        for i in range(6):
            L.S[k, q, i] = S[q, i]
    for q in range(12):
        for i in range(6):
            U[q, i] = 0.0
    body, turn, q = tree.body[k], tree.turn[k], 0
    P = add(vector(L.r[body]), rotate(scene.work.R[body], vector(tree.child_p[k])))
    if turn == TURN_ROOT or L.stressed[0] == 0:
        return
    if turn == TURN_AXIS:
        write_turn(U, 0, parent_axis(scene, k, 2), P, f, 0)
        q = 1
    elif turn == TURN_CROSS:
        write_turn(U, 0, child_axis(scene, k, tree.axis[k, CHILD_AXIS]), P, f, 1)
        write_turn(U, 1, parent_axis(scene, k, tree.axis[k, PARENT_AXIS]), P, f, 0)
        q = 2
    elif turn == TURN_FREE:
        for axis in range(3):
            e = (
                1.0 if axis == 0 else 0.0,
                1.0 if axis == 1 else 0.0,
                1.0 if axis == 2 else 0.0,
            )
            write_turn(U, axis, e, P, f, 1)
        q = 3
    if tree.free[k] > q:
        for axis in range(3):
            if tree.slide[k, axis] == 1:
                # (0, e), e on the parent: theta . (e x F)
                about = cross(parent_axis(scene, k, axis), (f[3], f[4], f[5]))
                for i in range(3):
                    U[6 + q, i] += about[i]
                q += 1


@jitable
def couple_equations(scene: Scene, P: Pattern) -> bool:
    """Couple the bodies that an equation holds together."""
    eq = scene.equations
    for row in range(active_count(scene)):
        e = eq.active[row]
        for term in range(eq.first[e], eq.first[e + 1]):
            a = scene.markers.body[eq.i[term]]
            first, end = terms_behind(scene, e, term)
            for by in range(first, end):
                for side in range(2):
                    b = scene.markers.body[eq.i[by] if side == 0 else eq.j[by]]
                    nb = len(scene.bodies.mass)
                    if a < nb and b < nb and a != b and not couple(P, a, b):
                        return False
    return True


@jitable
def terms_behind(scene: Scene, e: int, term: int) -> tuple[int, int]:
    """Return the range of terms on whose bodies the gradient of a term depends."""
    eq = scene.equations
    if (eq.general[e] != 0 and eq.level[e] == 2) or eq.user[e] > 0:
        # one term for each body of one expression, or terms of one relation
        return eq.first[e], eq.first[e + 1]
    return term, term + 1


@jitable
def slopes_of_contacts(scene: Scene, what: int, t: float, h: float, y: F1) -> int:
    """Do what derivatives of contacts are asked for, where there are contacts; return a code."""
    hook = scene.world.hooks[Hook.CONTACT_SLOPES]
    return call_int(hook, (scene, what, t, h, y)) if hook != 0 else 0


@jitable
def number_rows(scene: Scene, P: Pattern) -> None:
    """Find the row of each equation in use in its node, where it has one."""
    for c in range(len(scene.bodies.mass), len(P.rows)):
        P.rows[c] = 0
    for r in range(active_count(scene)):
        c = P.node[scene.equations.active[r]]
        if c >= 0:
            P.at[r] = P.rows[c]
            P.rows[c] += 1


@jitable
def find_couplings(scene: Scene, T: Tangent, t: float, y: F1) -> int:
    """Couple what acts on each other and order the bodies; return a code."""
    P = T.pattern
    for attempt in range(2):
        if P.count[COUPLINGS] == 0 or attempt == 1:
            forget_pattern(P)
        code = slopes_of_contacts(scene, ContactSlopes.COUPLE, t, 0.0, y)
        if code != 0 and code != Code.NO_ROOM:
            return code
        room = code == 0 and couple_applied(scene, P, T) and couple_equations(scene, P)
        if room and (P.count[STALE] == 0 or find_order(P)):
            number_rows(scene, P)
            return 0
        # couplings of the past take the room of these
        drop_fill(P)
    return Code.NO_ROOM


@jitable
def clear(scene: Scene, T: Tangent) -> None:
    """Start with no forces."""
    L = T.linear
    for k in range(T.pattern.count[COUPLINGS]):
        for i in range(6):
            for j in range(6):
                L.K[k, i, j] = 0.0
                L.D[k, i, j] = 0.0
    for e in range(len(L.column)):
        for b in range(len(scene.bodies.mass)):
            for i in range(6):
                L.column[e, b, i] = L.row[e, b, i] = L.row_rate[e, b, i] = 0.0


@jitable
def fill_rows(scene: Scene, L: Linear, t: float) -> None:
    """Fill the gradients of the equations in use; rows of level 2, others have their own."""
    eq = scene.equations
    for row in range(active_count(scene)):
        e = eq.active[row]
        L.released[row] = 0 if is_sticking(scene, e, t) else 1
        for term in range(eq.first[e], eq.first[e + 1]):
            for side in range(2):
                k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
                if k >= 0:
                    for i in range(6):
                        G = scene.sweep.G[term, 6 * side + i]
                        L.column[row, scene.tree.body[k], i] += G
                        if eq.level[e] == 2:
                            L.row[row, scene.tree.body[k], i] += G


@jitable
def take_bend(
    scene: Scene,
    L: Linear,
    y: F1,
    e: int,
    term: int,
    origins: tuple[V3, V3],
    size: float,
    direction: int,
) -> None:
    """Add what one displacement made of a term's gradient, over its size, to a table by column.

    Rows 0 to 5 of `L.law` are the wrench on I's body, columns 0 to 5 the ways, 6 to 11 J's body.
    """
    eq, sweep = scene.equations, scene.sweep
    for side in range(2):
        k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
        G = sweep.G[term, 6 * side : 6 * side + 6]
        force = (G[3], G[4], G[5])
        moment = (G[0], G[1], G[2])
        if k >= 0:
            # O may have moved with its root
            moment = add(moment, cross(sub(origin(scene, y, k), origins[side]), force))
        for i in range(3):
            L.law[i, 6 * side + direction] += size * moment[i]
            L.law[3 + i, 6 * side + direction] += size * force[i]


@jitable
def tree_origin(scene: Scene, y: F1, m: int) -> V3:
    """Return O of the body of marker m; the global origin for ground."""
    k = tree_index(scene, m)
    return origin(scene, y, k) if k >= 0 else (0.0, 0.0, 0.0)


@jitable
def bend_by(scene: Scene, T: Tangent, t: float, y: F1, row: int, e: int, term: int, b: int) -> None:
    """Add how the force of a term turns as body b is displaced."""
    L, eq, P, at = T.linear, scene.equations, T.pattern, BODY_SIZE * b
    origins = (tree_origin(scene, y, eq.i[term]), tree_origin(scene, y, eq.j[term]))
    kept = (y[at], y[at + 1], y[at + 2], y[at + 3], y[at + 4], y[at + 5], y[at + 6])
    size = scene.sweep.multiplier[row] / (2.0 * _PUSH)
    for i in range(6):
        for j in range(12):
            L.law[i, j] = 0.0
    for direction in range(6):
        scale_of_direction = scene.world.scale[SCALE_LENGTH] if direction < 3 else 1.0
        for side in range(2):
            sign = 1.0 if side == 0 else -1.0
            pushed(scene, y, b, direction, sign * _PUSH * scale_of_direction)
            fill_equation(scene, t, y, e)
            take_bend(scene, L, y, e, term, origins, sign * size / scale_of_direction, direction)
            for k in range(7):
                y[at + k] = kept[k]
            place_body(scene, y, b)
    r = vector(L.r[b])
    for side in range(2):
        k = tree_index(scene, eq.i[term] if side == 0 else eq.j[term])
        if k < 0:
            continue
        block = L.K[P.block[scene.tree.body[k], b]]
        for i in range(6):
            F = (L.law[i, 6 * side], L.law[i, 6 * side + 1], L.law[i, 6 * side + 2])
            # a turn about O displaces the cg by theta x r
            moment = cross(r, F)
            for c in range(3):
                block[i, c] += L.law[i, 6 * side + 3 + c] + moment[c]
                block[i, 3 + c] += F[c]


@jitable
def among(scene: Scene, first: int, end: int, b: int) -> bool:
    """Return whether body b is one of those of the terms from `first` to before `end`."""
    eq, body = scene.equations, scene.markers.body
    for k in range(first, end):
        if body[eq.i[k]] == b or body[eq.j[k]] == b:
            return True
    return False


@jitable
def add_bends(scene: Scene, T: Tangent, t: float, y: F1) -> None:
    """Add how the forces of equations turn with the bodies that they are fixed to."""
    eq = scene.equations
    for row in range(active_count(scene) if T.linear.stressed[0] == 1 else 0):
        e = eq.active[row]
        if eq.slot[e] >= 0:
            # incidents stay where they are
            continue
        for term in range(eq.first[e], eq.first[e + 1]):
            first, end = terms_behind(scene, e, term)
            for by in range(first, end):
                for side in range(2):
                    b = scene.markers.body[eq.i[by] if side == 0 else eq.j[by]]
                    named = first < by and among(scene, first, by, b)
                    if b < len(scene.bodies.mass) and on_tree(scene, b) and not named:
                        bend_by(scene, T, t, y, row, e, term, b)
        fill_equation(scene, t, y, e)


@jitable
def linearise(scene: Scene, T: Tangent, t: float, h: float, y: F1, dy: F1) -> int:
    """Keep the mechanism linearised at (t, y), where dy = f(t, y); return a code."""
    code = find_couplings(scene, T, t, y)
    if code != 0:
        return code
    clear(scene, T)
    keep_bodies(scene, T.linear, y, dy)
    fill_joint_forces(scene, T.linear)
    for k in range(len(scene.tree.body)):
        fill_joint(scene, T.linear, y, k)
    fill_rows(scene, T.linear, t)
    if active_count(scene) > 0:
        code = call_int(scene.world.hooks[Hook.BEND], (scene, t, y))
        if code != 0:
            return code
    T.keeps.held[len(T.keeps.held) - 1] = 0
    code = slopes_of_contacts(scene, ContactSlopes.FILL, t, h, y)
    if code == 0 and scene.world.hooks[Hook.SLOPES] != 0:
        code = call_int(scene.world.hooks[Hook.SLOPES], (scene, t, y))
    return code
