"""Where the step under trial leaves the branch that a force was on: see `compile_model.switching`.

What an expression or a force with branches is on is a number, its side. The driver ends a step
where a side becomes another than it was at the committed state, where an incident that goes on asks
for another mode of its friction, and where one has left: one that begins has no mode to leave.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ASKS,
    CHANGED,
    CHANGES,
    CHATTERING,
    CHATTERS,
    COMMITTED,
    COUNTS_AS,
    LEFT,
    SIDE,
    SLIDER_STATIC,
    SLIDES,
    TOLERANCE,
    WHOLE_X,
    WHOLE_Y,
)
from mbsim.arrays.hooks import Hook, Sticking, answer_of, failure_or, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int, vector_at, view
from mbsim.core.arrays import F1, Pointer
from mbsim.core.jitable import jitable
from mbsim.core.problem import ASK, BENDS, HALF, HALVES, HIDES, LOAD, LOAD_AT_MOST, PASS, PASS_CUT
from mbsim.core.rotation import norm, vector
from mbsim.dynamics.bodies.kinematics import place_bodies
from mbsim.dynamics.constraints.in_use import is_friction
from mbsim.dynamics.contact.forces import (
    ALONG_X,
    ALONG_Y,
    BRANCH,
    DEPTH,
    FOUND_AT,
    FOUND_OVER,
    LIMIT,
    LIMIT_SLOPE,
    LIMIT_THEN,
    MODE,
    NORMAL,
    NORMAL_SLOPE,
    NORMAL_THEN,
    RATE,
    STIFFNESS,
    STIFFNESS_SLOPE,
    STIFFNESS_THEN,
    contact_of,
    face_weight_of,
    pressing,
)
from mbsim.dynamics.contact.memory import slipping_mass
from mbsim.dynamics.events.hidden import answer_hides, bends, counts_as, follows
from mbsim.dynamics.expressions.jets import value
from mbsim.dynamics.forces.applied import side_of
from mbsim.dynamics.stiction.rigid_friction import holding_force, side_of_rigid
from mbsim.geometry.catalog import AT_POINT
from mbsim.laws.catalog import BRANCHES, UNDECIDED
from mbsim.laws.catalog import SLIP as SLIPS

#: Each change of side adds 1 to chattering, each step takes a tenth of it.
COOLING = 0.9
#: Modes of contacts are many: four points of a block come to rest and slip again one by one. With a
#: change in every step chattering rises to 10.
CHATTERS_MODES = 8.0
#: How far ahead rates of normal forces are found: a part of what swings on the contact, and of the
#: time in which it would be left.
AHEAD, BEFORE_LEAVE = 1e-6, 1e-3
#: Depths have digits down to so much of where the point is; times that differ by less are taken as
#: one, the longest.
RESOLVED, ALIKE = 1e-12, 0.1


@jitable
def leaves_branch(scene: Scene) -> bool:
    """Return whether an incident that goes on asks for another branch than it is committed to."""
    hit, state = scene.work.hit, scene.state
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        branch = scene.work.slot[s, BRANCH]
        if state.touching[s] == 1 and branch != UNDECIDED and branch != state.mode[s]:
            return True
    return False


@jitable
def some_left(scene: Scene) -> bool:
    """Return whether an incident with modes of the committed state is none at the point evaluated.

    One that was no deeper than rounding of its place has not left, and one that pressed less than
    the tolerance of what presses most, of its group of bodies, leaves nothing.
    """
    state, work, group = scene.state, scene.work, scene.scales.of_contact
    count = state.hit[len(state.hit) - 1]
    for k in range(count):
        s, most = state.hit[k], 0.0
        if work.touching[s] == 1 or not state.mode[s] % BRANCHES > 0.0:
            continue
        if work.slot[s, DEPTH] <= RESOLVED * norm(vector(work.points[s, AT_POINT:])):
            continue
        for other in range(count):
            if group[contact_of(scene, state.hit[other])] == group[contact_of(scene, s)]:
                most = max(most, state.normal[state.hit[other]])
        if state.normal[s] >= scene.world.scale[TOLERANCE] * most:
            return True
    return False


@jitable
def look_at(scene: Scene, context: int, t: float, y: F1, dy: F1) -> None:
    """Evaluate a point that is no step's; a failure is noted."""
    note_failure(scene, call_int(scene.world.hooks[Hook.EVALUATE], (context, t, 0.0, y, dy)))


