"""Multipliers of many loops: joints of the tree and equations in use, factored sparsely together.

Where bodies are cut free of each other, but for what hangs on them and is in no loop, joints and
equations with gradients J act on each other by B = J H^-1 J', which couples only those that meet
at a body. Of B x = (0, r), zeros for joints, x of the equations is A^-1 r: A of `equations` is
what is left of B once the joints are eliminated. The factor grows with the number of loops where
they form a row, with its power 3/2 where they form a net (A. George, Nested Dissection of a
Regular Finite Element Mesh, 1973, has the bound).
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    CHILD_AXIS,
    COST_OF_SPARSE,
    MEETS_BLOCK,
    MEETS_COLUMN,
    MEETS_ROW,
    PARENT_AXIS,
    PIVOT,
    TURN_AXIS,
    TURN_CROSS,
    TURN_LOCKED,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import I1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, rotate, vector
from mbsim.dynamics.constraints.equations import pivot_of
from mbsim.dynamics.constraints.folding import passes_fold
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.tree import (
    child_axis,
    fill_inertia,
    hang_on,
    parent_axis,
    put,
    six,
)
from mbsim.dynamics.loops.sparse_factor import (
    clear,
    eliminate,
    factor_diagonal,
    multiply_in,
    solve_factored,
)

#: Nanoseconds, about. Of equations: of a body and a free direction that answer a unit multiplier,
#: of what that does along another equation, of a product of two numbers. Of loops: of a body, a
#: node at one or a sum there, of a node, a block, a product.
_BODY, _FREE, _ALONG, _LONG = 30.0, 20.0, 10.0, 0.7
_MEETS, _NODE, _BLOCK, _SHORT = 65.0, 350.0, 10.0, 1.0


@jitable
def fill_bodies(scene: Scene) -> None:
    """Fill inertias of the bodies of loops, cut free of each other, as factors."""
    G, tree = scene.graph, scene.tree
    for b in range(len(G.bodies)):
        fill_inertia(scene, G.bodies[b], G.H[b])
    for k in range(len(tree.body)):
        parent = tree.parent[k]
        if parent >= 0 and G.body_of[k] < 0 and G.body_of[parent] >= 0:
            hang_on(scene, k, G.H[G.body_of[parent]])
    for b in range(len(G.bodies)):
        factor_diagonal(G.H[b], 6)


@jitable
def hold_along(scene: Scene, n: int, row: int, force: V3, torque: V3) -> int:
    """Fill a row of the joint that node n holds: a unit wrench on the child, less on the parent."""
    G = scene.graph
    for at in range(G.first[n], G.first[n + 1]):
        k, J = G.bodies[G.body[at]], G.J[at]
        if k == G.tree[n]:
            put(J[row], torque, force)
        elif k == scene.tree.parent[G.tree[n]]:
            for c in range(3):
                J[row, c], J[row, 3 + c] = -torque[c], -force[c]
    return row + 1


@jitable
def fill_joint(scene: Scene, n: int) -> int:
    """Fill the rows of the joint of the tree that node n holds; return their number.

    Its forces act through the joint's point along the parent's axes that it does not slide along;
    its torques are at right angles to the axes that it turns about.
    """
    tree, k, rows, zero = scene.tree, scene.graph.tree[n], 0, (0.0, 0.0, 0.0)
    arm = rotate(scene.work.R[tree.body[k]], vector(tree.child_p[k]))
    P = add(vector(scene.sweep.arm[k]), arm)
    for axis in range(3):
        if tree.slide[k, axis] == 0:
            e = parent_axis(scene, k, axis)
            rows = hold_along(scene, n, rows, e, cross(P, e))
    if tree.turn[k] == TURN_CROSS:
        a = child_axis(scene, k, tree.axis[k, CHILD_AXIS])
        b = parent_axis(scene, k, tree.axis[k, PARENT_AXIS])
        return hold_along(scene, n, rows, zero, cross(a, b))
    held = 3 if tree.turn[k] == TURN_LOCKED else 2 if tree.turn[k] == TURN_AXIS else 0
    for axis in range(held):
        rows = hold_along(scene, n, rows, zero, parent_axis(scene, k, axis))
    return rows


@jitable
def fill_gradient(scene: Scene, e: int, row: int) -> None:
    """Add the gradient of equation e to a row of its node, which is zero."""
    G, eq = scene.graph, scene.equations
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            at = G.term[k, side]
            if at >= 0:
                for c in range(6):
                    G.J[at, row, c] += scene.sweep.G[k, 6 * side + c]


@jitable
def fill_rows(scene: Scene, n: int, row: I1) -> int:
    """Fill gradients of node n: its joint's, then of equations whose `row` is not below 0.

    Returns their number, and in `row` which row is whose.
    """
    G = scene.graph
    for at in range(G.first[n], G.first[n + 1]):
        J = G.J[at]
        for r in range(6):
            for c in range(6):
                J[r, c] = 0.0
    rows = fill_joint(scene, n) if G.tree[n] >= 0 else 0
    for e in range(G.equation[n], G.equation[n] + G.several[n]):
        if row[e] >= 0:
            fill_gradient(scene, e, rows)
            row[e] = rows
            rows += 1
    return rows


@jitable
def divide_by_inertia(scene: Scene, at: int, rows: int) -> None:
    """Fill Y = L^-1 J' of an incidence."""
    G = scene.graph
    J, Y, L = G.J[at], G.Y[at], G.H[G.body[at]]
    for r in range(rows):
        g = six(J[r])
        a = g[0] / L[0, 0]
        b = (g[1] - L[1, 0] * a) / L[1, 1]
        c = (g[2] - L[2, 0] * a - L[2, 1] * b) / L[2, 2]
        d = (g[3] - L[3, 0] * a - L[3, 1] * b - L[3, 2] * c) / L[3, 3]
        e = (g[4] - L[4, 0] * a - L[4, 1] * b - L[4, 2] * c - L[4, 3] * d) / L[4, 4]
        f = g[5] - L[5, 0] * a - L[5, 1] * b - L[5, 2] * c - L[5, 3] * d - L[5, 4] * e
        put(Y[r], (a, b, c), (d, e, f / L[5, 5]))


