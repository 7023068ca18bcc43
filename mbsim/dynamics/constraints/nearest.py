"""Onto the constraints by the least change in the norm of the masses.

What joints do is no work then: momentum of what nothing outside holds stays, and no projection
makes kinetic energy. Displacements D of bodies are the least ones with

    D_child - D_parent = sum S q + c

where c closes the joint: the articulated-body recursion with c for what velocities cause. The
velocities that joints allow and that are nearest to V are those which the momenta H V give.

Equations that hold accelerations, f at the time t, have rates in a step from t0 to t0 + h: that of
its begin and (t - t0) f, with f of its midst. That is of order 2, as the midpoint rule.
"""

from __future__ import annotations

from mbsim.arrays.codes import (
    AIMED_AT,
    AIMED_FROM,
    AIMED_WORK,
    ASKED_FOR,
    DRIFT,
    RATE_BEGUN,
    SCALE_LENGTH,
    SCALE_SPEED,
    TURN_ROOT,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, dot, norm, rotate, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.equations import (
    FLOW,
    MISMATCH,
    along,
    factor_equations,
    fill_equations,
)
from mbsim.dynamics.constraints.in_use import active_count, is_friction
from mbsim.dynamics.constraints.projection import (
    FORGIVEN,
    close_loops,
    correct,
    displace,
    note_drift,
    prepare_equations,
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
from mbsim.dynamics.expressions.jets import jet

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
def holds_accelerations(scene: Scene, e: int) -> bool:
    """Return whether equation e is a motion that gives accelerations."""
    return scene.equations.level[e] == 0 and not is_friction(scene, e)


@jitable
def aims(scene: Scene) -> bool:
    """Return whether an equation in use is such a motion."""
    for r in range(active_count(scene)):
        if holds_accelerations(scene, scene.equations.active[r]):
            return True
    return False


@jitable
def aim(scene: Scene, t: float, y: F1) -> None:
    """Keep the rates of what holds accelerations: a step begins at (t, y)."""
    sweep = scene.sweep
    sweep.aimed[AIMED_FROM] = t
    if aims(scene):
        prepare_equations(scene, t, y)
        for r in range(active_count(scene)):
            e = scene.equations.active[r]
            sweep.aim[e, RATE_BEGUN] = sweep.rate[e, FLOW]


@jitable
def ask(scene: Scene, t: float, y: F1) -> None:
    """Keep the accelerations that it asks for: t is the midst of a step."""
    if aims(scene):
        place_bodies(scene, y)
        for r in range(active_count(scene)):
            e = scene.equations.active[r]
            if holds_accelerations(scene, e):
                scene.sweep.aim[e, ASKED_FOR] = jet(scene, t, y, scene.equations.program[e])[0]


@jitable
def take_aims(scene: Scene, t: float) -> int:
    """Fill by how much rates are off those of a step, if t is where it asks for them.

    Return the least level of equations that are to be held.
    """
    sweep = scene.sweep
    if t != sweep.aimed[AIMED_AT] or not aims(scene):
        return 1
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        if holds_accelerations(scene, e):
            gained = (t - sweep.aimed[AIMED_FROM]) * sweep.aim[e, ASKED_FOR]
            sweep.rate[e, MISMATCH] = sweep.rate[e, FLOW] - sweep.aim[e, RATE_BEGUN] - gained
    return 0


@jitable
def take_changes(scene: Scene) -> None:
    """Fill the work of the multipliers at hand, and rates of sums as `answer` changes them.

    Impulses do their work at the mean of the rates before and behind them.
    """
    sweep, work = scene.sweep, 0.0
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        change = along(scene, e, sweep.answer, -1)
        if not is_friction(scene, e):
            work += sweep.multiplier[r] * (sweep.rate[e, FLOW] + 0.5 * change)
        sweep.rate[e, FLOW] += change
    sweep.aimed[AIMED_WORK] = work


@jitable
def hold_all_velocities(scene: Scene, t: float, y: F1) -> None:
    """Replace velocities by the nearest that all constraints allow; positions are closed."""
    hold_velocities(scene, y)
    scene.sweep.aimed[AIMED_WORK] = 0.0
    if active_count(scene) > 0:
        fill_equations(scene, t, y)
        factor_equations(scene, t)
        part = FORGIVEN * scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]
        note_drift(scene, 1, MISMATCH, part)
        correct(scene, take_aims(scene, t), MISMATCH)
        speed_up(scene, y)
        take_changes(scene)
