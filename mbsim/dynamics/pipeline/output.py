"""One output row: the state, and the forces and accelerations that follow from it."""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ACTIVE,
    CONTACT_COLUMNS,
    DISSIPATED,
    DRIFT,
    INC_COUPLE,
    INC_COUPLE_OF_FORCE,
    INC_DEPTH,
    INC_FROZEN,
    INC_GRAPHIC_I,
    INC_GRAPHIC_J,
    INC_KIND,
    INC_MEMORY,
    INC_NORMAL,
    INC_POINT,
    INC_REGION,
    INC_SLOT,
    INC_STEP,
    INC_STICKING,
    INC_TANGENT,
    INC_TOUCHES,
    INC_WEIGHT,
    INC_X,
    KINETIC,
    NOISE_FORCE,
    NOISE_TORQUE,
    OF_DAMPERS,
    OF_MOTIONS,
    POINT_AREA,
    POINT_CONTACT,
    POINT_FORCE,
    POINT_SLIP,
    POTENTIAL,
    STORED_ENERGY,
    USED_EVENTS,
    USED_INCIDENTS,
    USED_ROWS,
    WORK_OF_MOTIONS,
    WORST_BODY,
)
from mbsim.arrays.hooks import Contacts, Effects, Gauges, Hook, Joints, answer_of, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, V2
from mbsim.core.counting import number_of_parts
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import GOES, LISTED
from mbsim.core.rotation import cross, dot, rotate, sub, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.scales import PART, fill_squares
from mbsim.dynamics.contact.forces import (
    ALONG_X,
    ALONG_Y,
    DEPTH,
    FORCE,
    FRICTION_STORED,
    MODE,
    SLIP,
    STORED,
    TORQUE,
    UNIT,
    contact_of,
    face_weight_of,
    patch,
    sides,
)
from mbsim.geometry.catalog import (
    AREA,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    GAIN,
    MOMENT_XX,
    MOMENT_XY,
    MOMENT_YY,
)
from mbsim.laws.catalog import BRANCHES, STICK
from mbsim.laws.catalog import SLIP as SLIDING


@jitable
def fill_energy(scene: Scene, y: F1, row: F1) -> None:
    """Write kinetic, potential (gravity and springs), dissipated energy and work of motions."""
    bodies = scene.bodies
    kinetic, potential, dissipated = 0.0, 0.0, 0.0
    if scene.awake.whole[GOES] == LISTED:
        # of what sleeps
        potential = scene.awake.potential[0]
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        at = BODY_SIZE * b
        v = (y[at + 7], y[at + 8], y[at + 9])
        w = (y[at + 10], y[at + 11], y[at + 12])
        kinetic += 0.5 * (bodies.mass[b] * dot(v, v) + dot(w, rotate(bodies.inertia[b], w)))
        potential -= bodies.mass[b] * dot(vector(scene.world.gravity), position(scene, y, b))
    row[KINETIC], row[POTENTIAL], row[DISSIPATED] = kinetic, potential, dissipated
    if scene.world.hooks[Hook.CONTACTS] != 0:
        contacts = scene.world.hooks[Hook.CONTACTS]
        answer_of(scene, call_int(contacts, (scene, Contacts.ENERGY, 0.0, 0.0, y, row)))
        potential, dissipated = row[POTENTIAL], row[DISSIPATED]
    for f in range(len(scene.applied.form)):
        potential += scene.work.applied[f, STORED_ENERGY]
    accumulators = scene.world.accumulators
    work, damped = accumulators[OF_MOTIONS], accumulators[OF_DAMPERS]
    if damped >= 0:
        dissipated += y[damped]
    row[POTENTIAL], row[DISSIPATED] = potential, dissipated
    row[WORK_OF_MOTIONS] = y[work] if work >= 0 else 0.0


@jitable
def add_stored(scene: Scene, y: F1, row: F1) -> None:
    """Add what contacts have stored and lost to a row of energies."""
    hit = scene.work.hit
    for k in range(hit[len(hit) - 1]):
        slot = scene.work.slot[hit[k]]
        row[POTENTIAL] += slot[STORED] + slot[FRICTION_STORED]
        row[DISSIPATED] -= slot[FRICTION_STORED]
    for c in range(len(scene.contacts.id)):
        row[DISSIPATED] += y[len(y) - len(scene.contacts.id) + c]


