"""What pushes where shapes touch: the incident marker, the two laws, the wrench on both bodies.

At the contact point p, n the unit normal from J into I, v the velocity of I's material
point relative to J's:

    depth rate = -v.n        slip = v - (v.n) n        spin = (w_I - w_J).n
    F_on_I = N n + Fx tx + Fy ty       T_on_I = (p - x_I) x F + Mx tx + My ty + Tz n
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    AT_PLACES,
    FRICTION_CALLS,
    NOISE_FORCE,
    NOISE_TORQUE,
    NORMAL_CALLS,
    PYTHON_CALLS,
)
from mbsim.arrays.hooks import Hook, Recall
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V2, V3
from mbsim.core.codes import Code
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import (
    add,
    cross,
    dot,
    norm,
    scale,
    sub,
    unrotate,
    vector,
)
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.frames import tangent
from mbsim.geometry.catalog import (
    AREA,
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    GAIN,
    REGION_ROWS,
)
from mbsim.laws.abi import (
    AREA_IN,
    ELASTIC,
    ENERGY,
    FORCE_X_OUT,
    FORCE_Y_OUT,
    LOAD,
    LOCI_IN,
    LOCJ_IN,
    NFORCE_IN,
    RADIUS_IN,
    ROLLING_IN,
    SLIDING_LIMIT,
    STEP_IN,
    TIME_IN,
    TORQUE_X_OUT,
    TORQUE_Y_OUT,
    TORQUE_Z_OUT,
    X_IN,
    XDOT_IN,
)
from mbsim.laws.user_normal import AREA as INPUT_AREA
from mbsim.laws.user_normal import DEPTH as INPUT_DEPTH
from mbsim.laws.user_normal import (
    EVALUATE,
    EXPLORE,
    LOCI,
    LOCJ,
    NI,
    NJ,
    NORMAL_INPUTS,
    PYTHON,
    TIME,
)
from mbsim.laws.user_normal import MODE as INPUT_MODE
from mbsim.laws.user_normal import RATE as INPUT_RATE

# columns of `Contacts.numbers`, as `Contact.numbers` of the model has them
IGNORE_DEEPER = 0
# columns of `Work.slot`
DEPTH, RATE, NORMAL, SLIP = range(4)
FORCE, TORQUE, STORED, LOST = 4, 7, 10, 11
# of friction with memory: dF/d(depth) of the normal force, energy stored, mode
STIFFNESS, FRICTION_STORED, MODE = 12, 13, 14
# of a pair that is one incident: its area, and how its normal force damps tilting
PATCH, TILTING = 15, 16
# of friction with memory: its branch, the velocity as which an error of 1 in what it integrates
# counts, its force along x and y of the incident marker; growth of STIFFNESS over itself, the
# user's own friction of sliding
BRANCH, UNIT, ALONG_X, ALONG_Y, STIFFENS, LIMIT = range(17, 23)
# the rates of normal force and of that, as found at a time; both as they were there; over how much
# time they are still to be found, else 0; the same of STIFFNESS, where more than the depth changes
# it, else NaN
NORMAL_SLOPE, LIMIT_SLOPE, FOUND_AT, NORMAL_THEN, LIMIT_THEN, FOUND_OVER = range(23, 29)
STIFFNESS_SLOPE, STIFFNESS_THEN = 29, 30
# the part of its normal force that rubs at its place on a rim (`contact.rims`)
PRESSED_PART = 31
# what rigid friction is taken to hold at least, where the audit asks for it
HELD_AT_LEAST = 32

# part by which k d/F has to be off 1 for a normal force's stiffness to change with its depth
CHANGES = 1e-9


@jitable
def velocity_at(scene: Scene, y: F1, b: int, p: V3) -> V3:
    """Return the velocity of body b's material point at p."""
    arm = sub(p, position(scene, y, b))
    return add(vector(scene.work.v[b]), cross(vector(scene.work.w[b]), arm))


@jitable
def in_marker(scene: Scene, y: F1, g: int, p: V3) -> V3:
    """Return point p from the origin of graphic g's reference marker, in that marker's axes."""
    b = scene.graphics.body[g]
    in_body = unrotate(scene.work.R[b], sub(p, position(scene, y, b)))
    return unrotate(scene.graphics.marker_R[g], sub(in_body, vector(scene.graphics.marker_p[g])))


