"""How long a step of a method without error estimate may be: its stability bound.

With K = sum over contacts of B' k B and each contact between two bodies, the largest eigenvalue
of M^-1 K is at most twice the largest of the blocks of single bodies, D_b / m_b with
D_b = sum of k n n' (a contact with ground counts half, and |D_b| is bounded by its Frobenius
norm), plus the turning part, k (r x n)' I^-1 (r x n) summed. Dampers, with the slope c of their
force over velocity, give rates in the same way. A contact that is yet to come, or that has
only begun, counts with the stiffness and damping of the depth that it will reach. Springs
between markers count like contacts; forces by expressions are refused with such a method.

A body that turns bounds the step by itself. With w of the middle of a step of velocity Verlet the
rotation is off by (w h)^3 / 12 a step where w turns as fast as the body, by the part of I that is
not isotropic where that is small. And the cubic polynomial of its quaternion over the step
is off by (w h / 2)^4 / 384, whatever the inertia.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ACTIVE,
    AXIS_TORQUE,
    BEST_CONTACT,
    BEST_ENERGY,
    BEST_FORCE,
    BEST_INVERSE,
    BOUND_DAMPING,
    BOUND_FORCE,
    BOUND_STIFFNESS,
    BOUND_TURNING,
    BOUND_TURNING_DAMPING,
    REST,
    SCALE_LENGTH,
    SCALE_SPEED,
    WRENCH,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot, norm, rotate, scale, sub, unrotate, vector
from mbsim.dynamics.bodies.kinematics import place_bodies, position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point
from mbsim.dynamics.contact.detection import find_contacts
from mbsim.dynamics.contact.forces import contact_of, face_weight_of, sides
from mbsim.dynamics.contact.points import deepest_of_impact
from mbsim.dynamics.events.step_limits import longest_travel
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT, REGION_ROWS
from mbsim.laws.abi import ELASTIC, ENERGY, LOAD

#: Tolerance at which the step is half of the stability bound of an undamped vibration.
COARSE = 1e-3
#: Largest step over half of the bound; the bound is below the true limit.
LARGEST_PART = 1.8
#: Part of a contact's stored energy that motion and push may add and it still counts as at rest.
AT_REST = 0.1
#: Substitutions that find the depth of an impact under a force to a few per cent.
SUBSTITUTIONS = 6


@jitable
def slopes(scene: Scene, c: int, depth: float, out: F1) -> V2:
    """Return stiffness dF/dd and damping dF/dd' of contact c's law at a depth."""
    contacts, speed = scene.contacts, scene.world.scale[SCALE_SPEED]
    call_int(contacts.normal_law[c], (depth, speed, contacts.normal_par[c], out))
    here, damping = out[ELASTIC], (out[LOAD] - out[ELASTIC]) / speed
    call_int(contacts.normal_law[c], (1.001 * depth, 0.0, contacts.normal_par[c], out))
    return max(0.0, (out[ELASTIC] - here) / (0.001 * depth)), max(0.0, damping)


@jitable
def yielding(scene: Scene, b: int, arm: V3, n: V3) -> float:
    """Return n' J I^-1 J' n: how a unit force along n at `arm` from body b's cg turns the point."""
    turning = unrotate(scene.work.R[b], cross(arm, n))
    return dot(turning, rotate(scene.bodies.inverse[b], turning))


@jitable
def translation(scene: Scene, b: int) -> float:
    """Return 1/m of body b, 0 for ground."""
    return 1.0 / scene.bodies.mass[b] if b < len(scene.bodies.mass) else 0.0


