"""How long a step of a method without error estimate may be: its stability bound.

With K = sum over contacts of B' k B and each contact between two bodies, the largest eigenvalue
of M^-1 K is at most twice the largest of the blocks of single bodies, D_b / m_b with
D_b = sum of k n n' (a contact with ground counts half, and |D_b| is bounded by its Frobenius
norm). Dampers and friction, with the slope c of their force over velocity, give rates in the same
way. A contact that is yet to come counts with the stiffness it reaches at its closing speed.
"""

from __future__ import annotations

import math

from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.problem import STABLE_EVERY
from mbsim.core.rotation import dot, norm, scale, sub, vector
from mbsim.dynamics.contact import DEPTH, FORCE, NORMAL, SLIP, sides
from mbsim.dynamics.incidents import deepest_of_impact
from mbsim.dynamics.limits import longest_stay, time_for
from mbsim.system.arrays import LIVE

#: Tolerance at which the step is half of the stability bound of an undamped vibration.
COARSE = 1e-3
#: Largest h w; the bound of w is above the true one.
LARGEST_PART = 1.6


@jitable
def slopes(scene, c, depth, out):
    """Return stiffness dF/dd and damping dF/dd' of contact c's law at a depth."""
    contacts, speed = scene.contacts, scene.world.scale[1]
    call_int(contacts.normal_law[c], (depth, speed, contacts.normal_par[c], out))
    here, damping = out[1], (out[0] - out[1]) / speed
    call_int(contacts.normal_law[c], (1.001 * depth, 0.0, contacts.normal_par[c], out))
    return max(0.0, (out[1] - here) / (0.001 * depth)), max(0.0, damping)


@jitable
def add_touching(scene, s, out):
    """Add stiffness and damping of slot s to the blocks of its bodies."""
    work, bodies = scene.work, scene.bodies
    row, point = work.slot[s], work.points[s]
    c = scene.kinds.contact[scene.pairs.kind[scene.slots.pair[s]]]
    k, damping = slopes(scene, c, row[DEPTH], out)
    k *= point[7]
    damping *= point[7]
    n = (point[4], point[5], point[6])
    gi, gj = sides(scene, s)
    bi, bj = scene.graphics.body[gi], scene.graphics.body[gj]
    ground = len(bodies.mass)
    both = 2.0 if bi < ground and bj < ground else 1.0
    rubbing = 0.0
    if row[SLIP] > 0.0:
        force = (row[FORCE], row[FORCE + 1], row[FORCE + 2])
        rubbing = norm(sub(force, scale(row[NORMAL], n))) / row[SLIP]
    for g in (gi, gj):
        b = scene.graphics.body[g]
        if b == ground:
            continue
        block = work.block[b]
        for r in range(3):
            for q in range(3):
                block[3 * r + q] += both * k * n[r] * n[q]
        arm = sub((point[1], point[2], point[3]), vector(scene.work.frames[g]))
        arm = sub(arm, scale(dot(arm, n), n))
        lever = scene.graphics.reach[g] if scene.graphics.reach[g] < math.inf else norm(arm)
        least = least_inertia(bodies.inertia[b])
        turning = bodies.mass[b] * lever * lever / least
        block[9] += both * (damping + rubbing * (1.0 + turning))


@jitable
def least_inertia(inertia):
    """Return a lower bound of the smallest principal moment of inertia."""
    low = math.inf
    for r in range(3):
        off = 0.0
        for q in range(3):
            off += abs(inertia[r, q]) if q != r else 0.0
        low = min(low, inertia[r, r] - off)
    trace = inertia[0, 0] + inertia[1, 1] + inertia[2, 2]
    return max(low, 1e-3 * trace)


@jitable
def meeting(scene, pair, out):
    """Return the square of the frequency with which a pair will vibrate that may come to touch."""
    pairs, bodies, graphics = scene.pairs, scene.bodies, scene.graphics
    i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
    speed = scene.work.speed[i, 0] + scene.work.speed[j, 0]
    inverse = 0.0
    for g in (i, j):
        if graphics.body[g] < len(bodies.mass):
            inverse += 1.0 / bodies.mass[graphics.body[g]]
    if speed == 0.0 or inverse == 0.0:
        return 0.0
    c = scene.kinds.contact[pairs.kind[pair]]
    depth = deepest_of_impact(scene, c, 0.5 * speed * speed / inverse)
    return slopes(scene, c, depth, out)[0] * inverse


@jitable
def stable_step(scene, tol, y, f):
    """Return the step that a method without error estimate is to take from the committed point."""
    work, bodies, pairs = scene.work, scene.bodies, scene.pairs
    longest = longest_stay(scene, y, f)
    for b in range(len(bodies.mass)):
        for k in range(10):
            work.block[b, k] = 0.0
    hit = work.hit
    for k in range(hit[len(hit) - 1]):
        add_touching(scene, hit[k], work.law_out)
    square, rate = 0.0, 0.0
    for b in range(len(bodies.mass)):
        block, total = work.block[b], 0.0
        for k in range(9):
            total += block[k] * block[k]
        square = max(square, math.sqrt(total) / bodies.mass[b])
        rate = max(rate, block[9] / bodies.mass[b])
    for k in range(pairs.count[LIVE]):
        pair = pairs.live[k]
        if pairs.touches[pair] > 0:
            continue
        square = max(square, meeting(scene, pair, work.law_out))
        # the step is believed for a while: nothing is buried unseen by then
        i, j = pairs.graphic_i[pair], pairs.graphic_j[pair]
        way = max(pairs.left[pair], 0.0) + 0.5 * min(scene.graphics.thin[i], scene.graphics.thin[j])
        speed = work.speed[i, 0] + work.speed[j, 0]
        push = work.speed[i, 1] + work.speed[j, 1]
        longest = min(longest, time_for(way, speed, push) / STABLE_EVERY)

    # h w < 2 is the limit; order 2 needs the root of the tolerance
    part = min(LARGEST_PART, math.sqrt(tol / COARSE))
    if square > 0.0:
        longest = min(longest, part / math.sqrt(square))
    # friction that turns within a step chatters but cannot grow beyond mu N: no shorter than this
    if rate > 0.0:
        longest = min(longest, max(part / rate, 1.0 * longest))
    return longest
