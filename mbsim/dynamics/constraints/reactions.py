"""Reactions of joints and motions: force and torque on the body of marker I, at marker I.

Where equations follow from others, internal forces are not known: any sum of the self-stresses,
one for each implied equation, may be added. Those reactions are given whose sum of
|F|^2 + |T|^2 / L^2 over all connections is least (L the model's size).
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import AXIS_TORQUE, COST_OF_LINK, COST_OF_SPARSE, SCALE_LENGTH
from mbsim.arrays.hooks import Hook, Loops
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, scale, sub
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.constraints.equations import (
    add_wrench,
    along,
    fill_equation,
    solve_equations,
    tree_index,
)
from mbsim.dynamics.constraints.in_use import active_count, is_active, is_friction, is_off
from mbsim.dynamics.constraints.tree import origin, plus, respond, six, times

#: A self-stress that others leave less of than this part is none of its own.
_NEW = 1e-9
#: Nanoseconds, about: of a body that answers a self-stress, of a body and joint of sparse factors.
_ANSWER, _ROW = 45.0, 3000.0


@jitable
def add_reaction(
    scene: Scene, y: F1, c: int, index: int, wrench: F1, factor: float, out: F1
) -> None:
    """Add `factor` times a wrench about O of that tree to the reaction of connection c."""
    at = sub(marker_point(scene, y, scene.connections.i[c]), origin(scene, y, index))
    force = scale(factor, (wrench[3], wrench[4], wrench[5]))
    moment = cross(at, force)
    for i in range(3):
        out[6 * c + i] += force[i]
        out[6 * c + 3 + i] += factor * wrench[i] - moment[i]


@jitable
def add_tree_reaction(scene: Scene, y: F1, c: int, motion: F2, out: F1) -> None:
    """Add what the joint of the tree carries: H A + p of all that hangs on it."""
    sweep, k = scene.sweep, scene.connections.tree[c]
    carried = plus(six(sweep.p[k]), 1.0, times(sweep.H[k], six(motion[k])))
    for i in range(6):
        sweep.z[k, i] = carried[i]
    # on the child; marker I may be on the parent
    factor = -1.0 if scene.connections.flip[c] == 1 else 1.0
    add_reaction(scene, y, c, k, sweep.z[k], factor, out)


@jitable
def add_tree_reactions(scene: Scene, y: F1, motion: F2, out: F1) -> None:
    """Add the reactions of all joints of the tree, for forces p and accelerations."""
    for c in range(len(scene.connections.i)):
        if scene.connections.tree[c] >= 0:
            add_tree_reaction(scene, y, c, motion, out)


@jitable
def add_equation_reaction(scene: Scene, y: F1, e: int, multiplier: float, out: F1) -> None:
    """Add what a multiplier of equation e does to the body of I."""
    eq, sweep = scene.equations, scene.sweep
    c = eq.connection[e]
    if c < 0:
        # friction shows its force itself
        return
    body = scene.markers.body[scene.connections.i[c]]
    other = scene.markers.body[scene.connections.j[c]]
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            m = eq.i[k] if side == 0 else eq.j[k]
            index = tree_index(scene, m)
            G = sweep.G[k, 6 * side : 6 * side + 6]
            if index >= 0 and scene.markers.body[m] == body:
                add_reaction(scene, y, c, index, G, multiplier, out)
            elif index >= 0 and body == len(scene.bodies.mass) and scene.markers.body[m] == other:
                # on ground acts the opposite of what acts on J
                add_reaction(scene, y, c, index, G, -multiplier, out)


@jitable
def add_reactions(scene: Scene, y: F1, motion: F2, out: F1) -> None:
    """Add the reactions of all connections for forces p, accelerations and multipliers."""
    add_tree_reactions(scene, y, motion, out)
    for r in range(active_count(scene)):
        add_equation_reaction(scene, y, scene.equations.active[r], scene.sweep.multiplier[r], out)


@jitable
def self_stress(scene: Scene, t: float, y: F1, e: int, out: F1) -> None:
    """Fill the reactions by which equation e, implied by others, and those hold each other."""
    sweep, active, n = scene.sweep, scene.equations.active, active_count(scene)
    nt = len(scene.tree.body)
    fill_equation(scene, t, y, e)
    for last in range(2):
        for k in range(nt):
            for i in range(6):
                sweep.p[k, i] = 0.0
        add_wrench(scene, e, 1.0)
        if last == 1:
            for r in range(n):
                add_wrench(scene, active[r], sweep.multiplier[r])
        respond(scene, 0, nt, 0, sweep.answer)
        if last == 0:
            for r in range(n):
                sweep.rhs[r] = -along(scene, active[r], sweep.answer, -1)
            solve_equations(scene)
    for i in range(len(out)):
        out[i] = 0.0
    add_reactions(scene, y, sweep.answer, out)
    add_equation_reaction(scene, y, e, 1.0, out)


@jitable
def product(scene: Scene, a: F1, b: F1) -> float:
    """Return the sum of F.F' + T.T'/L^2 over all connections."""
    L2, total = scene.world.scale[SCALE_LENGTH] ** 2, 0.0
    for c in range(len(scene.connections.i)):
        for i in range(3):
            at = 6 * c + i
            total += a[at] * b[at] + a[at + 3] * b[at + 3] / L2
    return total


@jitable
def is_implied(scene: Scene, e: int) -> bool:
    """Return whether equation e, not of friction, is left out as others imply it."""
    return not (is_active(scene, e) or is_friction(scene, e) or is_off(scene, e))


@jitable
def stresses_are_many(scene: Scene) -> bool:
    """Return whether there are so many self-stresses that a sparse factor does it in less time.

    Friction in use has no share in the norm: there they are found one by one.
    """
    if scene.world.hooks[Hook.LOOPS] == 0:
        return False
    active, count = scene.equations.active, active_count(scene)
    implied = len(active) - 1 - count
    for r in range(count):
        if is_friction(scene, active[r]):
            return False
    each = _ANSWER * len(scene.tree.body) + 6.0 * implied * len(scene.connections.i)
    cost = scene.graph.cost
    sparse = cost[COST_OF_LINK] + _ROW * len(scene.graph.body)
    return implied * each > cost[COST_OF_SPARSE] * sparse


@jitable
def fill_stresses(scene: Scene, t: float, y: F1) -> int:
    """Fill the self-stresses, orthonormal; return their number. Multipliers and p are lost.

    Where they are many, -1: how joints and equations carry loads is factored instead.
    """
    if stresses_are_many(scene):
        for e in range(len(scene.equations.program)):
            if is_implied(scene, e):
                fill_equation(scene, t, y, e)
        call_int(scene.world.hooks[Hook.LOOPS], (scene, Loops.STRESS, t, y))
        return -1
    stress, count = scene.sweep.stress, 0
    for e in range(len(scene.equations.program)):
        if not is_implied(scene, e):
            continue
        new = stress[count]
        self_stress(scene, t, y, e, new)
        whole = math.sqrt(product(scene, new, new))
        for k in range(count):
            part = product(scene, new, stress[k])
            for i in range(len(new)):
                new[i] -= part * stress[k, i]
        size = math.sqrt(product(scene, new, new))
        if not size > _NEW * whole:
            continue
        for i in range(len(new)):
            new[i] /= size
        count += 1
    return count


@jitable
def sum_reactions(scene: Scene, y: F1) -> None:
    """Fill reactions that hold, not yet the least of all; the state has just been evaluated."""
    out = scene.work.reaction
    for i in range(len(out)):
        out[i] = 0.0
    add_reactions(scene, y, scene.sweep.a, out)


@jitable
def take_stresses(scene: Scene, count: int) -> None:
    """Take the self-stresses out of the reactions, so that these are the least."""
    if count < 0:
        call_int(scene.world.hooks[Hook.LOOPS], (scene, Loops.RELIEVE, 0.0, scene.sweep.rhs))
    out = scene.work.reaction
    for k in range(count):
        stress = scene.sweep.stress[k]
        part = product(scene, out, stress)
        for i in range(len(out)):
            out[i] -= part * stress[i]


@jitable
def fill_reactions(scene: Scene, t: float, y: F1) -> None:
    """Fill the reactions of all connections; the state has just been evaluated."""
    sum_reactions(scene, y)
    take_stresses(scene, fill_stresses(scene, t, y))


@jitable
def show_sticking(scene: Scene) -> None:
    """Fill `Work.applied` of rigid frictions that are held; multipliers have been found."""
    active = scene.equations.active
    for r in range(active[len(active) - 1]):
        f = scene.equations.dry[active[r]]
        if f < 0:
            continue
        n, row = marker_axis(scene, scene.applied.axes[f], 2), scene.work.applied[f]
        first = 3 if scene.applied.form[f] == AXIS_TORQUE else 0
        for k in range(3):
            row[first + k] = scene.sweep.multiplier[r] * n[k]