@jitable
def longest_ahead(scene: Scene, t: float) -> float:
    """Return the longest time over which a rate is still to be found, 0 if there is none."""
    longest = 0.0
    for s in range(len(scene.work.slot)):
        row = scene.work.slot[s]
        if row[FOUND_AT] == t:
            longest = max(longest, row[FOUND_OVER])
    return longest


@jitable
def ahead_of(scene: Scene, s: int) -> float:
    """Return over what time the normal force in slot s shows its rate; 0 where positions cannot.

    Of the slot alone: what another one is about to leave in is no time to it.
    """
    row, point = scene.work.slot[s], scene.work.points[s]
    swings = math.sqrt(row[STIFFNESS] / slipping_mass(scene, s))
    left, size = BEFORE_LEAVE * row[DEPTH], norm(vector(point[AT_POINT:]))
    if left < RESOLVED * size:
        return 0.0
    return min(AHEAD / swings, left / max(abs(row[RATE]), 1e-300))


@jitable
def decide(scene: Scene, context: int, t: float, y: F1) -> None:
    """Evaluate again with the rates of normal forces, where a branch depends on them.

    A rate is found over a time of its own in each slot: over that of a touch that begins or ends
    the others would be rounding. Where positions have no digits for it, it is that of the depth.
    """
    hit, work, found = scene.work.hit, scene.work, False
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        row = work.slot[s]
        if scene.state.touching[s] == 1 and row[BRANCH] == UNDECIDED:
            h, found = ahead_of(scene, s), True
            row[FOUND_AT], row[NORMAL_THEN], row[LIMIT_THEN] = t, pressing(scene, s), row[LIMIT]
            row[FOUND_OVER], row[STIFFNESS_SLOPE] = h, math.nan
            # of a patch: it is not a function of the depth alone
            row[STIFFNESS_THEN] = row[STIFFNESS] if face_weight_of(scene, s) > 0.0 else math.nan
            if h == 0.0:
                row[NORMAL_SLOPE] = row[STIFFNESS] * row[RATE]
                part = row[LIMIT] / row[NORMAL] if row[NORMAL] > 0.0 else 0.0
                row[LIMIT_SLOPE] = part * row[NORMAL_SLOPE]
    if not found:
        return
    there, then = work.ahead[0], work.ahead[1]
    h = longest_ahead(scene, t)
    while h > 0.0:
        for i in range(len(y)):
            there[i] = y[i] + h * work.idle[i]
        look_at(scene, context, t + h, there, then)
        for s in range(len(work.slot)):
            row = work.slot[s]
            if row[FOUND_AT] == t and row[FOUND_OVER] > ALIKE * h:
                row[FOUND_OVER] = 0.0
                row[NORMAL_SLOPE] = (pressing(scene, s) - row[NORMAL_THEN]) / h
                row[LIMIT_SLOPE] = (row[LIMIT] - row[LIMIT_THEN]) / h
                row[STIFFNESS_SLOPE] = (row[STIFFNESS] - row[STIFFNESS_THEN]) / h
        h = longest_ahead(scene, t)
    look_at(scene, context, t, y, work.idle)


@jitable
def side(scene: Scene, t: float, y: F1, k: int) -> float:
    """Return on which side row k of `Switching` is; the bodies have been placed."""
    program = scene.switching.program[k]
    if program >= 0:
        return value(scene, t, y, program)
    if scene.switching.force[k] < 0:
        # of friction with modes: what asks for another one, and what has changed, is counted
        return 0.0
    f = scene.switching.force[k]
    if scene.applied.equation[f] >= 0:
        return side_of_rigid(scene, y, f)
    return side_of(scene, y, f)