@jitable
def fill_contacts(scene: Scene, y: F1, row: F1) -> None:
    """Write net force, net torque about I's cg, deepest depth, fastest slip, incidents, area."""
    work = scene.work
    for k in range(len(row)):
        row[k] = 0.0
    for h in range(work.hit[len(work.hit) - 1]):
        s = work.hit[h]
        at = CONTACT_COLUMNS * contact_of(scene, s)
        values, point = work.slot[s], work.points[s]
        gi = sides(scene, s)[0]
        force = vector(values[FORCE : FORCE + 3])
        arm = sub(vector(point[AT_POINT:]), position(scene, y, scene.graphics.body[gi]))
        moment = cross(arm, force)
        for k in range(3):
            row[at + k] += force[k]
            row[at + 3 + k] += moment[k] + values[TORQUE + k]
        row[at + 6] = max(row[at + 6], values[DEPTH])
        row[at + 7] = max(row[at + 7], values[SLIP])
        row[at + 8] += 1.0
        row[at + 9] += patch(scene, s)


@jitable
def fill_point(scene: Scene, s: int, row: F1) -> None:
    """Write the force in slot s on I's body, its slip speed, area and contact."""
    slot = scene.work.slot[s]
    for j in range(3):
        row[POINT_FORCE + j] = slot[FORCE + j]
    row[POINT_SLIP], row[POINT_AREA] = slot[SLIP], patch(scene, s)
    row[POINT_CONTACT] = contact_of(scene, s)


@jitable
def fill_incidents(scene: Scene, h: float, y: F1) -> int:
    """Append the incident table of this row, evaluated with `h`; return the number of incidents."""
    rows, work, state = scene.rows, scene.work, scene.state
    first = rows.used[USED_INCIDENTS]
    k = first
    for touching in range(work.hit[len(work.hit) - 1]):
        s = work.hit[touching]
        row = rows.incidents[k]
        at = scene.slots.x[s]
        row[INC_SLOT] = s
        for j in range(3):
            row[INC_POINT + j] = work.points[s, AT_POINT + j]
            row[INC_NORMAL + j] = work.points[s, AT_NORMAL + j]
            row[INC_COUPLE + j] = work.points[s, COUPLE + j]
            row[INC_COUPLE_OF_FORCE + j] = work.points[s, COUPLE_OF_FORCE + j]
            row[INC_TANGENT + j] = work.t[s, j]
            row[INC_X + j] = y[at + j] if at >= 0 else 0.0
        row[INC_DEPTH] = work.slot[s, DEPTH]
        # what its force followed from besides y: see pipeline.replay
        pair = scene.slots.pair[s]
        row[INC_WEIGHT], row[INC_STEP] = work.points[s, AT_WEIGHT], h
        row[INC_FROZEN] = 1.0 if scene.state.frozen[0] == 1 and state.touching[s] == 1 else 0.0
        row[INC_TOUCHES] = scene.pairs.touches[pair]
        row[INC_KIND] = scene.pairs.kind[pair]
        row[INC_GRAPHIC_I] = scene.pairs.graphic_i[pair]
        row[INC_GRAPHIC_J] = scene.pairs.graphic_j[pair]
        for j in range(state.before.shape[1]):
            row[INC_MEMORY + j] = state.before[s, j]
        if len(row) > INC_MEMORY + state.before.shape[1]:
            at = len(row) - INC_REGION
            for j in range(INC_REGION):
                row[at + j] = 0.0
            if face_weight_of(scene, s) > 0.0:
                numbers = work.points[s + 1]
                row[at], row[at + 1] = numbers[AREA], numbers[MOMENT_XX]
                row[at + 2], row[at + 3] = numbers[MOMENT_XY], numbers[MOMENT_YY]
                row[at + 4] = numbers[GAIN]
        rigid = scene.contacts.rigid[contact_of(scene, s)]
        if rigid == 1 and work.slot[s, MODE] == STICK:
            # what equations hold, the law can tell only from here
            for j in range(2):
                row[INC_STICKING + j] = work.sticking_force[s, j]
        if len(rows.points) > 0:
            fill_point(scene, s, rows.points[k])
        k += 1
    rows.used[USED_INCIDENTS] = k
    return k - first


@jitable
def write_row(scene: Scene, t: float, h: float, y: F1, f: F1) -> bool:
    """Append the row of (t, y), y' = f evaluated with `h`; return whether the table is full."""
    rows, work = scene.rows, scene.work
    k = rows.used[USED_ROWS]
    rows.time[k] = t
    for j in range(len(y)):
        rows.y[k, j] = y[j]
    for b in range(len(scene.bodies.mass)):
        at = BODY_SIZE * b
        alpha = rotate(work.R[b], (f[at + 10], f[at + 11], f[at + 12]))
        for j in range(3):
            rows.accel[k, 6 * b + j] = f[at + 7 + j]
            rows.accel[k, 6 * b + 3 + j] = alpha[j]
    contacts, incidents = scene.world.hooks[Hook.CONTACTS], 0
    if contacts != 0:
        answer_of(scene, call_int(contacts, (scene, Contacts.ROW, t, h, y, y)))
    if scene.world.hooks[Hook.JOINTS] != 0:
        reacts = call_int(scene.world.hooks[Hook.JOINTS], (scene, Joints.REACT, t, y, f))
        note_failure(scene, reacts)
    for j in range(len(scene.applied.form)):
        for c in range(6):
            rows.applied[k, 6 * j + c] = work.applied[j, c]
    for j in range(len(work.reaction)):
        rows.joint[k, j] = work.reaction[j]
    if scene.world.hooks[Hook.REQUESTS] != 0:
        note_failure(scene, call_int(scene.world.hooks[Hook.REQUESTS], (scene, t, y)))
    fill_energy(scene, y, rows.energy[k])
    if contacts != 0:
        answer = call_int(contacts, (scene, Contacts.INCIDENTS, t, h, y, y))
        incidents = answer_of(scene, answer)
    rows.incident_count[k] = incidents
    rows.used[USED_ROWS] = k + 1
    return k + 1 >= len(rows.time) or no_room(scene)


