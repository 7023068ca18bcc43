"""What a run judges itself by: sums over what has just been evaluated, now and then at its steps.

At an accepted step, every so many of them and where a contact begins or ends, a *sample* is taken:

* energy: B = kinetic + potential + dissipated - work of motions, all but the first two integrated
  with the motion, against what it was at first, and against the last sample;
* momentum: of a group of bodies that nothing outside acts on but its weight, P grows by M g dt and
  the angular momentum about its cg not at all;
* residuals of the constraints in use, and their rates; what slips although friction holds it;
* friction over mu N;
* the work of friction of each contact: it may give back no more than it took since it last had
  nothing in store, which is never anything where it has neither memory nor X; and the power of
  friction in joints and of dry friction, never above 0.

What a local error of e explains is e times a usual size: the energy error of a step that is wrong
by e V in velocities is e m v V. Steps give e, the tolerance is what they may be wrong by unseen
(`allowed`). A sample costs about as much as one evaluation of the bodies without contacts.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ANEW,
    ANGULAR,
    AUDIT_EVERY,
    AUDIT_TOL,
    AUDIT_UNTIL,
    CHANGE,
    CHANGED_AT,
    CLOSED_AT,
    CONE,
    CONTACT_THEN,
    DISSIPATED,
    DISSIPATED_FIRST,
    DRIVES,
    DRIVES_LIMIT,
    ENERGY,
    ENERGY_STEP,
    ERROR_NOW,
    ERRORS_ALL,
    ERRORS_SINCE,
    FOLD,
    FOLD_AT,
    FOLD_OFF,
    FOUND_ALLOWED,
    FOUND_ELEMENT,
    FOUND_TIME,
    FOUND_VALUE,
    HITS_THEN,
    KINETIC,
    LARGEST_CHANGE,
    LARGEST_ENERGY,
    LARGEST_FRICTION,
    LINEAR,
    LOST_POWER,
    MOMENTUM,
    OPEN_BY,
    POSITION,
    POTENTIAL,
    POTENTIAL_FIRST,
    REST_CENTRE,
    REST_MASS,
    REST_SPREAD,
    SPIN,
    STEPS_ALL,
    STEPS_SINCE,
    STICKING_SLIP,
    TIME_THEN,
    TOUCHED_NOW,
    TOUCHED_THEN,
    USUAL_ENERGY,
    VELOCITY,
    WORK_FIRST,
    WORK_NOW,
    WORK_OF_MOTIONS,
    WORK_THEN,
    WORST_OPEN,
    WORST_TIME,
)
from mbsim.arrays.hooks import Contacts, Hook, Joints, Sticking, answer_of, note_failure
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.layout import BODY_SIZE
from mbsim.core.problem import GOES, LISTED
from mbsim.core.rotation import add, cross, dot, norm, rotate, scale, sub, vector
from mbsim.dynamics.bodies.awake import bodies_awake, body_awake
from mbsim.dynamics.bodies.scales import fill_squares
from mbsim.dynamics.constraints.equations import MISMATCH, RESIDUAL
from mbsim.dynamics.constraints.folding import is_sticking
from mbsim.dynamics.constraints.in_use import active_count, is_friction
from mbsim.dynamics.contact.forces import (
    FORCE,
    HELD_AT_LEAST,
    NORMAL,
    contact_of,
    pressing,
    sides,
)
from mbsim.dynamics.pipeline.output import fill_energy
from mbsim.geometry.catalog import AT_NORMAL

#: Rounding of a sum of energies or momenta, over the sum of their sizes.
ROUNDING = 1e-13
#: Rounding of constraints' residuals and rates, over their units.
CLOSED = 1e-10
#: What rounding makes of velocities across a fold behind it, over the usual ones, for each loop.
PASSED = 1e-8
#: Rounding of a force whose friction is looked at, over its part along the normal.
CONE_ROUNDING = 1e-12
#: What friction may give at most, over the largest energy, however large the errors of all steps.
GIVEN = 0.02 / DRIVES_LIMIT
#: Bodies of the largest model that is sampled where contacts begin and end: of many, one always
#: does.
FEW = 16
# columns of `Audit.sums`: mass; sums of m d and m u; of m d x u + J w; of m |u| and of the size of
# angular momentum; d and u are from the group's first body
MASS, SHIFT, FLOW, TURN, SPEEDS, SPINS = 0, 1, 4, 7, 10, 11


@jitable
def note(scene: Scene, row: int, value: float, allowed: float, t: float, element: int) -> None:
    """Keep a value if it is larger over what is allowed than those before."""
    found = scene.audit.found[row]
    if not value * found[FOUND_ALLOWED] <= found[FOUND_VALUE] * allowed:
        found[FOUND_VALUE], found[FOUND_ALLOWED] = value, allowed
        found[FOUND_TIME], found[FOUND_ELEMENT] = t, element


@jitable
def note_given(scene: Scene, given: float, t: float, element: int) -> None:
    """Keep what friction gave; beyond the limit time and element stay those of the first.

    What errors of all steps explain is that of the energy balance, at most GIVEN.
    """
    audit, tally, found = scene.audit, scene.audit.tally, scene.audit.found[DRIVES]
    size = max(tally[LARGEST_ENERGY], tally[USUAL_ENERGY])
    errors = tally[ERRORS_ALL] + audit.plan[AUDIT_TOL] * math.sqrt(tally[STEPS_ALL])
    allowed = size * min(errors, GIVEN)
    if not found[FOUND_VALUE] > DRIVES_LIMIT * found[FOUND_ALLOWED]:
        note(scene, DRIVES, given, allowed, t, element)
        return
    most = max(found[FOUND_VALUE], DRIVES_LIMIT * allowed)
    if found[FOUND_ELEMENT] == element and given > most:
        found[FOUND_VALUE], found[FOUND_ALLOWED] = given, allowed


@jitable
def hardest(scene: Scene) -> int:
    """Return the contact that presses hardest, their number for none."""
    hit, largest, found = scene.work.hit, 0.0, len(scene.contacts.id)
    for k in range(hit[len(hit) - 1]):
        force = scene.work.slot[hit[k], NORMAL]
        if force >= largest:
            largest, found = force, contact_of(scene, hit[k])
    return found


@jitable
def examine_energy(scene: Scene, t: float, y: F1, steps: float, local: float) -> None:
    """Compare the energy with what it was; `local` is the sum of local errors of those steps."""
    audit, tally, energy = scene.audit, scene.audit.tally, scene.audit.energy
    fill_energy(scene, y, energy)
    total = energy[KINETIC] + energy[POTENTIAL] + energy[DISSIPATED] - energy[WORK_OF_MOTIONS]
    none = contact = len(scene.contacts.id)
    if scene.world.hooks[Hook.CONTACTS] != 0:
        contacts = scene.world.hooks[Hook.CONTACTS]
        contact = answer_of(scene, call_int(contacts, (scene, Contacts.HARDEST, t, 0.0, y, y)))
    if tally[ANEW] == 1.0:
        tally[CLOSED_AT] = total - tally[OPEN_BY]
        tally[POTENTIAL_FIRST], tally[DISSIPATED_FIRST] = energy[POTENTIAL], energy[DISSIPATED]
        tally[WORK_FIRST] = energy[WORK_OF_MOTIONS]
        tally[CONTACT_THEN] = contact
        return
    tally[LARGEST_ENERGY] = max(
        max(tally[LARGEST_ENERGY], energy[KINETIC]),
        max(
            abs(energy[POTENTIAL] - tally[POTENTIAL_FIRST]),
            max(
                abs(energy[DISSIPATED] - tally[DISSIPATED_FIRST]),
                abs(energy[WORK_OF_MOTIONS] - tally[WORK_FIRST]),
            ),
        ),
    )
    open_by = total - tally[CLOSED_AT]
    change = open_by - tally[OPEN_BY]
    size = max(tally[LARGEST_ENERGY], tally[USUAL_ENERGY])
    rounding = ROUNDING * (
        energy[KINETIC]
        + abs(energy[POTENTIAL])
        + abs(energy[DISSIPATED])
        + abs(energy[WORK_OF_MOTIONS])
    )
    # a contact that ended since counts still
    who = contact if contact < none else int(tally[CONTACT_THEN])
    tol = audit.plan[AUDIT_TOL]
    note(scene, ENERGY_STEP, abs(change), size * (local + steps * tol) + rounding, t, who)
    errors = tally[ERRORS_ALL] + tol * math.sqrt(tally[STEPS_ALL])
    rounding *= math.sqrt(tally[STEPS_ALL])
    note(scene, ENERGY, abs(open_by), size * errors + rounding, t, who)
    row = audit.contact[who]
    row[CHANGE] += change
    if abs(change) > abs(row[LARGEST_CHANGE]):
        row[LARGEST_CHANGE], row[CHANGED_AT] = change, t
    if abs(open_by) > abs(tally[WORST_OPEN]):
        tally[WORST_OPEN], tally[WORST_TIME] = open_by, t
    tally[OPEN_BY], tally[CONTACT_THEN] = open_by, contact


@jitable
def mark_touched(scene: Scene) -> None:
    """Mark the groups of bodies that ground touches."""
    sums, hit, graphics, nb = (
        scene.audit.sums,
        scene.work.hit,
        scene.graphics,
        len(scene.bodies.mass),
    )
    for k in range(hit[len(hit) - 1]):
        gi, gj = sides(scene, hit[k])
        bi, bj = graphics.body[gi], graphics.body[gj]
        if bi == nb and bj < nb:
            sums[scene.scales.group[bj], SPINS + 1] = 1.0
        elif bj == nb and bi < nb:
            sums[scene.scales.group[bi], SPINS + 1] = 1.0


@jitable
def add_asleep(scene: Scene, y: F1) -> None:
    """Add what sleeps to the sums of momentum: it has none but from where its group looks at it."""
    audit, sums = scene.audit, scene.audit.sums
    for g in range(len(sums)):
        rest, row = scene.awake.rest[g], sums[g]
        m, first = rest[REST_MASS], BODY_SIZE * audit.first[g]
        if audit.tied[g] == 1 or m == 0.0:
            continue
        d = sub(vector(rest[REST_CENTRE:]), (y[first], y[first + 1], y[first + 2]))
        u = (-y[first + 7], -y[first + 8], -y[first + 9])
        turn = scale(m, cross(d, u))
        row[MASS] += m
        for k in range(3):
            row[SHIFT + k] += m * d[k]
            row[FLOW + k] += m * u[k]
            row[TURN + k] += turn[k]
        row[SPEEDS] += m * norm(u)
        row[SPINS] += (m * norm(d) + rest[REST_SPREAD]) * norm(u)


@jitable
def examine_momentum(scene: Scene, t: float, y: F1, steps: float, local: float) -> None:
    """Compare the momentum of groups that ground does not touch with what their weight gives."""
    audit, bodies, sums = scene.audit, scene.bodies, scene.audit.sums
    for g in range(len(sums)):
        if audit.tied[g] == 0:
            for k in range(sums.shape[1]):
                sums[g, k] = 0.0
    for row_of in range(bodies_awake(scene)):
        b = body_awake(scene, row_of)
        g = scene.scales.group[b]
        if audit.tied[g] == 1:
            continue
        at, first, m, row = BODY_SIZE * b, BODY_SIZE * audit.first[g], bodies.mass[b], sums[g]
        d = (y[at] - y[first], y[at + 1] - y[first + 1], y[at + 2] - y[first + 2])
        u = (y[at + 7] - y[first + 7], y[at + 8] - y[first + 8], y[at + 9] - y[first + 9])
        spin = rotate(bodies.inertia[b], (y[at + 10], y[at + 11], y[at + 12]))
        turn = add(scale(m, cross(d, u)), rotate(scene.work.R[b], spin))
        row[MASS] += m
        for k in range(3):
            row[SHIFT + k] += m * d[k]
            row[FLOW + k] += m * u[k]
            row[TURN + k] += turn[k]
        row[SPEEDS] += m * norm(u)
        row[SPINS] += m * norm(d) * norm(u) + norm(spin)
    if scene.awake.whole[GOES] == LISTED:
        add_asleep(scene, y)
    if scene.world.hooks[Hook.CONTACTS] != 0:
        contacts = scene.world.hooks[Hook.CONTACTS]
        answer_of(scene, call_int(contacts, (scene, Contacts.TOUCHED, t, 0.0, y, y)))
    dt, gravity = t - audit.tally[TIME_THEN], vector(scene.world.gravity)
    errors = local + steps * audit.plan[AUDIT_TOL]
    for g in range(len(sums)):
        if audit.tied[g] == 1:
            continue
        row, then = sums[g], audit.momentum[g]
        length, speed = scene.scales.length[g], math.sqrt(scene.work.squares[g])
        first, m, touched = BODY_SIZE * audit.first[g], row[MASS], row[SPINS + 1]
        v = (y[first + 7], y[first + 8], y[first + 9])
        flow = vector(row[FLOW : FLOW + 3])
        P = add(scale(m, v), flow)
        L = sub(
            vector(row[TURN : TURN + 3]),
            scale(1.0 / m, cross(vector(row[SHIFT : SHIFT + 3]), flow)),
        )
        if then[TOUCHED_THEN] == 0.0 and touched == 0.0 and audit.tally[ANEW] == 0.0:
            missed = sub(sub(P, vector(then[LINEAR:ANGULAR])), scale(m * dt, gravity))
            size = m * norm(v) + row[SPEEDS]
            allowed = errors * (size + m * speed) + ROUNDING * (size + m * dt * norm(gravity))
            note(scene, MOMENTUM, norm(missed), allowed, t, audit.first[g])
            turned = norm(sub(L, vector(then[ANGULAR:TOUCHED_THEN])))
            size = row[SPINS] + m * length * speed
            note(scene, SPIN, turned, errors * size + ROUNDING * size, t, audit.first[g])
        for k in range(3):
            then[LINEAR + k], then[ANGULAR + k] = P[k], L[k]
        then[TOUCHED_THEN] = touched


@jitable
def own_time(scene: Scene, e: int) -> float:
    """Return L/V of the bodies that equation e holds."""
    eq, k = scene.equations, scene.equations.first[e]
    b = scene.markers.body[eq.i[k]]
    if b == len(scene.bodies.mass):
        b = scene.markers.body[eq.j[k]]
    # an expression alone may begin at ground
    g = scene.scales.group[b] if b < len(scene.bodies.mass) else 0
    return scene.scales.length[g] / math.sqrt(scene.work.squares[g])


@jitable
def examine_equations(scene: Scene, t: float) -> None:
    """Look at the residuals of the equations in use, and at what slips although it is held."""
    eq, sweep = scene.equations, scene.sweep
    allowed = scene.audit.plan[AUDIT_TOL] + CLOSED
    for r in range(active_count(scene)):
        e = eq.active[r]
        rate = abs(sweep.rate[e, MISMATCH]) / eq.unit[e] * own_time(scene, e)
        if is_friction(scene, e):
            note(scene, STICKING_SLIP, rate, allowed, t, e)
            continue
        if not is_sticking(scene, e, t):
            continue
        if eq.level[e] == 2:
            note(scene, POSITION, abs(sweep.rate[e, RESIDUAL]) / eq.unit[e], allowed, t, e)
        if eq.level[e] >= 1:
            note(scene, VELOCITY, rate, allowed, t, e)


@jitable
def examine_fold(scene: Scene, t: float) -> None:
    """Look at how far velocities were off when a fold was left behind."""
    quality, tol = scene.sweep.quality, scene.audit.plan[AUDIT_TOL]
    count = 0
    for e in range(len(scene.sweep.released)):
        count += scene.sweep.released[e]
    note(scene, FOLD, quality[FOLD_OFF], tol + PASSED * count, t, int(quality[FOLD_AT]))


@jitable
def examine_friction(scene: Scene, t: float, y: F1) -> None:
    """Look whether friction is within its cone at every incident."""
    audit, work, hit = scene.audit, scene.work, scene.work.hit
    if scene.world.hooks[Hook.STICKING] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.STICKING], (scene, Sticking.LIMIT, t, y)))
    for k in range(hit[len(hit) - 1]):
        s = hit[k]
        c = contact_of(scene, s)
        if audit.cone[c] == math.inf:
            continue
        force, n = vector(work.slot[s, FORCE : FORCE + 3]), vector(work.points[s, AT_NORMAL:])
        normal = dot(force, n)
        tangential = norm(sub(force, scale(normal, n)))
        most = audit.cone[c] * max(0.0, pressing(scene, s))
        if scene.contacts.rigid[c] == 1:
            most = max(most, work.slot[s, HELD_AT_LEAST])
        row = audit.contact[c]
        row[LARGEST_FRICTION] = max(row[LARGEST_FRICTION], most)
        if tangential > most + CONE_ROUNDING * abs(normal):
            beyond = (tangential - most) / max(row[LARGEST_FRICTION], tangential)
            note(scene, CONE, beyond, audit.plan[AUDIT_TOL], t, c)


@jitable
def examine_work(scene: Scene, t: float, y: F1) -> None:
    """Look whether friction of a contact gave more than it took."""
    audit, hit = scene.audit, scene.work.hit
    for c in range(len(audit.friction)):
        audit.friction[c, TOUCHED_NOW] = 0.0
    for k in range(hit[len(hit) - 1]):
        audit.friction[contact_of(scene, hit[k]), TOUCHED_NOW] = 1.0
    for c in range(len(audit.friction)):
        row = audit.friction[c]
        if audit.friction_at[c] < 0:
            continue
        row[WORK_NOW] = y[audit.friction_at[c]]
        note_given(scene, max(0.0, row[WORK_NOW] - row[WORK_THEN]), t, c)
        if audit.keeps[c] == 0 or row[TOUCHED_NOW] == 0.0:
            row[WORK_THEN] = min(row[WORK_THEN], row[WORK_NOW])


@jitable
def examine_applied(scene: Scene, t: float) -> None:
    """Look whether friction in a joint gives, or dry friction beyond what its spring stores."""
    given = scene.audit.given
    for f in range(len(given)):
        if scene.audit.resists[f] == 1:
            power = -scene.work.applied[f, LOST_POWER]
            given[f] += max(0.0, power) * (t - scene.audit.tally[TIME_THEN])
            note_given(scene, given[f], t, len(scene.contacts.id) + f)


@jitable
def examine(scene: Scene, t: float, h: float, y: F1) -> None:
    """Take a sample at an accepted step that is due for one; of no length, h = 0, begin anew."""
    audit, tally = scene.audit, scene.audit.tally
    hits = scene.work.hit[len(scene.work.hit) - 1]
    if h == 0.0:
        tally[ANEW] = 1.0
    else:
        tally[STEPS_SINCE] += 1.0
        tally[ERRORS_SINCE] += tally[ERROR_NOW]
        due = tally[STEPS_SINCE] >= audit.plan[AUDIT_EVERY]
        due = due or t + 1e-9 * h >= audit.plan[AUDIT_UNTIL]
        if not due and (hits == tally[HITS_THEN] or len(scene.bodies.mass) > FEW):
            return
    steps, local = tally[STEPS_SINCE], tally[ERRORS_SINCE]
    tally[STEPS_ALL] += steps
    tally[ERRORS_ALL] += local
    tally[STEPS_SINCE] = tally[ERRORS_SINCE] = 0.0
    fill_squares(scene, y)
    for g in range(len(scene.work.squares)):
        energy = scene.scales.mass[g] * scene.work.squares[g]
        tally[USUAL_ENERGY] = max(tally[USUAL_ENERGY], energy)
    examine_energy(scene, t, y, steps, local)
    examine_momentum(scene, t, y, steps, local)
    if tally[ANEW] == 0.0:
        examine_applied(scene, t)
        if scene.world.hooks[Hook.JOINTS] != 0:
            joints = scene.world.hooks[Hook.JOINTS]
            note_failure(scene, call_int(joints, (scene, Joints.AUDIT, t, y, y)))
        if scene.world.hooks[Hook.CONTACTS] != 0:
            contacts = scene.world.hooks[Hook.CONTACTS]
            answer_of(scene, call_int(contacts, (scene, Contacts.CONE, t, h, y, y)))
    tally[HITS_THEN], tally[TIME_THEN], tally[ANEW] = hits, t, 0.0
