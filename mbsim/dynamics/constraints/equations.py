"""Constraint equations that the tree does not hold: their rows, and the multipliers they need.

An equation g(q, t) = 0 is a sum of terms less a function of TIME. For each its residual, the
rate G V - dg/dt and what of the second rate follows from velocities alone are taken; a term's
gradient is a wrench on the bodies of its markers. The tree answers a unit multiplier of equation
r with accelerations T G_r', and A = G T G' says how equations act on each other, so

    A lambda = -(gamma + G a),   a: accelerations of the tree without multipliers.

A is factored within its skyline: equations on different trees do not meet.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.arrays.hooks import Held, Hook, answer_of
from mbsim.arrays.scene import (
    ANGLE,
    ASKED,
    AUDIT_TOL,
    FOLD_BEGINS,
    FOLD_ENDS,
    FOLD_HALT,
    FOLD_POWER,
    FOLDS,
    GENERAL,
    KEPT,
    KEPT_PIVOT,
    OFFSET,
    PERP,
    PIVOT,
    PIVOT_THEN,
    PIVOT_TIME,
    TOUCHING,
    TWIST,
    USUAL,
    Scene,
)
from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.bodies.angles import followed_angle
from mbsim.dynamics.bodies.kinematics import position
from mbsim.dynamics.bodies.markers import (
    marker_arm,
    marker_axis,
    marker_point,
    marker_quaternion,
    marker_velocity,
)
from mbsim.dynamics.constraints.tree import load, origin, put, respond
from mbsim.dynamics.expressions.jets import gradient, jet

# columns of `Sweep.rate`
RESIDUAL, MISMATCH, GAMMA, FLOW = range(4)


#: Below this part of the usual pivots a state is near a position in which a loop can fold: how far
#: that is goes as the square root of the least pivot.
NEAR = 0.01
#: Below this part what multipliers do is foreseen, until the fold is as far behind. A loop whose
#: lengths are wrong by a rounding error e is accelerated by e/part**1.5 beside what it should.
FOLDING = 2.5e-4
#: Equations are released there whose pivots are below this part.
RELEASED = 0.05
#: From this part on steps go no farther than `CLOSER` of the way to the fold, so that there are
#: samples of accelerations from which what is ahead can be told.
WATCHED, CLOSER = 0.25, 0.3
#: And so much farther at a tolerance of 1e-3, where fewer samples are enough.
LOOSER = 0.2
#: Samples are taken where the least pivot has fallen to this part of the last one's.
SAMPLED = 0.6
#: It is foreseen from so many times as far from the fold as `FOLDING` is, or, where samples do not
#: tell it to this part of tol, from nearer up to this.
ENTERED, DOUBT, NEAREST = 1.5, 0.1, 0.4
#: What rounding makes of that.
NOISE = 1e-10
#: What is foreseen lasts at most so many times the time over which samples were taken.
REACH = 1.0
#: Pivots of this part are none: there an equation fades out.
NAUGHT = 1e-8


@jitable
def add_side(scene, y, G, m, at, force, torque):
    """Write force at a point and torque, on the body of marker m, as a wrench about its O."""
    b = scene.markers.body[m]
    k = scene.tree.of_body[b]
    if k < 0:
        for i in range(6):
            G[i] = 0.0
        return
    put(G, add(torque, cross(sub(at, origin(scene, y, k)), force)), force)


@jitable
def centripetal(scene, m):
    """Return the acceleration of marker m that the turning of its body alone causes."""
    w = vector(scene.work.w[scene.markers.body[m]])
    return cross(w, cross(w, marker_arm(scene, m)))


@jitable
def offset_term(scene, y, i, j, axis, G):
    """Return value, rate and second rate of e_J . (P_I - P_J), and fill its gradient."""
    e = marker_axis(scene, j, axis)
    at = marker_point(scene, y, i)
    d = sub(at, marker_point(scene, y, j))
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    w = vector(scene.work.w[scene.markers.body[j]])
    turned = cross(w, e)
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, at, e, zero)
    add_side(scene, y, G[6:12], j, at, scale(-1.0, e), zero)
    a = sub(centripetal(scene, i), centripetal(scene, j))
    second = dot(e, a) + 2.0 * dot(turned, v) + dot(cross(w, turned), d)
    return dot(e, d), dot(e, v) + dot(turned, d), second


@jitable
def fill_turn(scene, y, i, j, torque, G):
    """Fill the gradient of a term that only turns: opposite torques on the two bodies."""
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, zero, zero, torque)
    add_side(scene, y, G[6:12], j, zero, zero, scale(-1.0, torque))


@jitable
def cosine(scene, i, axis_i, j, axis_j):
    """Return value, rate, second rate and torque of a_I . b_J."""
    a, b = marker_axis(scene, i, axis_i), marker_axis(scene, j, axis_j)
    w_i, w_j = (
        vector(scene.work.w[scene.markers.body[i]]),
        vector(scene.work.w[scene.markers.body[j]]),
    )
    da, db = cross(w_i, a), cross(w_j, b)
    second = dot(cross(w_i, da), b) + 2.0 * dot(da, db) + dot(a, cross(w_j, db))
    return dot(a, b), dot(da, b) + dot(a, db), second, cross(a, b)


@jitable
def perp_term(scene, y, i, j, axis_i, axis_j, G):
    """Return value, rate and second rate of a_I . b_J, and fill its gradient."""
    value, rate, second, torque = cosine(scene, i, axis_i, j, axis_j)
    fill_turn(scene, y, i, j, torque, G)
    return value, rate, second


@jitable
def angle_term(scene, y, i, j, slot, G):
    """Return value, rate and second rate of the angle about z, and fill its gradient.

    With c, s the cosines of x_I against x_J and y_J, n = c^2 + s^2: the rate is
    (c s' - s c')/n.
    """
    c, dc, ddc, about_c = cosine(scene, i, 0, j, 0)
    s, ds, dds, about_s = cosine(scene, i, 0, j, 1)
    n = c * c + s * s
    rate = (c * ds - s * dc) / n
    second = (c * dds - s * ddc) / n - rate * 2.0 * (c * dc + s * ds) / n
    fill_turn(scene, y, i, j, sub(scale(c / n, about_s), scale(s / n, about_c)), G)
    return followed_angle(scene, slot), rate, second


@jitable
def twist_term(scene, y, i, j, G):
    """Return value, rate and second rate of 2 z of the quaternion from J to I; fill its gradient.

    With q = (w, x, y, z), W = w_I - w_J and J's axes e: q' = (0, W) q/2 in these axes, so that
    2 z' = n . W, n = w e_z + y e_x - x e_y, |n|^2 = 1 - z^2, and where no body is accelerated
    2 z'' = -z W^2/2 - n . (w_J x w_I).
    """
    a, b = marker_quaternion(scene, y, j), marker_quaternion(scene, y, i)
    # conj(a) b
    w = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3]
    qx = a[0] * b[1] - a[1] * b[0] - a[2] * b[3] + a[3] * b[2]
    qy = a[0] * b[2] + a[1] * b[3] - a[2] * b[0] - a[3] * b[1]
    qz = a[0] * b[3] - a[1] * b[2] + a[2] * b[1] - a[3] * b[0]
    e_x, e_y = marker_axis(scene, j, 0), marker_axis(scene, j, 1)
    n = add(scale(w, marker_axis(scene, j, 2)), sub(scale(qy, e_x), scale(qx, e_y)))
    w_i = vector(scene.work.w[scene.markers.body[i]])
    w_j = vector(scene.work.w[scene.markers.body[j]])
    turning = sub(w_i, w_j)
    fill_turn(scene, y, i, j, n, G)
    second = -0.5 * qz * dot(turning, turning) - dot(n, cross(w_j, w_i))
    return 2.0 * qz, dot(n, turning), second


@jitable
def distance_term(scene, y, i, j, G):
    """Return value, rate and second rate of the distance of I and J, and fill its gradient."""
    at_i, at_j = marker_point(scene, y, i), marker_point(scene, y, j)
    d = sub(at_i, at_j)
    length = math.sqrt(dot(d, d))
    e = scale(1.0 / length, d) if length > 0.0 else (0.0, 0.0, 1.0)
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, at_i, e, zero)
    add_side(scene, y, G[6:12], j, at_j, scale(-1.0, e), zero)
    along = dot(e, v)
    second = dot(e, sub(centripetal(scene, i), centripetal(scene, j)))
    if length > 0.0:
        second += (dot(v, v) - along * along) / length
    return length, along, second


@jitable
def touching_term(scene, y, i, j, way, s, G):
    """Return rate and second rate of slip along x or y of slot s, and fill its gradient.

    With p where the surfaces touch, t the axis and n the normal, which all go with the contact:

        slip = t . v,  v = v_I + w_I x (p - x_I) - v_J - w_J x (p - x_J)
        its second rate by velocities = t' . v + t . (w_I x (p' - v_I) - w_J x (p' - v_J)),

    and where nothing slips t' . v = -(t . n') (n . v). `stiction.rigid_contact` places the slot.
    """
    row = scene.work.hold[s]
    p, n, t = (row[0], row[1], row[2]), (row[3], row[4], row[5]), (row[6], row[7], row[8])
    if way == 1:
        t = cross(n, t)
    dp, dn = (row[9], row[10], row[11]), (row[12], row[13], row[14])
    bi, bj = scene.markers.body[i], scene.markers.body[j]
    wi, wj = vector(scene.work.w[bi]), vector(scene.work.w[bj])
    vi, vj = vector(scene.work.v[bi]), vector(scene.work.v[bj])
    at_i = add(vi, cross(wi, sub(p, position(scene, y, bi))))
    v = sub(at_i, add(vj, cross(wj, sub(p, position(scene, y, bj)))))
    zero = (0.0, 0.0, 0.0)
    add_side(scene, y, G[0:6], i, p, t, zero)
    add_side(scene, y, G[6:12], j, p, scale(-1.0, t), zero)
    turning = sub(cross(wi, sub(dp, vi)), cross(wj, sub(dp, vj)))
    return dot(t, v), dot(t, turning) - dot(t, dn) * dot(n, v)


@jitable
def general_term(scene, t, y, i, program, G):
    """Fill the gradient of a program with respect to the body of marker i."""
    b = scene.markers.body[i]
    out = scene.sweep.jet
    gradient(scene, t, y, program, b, out)
    force, torque = (out[0], out[1], out[2]), (out[3], out[4], out[5])
    add_side(scene, y, G[0:6], i, position(scene, y, b), force, torque)
    for k in range(6, 12):
        G[k] = 0.0


@jitable
def fill_equation(scene, t, y, e):
    """Fill gradient, residual and rates of equation e."""
    eq, sweep = scene.equations, scene.sweep
    value, flow, second = -eq.constant[e], 0.0, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        i, j, factor, G = eq.i[k], eq.j[k], eq.factor[k], sweep.G[k]
        kind = eq.kind[k]
        if kind == GENERAL:
            general_term(scene, t, y, i, eq.program[e], G)
            continue
        if kind == TOUCHING:
            flow, second = touching_term(scene, y, i, j, eq.axis[k, 0], eq.axis[k, 1], G)
            continue
        g, dg, ddg = 0.0, 0.0, 0.0
        if kind == OFFSET:
            g, dg, ddg = offset_term(scene, y, i, j, eq.axis[k, 1], G)
        elif kind == PERP:
            g, dg, ddg = perp_term(scene, y, i, j, eq.axis[k, 0], eq.axis[k, 1], G)
        elif kind == ANGLE:
            g, dg, ddg = angle_term(scene, y, i, j, eq.angle[k], G)
        elif kind == TWIST:
            g, dg, ddg = twist_term(scene, y, i, j, G)
        else:
            g, dg, ddg = distance_term(scene, y, i, j, G)
        value += factor * g
        flow += factor * dg
        second += factor * ddg
        if factor != 1.0:
            for c in range(12):
                G[c] *= factor
    rate = flow
    if eq.program[e] >= 0:
        f, df, ddf = jet(scene, t, y, eq.program[e])
        if eq.general[e] == 1:
            value, rate, second = value + f, rate + df, second + ddf
        elif eq.level[e] == 2:
            value, rate, second = value - f, rate - df, second - ddf
        elif eq.level[e] == 1:
            rate, second = rate - f, second - df
        else:
            second -= f
    sweep.rate[e, RESIDUAL] = value
    sweep.rate[e, MISMATCH] = rate
    sweep.rate[e, GAMMA] = second
    sweep.rate[e, FLOW] = flow


@jitable
def active_count(scene):
    """Return the number of equations in use."""
    active = scene.equations.active
    return active[len(active) - 1]


@jitable
def is_active(scene, e):
    """Return whether equation e is in use."""
    active = scene.equations.active
    for r in range(active_count(scene)):
        if active[r] == e:
            return True
    return False


@jitable
def is_friction(scene, e):
    """Return whether equation e is of friction: it holds only while that sticks."""
    return scene.equations.dry[e] >= 0 or scene.equations.slot[e] >= 0


def lasting(scene: Scene) -> np.ndarray:
    """Return which equations are of no friction and hold always, (ne,)."""
    return np.asarray((scene.equations.dry < 0) & (scene.equations.slot < 0))


@jitable
def fill_equations(scene, t, y):
    """Fill gradient, residual and rates of the equations in use."""
    if scene.world.hooks[Hook.HELD] != 0:
        answer_of(scene, call_int(scene.world.hooks[Hook.HELD], (scene, Held.PLACE, t, y)))
    for r in range(active_count(scene)):
        fill_equation(scene, t, y, scene.equations.active[r])


@jitable
def side_place(scene, m):
    """Return the place in the tree of the body of marker m, -1 for none."""
    return scene.tree.of_body[scene.markers.body[m]]


@jitable
def add_wrench(scene, e, factor):
    """Take `factor` times the gradient of equation e from the forces p: it acts on the bodies."""
    eq, sweep = scene.equations, scene.sweep
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            place = side_place(scene, eq.i[k] if side == 0 else eq.j[k])
            if place >= 0:
                for c in range(6):
                    sweep.p[place, c] -= factor * sweep.G[k, 6 * side + c]


@jitable
def along(scene, e, motion, stamp):
    """Return G_e times the spatial motions of all places.

    With stamp >= 0 only trees whose root carries that mark count.
    """
    eq, sweep, total = scene.equations, scene.sweep, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            place = side_place(scene, eq.i[k] if side == 0 else eq.j[k])
            if place < 0 or (stamp >= 0 and sweep.mark[scene.tree.root[place]] != stamp):
                continue
            for c in range(6):
                total += sweep.G[k, 6 * side + c] * motion[place, c]
    return total


@jitable
def answer(scene, e, stamp):
    """Fill `answer` of the trees that equation e acts on with what a unit multiplier causes."""
    eq, sweep, tree = scene.equations, scene.sweep, scene.tree
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            place = side_place(scene, eq.i[k] if side == 0 else eq.j[k])
            if place >= 0 and sweep.mark[tree.root[place]] != stamp:
                root = tree.root[place]
                sweep.mark[root] = stamp
                for q in range(root, tree.end[root]):
                    for c in range(6):
                        sweep.p[q, c] = 0.0
    add_wrench(scene, e, 1.0)
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            place = side_place(scene, eq.i[k] if side == 0 else eq.j[k])
            if place < 0:
                continue
            root = tree.root[place]
            # a tree that two terms act on answers once: its mark says so
            if sweep.mark[root] == stamp:
                respond(scene, root, tree.end[root], 0, sweep.answer)
                sweep.mark[root] = -2 - stamp
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            place = side_place(scene, eq.i[k] if side == 0 else eq.j[k])
            if place >= 0:
                sweep.mark[tree.root[place]] = stamp


@jitable
def fill_matrix(scene):
    """Fill the lower part of A for the equations in use, within the skyline."""
    sweep, active = scene.sweep, scene.equations.active
    n = active_count(scene)
    for k in range(len(sweep.mark)):
        sweep.mark[k] = -1
    for r in range(n):
        answer(scene, active[r], r)
        for s in range(r, n):
            if sweep.skyline[s] <= r:
                sweep.A[s, r] = along(scene, active[s], sweep.answer, r)


@jitable
def factor_matrix(scene, t):
    """Replace A by L, A = L L'; an equation that those before it imply gets no multiplier.

    A pivot d stands as d (1 + 1/x^8), x being d over a part of the usual ones: itself where d
    is large, infinite where it is 0, smooth between.
    """
    A, first, n = scene.sweep.A, scene.sweep.skyline, active_count(scene)
    usual, least = scene.sweep.quality[USUAL], 1.0
    passing = passes_fold(scene, t)
    for i in range(n):
        e = scene.equations.active[i]
        size = scene.sweep.size[e] ** 2
        released = passing and not is_held(scene, e, t)
        for j in range(first[i], i + 1):
            total = A[i, j]
            for k in range(max(first[i], first[j]), j):
                total -= A[i, k] * A[j, k]
            if j < i:
                A[i, j] = total / A[j, j]
                continue
            if not released:
                least = min(least, total / size)
            part = total / (NAUGHT * usual * size) if usual > 0.0 else math.inf
            if part < 1e-4 or released:
                A[i, i] = math.inf
            else:
                A[i, i] = math.sqrt(total * (1.0 + part**-8) if part < 100.0 else total)
    scene.sweep.quality[PIVOT] = least


@jitable
def solve_matrix(scene):
    """Return the multipliers of `rhs`, by the equations in use."""
    sweep = scene.sweep
    A, first, x, n = sweep.A, sweep.skyline, sweep.multiplier, active_count(scene)
    for i in range(n):
        total = sweep.rhs[i]
        for k in range(first[i], i):
            total -= A[i, k] * x[k]
        x[i] = total / A[i, i]
    for i in range(n - 1, -1, -1):
        x[i] /= A[i, i]
        for k in range(first[i], i):
            x[k] -= A[i, k] * x[i]


@jitable
def hold(scene, t, y):
    """Fill the accelerations of all places under joints and equations."""
    load(scene)
    respond(scene, 0, len(scene.tree.body), 1, scene.sweep.a)
    if active_count(scene) == 0:
        return
    fill_equations(scene, t, y)
    fill_matrix(scene)
    factor_matrix(scene, t)
    impose(scene, t)


@jitable
def hold_again(scene, t):
    """Fill the accelerations anew after forces changed; all else is as `hold` left it."""
    load(scene)
    respond(scene, 0, len(scene.tree.body), 1, scene.sweep.a)
    if active_count(scene) > 0:
        impose(scene, t)


@jitable
def impose(scene, t):
    """Bend accelerations of the tree alone to those that the equations allow."""
    sweep, active = scene.sweep, scene.equations.active
    nt, n = len(scene.tree.body), active_count(scene)
    for r in range(n):
        e = active[r]
        sweep.rhs[r] = -sweep.rate[e, GAMMA] - along_motion(scene, e)
    solve_matrix(scene)
    # what is foreseen stands in for what equations that are released no longer ask for
    ahead = passes_fold(scene, t)
    if ahead:
        foresee(scene, t)
        for r in range(n):
            sweep.wanted[r] = sweep.multiplier[r]
            sweep.rhs[r] = along(scene, active[r], sweep.answer, -1)
        solve_matrix(scene)
    load(scene)
    for r in range(n):
        if ahead:
            add_wrench(scene, active[r], sweep.wanted[r] - sweep.multiplier[r])
            sweep.multiplier[r] = sweep.wanted[r]
        else:
            add_wrench(scene, active[r], sweep.multiplier[r])
    respond(scene, 0, nt, 1, sweep.a)
    if ahead:
        for p in range(nt):
            for c in range(6):
                sweep.a[p, c] += sweep.answer[p, c]


@jitable
def near_fold(scene):
    """Return whether the factor at hand is of a state near a position in which a loop can fold."""
    quality = scene.sweep.quality
    return quality[PIVOT] < NEAR * quality[USUAL]


@jitable
def passes_fold(scene, t):
    """Return whether at t a loop passes a fold.

    Steps begin and end where that does; times before are those of output rows.
    """
    quality = scene.sweep.quality
    return t >= quality[FOLD_BEGINS] and (t < quality[FOLD_ENDS] or quality[FOLDS] == 1.0)


@jitable
def is_held(scene, e, t):
    """Return whether equation e holds at t: what is released does not while a fold is passed."""
    return scene.sweep.released[e] == 0 or not passes_fold(scene, t)


@jitable
def watch_fold(scene, t):
    """Look at the committed state how far ahead a fold is, and begin to pass one that is near.

    The time until there follows from how the square root of the least pivot falls. Through the
    fold, and as far behind it, equations whose pivots vanish there are released.
    """
    sweep, active, quality = scene.sweep, scene.equations.active, scene.sweep.quality
    least, before, since = quality[PIVOT], quality[PIVOT_THEN], t - quality[PIVOT_TIME]
    quality[PIVOT_THEN], quality[PIVOT_TIME], quality[FOLD_HALT] = least, t, math.inf
    if not (since > 0.0 and 0.0 < least < min(before, WATCHED * quality[USUAL])):
        return
    ahead = since / (math.sqrt(before / least) - 1.0)
    last, tol = int(quality[KEPT]) - 1, scene.audit.plan[AUDIT_TOL]
    within = math.sqrt(least / (FOLDING * quality[USUAL]))
    near = within <= ENTERED and last > 0 and 2.0 * ahead < REACH * (t - sweep.kept_at[last])
    # where samples are too few a nearer one makes up for that
    if near and (
        within <= NEAREST or 2.0 * ahead * doubted(scene, t + ahead) <= max(DOUBT * tol, NOISE)
    ):
        quality[FOLDS], quality[FOLD_BEGINS], quality[FOLD_ENDS] = 1.0, t, t + 2.0 * ahead
        quality[FOLD_HALT] = quality[FOLD_ENDS]
        for r in range(active_count(scene)):
            pivot = (sweep.A[r, r] / sweep.size[active[r]]) ** 2
            sweep.released[active[r]] = 1 if pivot < RELEASED * quality[USUAL] else 0
    elif within > NEAREST:
        part = CLOSER + LOOSER * min(max(0.25 * math.log10(tol) + 1.75, 0.0), 1.0)
        until = 1.0 if within > ENTERED else NEAREST
        quality[FOLD_HALT] = t + ahead * min(part, 1.0 - until / within)


@jitable
def doubted(scene, t):
    """Return by how much accelerations foreseen at t differ with one sample less, over V [1/T]."""
    sweep, scales, when, off = scene.sweep, scene.scales, scene.sweep.kept_at, 0.0
    count = int(sweep.quality[KEPT])
    for p in range(len(scene.tree.body)):
        for c in range(6):
            sweep.answer[p, c] = 0.0
    for i in range(count):
        # the divided difference times the product of distances: what the last one adds
        part = 1.0
        for j in range(count):
            if j < count - 1:
                part *= t - when[j]
            if j != i:
                part /= when[i] - when[j]
        for p in range(len(scene.tree.body)):
            for c in range(6):
                sweep.answer[p, c] += part * sweep.kept_a[i, p, c]
    for p in range(len(scene.tree.body)):
        g, D = scales.group[scene.tree.body[p]], sweep.answer[p]
        shift = add((D[3], D[4], D[5]), cross((D[0], D[1], D[2]), vector(sweep.arm[p])))
        off = max(off, math.sqrt(dot(shift, shift) / scene.work.squares[g]))
    return off


@jitable
def leave_fold(scene, t):
    """Return whether a fold that was being passed is left behind at the committed time t."""
    quality = scene.sweep.quality
    begins, ends = quality[FOLD_BEGINS], quality[FOLD_ENDS]
    if t < ends - 1e-9 * (ends - begins):
        return False
    quality[FOLDS], quality[FOLD_ENDS] = 0.0, t
    quality[FOLD_HALT], quality[PIVOT_THEN] = math.inf, 0.0
    return True


@jitable
def power_of_equations(scene):
    """Return the power of what moves with time: multiplier times the rate of its equation's sum."""
    sweep, power = scene.sweep, 0.0
    for r in range(active_count(scene)):
        e = scene.equations.active[r]
        if not is_friction(scene, e):
            power += sweep.multiplier[r] * sweep.rate[e, FLOW]
    return power