@jitable
def watch_sticking(scene: Scene, t: float, y: F1, what: float) -> int:
    """Return 2 if a contact whose friction is rigid asks for another mode than it has, else 0.

    Of a step that was taken: 1 if it ends so. Such a step adds 1, whether a mode changed then or
    not; one that does not leaves half of the chattering, unless it was cut: a little before a
    change it tells nothing. So where changes follow each other a whole step is taken now and then.
    """
    chattering, differs = scene.state.chattering, 0
    if what == PASS or what == PASS_CUT:
        differs, before = 1 if chattering[ASKS] == 1.0 else 0, chattering[CHANGES]
        cooled = 0.5 * before if what == PASS else before
        chattering[CHANGES] = before + 1.0 if differs == 1 else cooled
        chattering[ASKS] = 0.0
    elif chattering[CHANGES] <= CHATTERS:
        asked = call_int(scene.world.hooks[Hook.STICKING], (scene, Sticking.ASK, t, y))
        differs = 2 if answer_of(scene, asked) == 1 else 0
        chattering[ASKS] = 1.0 if differs > 0 else 0.0
    return differs


@jitable
def load(scene: Scene, context: int, t: float, y: F1, what: float) -> float:
    """Return the largest force by which friction without give holds, over its limit.

    No less than that where LOAD_AT_MOST is asked for. -1 where nothing is held so, and -1 too where
    modes are left to each evaluation.
    """
    active, most = scene.equations.active, -1.0
    for r in range(active[len(active) - 1]):
        if is_friction(scene, active[r]):
            most = 0.0
    if most < 0.0 or scene.state.frozen[0] == 0:
        return -1.0
    look_at(scene, context, t, y, scene.work.idle)
    for f in range(len(scene.applied.form)):
        if scene.applied.equation[f] >= 0:
            force = holding_force(scene, f)
            if not math.isnan(force):
                most = max(most, abs(force) / scene.applied.par[f, SLIDER_STATIC])
    if scene.world.hooks[Hook.STICKING] != 0:
        asked = Sticking.LOAD if what == LOAD else Sticking.LOAD_AT_MOST
        load = call_int(scene.world.hooks[Hook.STICKING], (scene, asked, t, y))
        most = max(most, 1e-6 * answer_of(scene, load))
    return most


@jitable
def watch(scene: Scene, context: int, t: float, y: F1, what: float) -> int:
    """Return 1 if a side differs from that kept, 2 where it is to be found exactly, else 0.

    Unless it is only asked, the sides are kept. Of a step that was taken: 1 if one changed in it.
    """
    sides, differs, last = scene.state.sides, 0, len(scene.switching.program) - 1
    passed = what == PASS or what == PASS_CUT
    if scene.switching.program[last] < 0 and scene.switching.force[last] < 0:
        # what friction does follows from all the rest
        if what != ASK:
            # rates of forces are others on another branch, at the same time
            scene.work.slot[:, FOUND_AT] = math.nan
        look_at(scene, context, t, y, scene.work.idle)
        if what == ASK and len(scene.work.ahead) > 0:
            decide(scene, context, t, y)
    else:
        place_bodies(scene, y)
    for k in range(len(scene.switching.program)):
        now = side(scene, t, y, k)
        other = now != sides[k, SIDE]
        f = scene.switching.force[k]
        keeps, of_modes = f >= 0 and scene.applied.keeps[f] == 1, False
        if k == last and f < 0 and scene.switching.program[k] < 0:
            of_modes = leaves_branch(scene)
            chattering = scene.state.chattering
            if what == ASK:
                chattering[LEFT] = 1.0 if some_left(scene) else 0.0
            other = chattering[CHANGED] + chattering[LEFT] > 0.0
        # friction with a memory of its own is on the side that it keeps
        exact = keeps or of_modes
        leaves = now != scene.state.dry[f, SLIDES] if keeps else exact or other
        # a jump is found exactly too: what is wrong of one goes with the part of the step
        jumps = scene.switching.jumps[k] == 1
        if passed:
            differs = 1 if other else differs
        elif leaves and sides[k, CHATTERING] <= (
            CHATTERS if k < last or f >= 0 else CHATTERS_MODES
        ):
            differs = max(differs, 2 if exact or jumps else 1)
        if passed and (other or what == PASS):
            # a step that was cut in vain is as short as what chatters makes it: it cools nothing
            sides[k, CHATTERING] = COOLING * sides[k, CHATTERING] + (1.0 if other else 0.0)
        if what != ASK:
            sides[k, SIDE] = now
    if what != ASK:
        scene.state.chattering[CHANGED] = scene.state.chattering[LEFT] = 0.0
    if scene.world.hooks[Hook.STICKING] != 0:
        differs = max(differs, watch_sticking(scene, t, y, what))
    # where modes change at nearly every step they are left to each evaluation
    chatters = sides[last, CHATTERING] > CHATTERS_MODES
    for k in range(last):
        f = scene.switching.force[k]
        if f >= 0 and scene.applied.keeps[f] == 1:
            chatters = chatters or sides[k, CHATTERING] > CHATTERS
    scene.state.frozen[0] = 0 if chatters else 1
    return differs