@jitable
def along_marker(scene: Scene, g: int, v: V3) -> V3:
    """Return a vector along the axes of graphic g's reference marker."""
    in_body = unrotate(scene.work.R[scene.graphics.body[g]], v)
    return unrotate(scene.graphics.marker_R[g], in_body)


@jitable
def sides(scene: Scene, s: int) -> tuple[int, int]:
    """Return the graphics of a slot in the contact's order: I, J."""
    pair = scene.slots.pair[s]
    i, j = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
    if scene.kinds.swapped[scene.pairs.kind[pair]] == 1:
        return j, i
    return i, j


@jitable
def contact_of(scene: Scene, s: int) -> int:
    """Return the contact of slot s."""
    return scene.kinds.contact[scene.pairs.kind[scene.slots.pair[s]]]


@jitable
def face_weight_of(scene: Scene, s: int) -> float:
    """Return the weights of a flat face where slot s is the one incident of its pair, else 0."""
    return scene.kinds.whole[scene.pairs.kind[scene.slots.pair[s]]]


@jitable
def stands_for_points(scene: Scene, s: int) -> bool:
    """Return whether slot s is the one incident of a pair for the points behind it."""
    return scene.kinds.step[scene.pairs.kind[scene.slots.pair[s]]] > REGION_ROWS


@jitable
def is_patch(scene: Scene, s: int) -> bool:
    """Return whether slot s is a patch, whose pressure has moments."""
    return scene.kinds.step[scene.pairs.kind[scene.slots.pair[s]]] == REGION_ROWS


@jitable
def gain_of(scene: Scene, s: int) -> float:
    """Return how much the depth of slot s grows as its bodies get nearer by 1."""
    return scene.work.points[s + 1, GAIN] if is_patch(scene, s) else 1.0


@jitable
def patch(scene: Scene, s: int) -> float:
    """Return the area of contact of slot s, 0 for a point."""
    return scene.work.slot[s, PATCH] if face_weight_of(scene, s) > 0.0 else 0.0


@jitable
def pressing(scene: Scene, s: int) -> float:
    """Return what presses where friction of slot s acts."""
    row = scene.work.slot[s]
    part = row[PRESSED_PART] if scene.contacts.rims[contact_of(scene, s)] == AT_PLACES else 1.0
    return part * row[NORMAL]


@jitable
def add_wrench(scene: Scene, y: F1, b: int, p: V3, force: V3, torque: V3) -> None:
    """Add a force at p and a torque to body b."""
    arm = sub(p, position(scene, y, b))
    moment = add(cross(arm, force), torque)
    for k in range(3):
        scene.work.force[b, k] += force[k]
        scene.work.torque[b, k] += moment[k]


@jitable
def show_state(scene: Scene, y: F1) -> None:
    """Let interpreted laws that ask for it see the trial point."""
    for k in range(len(scene.users.seen)):
        scene.users.seen[k] = y[k]


@jitable
def friction(
    scene: Scene,
    t: float,
    h: float,
    y: F1,
    s: int,
    c: int,
    loci: V3,
    locj: V3,
    spin_rates: V3,
    slip: V2,
    normal: float,
) -> int:
    """Call the friction law of contact c for slot s into `law_out`; return its code.

    Many arguments because compiled code is given numbers, not records.
    """
    contacts, work = scene.contacts, scene.work
    given = work.law_in
    at = scene.slots.x[s]
    given[TIME_IN] = t
    given[STEP_IN] = h
    for k in range(3):
        given[X_IN + k] = y[at + k] if at >= 0 else 0.0
        given[LOCI_IN + k] = loci[k]
        given[LOCJ_IN + k] = locj[k]
    given[XDOT_IN], given[XDOT_IN + 1], given[XDOT_IN + 2] = slip[0], slip[1], spin_rates[2]
    given[ROLLING_IN], given[ROLLING_IN + 1] = spin_rates[0], spin_rates[1]
    given[NFORCE_IN] = normal
    area = patch(scene, s)
    given[AREA_IN] = area
    given[RADIUS_IN] = math.sqrt(area / math.pi) if area > 0.0 else 0.0
    if contacts.memory[c] > 0:
        answer = call_int(scene.world.hooks[Hook.RECALL], (scene, Recall.GIVE, s, t, y, 0))
        if answer < 0:
            return -answer
    scene.log.counters[FRICTION_CALLS] += 1
    scene.log.counters[PYTHON_CALLS] += contacts.interpreted[c]
    if contacts.interpreted[c] == 1:
        show_state(scene, y)
    out = work.law_out
    if contacts.sliding_law[c] != 0:
        call = (contacts.id[c], given, contacts.sliding_par[c], out)
        code = call_int(contacts.sliding_law[c], call)
        if code != 0:
            return code
        given[SLIDING_LIMIT] = work.slot[s, LIMIT] = math.hypot(out[FORCE_X_OUT], out[FORCE_Y_OUT])
    if contacts.spreads[c] == 1 and is_patch(scene, s):
        return call_int(scene.world.hooks[Hook.SPREAD], (scene, s, c))
    if contacts.rims[c] > 0:
        return call_int(scene.world.hooks[Hook.RIM], (scene, s, c))
    call = (contacts.id[c], given, contacts.friction_par[c], out)
    return call_int(contacts.friction_law[c], call)