@jitable
def foresee(scene, t):
    """Fill `answer` with what multipliers do to accelerations, if that goes on as it did.

    It goes on as the polynomial through what was kept does (Lagrange's form).
    """
    sweep, nt = scene.sweep, len(scene.tree.body)
    count, when = int(sweep.quality[KEPT]), sweep.kept_at
    sweep.quality[FOLD_POWER] = 0.0
    for p in range(nt):
        for c in range(6):
            sweep.answer[p, c] = 0.0
    for i in range(count):
        part = 1.0
        for j in range(count):
            if j != i:
                part *= (t - when[j]) / (when[i] - when[j])
        sweep.quality[FOLD_POWER] += part * sweep.kept_power[i]
        for p in range(nt):
            for c in range(6):
                sweep.answer[p, c] += part * sweep.kept_a[i, p, c]


@jitable
def keep_accelerations(scene, t):
    """Keep what multipliers do to accelerations at the committed state.

    Their square, in the norm of the inertia, is w = m' A m. Where a loop passes through a fold it
    stays as it is while the least pivot d falls; where the loop cannot be closed beyond, what is
    asked of it stays, and w grows as 1/d at least. From 1/sqrt(d) on nothing is foreseen.
    """
    sweep, nt, most = scene.sweep, len(scene.tree.body), len(scene.sweep.kept_at)
    quality, when = sweep.quality, sweep.kept_at
    count = int(quality[KEPT])
    if count > 0 and not (t > when[0] and quality[PIVOT] < quality[KEPT_PIVOT]):
        count = 0
    if count > 0 and quality[PIVOT] > SAMPLED * quality[KEPT_PIVOT]:
        # too near to tell how they change
        return
    for i in range(min(count, most - 1), 0, -1):
        when[i], sweep.kept_power[i] = when[i - 1], sweep.kept_power[i - 1]
        for p in range(nt):
            for c in range(6):
                sweep.kept_a[i, p, c] = sweep.kept_a[i - 1, p, c]
    when[0], sweep.kept_power[0] = t, power_of_equations(scene)
    for p in range(nt):
        for c in range(6):
            sweep.p[p, c] = 0.0
    for r in range(active_count(scene)):
        add_wrench(scene, scene.equations.active[r], sweep.multiplier[r])
    respond(scene, 0, nt, 0, sweep.answer)
    for p in range(nt):
        for c in range(6):
            sweep.kept_a[0, p, c] = sweep.answer[p, c]
    square = 0.0
    for r in range(active_count(scene)):
        along_answer = along(scene, scene.equations.active[r], sweep.answer, -1)
        square += sweep.multiplier[r] * along_answer
    asked, fell = square * math.sqrt(quality[PIVOT]), quality[PIVOT] < quality[KEPT_PIVOT]
    if near_fold(scene) and fell and asked > quality[ASKED]:
        count = 0
    quality[ASKED], quality[KEPT_PIVOT] = asked, quality[PIVOT]
    quality[KEPT] = min(count + 1, most)


@jitable
def along_motion(scene, e):
    """Return G_e times the accelerations, less what G_e takes of velocities.

    The gradient acts on (alpha, a_cg) as a wrench about the cg does; about O the linear part of
    the spatial acceleration lacks w x v, which is a force's arm on velocities.
    """
    eq, sweep, total = scene.equations, scene.sweep, 0.0
    for k in range(eq.first[e], eq.first[e + 1]):
        for side in range(2):
            place = side_place(scene, eq.i[k] if side == 0 else eq.j[k])
            if place < 0:
                continue
            b = scene.tree.body[place]
            G = sweep.G[k, 6 * side : 6 * side + 6]
            for c in range(6):
                total += G[c] * sweep.a[place, c]
            total += dot(
                (G[3], G[4], G[5]), cross(vector(scene.work.w[b]), vector(scene.work.v[b]))
            )
    return total
