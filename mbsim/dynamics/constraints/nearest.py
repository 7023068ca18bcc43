"""Onto the constraints by the least change in the norm of the masses.

What joints do is no work then: momentum of what nothing outside holds stays, and no projection
makes kinetic energy. Displacements D of bodies are the least ones with

    D_child - D_parent = sum S q + c

where c closes the joint: the articulated-body recursion with c for what velocities cause. The
velocities that joints allow and that are nearest to V are those which the momenta H V give.
"""

from __future__ import annotations

from mbsim.arrays.codes import DRIFT, SCALE_LENGTH, SCALE_SPEED, TURN_ROOT
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, norm, rotate, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.equations import (
    MISMATCH,
    factor_equations,
    fill_equations,
)
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.projection import (
    FORGIVEN,
    close_loops,
    correct,
    displace,
    note_drift,
    speed_up,
)
from mbsim.dynamics.constraints.tree import parent_axis, prepare, put, respond
from mbsim.dynamics.constraints.tree_projection import (
    joint_arms,
    project_tree,
    set_spin,
    set_velocity,
    wanted_turn,
)

#: Rounds of Newton's method at most, and gaps over a body's size that need none: in the first
#: round rounding alone, for a gap that each step leaves to the child moves the centre of mass;
#: behind it what no run of 1e5 steps shows.
MOST_ROUNDS, ROUNDING, NEAR = 4, 1e-14, 1e-10


@jitable
def gap_of(scene: Scene, y: F1, k: int) -> tuple[V3, V3]:
    """Return how tree index k has to turn about its cg and then to move, to close its joint."""
    turn = wanted_turn(scene, k)
    arm, apart = joint_arms(scene, y, k)
    apart = add(apart, cross(turn, arm))
    for axis in range(3):
        if scene.tree.slide[k, axis] == 1:
            e = parent_axis(scene, k, axis)
            apart = sub(apart, scale(dot(apart, e), e))
    return turn, scale(-1.0, apart)


@jitable
def largest_gap(scene: Scene, y: F1) -> float:
    """Return the largest gap of the tree's joints, over the length of their bodies."""
    tree, worst = scene.tree, 0.0
    for k in range(len(tree.body)):
        if tree.turn[k] != TURN_ROOT:
            turn, move = gap_of(scene, y, k)
            length = scene.scales.length[scene.scales.group[tree.body[k]]]
            worst = max(worst, norm(move) / length, norm(turn))
    return worst


@jitable
def close_once(scene: Scene, y: F1) -> None:
    """Close the joints of the tree by the least displacements, to first order."""
    tree, sweep = scene.tree, scene.sweep
    prepare(scene, y)
    for k in range(len(tree.body)):
        for c in range(6):
            sweep.p[k, c] = 0.0
        if tree.turn[k] != TURN_ROOT:
            turn, move = gap_of(scene, y, k)
            put(sweep.c[k], turn, sub(move, cross(turn, vector(sweep.arm[k]))))
    respond(scene, 0, len(tree.body), 1, sweep.answer)
    displace(scene, y)


@jitable
def close_tree(scene: Scene, y: F1) -> None:
    """Close the joints of the tree by the least displacements."""
    place_bodies(scene, y)
    for n in range(MOST_ROUNDS):
        if largest_gap(scene, y) <= (ROUNDING if n == 0 else NEAR):
            break
        close_once(scene, y)
        place_bodies(scene, y)
    project_tree(scene, y)


@jitable
def hold_velocities(scene: Scene, y: F1) -> None:
    """Replace velocities by the nearest that constraints allow, with bodies where y has them."""
    tree, sweep, bodies, work = scene.tree, scene.sweep, scene.bodies, scene.work
    place_bodies(scene, y)
    prepare(scene, y)
    for k in range(len(tree.body)):
        b = tree.body[k]
        momentum = scale(bodies.mass[b], vector(work.v[b]))
        at = BODY_SIZE * b + 10
        spin = rotate(work.R[b], rotate(bodies.inertia[b], (y[at], y[at + 1], y[at + 2])))
        spin = add(spin, cross(vector(sweep.arm[k]), momentum))
        put(sweep.p[k], scale(-1.0, spin), scale(-1.0, momentum))
    respond(scene, 0, len(tree.body), 0, sweep.answer)
    for k in range(len(tree.body)):
        b, D = tree.body[k], sweep.answer[k]
        turn = (D[0], D[1], D[2])
        set_velocity(scene, y, b, add((D[3], D[4], D[5]), cross(turn, vector(sweep.arm[k]))))
        set_spin(scene, y, b, turn)


@jitable
def close_all(scene: Scene, t: float, y: F1) -> None:
    """Bring positions onto all constraints at t."""
    scene.sweep.quality[DRIFT] = 0.0
    close_tree(scene, y)
    if active_count(scene) > 0:
        close_loops(scene, t, y)


@jitable
def hold_all_velocities(scene: Scene, t: float, y: F1) -> None:
    """Replace velocities by the nearest that all constraints allow; positions are closed."""
    hold_velocities(scene, y)
    if active_count(scene) > 0:
        fill_equations(scene, t, y)
        factor_equations(scene, t)
        part = FORGIVEN * scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]
        note_drift(scene, 1, MISMATCH, part)
        correct(scene, 1, MISMATCH)
        speed_up(scene, y)