@jitable
def turning(scene: Scene, g: int) -> float:
    """Return a bound of n' J I^-1 J' n for a touch anywhere on graphic g: ground and planes 0.

    With the box half edges a (from the cg) and D = I^-1 in its axes (r x n)' D (r x n) is at most
    the two largest of D_k (a_i^2 + a_j^2), as the three (n_i^2 + n_j^2) are at most 1
    and 2 together; products of inertia are left out.
    """
    graphics, b = scene.graphics, scene.graphics.body[g]
    if b == len(scene.bodies.mass) or math.isinf(graphics.radius[g]):
        return 0.0
    R, p, inverse = graphics.R[g], graphics.p[g], scene.bodies.inverse[b]
    is_round = graphics.turns[g] == 0
    if is_round and p[0] == 0.0 and p[1] == 0.0 and p[2] == 0.0:
        return 0.0
    square = (0.0, 0.0, 0.0)
    for k in range(3):
        # a sphere's surface has its normal through the centre
        a = abs(p[0] * R[0, k] + p[1] * R[1, k] + p[2] * R[2, k])
        a += 0.0 if is_round else graphics.half[g, k]
        square = (square[1], square[2], a * a)
    total, least = 0.0, math.inf
    for k in range(3):
        column = (R[0, k], R[1, k], R[2, k])
        part = dot(column, rotate(inverse, column)) * (
            square[0] + square[1] + square[2] - square[k]
        )
        total += part
        least = min(least, part)
    return total - least


@jitable
def depth_to_come(scene: Scene, c: int, energy: float, force: float) -> float:
    """Return the depth at which contact c has stored an impact's energy and what `force` adds.

    E(d) = energy + force d, by repeated substitution: of a power law of exponent e an error
    shrinks by 1/(e + 1) each time.
    """
    # without an impact something has to begin the substitution
    depth = 1e-4 * scene.world.scale[SCALE_LENGTH]
    for _ in range(SUBSTITUTIONS if force > 0.0 else 1):
        depth = deepest_of_impact(scene, c, energy + force * depth)
    return depth


@jitable
def add_to_block(block: F1, n: V3, stiffness: float, damping: float, turn: float) -> None:
    """Add stiffness and damping along n to the block of a body; `turn`: see `yielding`."""
    for r in range(3):
        for q in range(3):
            block[3 * r + q] += stiffness * n[r] * n[q]
            block[10 + 3 * r + q] += damping * n[r] * n[q]
    block[9] += stiffness * turn
    block[19] += damping * turn


@jitable
def add_points(scene: Scene, y: F1, s: int, b: int, k: float, damping: float) -> None:
    """Add the points that slot s stands for to the block of body b, each with its weight."""
    rows = scene.work.points
    first = s + REGION_ROWS
    for row in range(first, s + scene.kinds.slots[scene.pairs.kind[scene.slots.pair[s]]]):
        if rows[row, AT_DEPTH] > 0.0:
            p, n, weight = (
                vector(rows[row, AT_POINT:]),
                vector(rows[row, AT_NORMAL:]),
                rows[row, AT_WEIGHT],
            )
            turn = yielding(scene, b, sub(p, position(scene, y, b)), n)
            add_to_block(scene.work.block[b], n, weight * k, weight * damping, turn)


@jitable
def add_touching(scene: Scene, y: F1, s: int, out: F1) -> None:
    """Add stiffness and damping of slot s to the blocks of its bodies."""
    work, bodies, state = scene.work, scene.bodies, scene.state
    point = work.points[s]
    c, depth, weight = contact_of(scene, s), point[AT_DEPTH], point[AT_WEIGHT]
    p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    ground = len(bodies.mass)
    rate = state.rate[s] if state.touching[s] == 1 else 0.0
    inverse = translation(scene, bi) + translation(scene, bj)
    kinetic = 0.5 * rate * rate / (weight * inverse)
    force = (work.speed[gi, 1] + work.speed[gj, 1]) / (weight * inverse)
    call_int(scene.contacts.normal_law[c], (depth, 0.0, scene.contacts.normal_par[c], out))
    if kinetic + force * depth > AT_REST * out[ENERGY]:
        energy = max(0.0, out[ENERGY] + kinetic - force * depth)
        depth = max(depth, depth_to_come(scene, c, energy, force))
    k, damping = slopes(scene, c, depth, out)
    k *= weight
    damping *= weight
    both = 2.0 if bi < ground and bj < ground else 1.0
    for b in (bi, bj):
        if b == ground:
            continue
        if face_weight_of(scene, s) > 0.0:
            add_points(scene, y, s, b, both * k / weight, both * damping / weight)
            continue
        turn = yielding(scene, b, sub(p, position(scene, y, b)), n)
        add_to_block(work.block[b], n, both * k, both * damping, turn)


