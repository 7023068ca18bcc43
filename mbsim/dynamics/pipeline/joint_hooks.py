"""What joints are asked for, behind one hook: accelerations, projection, reactions, assembly.

Where the tree holds all of them there are no equations to compile.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    DRIFT,
    DRIFTER,
    FOLD_AT,
    FOLD_BEGINS,
    FOLD_OFF,
    FOLD_POWER,
    NEAR_FOLD,
    OF_MOTIONS,
)
from mbsim.arrays.hooks import Hook, Joints
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, vector
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.equations import MISMATCH, fill_matrix, hold, power_of_equations
from mbsim.dynamics.constraints.folding import passes_fold
from mbsim.dynamics.constraints.impulses import answer_impulses, answer_tree, make_ready
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.nearest import (
    aim,
    ask,
    close_all,
    close_tree,
    hold_all_velocities,
    hold_velocities,
)
from mbsim.dynamics.constraints.projection import (
    displace,
    prepare_equations,
    project,
    push,
    speed_up,
)
from mbsim.dynamics.constraints.reactions import add_tree_reactions, fill_reactions, show_sticking
from mbsim.dynamics.constraints.selection import (
    LEFT,
    choose,
    fill_size,
    keep_selection,
    renew_selection,
    use_all,
)
from mbsim.dynamics.constraints.tree import load, prepare, respond, write_accelerations
from mbsim.dynamics.constraints.tree_projection import project_tree, project_tree_velocities
from mbsim.dynamics.pipeline.audit import examine_equations, examine_fold


@jitable
def constrain(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Replace the accelerations in y' by those that the constraints leave; return 0 or a code."""
    prepare(scene, y)
    hold(scene, t, y)
    if scene.world.hooks[Hook.REACTION_FORCES] != 0:
        # friction follows from reactions, and these from friction
        code = call_int(scene.world.hooks[Hook.REACTION_FORCES], (scene, t, y, dy))
        if code != 0:
            return code
    show_sticking(scene)
    total = write_accelerations(scene, dy)
    accumulators = scene.world.accumulators[OF_MOTIONS]
    if accumulators >= 0:
        passing = passes_fold(scene, t)
        power = scene.sweep.quality[FOLD_POWER] if passing else power_of_equations(scene)
        dy[accumulators] = power
    return 0 if math.isfinite(total) else Code.NOT_FINITE


@jitable
def hold_all(scene: Scene, t: float, y: F1) -> None:
    """Fill accelerations and multipliers as if nothing was released: reactions are those."""
    quality = scene.sweep.quality
    begins = quality[FOLD_BEGINS]
    quality[FOLD_BEGINS] = math.inf
    hold(scene, t, y)
    quality[FOLD_BEGINS] = begins


@jitable
def return_to_equations(scene: Scene, t: float, y: F1) -> None:
    """Bring y back onto what was released while a loop passed a fold; note how far off that was.

    What was foreseen is off along the constraints as much as across them, which is seen here.
    """
    sweep, scales, quality, eq = scene.sweep, scene.scales, scene.sweep.quality, scene.equations
    project(scene, t, y, 1)
    quality[FOLD_OFF], worst = 0.0, 0.0
    for p in range(len(scene.tree.body)):
        g, D, r = scales.group[scene.tree.body[p]], sweep.answer[p], vector(sweep.arm[p])
        shift = add((D[3], D[4], D[5]), cross((D[0], D[1], D[2]), r))
        off = math.sqrt(dot(shift, shift) / scene.work.squares[g])
        quality[FOLD_OFF] = max(quality[FOLD_OFF], off)
    for k in range(active_count(scene)):
        e = eq.active[k]
        rate = abs(sweep.rate[e, MISMATCH]) / eq.unit[e]
        if sweep.released[e] == 1 and rate >= worst:
            worst, quality[FOLD_AT] = rate, e
    prepare_equations(scene, t, y)
    quality[NEAR_FOLD] = 1.0


