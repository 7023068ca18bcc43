"""What contacts add to the stability bound of a step: see `stability`."""

from __future__ import annotations

import math

from mbsim.arrays.codes import (
    ACTIVE,
    BEST_CONTACT,
    BEST_ENERGY,
    BEST_FORCE,
    BEST_INVERSE,
    CENTRE_ACCELERATION,
    FASTEST_POINT,
    HIGHEST_DAMPING,
    HIGHEST_FRICTION,
    HIGHEST_SQUARE,
    SCALE_LENGTH,
    SCALE_SPEED,
)
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import F1, V2
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm, rotate, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.contact.detection import find_contacts
from mbsim.dynamics.contact.forces import (
    contact_of,
    face_weight_of,
    gain_of,
    sides,
    stands_for_points,
    velocity_at,
)
from mbsim.dynamics.contact.points import deepest_of_impact
from mbsim.dynamics.events.stability import add_to_block, translation, yielding
from mbsim.dynamics.events.step_limits import longest_travel
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    MOMENT_XX,
    MOMENT_YY,
    REGION_ROWS,
    STIFF_XX,
    STIFF_YY,
    plane_axes,
)
from mbsim.laws.abi import ELASTIC, ENERGY, FORCE_X_OUT, LOAD, NFORCE_IN, XDOT_IN

#: Part of a contact's stored energy that motion and push may add and it still counts as at rest.
AT_REST = 0.1
#: Part of the slip that is left at least in `STABLE_EVERY` steps, each of which takes up to a
#: quarter of what is left: 1/(1 + 16/4).
LEFT = 0.2
#: Slip below which friction is not followed, as a part of the scale of speeds.
SLOW = 1e-5
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
def add_points(scene: Scene, y: F1, s: int, b: int, k: float, damping: float) -> None:
    """Add the points that slot s stands for to the block of body b, each with its weight."""
    rows = scene.work.points
    first = s + REGION_ROWS
    for row in range(first, s + scene.kinds.step[scene.pairs.kind[scene.slots.pair[s]]]):
        if rows[row, AT_DEPTH] > 0.0:
            p, n, weight = (
                vector(rows[row, AT_POINT:]),
                vector(rows[row, AT_NORMAL:]),
                rows[row, AT_WEIGHT],
            )
            turn = yielding(scene, b, sub(p, position(scene, y, b)), n)
            add_to_block(scene.work.block[b], n, weight * k, weight * damping, turn)


@jitable
def note_friction(scene: Scene, y: F1, s: int, normal: float, out: F1) -> None:
    """Raise the rate of friction to that of slot s [1/T], where its law is built in.

    The slope is that from rest to the slip that is left until steps are found anew; `normal` is the
    force that will press.
    """
    contacts, work, given = scene.contacts, scene.work, scene.work.law_in
    c = contact_of(scene, s)
    if contacts.friction_law[c] == 0 or contacts.framed[c] == 1 or contacts.interpreted[c] == 1:
        return
    p, n = vector(work.points[s, AT_POINT:]), vector(work.points[s, AT_NORMAL:])
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    # not that of the slot: what was evaluated last may be another point
    slip = sub(velocity_at(scene, y, bi, p), velocity_at(scene, y, bj, p))
    speed = LEFT * norm(sub(slip, scale(dot(slip, n), n)))
    for k in range(len(given)):
        given[k] = 0.0
    given[XDOT_IN], given[NFORCE_IN] = speed, normal
    call = (contacts.id[c], given, contacts.friction_par[c], out)
    if call_int(contacts.friction_law[c], call) != 0:
        return
    # what rolls has next to no friction, and what is held back of that counts for nothing
    slope = abs(out[FORCE_X_OUT]) / max(speed, SLOW * scene.world.scale[SCALE_SPEED])
    u, v = plane_axes(n)
    answer = 0.0
    for b in (bi, bj):
        if b < len(scene.bodies.mass):
            arm = sub(p, position(scene, y, b))
            answer += max(yielding(scene, b, arm, u), yielding(scene, b, arm, v))
            answer += translation(scene, b)
    work.bound[HIGHEST_FRICTION] = max(work.bound[HIGHEST_FRICTION], slope * answer)