@jitable
def add_wrench(scene: Scene, y: F1, f: int) -> None:
    """Add the largest stiffness and damping of wrench f, along every axis and about it.

    Both bodies are pushed at I's origin P, so arms go there. A turn of body b moves P by its
    arm, and turns the axes along which a force that already acts does: arm times
    force, as much again where J's axes turn with b.
    """
    applied, markers, ground = scene.applied, scene.markers, len(scene.bodies.mass)
    i, j, bound = applied.i[f], applied.j[f], applied.bound[f]
    both = 2.0 if markers.body[i] < ground and markers.body[j] < ground else 1.0
    k, c = bound[BOUND_STIFFNESS], bound[BOUND_DAMPING]
    turn_k, turn_c = bound[BOUND_TURNING], bound[BOUND_TURNING_DAMPING]
    at = marker_point(scene, y, i)
    stretch = sub(at, marker_point(scene, y, j))
    for axis in range(3):
        stretch = sub(stretch, scale(bound[REST + axis], marker_axis(scene, j, axis)))
    force = k * norm(stretch) + bound[BOUND_FORCE]
    for side in range(2):
        m = i if side == 0 else j
        b = markers.body[m]
        if b == ground:
            continue
        block, inverse = scene.work.block[b], scene.bodies.inverse[b]
        arm = sub(at, position(scene, y, b))
        square, bent = dot(arm, arm), 2.0 * norm(arm) * force
        most = inverse[0, 0] + inverse[1, 1] + inverse[2, 2]
        for r in range(3):
            block[4 * r] += both * k
            block[10 + 4 * r] += both * c
        block[9] += both * (k * square + turn_k + bent) * most
        block[19] += both * (c * square + turn_c) * most


@jitable
def add_spring(scene: Scene, y: F1, f: int) -> None:
    """Add stiffness and damping of spring f to the blocks of its bodies.

    Along the line of a spring at distance d acts k, across it F/d, and an arm r turns with the
    torque F r. Stiffness across and by F is bounded by what the smallest moment of inertia gives.
    """
    applied, markers, ground = scene.applied, scene.markers, len(scene.bodies.mass)
    if applied.form[f] == WRENCH:
        add_wrench(scene, y, f)
        return
    i, j, bound = applied.i[f], applied.j[f], applied.bound[f]
    both = 2.0 if markers.body[i] < ground and markers.body[j] < ground else 1.0
    k, damping = both * bound[BOUND_STIFFNESS], both * bound[BOUND_DAMPING]
    line = sub(marker_point(scene, y, i), marker_point(scene, y, j))
    d = norm(line)
    n = scale(1.0 / d, line) if d > 0.0 else (0.0, 0.0, 0.0)
    pull = bound[BOUND_FORCE] - bound[BOUND_STIFFNESS] * (d - bound[REST])
    force = abs(pull) if d > 0.0 else 0.0
    for side in range(2):
        m = i if side == 0 else j
        b = markers.body[m]
        if b == ground:
            continue
        block, inverse = scene.work.block[b], scene.bodies.inverse[b]
        if applied.form[f] == AXIS_TORQUE:
            axis = unrotate(scene.work.R[b], marker_axis(scene, j, 2))
            turn = dot(axis, rotate(inverse, axis))
            block[9] += k * turn
            block[19] += damping * turn
            continue
        arm = marker_arm(scene, m)
        add_to_block(block, n, k, damping, yielding(scene, b, arm, n))
        if d > 0.0:
            across, length = both * force / d, norm(arm)
            for r in range(3):
                block[4 * r] += across
            most = inverse[0, 0] + inverse[1, 1] + inverse[2, 2]
            block[9] += (across * length * length + both * force * length) * most


@jitable
def fast_pair(scene: Scene, pair: int, best: F1) -> bool:
    """Return whether a pair that may come to touch can be stiffer than the one in `best`.

    If so `best` becomes it: contact, its energy at touch, the force behind it, inverse mass.
    """
    pairs, graphics = scene.pairs, scene.graphics
    i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
    speed = scene.work.speed[i, 0] + scene.work.speed[j, 0]
    push = scene.work.speed[i, 1] + scene.work.speed[j, 1]
    inverse = translation(scene, graphics.body[i]) + translation(scene, graphics.body[j])
    if inverse == 0.0 or speed + push == 0.0:
        return False
    c = float(scene.kinds.contact[pairs.kind[pair]])
    force = push / inverse
    energy = 0.5 * speed * speed / inverse + force * max(0.0, pairs.left[pair])
    inverse += turning(scene, i) + turning(scene, j)
    if (
        c == best[BEST_CONTACT]
        and energy <= best[BEST_ENERGY]
        and force <= best[BEST_FORCE]
        and inverse <= best[BEST_INVERSE]
    ):
        return False
    best[BEST_CONTACT], best[BEST_ENERGY] = c, energy
    best[BEST_FORCE], best[BEST_INVERSE] = force, inverse
    return True


