"""Forces that are implicit in a step, as stiff springs, dampers, drives and user's states ask.

With a the accelerations that forces and joints give, and Delta = v' - v, a step is to obey

    v' = v + h a(t + theta h, q + theta h (v + theta Delta), v + theta Delta) + M^-1 H' r

Newton's method on that, from a guess v_1, with the linearisation of implicit methods
(`dynamics.linearization`, which joints and equations are part of):

    v' = v_1 + A^-1 (v + h a_1 - v_1) + A^-1 M^-1 H' r,    A = 1 - theta h a_v - (theta h)^2 a_q

so velocities without contacts and what impulses do to bodies are both A^-1 times what they are of
explicit forces, and contacts know what the forces will be at the step's end. Iterations are made
from v, from the step that is found then, and on until that settles (`step`): of what a stiff damper
turns by within the step each leaves a part. A is that of motions which joints allow: what
accelerations are across them is added as it is.

theta is the least with which the stiffest of forces does not overshoot, 1 - 1/s of a damper of rate
s/h; but 1/2, of order 2, up to s = 2, and `LARGEST` at most: what is stiff still decays then. A
vector that is multiplied by A^-1 once a step, and keeps what that takes off it, turns to the
stiffest motion; it says s for the next step.
Source: M. Jean, Comput. Methods Appl. Mech. Eng. 177 (1999) 235, for theta; the power method.
"""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Hook, Joints, note_failure
from mbsim.arrays.scene import Scene
from mbsim.compile_model.tangent import Tangent
from mbsim.core.address import call_int, view
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import AT_V, AT_W, BODY_SIZE
from mbsim.core.rotation import dot, rotate, sub, unrotate, vector
from mbsim.stepping.arrays import (
    FACTOR,
    LINEARISE,
    SOLVE,
    STIFFNESS,
    THETA,
    Stepping,
)

#: The largest theta: a swing far shorter than a step loses a twelfth in one, and all that is slow
#: has a tenth of the error that an implicit Euler step has.
LARGEST = 0.55


@jitable
def is_implicit(S: Stepping) -> bool:
    """Return whether forces are implicit."""
    return S.plan.force[LINEARISE] != 0


@jitable
def choose_theta(S: Stepping, h: float) -> None:
    """Choose how far into a step h forces are taken."""
    number = S.forces.number
    number[THETA] = 0.5
    if is_implicit(S):
        s = h * number[STIFFNESS]
        number[THETA] = min(max(0.5, 1.0 - 1.0 / s), LARGEST) if s > 0.0 else 0.5


@jitable
def factor_forces(scene: Scene, S: Stepping, t: float, h: float, y: F1, dy: F1) -> int:
    """Factor A where forces have just been found; return 0 or a code."""
    code = call_int(S.plan.force[LINEARISE], (scene, t, h, y, dy))
    if code != 0:
        return code
    c, rate = S.forces.coefficients, 1.0 / (S.forces.number[THETA] * h)
    c[0], c[1], c[2], c[3] = rate, rate * rate, rate, 0.0
    return call_int(S.plan.force[FACTOR], (scene, t, h, c, c))


@jitable
def divide(scene: Scene, S: Stepping, given: F1, found: F1) -> int:
    """Fill `found` by A^-1 times `given`, changes of velocities and states in the layout of y.

    Angular velocities are in body axes of the linearisation. Return 0 or a code.
    """
    code = call_int(S.plan.force[SOLVE], (scene, 0.0, 0.0, given, found))
    # the solver takes accelerations, and gives what velocities are at the part theta of the step
    part = S.forces.coefficients[0]
    for k in range(len(given)):
        found[k] *= part
    return code


@jitable
def energy_of(scene: Scene, x: F1) -> float:
    """Return v . M v of changes of velocities, angular ones in body axes."""
    total = 0.0
    for b in range(len(scene.bodies.mass)):
        v, w = vector(x, BODY_SIZE * b + AT_V), vector(x, BODY_SIZE * b + AT_W)
        total += scene.bodies.mass[b] * dot(v, v) + dot(w, rotate(scene.bodies.inertia[b], w))
    return total


@jitable
def keep_velocities(scene: Scene, x: F1, less: F1, part: float) -> None:
    """Take a part of `less` off x, of which only velocities of bodies are kept."""
    velocities = BODY_SIZE * len(scene.bodies.mass)
    for k in range(len(x)):
        held = k < velocities and k % BODY_SIZE >= AT_V
        x[k] = x[k] - part * less[k] if held else 0.0