@jitable
def no_room(scene: Scene) -> bool:
    """Return whether another step or row could overflow the tables of events and incidents."""
    rows, pairs, slots = scene.rows, scene.pairs, 0
    room = min(
        len(rows.events) - rows.used[USED_EVENTS], len(rows.incidents) - rows.used[USED_INCIDENTS]
    )
    if room >= 2 * len(scene.slots.pair):
        return False
    for k in range(pairs.count[ACTIVE]):
        slots += pairs.last[pairs.active[k]] - pairs.slot[pairs.active[k]]
    return room < 2 * slots


@jitable
def beyond_noise(scene: Scene, b: int, h: float, dv: float, dw: float) -> V2:
    """Return the squares of a velocity error less what detection noise does in a step h."""
    bodies, noise = scene.bodies, scene.work.noise
    if noise[b, NOISE_FORCE] == 0.0:
        return dv, dw
    ease = h * noise[b, NOISE_FORCE] / bodies.mass[b]
    least = min(bodies.inertia[b, 0, 0], min(bodies.inertia[b, 1, 1], bodies.inertia[b, 2, 2]))
    turn = h * noise[b, NOISE_TORQUE] / least
    return max(0.0, math.sqrt(dv) - ease) ** 2, max(0.0, math.sqrt(dw) - turn) ** 2


@jitable
def carried_error(scene: Scene, e: F1, s: int) -> float:
    """Return the velocity as which e in what friction in slot s integrates counts.

    Where it slips that is the way of slip over the spring's length, which acts only across the
    force.
    """
    row, at = scene.work.slot[s], scene.slots.z[s]
    if scene.state.mode[s] % BRANCHES == SLIDING:
        force = math.hypot(row[ALONG_X], row[ALONG_Y])
        across = row[ALONG_X] * e[at + 1] - row[ALONG_Y] * e[at]
        return row[UNIT] * across / force if force > 0.0 else 0.0
    square = 0.0
    for j in range(scene.contacts.carried[contact_of(scene, s)]):
        square += e[at + j] * e[at + j]
    return row[UNIT] * math.sqrt(square)


@jitable
def carried_square(scene: Scene, e: F1) -> float:
    """Return the largest square of |dX|/L and of what friction carries, over V."""
    scales, squares, largest = scene.scales, scene.work.squares, 0.0
    for side in range(2):
        hit = scene.work.hit if side == 0 else scene.state.hit
        for k in range(hit[len(hit) - 1]):
            at = scene.slots.x[hit[k]]
            if at >= 0 and scene.contacts.reads_x[contact_of(scene, hit[k])] == 1:
                g = scales.of_contact[contact_of(scene, hit[k])]
                square = (e[at] ** 2 + e[at + 1] ** 2) / scales.length[g] ** 2
                largest = max(largest, max(square, e[at + 2] ** 2))
            if scene.slots.z[hit[k]] >= 0:
                g = scales.of_contact[contact_of(scene, hit[k])]
                largest = max(largest, carried_error(scene, e, hit[k]) ** 2 / squares[g])
    return largest


@jitable
def gauged(scene: Scene, hook: int, what: int, t: float, h: float, e: F1, y: F1) -> float:
    """Return what is measured of contacts: `Gauges` or `Effects`; 0 where there is no such hook."""
    address = scene.world.hooks[hook]
    return call_float(address, (scene, what, t, h, e, y)) if address != 0 else 0.0


