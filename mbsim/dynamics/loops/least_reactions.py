"""Least reactions of many loops, by a sparse factor: how loads spread if all joints were as stiff.

Rows of a connection are made orthonormal in the norm of `reactions`: then reactions are u with load
f = J'u on the bodies, and of all u with that load the least is u = J d, J'J d = f. J'J couples the
bodies that a connection joins, as stiffness does; along motions that are free it is singular, and a
little is added. What that makes wrong is taken away by repeating it.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    MEETS_BLOCK,
    MEETS_COLUMN,
    MEETS_ROW,
    REACTION_AT,
    REACTION_SIGN,
    SCALE_LENGTH,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, sub
from mbsim.dynamics.bodies.markers import marker_point
from mbsim.dynamics.constraints.in_use import is_friction, is_off
from mbsim.dynamics.constraints.tree import origin
from mbsim.dynamics.loops.multipliers import fill_rows
from mbsim.dynamics.loops.sparse_factor import (
    clear,
    eliminate,
    factor_diagonal,
    solve_factored,
)

#: Stiffness that is added, as part of what joints give, and where they give none; how often what it
#: does is taken away.
_ADDED, _LEAST, _ROUNDS = 1e-12, 1e-30, 3
#: A row of which others of its connection leave less than this part has no share of its own.
_OWN = 1e-9


@jitable
def fill_units(scene: Scene, y: F1, n: int) -> None:
    """Fill the reactions R of units of node n, force and torque over the length of the model."""
    G, c = scene.graph, scene.graph.connection[n]
    at, sign = G.reaction[n, REACTION_AT], float(G.reaction[n, REACTION_SIGN])
    length, k = scene.world.scale[SCALE_LENGTH], G.bodies[G.body[at]]
    arm = sub(marker_point(scene, y, scene.connections.i[c]), origin(scene, y, k))
    for r in range(G.rows[n]):
        J, R = G.J[at, r], G.R[n, r]
        moment = cross(arm, (J[3], J[4], J[5]))
        for i in range(3):
            R[i], R[3 + i] = sign * J[3 + i], sign * (J[i] - moment[i]) / length


@jitable
def size_of(row: F1) -> float:
    """Return the norm of six numbers."""
    total = 0.0
    for i in range(6):
        total += row[i] * row[i]
    return math.sqrt(total)


@jitable
def subtract_row(scene: Scene, n: int, r: int, s: int, part: float) -> None:
    """Take `part` of row s of node n, reactions and gradients, from row r."""
    G = scene.graph
    for i in range(6):
        G.R[n, r, i] -= part * G.R[n, s, i]
    for at in range(G.first[n], G.first[n + 1]):
        for i in range(6):
            G.J[at, r, i] -= part * G.J[at, s, i]


@jitable
def make_orthonormal(scene: Scene, n: int) -> None:
    """Combine the rows of node n so that their reactions are orthonormal (Gram and Schmidt)."""
    G = scene.graph
    for r in range(G.rows[n]):
        R = G.R[n, r]
        whole = size_of(R)
        for s in range(r):
            part = 0.0
            for i in range(6):
                part += R[i] * G.R[n, s, i]
            subtract_row(scene, n, r, s, part)
        size = size_of(R)
        # a row that is none is taken away from itself
        factor = 1.0 - 1.0 / size if size > _OWN * whole else 1.0
        subtract_row(scene, n, r, r, factor)


@jitable
def fill_links(scene: Scene, y: F1) -> None:
    """Fill J'J of all that has a share in reactions, and factor it; gradients have been filled."""
    G, P = scene.graph, scene.graph.links
    for e in range(len(G.bears)):
        G.bears[e] = -1 if is_friction(scene, e) or is_off(scene, e) else 0
    for n in range(len(G.tree)):
        G.rows[n] = fill_rows(scene, n, G.bears)
        if G.connection[n] >= 0:
            fill_units(scene, y, n)
            make_orthonormal(scene, n)
    clear(P)
    for k in range(len(P.meets)):
        a, b = P.meets[k, MEETS_ROW], P.meets[k, MEETS_COLUMN]
        J, K, B = G.J[a], G.J[b], P.block[P.meets[k, MEETS_BLOCK]]
        for r in range(G.rows[G.node[a]]):
            for i in range(6):
                for j in range(6):
                    B[i, j] += J[r, i] * K[r, j]
    at = 0
    for b in range(len(P.size)):
        P.size[b], B = 6, P.block[b]
        for i in range(6):
            B[i, i] += _ADDED * B[i, i] + _LEAST
    for b in range(len(P.size)):
        factor_diagonal(P.block[b], 6)
        at = eliminate(P, b, at)


@jitable
def stretch(scene: Scene, n: int, r: int) -> float:
    """Return what displacements d do to row r of node n."""
    G, total = scene.graph, 0.0
    for at in range(G.first[n], G.first[n + 1]):
        for i in range(6):
            total += G.J[at, r, i] * G.shift[G.body[at], i]
    return total


@jitable
def displace_more(scene: Scene) -> None:
    """Add to displacements d what the loads that they do not carry yet cause."""
    G, P = scene.graph, scene.graph.links
    for b in range(len(P.size)):
        for i in range(6):
            P.x[b, i] = 0.0
    for n in range(len(G.tree)):
        for r in range(G.rows[n]):
            left = G.u[n, r] - stretch(scene, n, r)
            for at in range(G.first[n], G.first[n + 1]):
                x = P.x[G.place[G.body[at]]]
                for i in range(6):
                    x[i] += left * G.J[at, r, i]
    solve_factored(P)
    for b in range(len(G.bodies)):
        for i in range(6):
            G.shift[b, i] += P.x[G.place[b], i]


@jitable
def relieve(scene: Scene) -> None:
    """Replace the reactions of all nodes by the least with the same loads."""
    G, out, length = scene.graph, scene.work.reaction, scene.world.scale[SCALE_LENGTH]
    for n in range(len(G.tree)):
        c = G.connection[n]
        for r in range(G.rows[n]):
            R, total = G.R[n, r], 0.0
            for i in range(3):
                total += R[i] * out[6 * c + i] + R[3 + i] * out[6 * c + 3 + i] / length
            G.u[n, r] = total
    for b in range(len(G.bodies)):
        for i in range(6):
            G.shift[b, i] = 0.0
    for _ in range(_ROUNDS):
        displace_more(scene)
    for n in range(len(G.tree)):
        c = G.connection[n]
        if c < 0:
            continue
        for i in range(6):
            out[6 * c + i] = 0.0
        for r in range(G.rows[n]):
            u = stretch(scene, n, r)
            for i in range(3):
                out[6 * c + i] += u * G.R[n, r, i]
                out[6 * c + 3 + i] += u * length * G.R[n, r, 3 + i]