@jitable
def find_stiffness(scene: Scene, S: Stepping, h: float) -> int:
    """Measure the stiffest of forces by one more power of what A takes off; return 0 or a code."""
    F, x, found = S.forces, S.forces.stiffest, S.forces.found
    # A^-1 takes off all that is across joints, which have turned since the last step
    keep_to_joints(scene, S, x)
    size = energy_of(scene, x)
    if not size > 0.0:
        # begin with what forces do
        keep_velocities(scene, x, F.given, -1.0)
        size = energy_of(scene, x)
        if not size > 0.0:
            return 0
    code = divide(scene, S, x, found)
    left = energy_of(scene, found)
    if code != 0 or not left > 0.0 or not math.isfinite(left):
        return code
    off = max(math.sqrt(size / left) - 1.0, 0.0)
    F.number[STIFFNESS] = off / (F.number[THETA] * h)
    keep_velocities(scene, x, found, 1.0)
    size = energy_of(scene, x)
    keep_velocities(scene, x, x, 1.0 - 1.0 / math.sqrt(size) if size > 0.0 else 1.0)
    return 0


@jitable
def keep_to_joints(scene: Scene, S: Stepping, given: F1) -> None:
    """Replace changes of velocities by those that joints allow, as `divide` takes them.

    What they leave out, across joints, is how accelerations turn velocities with them. It is that
    of an impulse M given.
    """
    impulse, joints = S.motion.impulse, scene.world.hooks[Hook.JOINTS]
    if joints == 0:
        return
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        at = BODY_SIZE * b
        turn = rotate(T.linear.R[b], rotate(scene.bodies.inertia[b], vector(given, at + AT_W)))
        for c in range(3):
            impulse[6 * b + c] = scene.bodies.mass[b] * given[at + AT_V + c]
            impulse[6 * b + 3 + c] = turn[c]
    note_failure(scene, call_int(joints, (scene, Joints.IMPULSE, 0.0, impulse, impulse)))
    for k in range(len(scene.tree.body)):
        b = scene.tree.body[k]
        at, turn = BODY_SIZE * b, unrotate(T.linear.R[b], vector(impulse, 6 * b + 3))
        for c in range(3):
            given[at + AT_V + c], given[at + AT_W + c] = impulse[6 * b + c], turn[c]


@jitable
def take_into_step(scene: Scene, S: Stepping, h: float, dy: F1, first: bool) -> int:
    """Let what forces do in a step be what they do within it; return 0 or a code.

    `Motion.free` are velocities by explicit forces; those that they were found at are `Motion.v`
    at the part theta of the step, which were y's for the `first` time. dy of states likewise.
    """
    M, F, theta, plan = S.motion, S.forces, S.forces.number[THETA], S.plan
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    given, found = F.given, F.found
    for k in range(len(given)):
        given[k] = 0.0
    for row in range(plan.first[len(plan.first) - 1]):
        b = plan.members[row]
        v, before, free, at = M.v[b], M.before[b], M.free[b], BODY_SIZE * b
        for c in range(6):
            # what is left of the guess
            free[c] -= before[c] + (v[c] - before[c]) / theta
        turn = unrotate(T.linear.R[b], vector(free, 3))
        for c in range(3):
            given[at + AT_V + c], given[at + AT_W + c] = free[c], turn[c]
    for z in range(len(scene.states.program)):
        k = scene.states.offset[z]
        F.slope[z] = 0.0 if first else F.slope[z]
        given[k] = h * (dy[k] - F.slope[z])
    keep_to_joints(scene, S, given)
    code = find_stiffness(scene, S, h) if first else 0
    if code == 0:
        code = divide(scene, S, given, found)
    for row in range(plan.first[len(plan.first) - 1]):
        b = plan.members[row]
        v, before, free, at = M.v[b], M.before[b], M.free[b], BODY_SIZE * b
        w = vector(found, at + AT_W)
        turn = rotate(T.linear.R[b], sub(w, vector(given, at + AT_W)))
        for c in range(3):
            free[c] += found[at + AT_V + c] - given[at + AT_V + c]
            free[3 + c] += turn[c]
        for c in range(6):
            free[c] += before[c] + (v[c] - before[c]) / theta
    for z in range(len(scene.states.program)):
        k = scene.states.offset[z]
        F.slope[z] += found[k] / h
        dy[k] = F.slope[z]
    return code


@jitable
def yield_to_forces(scene: Scene, S: Stepping, impulse: F1) -> int:
    """Let what an impulse changes of velocities, at 6 b of body b, be that with forces; 0 or code.

    Global axes.
    """
    T = view(scene.world.hooks[Hook.TANGENT], Tangent)
    given, found = S.forces.given, S.forces.found
    for k in range(len(given)):
        given[k] = 0.0
    for b in range(len(scene.bodies.mass)):
        at = BODY_SIZE * b
        turn = unrotate(T.linear.R[b], vector(impulse, 6 * b + 3))
        for c in range(3):
            given[at + AT_V + c], given[at + AT_W + c] = impulse[6 * b + c], turn[c]
    code = divide(scene, S, given, found)
    for b in range(len(scene.bodies.mass)):
        at = BODY_SIZE * b
        turn = rotate(T.linear.R[b], vector(found, at + AT_W))
        for c in range(3):
            impulse[6 * b + c], impulse[6 * b + 3 + c] = found[at + AT_V + c], turn[c]
    return code
