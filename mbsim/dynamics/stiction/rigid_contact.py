"""STICTION of contacts without give: what sticks is held by two equations of velocities a slot.

As `stiction.rigid_friction`, which takes equations into use and out of it, and keeps what it does
for contacts here, behind one hook. The equations are those of `equations.touching_term`; how the
contact point and its normal move is found by differences of the closed form along the velocities
of both bodies. Where equations follow from others (four points of a block) multipliers are not
known point by point: forces are taken whose largest part of mu_s N is least (`stiction.cones`).
Where it is above 1 no forces can hold what sticks, and only there something begins to slip: what
then moves, and where to, follows from the accelerations of all that is at rest, by Gauss's
principle. A slot that those that stick hold sticks too: it cannot move.

What a slot keeps is in `State.memory`, see `laws.friction.stiction.rigid`.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import CHANGED, SCALE_LENGTH, SCALE_SPEED, TOLERANCE
from mbsim.arrays.codes import SLIP as SLIP_EVENT
from mbsim.arrays.codes import STICK as STICK_EVENT
from mbsim.arrays.hooks import Hook, Sticking, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V2
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, vector
from mbsim.dynamics.constraints.in_use import active_count, is_active
from mbsim.dynamics.constraints.selection import LEVER, fill_size
from mbsim.dynamics.contact.forces import FORCE, contact_of
from mbsim.dynamics.contact.memory import least_limit
from mbsim.dynamics.contact.points import record_event
from mbsim.dynamics.stiction.cones import CAPACITY, MOVES, SHARED, SLIDE, SLIPPING, solve_cones
from mbsim.dynamics.stiction.faces import holds_nothing, slip_of
from mbsim.dynamics.stiction.rigid_friction import AT_REST, ROUNDING
from mbsim.dynamics.stiction.rigid_shares import (
    SLIDING,
    STATIC,
    WHICH,
    capacity,
    fill_cones,
    fill_least_limits,
    fill_slip,
    first_of_slots,
    most_capacity,
    part_at_most_of,
    share_sticking,
    sticking_part,
)
from mbsim.dynamics.stiction.rigid_slots import MOMENT, fill_hold, locate_sticking, look_around
from mbsim.geometry.catalog import AT_NORMAL
from mbsim.laws.catalog import BEGUN, SLIP, STICK
from mbsim.laws.friction.stiction import KEPT_MODE, KEPT_PLAY, KEPT_SPEED, KEPT_X, KEPT_Y

#: A slip that turns below this part of the tolerance, over the model's speed, has come to rest.
SETTLED = 0.1
#: Slip whose part against the way it had is larger than this part of it goes back, and has not only
#: turned.
BACK = 0.7
#: What is let go while it moves goes back only where it is so many times faster, and keeps to the
#: way in which it is accelerated until it is that many times faster again.
BEYOND = 3.0
#: What sticks but is held by joints and motions alone slips with them above so many times the speed
#: that is settled.
DRAGS = 10.0
#: Slots that slip are sought with limits that are lower by this part: where they are just reached
#: accelerations are 0, and do not tell the way.
OVER = 1e-5


@jitable
def settled(scene: Scene) -> float:
    """Return what slip is none to the tolerance."""
    return SETTLED * scene.world.scale[TOLERANCE] * scene.world.scale[SCALE_SPEED]


@jitable
def onward(scene: Scene, s: int, v: V2) -> float:
    """Return the part of slip along the direction in which slot s began to slip."""
    kept = scene.state.memory[s]
    size = math.hypot(kept[KEPT_X], kept[KEPT_Y])
    return (v[0] * kept[KEPT_X] + v[1] * kept[KEPT_Y]) / size


@jitable
def rest(scene: Scene) -> float:
    """Return what is no slip but rounding."""
    return ROUNDING * scene.world.scale[SCALE_SPEED]


@jitable
def is_dragged(scene: Scene, y: F1, e: int) -> bool:
    """Return whether the slot of equations e and e + 1 slips though it sticks.

    Its equation follows from those of joints and motions then, and these say something else: a
    body that may not move along a belt sticks to it while the belt stands, and no longer.
    """
    if is_active(scene, e) and is_active(scene, e + 1):
        return False
    v = slip_of(scene, y, scene.equations.slot[e])
    return math.hypot(v[0], v[1]) > max(DRAGS * settled(scene), AT_REST * rest(scene))


@jitable
def ask_sticking(scene: Scene, t: float, y: F1) -> int:
    """Return 1 if a slot asks for another mode than it has, at the point evaluated last, else 0."""
    if part_at_most_of(scene, t, y) > 1.0:
        share_sticking(scene, t, y)
        if sticking_part(scene) > 1.0:
            return 1
    slot = scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        if scene.work.touching[s] == 0 or holds_nothing(scene, s):
            continue
        if scene.state.memory[s, KEPT_MODE] == SLIP:
            if goes_back(scene, s, onward(scene, s, slip_of(scene, y, s))):
                return 1
        elif scene.state.memory[s, KEPT_MODE] == STICK and is_dragged(scene, y, e):
            return 1
    return 0


@jitable
def in_millionths(part: float) -> int:
    """Return a part as an answer."""
    return int(1e6 * min(part, 1e6))


@jitable
def goes_back(scene: Scene, s: int, along: float) -> bool:
    """Return whether slot s goes back that slips by so much along the way it had."""
    return along < -(rest(scene) + BEYOND * scene.state.memory[s, KEPT_PLAY])


@jitable
def let_slip(scene: Scene, s: int, x: float, y: float, speed: float, play: float) -> None:
    """Let slot s slip along (x, y) from here on, at a speed, let go with some play."""
    kept = scene.state.memory[s]
    size = (rest(scene) + settled(scene) + BEYOND**2 * play) / math.hypot(x, y)
    kept[KEPT_MODE], kept[KEPT_X], kept[KEPT_Y] = SLIP, size * x, size * y
    kept[KEPT_SPEED], kept[KEPT_PLAY] = speed, play


@jitable
def let_stick(scene: Scene, s: int) -> None:
    """Let slot s stick from here on."""
    kept = scene.state.memory[s]
    kept[KEPT_MODE], kept[KEPT_SPEED], kept[KEPT_PLAY] = STICK, 0.0, 0.0


@jitable
def begin_slot(scene: Scene, y: F1, s: int) -> int:
    """Set the mode of slot s, which does not stick; return 1 where it turns.

    What turns at a speed that the tolerance explains has come to rest, and so has what went back:
    where that is is not located, or not so well.
    """
    kept, v = scene.state.memory[s], slip_of(scene, y, s)
    speed = math.hypot(v[0], v[1])
    turns, rests = 0, speed <= AT_REST * rest(scene)
    if kept[KEPT_MODE] == SLIP:
        along = onward(scene, s, v)
        turns = 1 if goes_back(scene, s, along) else 0
        rests = rests or (turns == 1 and speed <= settled(scene))
        rests = rests or (turns == 1 and -along > BACK * speed)
    if not rests and kept[KEPT_MODE] == SLIP and turns == 0:
        # the way that friction is against
        let_slip(scene, s, v[0] + kept[KEPT_X], v[1] + kept[KEPT_Y], speed, kept[KEPT_PLAY])
    elif not rests:
        let_slip(scene, s, v[0], v[1], speed, 0.0)
    elif kept[KEPT_MODE] == BEGUN or turns == 1:
        let_stick(scene, s)
    return turns


@jitable
def let_follow(scene: Scene, y: F1, s: int) -> None:
    """Let slot s slip as the rest moves, which it does not hold: it tells of no event."""
    v = slip_of(scene, y, s)
    speed = math.hypot(v[0], v[1])
    let_slip(scene, s, v[0] if speed > 0.0 else 1.0, v[1], max(speed, rest(scene)), 0.0)


@jitable
def came_to_rest(scene: Scene, group: int) -> bool:
    """Return whether a slot sticks that did not, of a group of bodies that are connected."""
    slot = scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        if group_of(scene, s) == group and scene.state.memory[s, KEPT_MODE] == STICK:
            if not was_sticking(scene, s):
                return True
    return False


@jitable
def group_of(scene: Scene, s: int) -> int:
    """Return the group of connected bodies that slot s is of."""
    return scene.scales.of_contact[contact_of(scene, s)]


@jitable
def begin_sticking(scene: Scene, y: F1) -> int:
    """Set the modes that the point evaluated last asks for; return whether equations change.

    What is at rest is first taken to stick wherever something changes, and what is as good as at
    rest where something of its group comes to rest: what of it slips is found for all together
    (`release_sticking`). Corner by corner each would turn at a time of its own, at any speed.
    """
    state, slot, first = scene.state, scene.equations.slot, first_of_slots(scene)
    changed, sticking, begun = 1 if sticking_part(scene) > 1.0 else 0, 0, 0
    for e in range(first, len(slot), 2):
        s = slot[e]
        mode = state.memory[s, KEPT_MODE]
        if state.touching[s] == 1 and holds_nothing(scene, s):
            let_follow(scene, y, s)
        elif state.touching[s] == 1 and mode != STICK:
            begun = max(begun, 1 if mode == BEGUN else 0)
            changed = max(changed, begin_slot(scene, y, s))
        elif state.touching[s] == 1 and was_sticking(scene, s) and is_dragged(scene, y, e):
            v = slip_of(scene, y, s)
            let_slip(scene, s, v[0], v[1], math.hypot(v[0], v[1]), 0.0)
        mode = state.memory[s, KEPT_MODE]
        sticking = max(sticking, 1 if mode == STICK else 0)
        if (mode == STICK) != was_sticking(scene, s):
            changed = 1
    # what begins to touch beside what sticks may be held by that
    if changed == 0 and (sticking == 0 or begun == 0):
        return 0
    for e in range(first, len(slot), 2):
        s = slot[e]
        if state.touching[s] == 0 or holds_nothing(scene, s):
            continue
        if state.memory[s, KEPT_MODE] == SLIP:
            v, least = slip_of(scene, y, s), AT_REST * rest(scene)
            if came_to_rest(scene, group_of(scene, s)):
                least = max(least, settled(scene))
            if math.hypot(v[0], v[1]) <= least:
                let_stick(scene, s)
    return 1


@jitable
def was_sticking(scene: Scene, s: int) -> bool:
    """Return whether slot s has stuck so far."""
    return scene.state.before[s, KEPT_MODE] == STICK


@jitable
def hold_implied(scene: Scene, t: float, y: F1) -> None:
    """Let all slots stick whose slip those that stick imply: they move by rounding at most.

    What has been released for this very change does slip.
    """
    slot, first = scene.equations.slot, first_of_slots(scene)
    moment = MOMENT * scene.world.scale[SCALE_LENGTH] / scene.world.scale[SCALE_SPEED]
    for e in range(first, len(slot), 2):
        s, implied = slot[e], True
        kept = scene.state.memory[s]
        released = kept[KEPT_MODE] == SLIP and kept[KEPT_SPEED] == 0.0
        if scene.state.touching[s] == 0 or kept[KEPT_MODE] == STICK or released:
            continue
        if holds_nothing(scene, s) or is_dragged(scene, y, e):
            continue
        look_around(scene, y, scene.slots.pair[s], moment)
        fill_hold(scene, t, y, s, moment)
        for q in (e, e + 1):
            left = fill_slip(scene, t, y, q, active_count(scene), scene.sweep.share[0])
            fill_size(scene, q)
            implied = implied and left <= LEVER * scene.sweep.size[q] ** 2
        if implied:
            let_stick(scene, s)


@jitable
def fill_sliding(scene: Scene, t: float, y: F1, count: int) -> None:
    """Fill what friction would be where the slots of so many rows slid against what holds them."""
    cone = scene.sweep.cone
    for k in range(count // 2):
        s = scene.equations.slot[int(cone[WHICH, k])]
        x, z = scene.work.sticking_force[s, 0], scene.work.sticking_force[s, 1]
        let_slip(scene, s, -x if x != 0.0 or z != 0.0 else 1.0, -z, 0.0, 0.0)
    code = call_int(scene.world.hooks[Hook.EVALUATE], (scene, t, 0.0, y, scene.work.idle))
    note_failure(scene, code)
    for k in range(count // 2):
        s = scene.equations.slot[int(cone[WHICH, k])]
        point, force = scene.work.points[s], vector(scene.work.slot[s, FORCE : FORCE + 3])
        n, tx = vector(point[AT_NORMAL:]), vector(scene.work.t[s])
        tangential = math.hypot(dot(force, tx), dot(force, cross(n, tx)))
        cone[SLIDING, k] = tangential if scene.work.touching[s] == 1 else 0.0
        let_stick(scene, s)


@jitable
def solve_slips(scene: Scene, count: int, r: int, most: float) -> float:
    """Find what slips of the slots of so many rows; what begins to rubs as what slides.

    Returns the speed above which a slot does; `most` is what any holds at most.
    """
    cone, grows = scene.sweep.cone, True
    for k in range(count // 2):
        cone[STATIC, k] = cone[CAPACITY, k]
    eps = 0.0
    while grows:
        grows = False
        for k in range(count // 2):
            s = scene.equations.slot[int(cone[WHICH, k])]
            cone[CAPACITY, k] = (1.0 - OVER) * max(cone[STATIC, k], least_limit(scene, s, most))
        _, eps = solve_cones(scene.sweep.share, count, r, cone, scene.sweep.mix, SLIPPING)
        for k in range(count // 2):
            slips = math.hypot(cone[SLIDE, 2 * k], cone[SLIDE, 2 * k + 1]) > MOVES * eps
            if slips and cone[STATIC, k] != cone[SLIDING, k]:
                cone[STATIC, k] = cone[SLIDING, k]
                grows = True
    return MOVES * eps


@jitable
def solve_mechanism(scene: Scene, count: int, r: int, most: float) -> float:
    """Find how what sticks would begin to slip, however slowly; return as `solve_slips` does.

    Accelerations are known to a part of those of what presses most, and where shapes have just
    touched beside that theirs are less. Which way the limit gives first the dual of shares tells,
    whatever the size; inf where sliding there would rub more than pulls.
    """
    cone = scene.sweep.cone
    for k in range(count // 2):
        s = scene.equations.slot[int(cone[WHICH, k])]
        cone[CAPACITY, k] = max(capacity(scene, s), least_limit(scene, s, most))
    _, eps = solve_cones(scene.sweep.share, count, r, cone, scene.sweep.mix, SHARED)
    friction = 0.0
    for k in range(count // 2):
        friction += cone[SLIDING, k] * math.hypot(cone[SLIDE, 2 * k], cone[SLIDE, 2 * k + 1])
    return MOVES * eps if friction < 1.0 else math.inf


@jitable
def let_go(scene: Scene, y: F1, count: int, least: float) -> int:
    """Let slip the slots of so many rows that move faster than `least`; return how many do."""
    released, cone = 0, scene.sweep.cone
    for k in range(count // 2):
        x, z = cone[SLIDE, 2 * k], cone[SLIDE, 2 * k + 1]
        if math.hypot(x, z) > least:
            s = scene.equations.slot[int(cone[WHICH, k])]
            v = slip_of(scene, y, s)
            let_slip(scene, s, -x, -z, 0.0, math.hypot(v[0], v[1]))
            released += 1
    return released


@jitable
def release_sticking(scene: Scene, t: float, y: F1) -> int:
    """Let slip what is not held of what sticks, the way it is accelerated; return how many do."""
    hold_implied(scene, t, y)
    share_sticking(scene, t, y)
    if sticking_part(scene) <= 1.0:
        return 0
    most = most_capacity(scene)
    count, r = fill_cones(scene, t, y, most)
    fill_sliding(scene, t, y, count)
    released = let_go(scene, y, count, solve_slips(scene, count, r, most))
    if released == 0:
        released = let_go(scene, y, count, solve_mechanism(scene, count, r, most))
    if released == 0:
        # sliding would rub more than sticking holds: it goes on to stick
        code = call_int(scene.world.hooks[Hook.EVALUATE], (scene, t, 0.0, y, scene.work.idle))
        note_failure(scene, code)
        share_sticking(scene, t, y)
    return released


@jitable
def keep_play(scene: Scene, y: F1, s: int) -> None:
    """Keep how slot s moves that was let go: as all that goes on to stick lets it from here on."""
    kept, v = scene.state.memory[s], slip_of(scene, y, s)
    play = math.hypot(v[0], v[1])
    if play > kept[KEPT_PLAY]:
        let_slip(scene, s, kept[KEPT_X], kept[KEPT_Y], 0.0, play)


@jitable
def record_sticking(scene: Scene, t: float, y: F1) -> None:
    """Append events of the slots that go on otherwise than before."""
    state, slot = scene.state, scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        kept, before = state.memory[s], state.before[s]
        if state.touching[s] == 0:
            before[KEPT_MODE] = BEGUN
            kept[KEPT_X] = rest(scene) + settled(scene)
            continue
        if holds_nothing(scene, s):
            if before[KEPT_MODE] == STICK:
                # it will tell where it is held again
                record_event(scene, t, SLIP_EVENT, s)
            state.mode[s] = kept[KEPT_MODE]
            continue
        if kept[KEPT_MODE] == SLIP and kept[KEPT_SPEED] == 0.0:
            keep_play(scene, y, s)
        if before[KEPT_MODE] == BEGUN:
            # rows of the step in which it began show what holds from there on
            for k in range(len(before)):
                before[k] = kept[k]
        if kept[KEPT_MODE] != before[KEPT_MODE]:
            state.chattering[CHANGED] += 1.0
        turned = kept[KEPT_X] * before[KEPT_X] + kept[KEPT_Y] * before[KEPT_Y] < 0.0
        if kept[KEPT_MODE] == STICK and before[KEPT_MODE] == SLIP:
            record_event(scene, t, STICK_EVENT, s)
        elif kept[KEPT_MODE] == SLIP and (before[KEPT_MODE] == STICK or turned):
            record_event(scene, t, SLIP_EVENT, s)
        state.mode[s] = kept[KEPT_MODE]


@jitable
def changed_sticking(scene: Scene) -> int:
    """Return 1 if other slots stick than in the last step, else 0."""
    state, slot = scene.state, scene.equations.slot
    for e in range(first_of_slots(scene), len(slot), 2):
        s = slot[e]
        within = was_sticking(scene, s) and state.touching[s] == 1
        if within != (state.memory[s, KEPT_MODE] == STICK):
            return 1
    return 0


@jitable
def serve_sticking(scene: Scene, what: int, t: float, y: F1) -> int:
    """Do what contacts with rigid friction are asked for (`Sticking`); return an answer or 0."""
    if what == Sticking.LOCATE:
        locate_sticking(scene, t, y)
    elif what == Sticking.SHARE:
        share_sticking(scene, t, y)
    elif what == Sticking.ASK:
        return ask_sticking(scene, t, y)
    elif what == Sticking.BEGIN:
        return begin_sticking(scene, y)
    elif what == Sticking.RELEASE:
        return release_sticking(scene, t, y)
    elif what == Sticking.RECORD:
        record_sticking(scene, t, y)
    elif what == Sticking.CHANGED:
        return changed_sticking(scene)
    elif what == Sticking.LIMIT:
        fill_least_limits(scene)
    elif what == Sticking.LOAD:
        share_sticking(scene, t, y)
        return in_millionths(sticking_part(scene))
    elif what == Sticking.LOAD_AT_MOST:
        return in_millionths(part_at_most_of(scene, t, y))
    return 0