@jitable
def ask_normal(
    scene: Scene,
    t: float,
    y: F1,
    c: int,
    at: tuple[int, int, V3, V3, float],
    depth: float,
    rate: float,
    out: F1,
) -> int:
    """Call the normal law of contact c into `out`; `at`: graphics I and J, point, normal, area."""
    contacts = scene.contacts
    if contacts.user_normal[c] == 0:
        return call_int(contacts.normal_law[c], (depth, rate, contacts.normal_par[c], out))
    # a user's law looks at more, as if in the middle of a question for forces
    gi, gj, p, n, area = at
    inputs = floats_at(contacts.user_normal[c], NORMAL_INPUTS)
    inputs[TIME], inputs[INPUT_DEPTH], inputs[INPUT_RATE] = t, depth, rate
    inputs[INPUT_AREA] = area
    loci = in_marker(scene, y, gi, sub(p, scale(0.5 * depth, n)))
    locj = in_marker(scene, y, gj, add(p, scale(0.5 * depth, n)))
    ni, nj = along_marker(scene, gi, scale(-1.0, n)), along_marker(scene, gj, n)
    for k in range(3):
        inputs[LOCI + k], inputs[NI + k] = loci[k], ni[k]
        inputs[LOCJ + k], inputs[NJ + k] = locj[k], nj[k]
    if inputs[PYTHON] == 1.0:
        scene.log.counters[PYTHON_CALLS] += 1
        show_state(scene, y)
    inputs[INPUT_MODE] = EVALUATE
    code = call_int(contacts.normal_law[c], (depth, rate, contacts.normal_par[c], out))
    inputs[INPUT_MODE] = EXPLORE
    if code == 0 and math.isfinite(depth + rate) and not math.isfinite(out[LOAD]):
        return Code.USER_NORMAL_FAILED
    return code