@jitable
def fill_joints(scene: Scene) -> None:
    """Fill B of the equations in use and the joints that they act through."""
    G, P, active = scene.graph, scene.graph.joints, scene.equations.active
    for e in range(len(G.row)):
        G.row[e] = -1
    for r in range(active_count(scene)):
        G.row[active[r]] = 0
    for n in range(len(G.tree)):
        P.size[n] = fill_rows(scene, n, G.row)
        for at in range(G.first[n], G.first[n + 1]):
            divide_by_inertia(scene, at, P.size[n])
    clear(P)
    for k in range(len(P.meets)):
        a, b = P.meets[k, MEETS_ROW], P.meets[k, MEETS_COLUMN]
        block = P.meets[k, MEETS_BLOCK]
        multiply_in(P, block, G.Y[a], G.Y[b], P.size[G.node[a]], P.size[G.node[b]])


@jitable
def factor_node(scene: Scene, t: float, n: int, passing: bool) -> None:
    """Factor the block of node n, with pivots of equations as `factor_matrix` has them."""
    G = scene.graph
    D, m = G.joints.block[n], G.joints.size[n]
    held = 6 - scene.tree.free[G.tree[n]] if G.tree[n] >= 0 else 0
    e = G.equation[n] - 1
    for r in range(m):
        for c in range(r + 1):
            total = D[r, c]
            for k in range(c):
                total -= D[r, k] * D[c, k]
            if c < r:
                D[r, c] = total / D[c, c]
            elif r < held:
                D[r, r] = math.sqrt(total)
            else:
                e += 1
                while G.row[e] != r:
                    e += 1
                D[r, r] = pivot_of(scene, t, e, total, passing)


@jitable
def factor_loops(scene: Scene, t: float) -> None:
    """Fill B and replace it by its factor."""
    fill_bodies(scene)
    fill_joints(scene)
    scene.sweep.quality[PIVOT] = 1.0
    passing, at = passes_fold(scene, t), 0
    for n in range(len(scene.graph.tree)):
        factor_node(scene, t, n, passing)
        at = eliminate(scene.graph.joints, n, at)
    # the pivots, as the other factor has them
    G, active = scene.graph, scene.equations.active
    for r in range(active_count(scene)):
        n, row = G.node_of[active[r]], G.row[active[r]]
        scene.sweep.A[r, r] = G.joints.block[n, row, row]


@jitable
def solve_loops(scene: Scene) -> None:
    """Return the multipliers of `rhs`, by the equations in use."""
    G, P, active, sweep = scene.graph, scene.graph.joints, scene.equations.active, scene.sweep
    for n in range(len(P.x)):
        for r in range(6):
            P.x[n, r] = 0.0
    for r in range(active_count(scene)):
        P.x[G.node_of[active[r]], G.row[active[r]]] = sweep.rhs[r]
    solve_factored(P)
    for r in range(active_count(scene)):
        sweep.multiplier[r] = P.x[G.node_of[active[r]], G.row[active[r]]]


@jitable
def cost_of_equations(scene: Scene) -> float:
    """Return about how long `fill_matrix` and `factor_matrix` take, in nanoseconds."""
    G, tree, active, total = scene.graph, scene.tree, scene.equations.active, 0.0
    free = 0
    for k in range(len(tree.free)):
        free += tree.free[k]
    each = _BODY + _FREE * free / len(tree.free)
    for r in range(active_count(scene)):
        width, n = r - scene.sweep.skyline[r], G.node_of[active[r]]
        before = -1
        for at in range(G.first[n], G.first[n + 1]):
            root = tree.root[G.bodies[G.body[at]]]
            if root != before:
                total += each * (tree.end[root] - root)
            before = root
        total += width * (_ALONG + 0.5 * _LONG * width)
    return total


@jitable
def cost_of_loops(scene: Scene) -> float:
    """Return about how long `factor_loops` takes, in nanoseconds."""
    G, P, eq, total = scene.graph, scene.graph.joints, scene.equations, 0.0
    for n in range(len(G.tree)):
        P.size[n] = 6 - scene.tree.free[G.tree[n]] if G.tree[n] >= 0 else 0
    for r in range(active_count(scene)):
        P.size[G.node_of[eq.active[r]]] += 1
    for n in range(len(G.tree)):
        m, beside, blocks = P.size[n], 0, P.first[n + 1] - P.first[n]
        for p in range(P.first[n], P.first[n + 1]):
            beside += P.size[P.row[p]]
        total += _SHORT * m * (m * m / 6.0 + 0.5 * m * beside + 0.5 * beside * beside)
        total += _NODE + _BLOCK * 0.5 * (blocks + 1) * (blocks + 2)
    return total + _MEETS * (len(G.bodies) + len(G.body) + len(P.meets))


@jitable
def weigh(scene: Scene) -> None:
    """Factor in the way that takes less time for the equations in use."""
    dearer = scene.graph.cost[COST_OF_SPARSE] * cost_of_loops(scene)
    scene.graph.in_use[0] = 1 if dearer < cost_of_equations(scene) else 0