@jitable
def add_meeting(scene: Scene, best: F1, out: F1, bound: F1) -> None:
    """Raise the squared frequency and the rate in `bound` to those of the pair in `best`."""
    c, inverse = int(best[BEST_CONTACT]), best[BEST_INVERSE]
    depth = depth_to_come(scene, c, best[BEST_ENERGY], best[BEST_FORCE])
    k, damping = slopes(scene, c, depth, out)
    bound[0] = max(bound[0], k * inverse)
    bound[1] = max(bound[1], damping * inverse)


@jitable
def anisotropy(inertia: F2) -> float:
    """Return |I - E tr I / 3| over tr I / 3 (Frobenius): 0 of a ball, 1.22 of a thin rod."""
    mean = (inertia[0, 0] + inertia[1, 1] + inertia[2, 2]) / 3.0
    square = 0.0
    for r in range(3):
        for q in range(3):
            part = inertia[r, q] - (mean if r == q else 0.0)
            square += part * part
    return math.sqrt(square) / mean


@jitable
def turning_step(scene: Scene, tol: float) -> float:
    """Return the step over which the rotation of every body, as placed, is good to `tol`."""
    bodies, longest = scene.bodies, math.inf
    # (angle / 2)^4 / 384 = tol
    drawn = 2.0 * math.sqrt(math.sqrt(384.0 * tol))
    for b in range(len(bodies.mass)):
        w = scene.work.w[b]
        speed = norm((w[0], w[1], w[2]))
        if speed == 0.0:
            continue
        # angle^2 / 12 = tol
        uneven = anisotropy(bodies.inertia[b])
        angle = math.sqrt(12.0 * tol / uneven) if uneven > 0.0 else math.inf
        longest = min(longest, min(angle, drawn) / speed)
    return longest


@jitable
def stable_step(scene: Scene, tol: float, y: F1, f: F1) -> float:
    """Return the step that a method without error estimate is to take from the committed point."""
    work, bodies, pairs = scene.work, scene.bodies, scene.pairs
    # what was evaluated last may be another point: an output within the step, or nothing yet
    place_bodies(scene, y)
    if find_contacts(scene, y) != 0:
        return math.inf
    longest = min(longest_travel(scene, y, f, 0.0), turning_step(scene, tol))
    for b in range(len(bodies.mass)):
        for k in range(20):
            work.block[b, k] = 0.0
    hit = work.hit
    for k in range(hit[len(hit) - 1]):
        add_touching(scene, y, hit[k], work.law_out)
    for k in range(len(scene.applied.form)):
        add_spring(scene, y, k)
    bound, best = work.bound, work.best
    bound[0] = bound[1] = 0.0
    for b in range(len(bodies.mass)):
        block, stiff, damped = work.block[b], 0.0, 0.0
        for k in range(9):
            stiff += block[k] * block[k]
            damped += block[10 + k] * block[10 + k]
        bound[0] = max(bound[0], math.sqrt(stiff) / bodies.mass[b] + block[9])
        bound[1] = max(bound[1], math.sqrt(damped) / bodies.mass[b] + block[19])
    best[BEST_CONTACT] = -1.0
    for k in range(pairs.count[ACTIVE]):
        if pairs.touches[pairs.active[k]] == 0 and fast_pair(scene, pairs.active[k], best):
            add_meeting(scene, best, work.law_out, bound)

    # the limit of the method is (h w)^2 / 4 + h c = 1 (w frequency, c rate of damping), so h =
    # 2 / (c + sqrt(c^2 + w^2)); order 2 needs the root of the tolerance. Friction is held back
    # instead (`contact.hold_back`)
    part = min(LARGEST_PART, math.sqrt(tol / COARSE))
    fastest = bound[1] + math.sqrt(bound[1] * bound[1] + bound[0])
    return min(longest, part / fastest) if fastest > 0.0 else longest