@jitable
def add_contact(scene: Scene, t: float, h: float, y: F1, dy: F1, s: int) -> int:  # noqa: C901
    """Add the wrench of the touching slot s; return 0 or the code of the law that failed.

    Long, with many branches, because normal force, friction and torques share the contact's frame
    and velocities.
    """
    contacts, work = scene.contacts, scene.work
    c = contact_of(scene, s)
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    point = work.points[s]
    depth, p, n = point[AT_DEPTH], vector(point[AT_POINT:]), vector(point[AT_NORMAL:])

    # how the surfaces move at p
    v = sub(velocity_at(scene, y, bi, p), velocity_at(scene, y, bj, p))
    w = sub(vector(work.w[bi]), vector(work.w[bj]))
    gain = gain_of(scene, s)
    rate = -gain * dot(v, n)
    tx = tangent(scene, t, y, s, c, gi, bi, bj, n)
    ty = cross(n, tx)
    for k in range(3):
        work.t[s, k] = tx[k]
    slip = (dot(v, tx), dot(v, ty))
    spin_rates = (dot(w, tx), dot(w, ty), dot(w, n))

    row, whole = work.slot[s], face_weight_of(scene, s)
    if whole > 0.0:
        row[PATCH] = work.points[s + 1, AREA]

    torque = (0.0, 0.0, 0.0)

    # normal force; out: force, force at rate 0, stored energy
    out = work.law_out
    scene.log.counters[NORMAL_CALLS] += 1
    touching_point = (gi, gj, p, n, patch(scene, s))
    code = ask_normal(scene, t, y, c, touching_point, depth, rate, out)
    if code != 0:
        return code
    weight = point[AT_WEIGHT]
    stored, lost = weight * out[ENERGY], weight * (out[LOAD] - out[ELASTIC]) * rate
    normal, elastic = weight * gain * out[LOAD], weight * gain * out[ELASTIC]
    # of weights that turn with the shapes, and of depths that do
    couple = scale(out[ENERGY], vector(point[COUPLE:]))
    couple = add(couple, scale(out[ELASTIC], vector(point[COUPLE_OF_FORCE:])))
    row[FRICTION_STORED] = row[MODE] = row[BRANCH] = 0.0
    if contacts.memory[c] > 0:
        # of a power law F = k d^e, whose energy is F d / (e + 1)
        by_depth = elastic * elastic / stored - gain * elastic / depth if stored > 0.0 else 0.0
        row[STIFFNESS] = by_depth
        over = elastic * depth / (gain * stored) - 2.0 if stored > 0.0 else 0.0
        row[STIFFENS] = over * rate / depth if abs(over) > CHANGES else 0.0
    if whole > 0.0:
        # see geometry.region
        if stands_for_points(scene, s):
            stored = whole * out[ENERGY]
        code = call_int(scene.world.hooks[Hook.TILTING], (scene, s, t, normal, y))
        if code != 0:
            return code
        torque, lost = vector(row[TORQUE : TORQUE + 3]), lost + row[LOST]
    torque = add(torque, couple)

    force = scale(normal, n)
    if contacts.friction_law[c] != 0:
        if contacts.framed[c] == 1:
            loci = in_marker(scene, y, gi, sub(p, scale(0.5 * depth, n)))
            locj = in_marker(scene, y, gj, add(p, scale(0.5 * depth, n)))
        else:
            loci, locj = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        # what a user's law pulls with rubs nothing
        pressed = max(normal, 0.0)
        code = friction(scene, t, h, y, s, c, loci, locj, spin_rates, slip, pressed)
        if code != 0:
            return code
        finite = math.isfinite(out[FORCE_X_OUT] + out[FORCE_Y_OUT] + out[TORQUE_Z_OUT])
        if not finite and contacts.framed[c] == 1 and math.isfinite(normal + slip[0] + slip[1]):
            return Code.USER_NOT_FINITE
        held_back = scene.world.hooks[Hook.HOLD_BACK]
        if held_back != 0 and h > 0.0:
            call_int(held_back, (scene, s, h, slip[0], slip[1], y))
        if contacts.memory[c] > 0:
            answer = call_int(scene.world.hooks[Hook.RECALL], (scene, Recall.TAKE, s, t, dy, 0))
            if answer < 0:
                return -answer
        fx, fy = out[FORCE_X_OUT], out[FORCE_Y_OUT]
        mx, my, tz = out[TORQUE_X_OUT], out[TORQUE_Y_OUT], out[TORQUE_Z_OUT]
        force = add(force, add(scale(fx, tx), scale(fy, ty)))
        torque = add(torque, add(scale(mx, tx), add(scale(my, ty), scale(tz, n))))
        along = fx * slip[0] + fy * slip[1]
        about = mx * spin_rates[0] + my * spin_rates[1] + tz * spin_rates[2]
        lost -= along
        lost -= about
        dy[scene.audit.friction_at[c]] += along + about
    add_wrench(scene, y, bi, p, force, torque)
    add_wrench(scene, y, bj, p, scale(-1.0, force), scale(-1.0, torque))
    noise = scene.kinds.noise[scene.pairs.kind[scene.slots.pair[s]]]
    if noise > 0.0:
        for b in (bi, bj):
            work.noise[b, NOISE_FORCE] += noise * normal
            work.noise[b, NOISE_TORQUE] += noise * normal * norm(sub(p, position(scene, y, b)))

    # X of the incident follows the slip
    at = scene.slots.x[s]
    if at >= 0:
        dy[at], dy[at + 1], dy[at + 2] = slip[0], slip[1], spin_rates[2]
    dy[len(dy) - len(contacts.id) + c] += lost

    # what recorder, log and commit want to know
    row[DEPTH], row[RATE], row[NORMAL] = depth, rate, normal
    row[SLIP] = math.hypot(slip[0], slip[1])
    for k in range(3):
        row[FORCE + k] = force[k]
        row[TORQUE + k] = torque[k]
    row[STORED], row[LOST] = stored, lost
    return 0
