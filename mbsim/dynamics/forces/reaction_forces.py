"""Forces by expressions of reactions, settled with the friction in joints.

With x all of them, scalars, components of vectors and frictions, and g(x) what their expressions
and laws make of the reactions under x, x = g(x) is sought from x = 0. With r = g(x) - x and J
its derivative a step is dx = -H r, H = -1 at first and J^-1 after C. G. Broyden's update
(Math. Comp. 19 (1965) 577-593),

    H <- H + (dx - H dr) (dx' H) / (dx' H dr),

which ends after at most 2 n steps where g is linear (D. M. Gay, SIAM J. Numer. Anal. 16 (1979)
623-630), whether reactions are raised or lowered by what they cause, and is the secant's for one
unknown.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    APPLIED_FORCE,
    AT_FAULT,
    AXIS_TORQUE,
    COMPONENT,
    JOINT_FRICTION,
    LOST_POWER,
    OF_DAMPERS,
    PROGRAM,
    ROW_OF,
    SCALAR,
    SCALE_LENGTH,
    WRENCH_FORCE,
    WRENCH_TORQUE,
)
from mbsim.arrays.hooks import failure_or
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, scale, sub, vector
from mbsim.dynamics.bodies.acceleration import accelerate
from mbsim.dynamics.bodies.markers import marker_axis, marker_point
from mbsim.dynamics.constraints.equations import restick
from mbsim.dynamics.constraints.in_use import active_count
from mbsim.dynamics.constraints.reactions import fill_stresses, sum_reactions, take_stresses
from mbsim.dynamics.expressions.jets import value
from mbsim.dynamics.forces.applied import displacement, push
from mbsim.dynamics.forces.joint_friction import (
    GOOD_ENOUGH,
    SETTLED,
    SPEED,
    add_force,
    ask_law,
    fill_slip,
)
from mbsim.dynamics.forces.wrenches import push_at, velocity_at

# columns of `Work.by_reactions`
SIZE, MISS, STEP, CHANGE, ROW = range(5)


#: Rounding of reactions, in parts of the largest.
ROUNDING = 1e-15
MOST_ROUNDS = 60
#: Forces this many times larger than what is asked for at first agree by rounding alone.
TOO_LARGE = 1e9


@jitable
def fill_direction(scene: Scene, y: F1, f: int) -> None:
    """Fill the wrench of a unit of scalar force f, and the rate at which it works."""
    applied, row = scene.applied, scene.work.joint_friction[f]
    turns = applied.form[f] == AXIS_TORQUE
    n, _, rate = displacement(scene, y, f)
    for k in range(3):
        row[k] = 0.0 if turns else n[k]
        row[3 + k] = n[k] if turns else 0.0
    row[SPEED] = rate


@jitable
def push_scalar(scene: Scene, f: int, size: float) -> None:
    """Add `size` of scalar force f to its bodies."""
    applied, row = scene.applied, scene.work.joint_friction[f]
    force = scale(size, vector(row[WRENCH_FORCE:]))
    torque = scale(size, vector(row[WRENCH_TORQUE:]))
    push(scene, applied.i[f], force, torque)
    if applied.alone[f] == 0:
        push(scene, applied.j[f], scale(-1.0, force), scale(-1.0, torque))


@jitable
def push_component(scene: Scene, y: F1, f: int, c: int, size: float) -> None:
    """Add `size` of component c of vector force f to its bodies."""
    applied, none = scene.applied, (0.0, 0.0, 0.0)
    e = scale(size, marker_axis(scene, applied.axes[f], c % 3))
    force, torque = (e, none) if c < 3 else (none, e)
    p = marker_point(scene, y, applied.i[f])
    push_at(scene, y, scene.markers.body[applied.i[f]], p, force, torque)
    if applied.alone[f] == 0:
        other = scene.markers.body[applied.j[f]]
        push_at(scene, y, other, p, scale(-1.0, force), scale(-1.0, torque))


@jitable
def add_to_all(scene: Scene, y: F1) -> None:
    """Add the last step of every unknown to the bodies."""
    by_reactions, work = scene.applied.by_reactions, scene.work.by_reactions
    for u in range(len(by_reactions)):
        f, c, size = by_reactions[u, ROW_OF], by_reactions[u, COMPONENT], work[u, STEP]
        work[u, SIZE] += size
        if c == JOINT_FRICTION:
            add_force(scene, f, size)
        elif c == SCALAR:
            push_scalar(scene, f, size)
        else:
            push_component(scene, y, f, c, size)


@jitable
def add_to_row(scene: Scene, f: int, c: int, size: float) -> None:
    """Add an unknown to the force and torque of its row of `Work.applied`."""
    row = scene.work.applied[f]
    if c >= SCALAR:
        for k in range(6):
            row[k] += size * scene.work.joint_friction[f, k]
        return
    e = marker_axis(scene, scene.applied.axes[f], c % 3)
    at = 0 if c < 3 else 3
    for k in range(3):
        row[at + k] += size * e[k]


@jitable
def fill_rows(scene: Scene) -> None:
    """Fill force and torque of all rows that are settled."""
    by_reactions, work = scene.applied.by_reactions, scene.work
    for u in range(len(by_reactions)):
        for k in range(len(work.applied[by_reactions[u, ROW_OF]])):
            work.applied[by_reactions[u, ROW_OF], k] = 0.0
    for u in range(len(by_reactions)):
        add_to_row(
            scene, by_reactions[u, ROW_OF], by_reactions[u, COMPONENT], work.by_reactions[u, SIZE]
        )


@jitable
def measure_misses(scene: Scene, t: float, y: F1) -> tuple[int, float, float]:
    """Fill by how much each unknown misses its law or expression, and the change of that.

    Returns the first that is no number or -1, and the largest force, torque (over the length)
    and reaction.
    """
    by_reactions, work = scene.applied.by_reactions, scene.work
    length = scene.world.scale[SCALE_LENGTH]
    largest, reaction = 0.0, 0.0
    for k in range(len(work.reaction)):
        reaction = max(reaction, abs(work.reaction[k]) / (1.0 if k % 6 < 3 else length))
    for u in range(len(by_reactions)):
        f, row = by_reactions[u, ROW_OF], work.by_reactions[u]
        if by_reactions[u, COMPONENT] == JOINT_FRICTION:
            asked = ask_law(scene, t, f)
        else:
            asked = value(scene, t, y, by_reactions[u, PROGRAM])
        if not math.isfinite(asked):
            work.applied[f, APPLIED_FORCE] = asked
            return u, largest, reaction
        miss = asked - row[SIZE]
        row[CHANGE] = miss - row[MISS]
        row[MISS] = miss
        largest = max(largest, max(abs(asked), abs(row[SIZE])) / unit(scene, u))
    return -1, largest, reaction


@jitable
def unit(scene: Scene, u: int) -> float:
    """Return what makes a force of unknown u: the length for torques, else 1."""
    f, c = scene.applied.by_reactions[u, ROW_OF], scene.applied.by_reactions[u, COMPONENT]
    turns = (c >= 3 and c < SCALAR) or scene.applied.form[f] == AXIS_TORQUE
    return scene.world.scale[SCALE_LENGTH] if turns else 1.0


@jitable
def worst_unknown(scene: Scene) -> tuple[int, float]:
    """Return the unknown that misses most, and by how much."""
    worst, at = 0.0, 0
    for u in range(len(scene.applied.by_reactions)):
        miss = abs(scene.work.by_reactions[u, MISS]) / unit(scene, u)
        if miss > worst:
            worst, at = miss, u
    return at, worst


@jitable
def update_secant(scene: Scene) -> None:
    """Let H take the last change of the misses to the last step."""
    H, work = scene.work.secant, scene.work.by_reactions
    n, below = len(H), 0.0
    for i in range(n):
        row = 0.0
        for j in range(n):
            row += H[i, j] * work[j, CHANGE]
        work[i, ROW] = row
        below += work[i, STEP] * row
    if below == 0.0:
        return
    for j in range(n):
        # column j of dx' H, which only later columns of H do not need
        along = 0.0
        for i in range(n):
            along += work[i, STEP] * H[i, j]
        for i in range(n):
            H[i, j] += (work[i, STEP] - work[i, ROW]) * along / below


@jitable
def next_step(scene: Scene) -> None:
    """Fill the next step, -H r."""
    H, work = scene.work.secant, scene.work.by_reactions
    for i in range(len(H)):
        total = 0.0
        for j in range(len(H)):
            total -= H[i, j] * work[j, MISS]
        work[i, STEP] = total


@jitable
def begin(scene: Scene, y: F1) -> None:
    """Set all unknowns to 0, H to -1, and fill the directions in which they act."""
    by_reactions, work = scene.applied.by_reactions, scene.work
    for u in range(len(by_reactions)):
        f = by_reactions[u, ROW_OF]
        if by_reactions[u, COMPONENT] == JOINT_FRICTION:
            fill_slip(scene, f)
        elif by_reactions[u, COMPONENT] == SCALAR:
            fill_direction(scene, y, f)
        for k in range(work.by_reactions.shape[1]):
            work.by_reactions[u, k] = 0.0
        for k in range(len(by_reactions)):
            work.secant[u, k] = -1.0 if k == u else 0.0


@jitable
def settle(scene: Scene, t: float, y: F1, stresses: int) -> int:
    """Find the unknowns and the accelerations under them; return 0 or a code."""
    by_reactions, work = scene.applied.by_reactions, scene.work
    most, bound = MOST_ROUNDS + 2 * len(by_reactions), 0.0
    for k in range(most):
        sum_reactions(scene, y)
        take_stresses(scene, stresses)
        fill_rows(scene)
        broken, largest, reaction = measure_misses(scene, t, y)
        if broken >= 0:
            # the row of `Work.applied` tells which it is, and no contact is at fault
            work.diagnostics[AT_FAULT] = -1
            return Code.NOT_FINITE
        if k == 0:
            bound = TOO_LARGE * max(largest, reaction)
        at, worst = worst_unknown(scene)
        part = SETTLED if k < most - 1 else GOOD_ENOUGH
        if largest <= bound and worst <= max(part * largest, ROUNDING * reaction):
            work.diagnostics[AT_FAULT] = -1
            return 0
        work.diagnostics[AT_FAULT] = by_reactions[at, ROW_OF]
        if k > 0:
            update_secant(scene)
        next_step(scene)
        add_to_all(scene, y)
        restick(scene, t)
    return (
        Code.JAMMED
        if scene.applied.by_reactions[at, COMPONENT] == JOINT_FRICTION
        else Code.UNSETTLED
    )


@jitable
def lost_power(scene: Scene, y: F1, u: int) -> float:
    """Return the power of unknown u with the sign turned."""
    applied, f, c = (
        scene.applied,
        scene.applied.by_reactions[u, ROW_OF],
        scene.applied.by_reactions[u, COMPONENT],
    )
    size = scene.work.by_reactions[u, SIZE]
    if c >= SCALAR:
        return -size * scene.work.joint_friction[f, SPEED]
    i, j = applied.i[f], applied.j[f]
    b = scene.markers.body[i]
    other = len(scene.bodies.mass) if applied.alone[f] == 1 else scene.markers.body[j]
    e = marker_axis(scene, applied.axes[f], c % 3)
    if c >= 3:
        w = scene.work.w
        return -size * dot(e, sub(vector(w[b]), vector(w[other])))
    p = marker_point(scene, y, i)
    return -size * dot(e, sub(velocity_at(scene, y, b, p), velocity_at(scene, y, other, p)))


@jitable
def add_reaction_forces(scene: Scene, t: float, y: F1, dy: F1) -> int:
    """Add forces by reactions to the accelerations, what they dissipate to y'; return 0."""
    by_reactions, work, lost = scene.applied.by_reactions, scene.work, 0.0
    begin(scene, y)
    stresses = 0
    if active_count(scene) < len(scene.equations.program):
        stresses = fill_stresses(scene, t, y)
        restick(scene, t)
    code = failure_or(scene, settle(scene, t, y, stresses))
    if code != 0:
        return code
    for u in range(len(by_reactions)):
        power = lost_power(scene, y, u)
        work.applied[by_reactions[u, ROW_OF], LOST_POWER] += power
        lost += power
    dy[scene.world.accumulators[OF_DAMPERS]] += lost
    # bodies that no joint holds may be pushed too
    return 0 if math.isfinite(accelerate(scene, y, dy)) else Code.NOT_FINITE
