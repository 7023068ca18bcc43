"""Back onto the constraints: positions joint by joint from the root, then equations by Newton.

What is left of loops and motions, once the tree is seated (`seating`), is closed by displacements
that the tree allows, weighted by inertia; last, velocities are treated likewise.
"""

from __future__ import annotations

from mbsim.arrays.codes import (
    DRIFT,
    DRIFTER,
    LEFT_OPEN,
    OPEN_AT,
    SCALE_LENGTH,
    SCALE_SPEED,
)
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.rotation import add, cross, vector
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.equations import (
    MISMATCH,
    RESIDUAL,
    add_wrench,
    factor_equations,
    fill_equations,
    solve_equations,
)
from mbsim.dynamics.constraints.folding import is_sticking
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.tree import prepare, respond
from mbsim.dynamics.constraints.tree_projection import (
    project_tree,
    project_tree_velocities,
    set_spin,
    set_velocity,
    turn_body,
)

#: Newton ends when no residual is above this part of its unit, or after so many rounds. What is
#: left moves bodies by that over how near the equations are to singular: it is rounding alone.
CLOSED = 1e-15
MOST_ROUNDS = 8
#: A residual, over its unit, whose square is rounding.
SMALL = 1e-8
#: What of the way back onto the constraints counts as a step's error: its own estimate is to
#: rule, unless the constraints themselves moved in a way that no stage of the step has met.
FORGIVEN = 0.1


@jitable
def correct(scene: Scene, level: int, column: int) -> None:
    """Fill `answer` with the motion that takes the residuals of that level and column away."""
    sweep, active = scene.sweep, scene.equations.active
    n = active_count(scene)
    for r in range(n):
        held = scene.equations.level[active[r]] >= level
        sweep.rhs[r] = -sweep.rate[active[r], column] if held else 0.0
    solve_equations(scene)
    push(scene)


@jitable
def push(scene: Scene) -> None:
    """Fill `answer` with the motion that the multipliers cause."""
    sweep, active = scene.sweep, scene.equations.active
    for k in range(len(scene.tree.body)):
        for c in range(6):
            sweep.p[k, c] = 0.0
    for r in range(active_count(scene)):
        add_wrench(scene, active[r], sweep.multiplier[r])
    respond(scene, 0, len(scene.tree.body), 0, sweep.answer)


@jitable
def displace(scene: Scene, y: F1) -> None:
    """Move all bodies by the spatial displacement in `answer`.

    All moves are found before the first is made: they are about points that move too.
    """
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        D = scene.sweep.answer[k]
        turn = (D[0], D[1], D[2])
        r = vector(scene.sweep.arm[k])
        move = add((D[3], D[4], D[5]), cross(turn, r))
        for i in range(3):
            scene.sweep.c[k, i] = move[i]
            scene.sweep.c[k, 3 + i] = turn[i]
    for k in range(len(scene.tree.body)):
        b, c = scene.tree.body[k], scene.sweep.c[k]
        for i in range(3):
            y[BODY_SIZE * b + i] += c[i]
        turn_body(scene, y, b, (c[3], c[4], c[5]))


@jitable
def speed_up(scene: Scene, y: F1) -> None:
    """Add the spatial velocities in `answer` to those of all bodies."""
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        D = scene.sweep.answer[k]
        turn = (D[0], D[1], D[2])
        r = vector(scene.sweep.arm[k])
        rise = add((D[3], D[4], D[5]), cross(turn, r))
        set_velocity(scene, y, b, add(vector(scene.work.v[b]), rise))
        set_spin(scene, y, b, add(vector(scene.work.w[b]), turn))


@jitable
def largest_residual(scene: Scene, level: int, column: int, t: float) -> float:
    """Return the largest residual over its unit of the equations in use that hold at t."""
    largest = 0.0
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        if scene.equations.level[e] >= level and is_sticking(scene, e, t):
            largest = max(largest, abs(scene.sweep.rate[e, column]) / scene.equations.unit[e])
    return largest


@jitable
def note_drift(scene: Scene, level: int, column: int, part: float) -> None:
    """Note the largest residual of motions, over its unit and times `part`, if none was larger."""
    quality = scene.sweep.quality
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        if scene.equations.program[e] >= 0 and scene.equations.level[e] >= level:
            drift = part * abs(scene.sweep.rate[e, column]) / scene.equations.unit[e]
            if not drift <= quality[DRIFT]:
                quality[DRIFT], quality[DRIFTER] = drift, e


@jitable
def note_gap(scene: Scene, t: float) -> None:
    """Note as drift, over `SMALL`, a residual that Newton has left: the step is to be refused.

    Where steps have no error it is in `LEFT_OPEN`. A motion that asked for more than that of the
    step keeps its name: it is the cause.
    """
    quality = scene.sweep.quality
    asked, worst = quality[DRIFT], 0.0
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        gap = abs(scene.sweep.rate[e, RESIDUAL]) / scene.equations.unit[e]
        held = scene.equations.level[e] >= 2 and is_sticking(scene, e, t)
        if held and gap > max(SMALL, worst):
            worst = gap
            quality[LEFT_OPEN], quality[OPEN_AT] = gap, e
            if asked <= SMALL:
                quality[DRIFTER] = e
    if worst > 0.0:
        quality[DRIFT] = max(asked, worst / SMALL)


@jitable
def prepare_equations(scene: Scene, t: float, y: F1) -> None:
    """Fill all that follows from y: bodies, tree, equations."""
    place_bodies(scene, y)
    prepare(scene, y)
    fill_equations(scene, t, y)


@jitable
def close_loops(scene: Scene, t: float, y: F1) -> None:
    """Move the bodies until no equation has a residual; leave the factor of there.

    Newton leaves the square of a residual: after a small one neither bodies nor factor are so
    different that the last round, or the velocities, would notice.
    """
    prepare_equations(scene, t, y)
    note_drift(scene, 2, RESIDUAL, FORGIVEN)
    scene.sweep.quality[LEFT_OPEN] = 0.0
    factor_equations(scene, t)
    for _ in range(MOST_ROUNDS):
        size = largest_residual(scene, 2, RESIDUAL, t)
        if size <= CLOSED:
            return
        correct(scene, 2, RESIDUAL)
        displace(scene, y)
        project_tree(scene, y)
        if size <= SMALL:
            return
        prepare_equations(scene, t, y)
        factor_equations(scene, t)
    note_gap(scene, t)


@jitable
def project(scene: Scene, t: float, y: F1, level: int) -> None:
    """Bring y back onto all constraints, positions first.

    Of velocities, what equations of that level and above hold: with 2, velocities are
    displacements, which motions of velocities leave free.
    """
    scene.sweep.quality[DRIFT] = 0.0
    place_bodies(scene, y)
    project_tree(scene, y)
    if active_count(scene) > 0:
        close_loops(scene, t, y)
    project_tree_velocities(scene, y)
    if active_count(scene) > 0:
        fill_equations(scene, t, y)
        part = FORGIVEN * scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]
        note_drift(scene, level, MISMATCH, part)
        correct(scene, level, MISMATCH)
        speed_up(scene, y)