@jitable
def add_touching(scene: Scene, y: F1, s: int, out: F1) -> None:
    """Add stiffness and damping of slot s to the blocks of its bodies."""
    work, bodies, state = scene.work, scene.bodies, scene.state
    point = work.points[s]
    c, depth, weight = contact_of(scene, s), point[AT_DEPTH], point[AT_WEIGHT]
    weight *= gain_of(scene, s) ** 2
    p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    ground = len(bodies.mass)
    rate = state.rate[s] if state.touching[s] == 1 else 0.0
    inverse = translation(scene, bi) + translation(scene, bj)
    kinetic = 0.5 * rate * rate / (weight * inverse)
    push = work.speed[gi, CENTRE_ACCELERATION] + work.speed[gj, CENTRE_ACCELERATION]
    force = push / (weight * inverse)
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
        if stands_for_points(scene, s):
            add_points(scene, y, s, b, both * k / weight, both * damping / weight)
            continue
        turn = yielding(scene, b, sub(p, position(scene, y, b)), n)
        if face_weight_of(scene, s) > 0.0:
            # tilting about the centre of a patch
            numbers = work.points[s + 1]
            moments = numbers[MOMENT_XX] + numbers[MOMENT_YY]
            # of corners that are held, those are larger
            own = gain_of(scene, s) * point[AT_DEPTH] * (numbers[STIFF_XX] + numbers[STIFF_YY])
            moments = max(moments, own)
            inverse = bodies.inverse[b]
            turn += moments / weight * (inverse[0, 0] + inverse[1, 1] + inverse[2, 2])
        add_to_block(work.block[b], n, both * k, both * damping, turn)
    call_int(scene.contacts.normal_law[c], (depth, 0.0, scene.contacts.normal_par[c], out))
    note_friction(scene, y, s, weight * out[ELASTIC], out)


@jitable
def fast_pair(scene: Scene, pair: int, best: F1) -> bool:
    """Return whether a pair that may come to touch can be stiffer than the one in `best`.

    If so `best` becomes it: contact, its energy at touch, the force behind it, inverse mass.
    """
    pairs, graphics = scene.pairs, scene.graphics
    i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
    speed = scene.work.speed[i, FASTEST_POINT] + scene.work.speed[j, FASTEST_POINT]
    push = scene.work.speed[i, CENTRE_ACCELERATION] + scene.work.speed[j, CENTRE_ACCELERATION]
    inverse = translation(scene, graphics.body[i]) + translation(scene, graphics.body[j])
    if inverse == 0.0 or speed + push == 0.0:
        return False
    c = float(scene.kinds.contact[pairs.kind[pair]])
    force = push / inverse
    energy = 0.5 * speed * speed / inverse + force * max(0.0, pairs.left[pair])
    inverse += turning(scene, i) + turning(scene, j)
    if scene.kinds.pressure[pairs.kind[pair]] == 1:
        # per area: a patch is no larger than the smaller shape
        area = math.pi * min(graphics.radius[i], graphics.radius[j]) ** 2
        energy, force, inverse = energy / area, force / area, inverse * area
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
    bound[HIGHEST_SQUARE] = max(bound[HIGHEST_SQUARE], k * inverse)
    bound[HIGHEST_DAMPING] = max(bound[HIGHEST_DAMPING], damping * inverse)


@jitable
def add_all_touching(scene: Scene, y: F1, f: F1) -> float:
    """Add what touches at y to the blocks of bodies; return the step that lets none through.

    Less than 0 where they are not found.
    """
    if find_contacts(scene, y) != 0:
        return -1.0
    hit, longest = scene.work.hit, longest_travel(scene, y, f, 0.0)
    for k in range(hit[len(hit) - 1]):
        add_touching(scene, y, hit[k], scene.work.law_out)
    return longest


@jitable
def add_all_meeting(scene: Scene) -> None:
    """Raise the bounds to those of pairs that may come to touch."""
    work, pairs = scene.work, scene.pairs
    work.best[BEST_CONTACT] = -1.0
    for k in range(pairs.count[ACTIVE]):
        if pairs.touches[pairs.active[k]] == 0 and fast_pair(scene, pairs.active[k], work.best):
            add_meeting(scene, work.best, work.law_out, work.bound)