@jitable
def serve_steps(scene: Scene, what: int, t: float, y: F1, dy: F1) -> int:
    """Do what steps with impulses ask for; return 0 or a code."""
    if what == Joints.READY:
        make_ready(scene, t, y)
    elif what == Joints.IMPULSE:
        answer_impulses(scene, dy)
    elif what == Joints.CLOSE:
        close_all(scene, t, y)
    elif what == Joints.AIM:
        aim(scene, t, y)
    elif what == Joints.ASK:
        ask(scene, t, y)
    elif what == Joints.RENEW:
        return renew_selection(scene, t, y)
    else:
        hold_all_velocities(scene, t, y)
    return 0


@jitable
def serve(scene: Scene, what: int, t: float, y: F1, dy: F1) -> int:
    """Do what joints are asked for (`Joints`); return 0 or a code."""
    if what == Joints.ACCELERATE:
        return constrain(scene, t, y, dy)
    if Joints.READY <= what <= Joints.RENEW:
        return serve_steps(scene, what, t, y, dy)
    if what == Joints.PROJECT_TREE:
        quality = scene.sweep.quality
        drift, drifter = quality[DRIFT], quality[DRIFTER]
        project(scene, t, y, 1)
        quality[DRIFT], quality[DRIFTER] = drift, drifter
    elif what == Joints.PROJECT or what == Joints.ALONG:
        project(scene, t, y, 1 if what == Joints.PROJECT else 2)
    elif what == Joints.REACT:
        if passes_fold(scene, t):
            hold_all(scene, t, y)
        fill_reactions(scene, t, y)
    elif what == Joints.KEEP:
        code = keep_selection(scene, t, y)
        if code == LEFT:
            return_to_equations(scene, t, y)
            examine_fold(scene, t)
            return 0
        return code
    elif what == Joints.AUDIT:
        examine_equations(scene, t)
    elif what == Joints.MATRIX:
        use_all(scene, 0)
        prepare_equations(scene, t, y)
        fill_matrix(scene)
        for r in range(active_count(scene)):
            fill_size(scene, scene.equations.active[r])
    elif what == Joints.CHOOSE:
        prepare_equations(scene, t, y)
        choose(scene, t, y)
    elif what == Joints.DISPLACE:
        push(scene)
        displace(scene, y)
        project_tree(scene, y)
    elif what == Joints.SPEED_UP:
        push(scene)
        speed_up(scene, y)
        project_tree_velocities(scene, y)
    return 0


@jitable
def serve_tree_joints(scene: Scene, what: int, t: float, y: F1, dy: F1) -> int:
    """Do what `serve` does, for a scene without equations."""
    if what == Joints.ACCELERATE:
        prepare(scene, y)
        load(scene)
        respond(scene, 0, len(scene.tree.body), 1, scene.sweep.a)
        return 0 if math.isfinite(write_accelerations(scene, dy)) else Code.NOT_FINITE
    if what == Joints.REACT:
        reaction = scene.work.reaction
        for i in range(len(reaction)):
            reaction[i] = 0.0
        add_tree_reactions(scene, y, scene.sweep.a, reaction)
    elif what == Joints.MATRIX or what == Joints.READY:
        place_bodies(scene, y)
        prepare(scene, y)
    elif what == Joints.IMPULSE:
        answer_tree(scene, dy)
    elif what == Joints.PROJECT or what == Joints.ALONG:
        place_bodies(scene, y)
        project_tree(scene, y)
        project_tree_velocities(scene, y)
    elif what == Joints.CLOSE:
        close_tree(scene, y)
    elif what == Joints.HOLD:
        hold_velocities(scene, y)
    return 0


def serve_joints(context: int, what: int, t: float, y: Pointer, dy: Pointer) -> int:
    """All that joints are asked for."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve(scene, what, t, vector_at(y, n), vector_at(dy, n))


def serve_tree(context: int, what: int, t: float, y: Pointer, dy: Pointer) -> int:
    """The same where the tree holds all joints."""
    scene = view(context, Scene)
    n = scene.rows.y.shape[1]
    return serve_tree_joints(scene, what, t, vector_at(y, n), vector_at(dy, n))
