"""Reactions of joints and motions: force and torque on the body of marker I, at marker I."""

from __future__ import annotations

from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, scale, sub
from mbsim.dynamics.equations import active_count, side_place
from mbsim.dynamics.markers import marker_point
from mbsim.dynamics.tree import origin


@jitable
def add_reaction(scene, y, c, place, wrench, factor):
    """Add `factor` times a wrench about O of that place to the reaction of connection c."""
    at = sub(marker_point(scene, y, scene.connections.i[c]), origin(scene, y, place))
    force = scale(factor, (wrench[3], wrench[4], wrench[5]))
    moment = cross(at, force)
    row = scene.work.joint[c]
    for i in range(3):
        row[i] += force[i]
        row[3 + i] += factor * wrench[i] - moment[i]


@jitable
def add_tree_reaction(scene, y, c):
    """Add what the joint of the tree carries: H A + p of all that hangs on it."""
    sweep, k = scene.sweep, scene.connections.tree[c]
    for i in range(6):
        total = sweep.p[k, i]
        for j in range(6):
            total += sweep.H[k, i, j] * sweep.a[k, j]
        sweep.z[k, i] = total
    # on the child; marker I may be on the parent
    add_reaction(scene, y, c, k, sweep.z[k], -1.0 if scene.connections.flip[c] == 1 else 1.0)


@jitable
def add_equation_reaction(scene, y, r):
    """Add what the multiplier of the r-th equation in use does to the body of I."""
    eq, sweep = scene.equations, scene.sweep
    e = eq.active[r]
    c = eq.connection[e]
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            m = eq.i[k] if side == 0 else eq.j[k]
            place = side_place(scene, m)
            if scene.markers.body[m] == scene.markers.body[scene.connections.i[c]] and place >= 0:
                G = sweep.G[k, 6 * side : 6 * side + 6]
                add_reaction(scene, y, c, place, G, sweep.multiplier[r])


@jitable
def fill_reactions(scene, y):
    """Fill the reactions of all connections; the state has just been evaluated."""
    connections = scene.connections
    for c in range(len(connections.i)):
        for i in range(6):
            scene.work.joint[c, i] = 0.0
    for c in range(len(connections.i)):
        if connections.tree[c] >= 0:
            add_tree_reaction(scene, y, c)
    for r in range(active_count(scene)):
        add_equation_reaction(scene, y, r)