@jitable
def scaled_error(scene: Scene, h: float, e: F1, y: F1) -> float:
    """Return the largest of |dx|/L, |dtheta|, |dv|/V, |dw| L/V, of incidents' X/L, energy, states.

    L and V are those of the group of connected bodies (`bodies.scales`), the energy is that of
    its heaviest body at V, at least PART^2 of what was taken so far (as V is PART of a speed): a
    damper that holds back strong springs takes far more than bodies so slow ever have. Detection
    that is exact only to a given noise makes forces uncertain; what the noise of a step can do to a
    velocity is not chased. With h = 0, `e` is no step's error, and what it does to friction, over
    the normal force, counts as well. The worst body is left in `diagnostics`.
    """
    scales, squares, largest, worst = scene.scales, scene.work.squares, 0.0, -1
    fill_squares(scene, y)
    for k in range(bodies_awake(scene)):
        b = body_awake(scene, k)
        at = BODY_SIZE * b
        dx = e[at] ** 2 + e[at + 1] ** 2 + e[at + 2] ** 2
        dq = e[at + 3] ** 2 + e[at + 4] ** 2 + e[at + 5] ** 2 + e[at + 6] ** 2
        dv = e[at + 7] ** 2 + e[at + 8] ** 2 + e[at + 9] ** 2
        dw = e[at + 10] ** 2 + e[at + 11] ** 2 + e[at + 12] ** 2
        dv, dw = beyond_noise(scene, b, h, dv, dw)
        g = scales.group[b]
        area, fast = scales.length[g] ** 2, squares[g]
        # |dtheta| = 2 |dq| for a unit quaternion
        square = max(
            max(dx / area, 4.0 * dq),
            max(dv / fast, dw * area / fast),
        )
        if not square <= largest:
            largest, worst = square, b
    largest = max(largest, gauged(scene, Hook.GAUGES, Gauges.ERROR, 0.0, h, e, y))
    # the energy balance closes as well as the motion
    first, most = len(e) - max(1, len(scene.contacts.id)), 0.0
    for c in range(len(scene.contacts.id)):
        g = scales.of_contact[c]
        energy = max(scales.mass[g] * squares[g], PART**2 * abs(y[first + c]))
        largest = max(largest, (e[first + c] / energy) ** 2)
    for g in range(len(squares)):
        most = max(most, scales.mass[g] * squares[g])
    for kept in scene.world.accumulators:
        if kept >= 0:
            largest = max(largest, (e[kept] / max(most, PART**2 * abs(y[kept]))) ** 2)
    states = scene.states
    for k in range(len(states.offset)):
        at = states.offset[k]
        largest = max(largest, (e[at] / max(abs(y[at]), states.scale[k])) ** 2)
    if h > 0.0:
        # what was not integrated but put right, as after a motion that jumps
        largest = max(largest, scene.sweep.quality[DRIFT] ** 2)
    else:
        largest = max(largest, gauged(scene, Hook.EFFECTS, Effects.REVERSAL, 0.0, h, e, y) ** 2)
        largest = max(largest, gauged(scene, Hook.EFFECTS, Effects.PRESSURE, 0.0, h, e, y) ** 2)
    scene.work.diagnostics[WORST_BODY] = worst
    return math.sqrt(largest)


@jitable
def fill_sizes(scene: Scene, d: F1, y: F1) -> None:
    """Leave in the first number of each of the states' differences in d what it is in the norm.

    As `scaled_error` has it with h = 0. Of bodies alone, where there are some.
    """
    scales, squares, n = scene.scales, scene.work.squares, len(y)
    count = len(scene.bodies.mass)
    fill_squares(scene, y)
    for part in range(number_of_parts(len(d), n)):
        e, largest = d[part * n : (part + 1) * n], 0.0
        if count == 0:
            e[0] = scaled_error(scene, 0.0, e, y)
            continue
        for b in range(count):
            at = BODY_SIZE * b
            dx = e[at] ** 2 + e[at + 1] ** 2 + e[at + 2] ** 2
            dq = e[at + 3] ** 2 + e[at + 4] ** 2 + e[at + 5] ** 2 + e[at + 6] ** 2
            dv = e[at + 7] ** 2 + e[at + 8] ** 2 + e[at + 9] ** 2
            dw = e[at + 10] ** 2 + e[at + 11] ** 2 + e[at + 12] ** 2
            g = scales.group[b]
            area, fast = scales.length[g] ** 2, squares[g]
            square = max(max(dx / area, 4.0 * dq), max(dv / fast, dw * area / fast))
            if not square <= largest:
                largest = square
        change = gauged(scene, Hook.EFFECTS, Effects.REVERSAL, 0.0, 0.0, e, y)
        e[0] = math.sqrt(max(largest, change**2))


@jitable
def find_fault(scene: Scene) -> int:
    """Return the contact that presses hardest on the body with the worst error, -1 for none."""
    worst, hardest, contact = scene.work.diagnostics[WORST_BODY], 0.0, -1
    hit = scene.work.hit
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        gi, gj = sides(scene, s)
        of_body = scene.graphics.body[gi] == worst or scene.graphics.body[gj] == worst
        force = vector(scene.work.slot[s, FORCE : FORCE + 3])
        size = dot(force, force)
        if of_body and size >= hardest:
            hardest, contact = size, contact_of(scene, s)
    return contact