@jitable
def follow_half(scene: Scene, context: int, t: float, y: F1) -> None:
    """Go on from a step's middle y as if that were committed, as far as friction is concerned."""
    state, work, hit = scene.state, scene.work, scene.state.hit
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        row, kept = work.slot[s], work.kept[s]
        kept[WHOLE_X], kept[WHOLE_Y] = row[ALONG_X], row[ALONG_Y]
        kept[COUNTS_AS] = counts_as(scene, s)
    look_at(scene, context, t, y, work.idle)
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        for j in range(state.memory.shape[1]):
            work.kept[s, COMMITTED + j] = state.memory[s, j]
        if follows(scene, s) and work.touching[s] == 1 and work.slot[s, MODE] == SLIPS:
            for j in range(state.memory.shape[1]):
                state.memory[s, j] = work.memory[s, j]
        else:
            work.kept[s, COUNTS_AS] = 0.0


@jitable
def follow_halves(scene: Scene, context: int, t: float, y: F1) -> float:
    """Return how far friction at a step's end is from that of its second half, as an error."""
    state, work, hit, worst = scene.state, scene.work, scene.state.hit, 0.0
    look_at(scene, context, t, y, work.idle)
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        row, kept = work.slot[s], work.kept[s]
        for j in range(state.memory.shape[1]):
            state.memory[s, j] = kept[COMMITTED + j]
        size = math.hypot(kept[WHOLE_X], kept[WHOLE_Y])
        if kept[COUNTS_AS] > 0.0 and size > 0.0 and work.touching[s] == 1:
            off = math.hypot(row[ALONG_X] - kept[WHOLE_X], row[ALONG_Y] - kept[WHOLE_Y])
            worst = max(worst, kept[COUNTS_AS] * off / size)
    return worst


@jitable
def serve_switching(
    scene: Scene, context: int, t: float, what: float, a: Pointer, b: Pointer
) -> int:
    """Do what the hook `switching` is asked for; return its answer."""
    n = scene.rows.y.shape[1]
    if what == LOAD or what == LOAD_AT_MOST:
        b[0] = load(scene, context, t, vector_at(a, n), what)
        return 1 if b[0] >= 0.0 else 0
    if what >= BENDS and scene.state.frozen[0] == 0:
        return 0
    if what >= BENDS and what != HIDES and len(scene.work.kept) == 0:
        return 0
    if what == HIDES:
        return answer_hides(scene, t, vector_at(a, n), vector_at(b, n))
    if what == BENDS:
        return 1 if bends(scene, vector_at(a, n), vector_at(b, n)) else 0
    if what == HALF:
        follow_half(scene, context, t, vector_at(a, n))
        return 0
    if what == HALVES:
        b[0] = follow_halves(scene, context, t, vector_at(a, n))
        return 0
    return watch(scene, context, t, vector_at(a, n), what)


def switching_hook(context: int, t: float, h: float, a: Pointer, b: Pointer) -> int:
    """Whether a force is on another branch; h says whether that is kept, or what else is asked."""
    scene = view(context, Scene)
    answer = serve_switching(scene, context, t, h, a, b)
    code = failure_or(scene, 0)
    return answer if code == 0 else -code
