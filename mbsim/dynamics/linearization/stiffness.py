"""How forces change with displacements and velocities of bodies: the blocks K and D.

A force F along the rows u of two bodies (wrench on I; less that of J) has

    d F = F_x (u_i . xi_i - u_j . xi_j) + F_v (u_i . eta_i - u_j . eta_j)

with xi the displacement and eta the change of velocity of a body, both about its O. Incidents
are frozen: contact point, normal and tangents stay where they are on the bodies, and X and memory
as they are. Laws are asked at neighbouring arguments, expressions give exact derivatives.
Where forces look at reactions, and press friction in joints,
these are taken as they are.
"""

from __future__ import annotations

import math

from mbsim.arrays.hooks import Hook, Memory
from mbsim.arrays.scene import (
    AXIS_FORCE,
    AXIS_TORQUE,
    BODY_SIZE,
    DRY_TURN,
    LINE_FORCE,
    MARKER_FORCE,
    RESIDUAL,
    SLIDE_LIMIT,
    TURN_LIMIT,
    VECTOR_FORCE,
)
from mbsim.compile_model.instructions import USER
from mbsim.core.address import call_int
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.bodies.kinematics import place_body, position
from mbsim.dynamics.bodies.markers import marker_arm, marker_axis, marker_point, marker_velocity
from mbsim.dynamics.contact.forces import (
    FORCE,
    NORMAL,
    TILTING,
    contact_of,
    face_weight_of,
    friction,
    in_marker,
    patch,
    sides,
    velocity_at,
)
from mbsim.dynamics.expressions.jets import run, value
from mbsim.dynamics.expressions.measures import unit
from mbsim.dynamics.expressions.slopes import A_STATE, DIRECTIONS, POSES
from mbsim.dynamics.expressions.subroutines import user_result
from mbsim.dynamics.forces.applied import along_axis, along_line, along_slide, at_limit
from mbsim.dynamics.forces.dry_friction import STIFFNESS, dry_motion, dry_now, is_dry
from mbsim.dynamics.linearization.blocks import couple
from mbsim.geometry.catalog import MOMENT_XX, MOMENT_XY, MOMENT_YY, REGION_ROWS, plane_axes
from mbsim.laws.abi import DFLAG
from mbsim.laws.catalog import SLIP
from mbsim.laws.friction.stiction import KEPT_MODE, KEPT_SPEED, KEPT_X, KEPT_Y
from mbsim.laws.user_normal import AREA, EXPLORE, MODE, PLACE, SLOPES

#: Differences of the laws' arguments, as parts of them and of the model's speed.
_PART, _PART_OF_SPEED = 1e-6, 1e-8
#: Row of `basis` with how the force of one incident for many points changes.
PRESS = 6
#: Slip, over the model's speed, below which directions of rigid friction converge only as far as
#: slip does that is so fast: its part across may be as large as there.
SLOW = 1e-3
#: Least difference of slip over the usual one: what is slower is at rest.
AT_REST = 1e-4
#: Differences of slip that is rigid, as a part of what it was at the committed state.
_PART_OF_SLIP = 1e-3
#: Differences of the state for user subroutines, as parts of length or speed, and radians.
_PUSH = 1e-7


@jitable
def lever(scene, linear, y, b, p, force, torque, row):
    """Write the wrench of a unit: force at p and torque, about O of body b; nothing for ground."""
    if b == len(scene.bodies.mass):
        for k in range(6):
            row[k] = 0.0
        return
    arm = add(sub(p, position(scene, y, b)), vector(linear.r[b]))
    moment = add(cross(arm, force), torque)
    for k in range(3):
        row[k] = moment[k]
        row[3 + k] = force[k]


@jitable
def add_product(target, factor, u, v):
    """Add factor u v' to a block."""
    for i in range(target.shape[0]):
        part = factor * u[i]
        if part != 0.0:
            for j in range(target.shape[1]):
                target[i, j] += part * v[j]


@jitable
def add_two_sided(P, blocks, nb, i, j, factor, u, v):
    """Add factor u v' of a force between bodies i and j; rows 0 of u and v are of i, 1 of j."""
    for of in range(2):
        a = i if of == 0 else j
        for by in range(2):
            b = i if by == 0 else j
            if a < nb and b < nb:
                size = factor if of == by else -factor
                add_product(blocks[P.place[a, b]], size, u[of], v[by])


@jitable
def contact_bodies(scene, s):
    """Return the bodies of a slot."""
    gi, gj = sides(scene, s)
    return scene.graphics.body[gi], scene.graphics.body[gj]


@jitable
def couple_contacts(scene, P):
    """Couple the bodies that touch; return whether there is room."""
    nb, hit = len(scene.bodies.mass), scene.work.hit
    for k in range(hit[len(hit) - 1]):
        i, j = contact_bodies(scene, hit[k])
        if i < nb and j < nb and i != j and not couple(P, i, j):
            return False
    return True


@jitable
def ask_friction(scene, t, h, y, s, c, around, given):
    """Return code of the friction law; `given`: slip (2), spin rates (3), normal force."""
    loci, locj = around
    slip, spin = (given[0], given[1]), (given[2], given[3], given[4])
    scene.work.law_in[DFLAG] = 1.0
    code = friction(scene, t, h, y, s, c, loci, locj, spin, slip, given[5])
    scene.work.law_in[DFLAG] = 0.0
    return code


@jitable
def rigid_slip(scene, s, c):
    """Return over which slip the friction of slot s turns if it is rigid and slips, else 0."""
    kept = scene.state.memory[s]
    if scene.contacts.rigid[c] == 0 or kept[KEPT_MODE] != SLIP:
        return 0.0
    return kept[KEPT_SPEED] + math.hypot(kept[KEPT_X], kept[KEPT_Y])


@jitable
def friction_slopes(scene, t, h, y, s, c, around, given, table):
    """Fill rows of d(Fx, Fy, Mx, My, Tz)/d(slip x, y, spin x, y, z, normal); return a code."""
    out, least = scene.work.law_out, _PART_OF_SPEED * scene.world.scale[1]
    base, code, speed = table[:, 6:11], 0, rigid_slip(scene, s, c)
    if speed > 0.0:
        # it turns over a way in velocities as short as itself
        least = min(least, max(_PART_OF_SLIP * speed, AT_REST * least))
    for column in range(6):
        size = _PART * abs(given[column])
        if column < 5:
            size += least if column < 2 else least / scene.world.scale[0]
        elif size == 0.0:
            size = _PART
        kept = given[column]
        for side in range(2):
            given[column] = kept + (size if side == 0 else -size)
            code = ask_friction(scene, t, h, y, s, c, around, given)
            if code != 0:
                return code
            for r in range(5):
                if side == 0:
                    base[column, r] = out[r]
                else:
                    table[r, column] = (base[column, r] - out[r]) / (2.0 * size)
        given[column] = kept
    return 0


@jitable
def damp_tilting(scene, T, y, s):
    """Add the couple against tilting of `contact.tilting`."""
    P, L, nb, none = T.pattern, T.linear, len(scene.bodies.mass), (0.0, 0.0, 0.0)
    i, j = contact_bodies(scene, s)
    point, damping = scene.work.points[s], scene.work.slot[s, TILTING]
    numbers = scene.work.points[s + 1]
    p, (ax, ay) = vector(point[1:4]), plane_axes(vector(point[4:7]))
    for side in range(2):
        lever(scene, L, y, i if side == 0 else j, p, none, ax, L.basis[side, 2])
        lever(scene, L, y, i if side == 0 else j, p, none, ay, L.basis[side, 3])
    u, v = L.basis[:, 2], L.basis[:, 3]
    add_two_sided(P, L.D, nb, i, j, -damping * numbers[MOMENT_YY], u, u)
    add_two_sided(P, L.D, nb, i, j, damping * numbers[MOMENT_XY], u, v)
    add_two_sided(P, L.D, nb, i, j, damping * numbers[MOMENT_XY], v, u)
    add_two_sided(P, L.D, nb, i, j, -damping * numbers[MOMENT_XX], v, v)


@jitable
def add_region_stiffness(scene, T, y, s, force, by_depth):
    """Add how the force of one incident for many points changes with depth and tilt.

    With the energy S U(d), d^2 = sum w_i d_i^2 / S of `geometry.region` and g_i the displacement
    into the other body at point i, its second derivative is
    F/d sum w_i g_i g_i' + (F' - F/d) / (S d^2) g g' with g = sum w_i d_i g_i. `force` is F,
    `by_depth` F'; return how the whole force changes where all depths change alike. How it changes
    with displacements is left in row PRESS of `basis`.
    """
    P, L, rows, nb = T.pattern, T.linear, scene.work.points, len(scene.bodies.mass)
    i, j = contact_bodies(scene, s)
    depth, whole, none = rows[s, 0], face_weight_of(scene, s), (0.0, 0.0, 0.0)
    one, every, press = L.basis[:, 0], L.basis[:, 1], L.basis[:, PRESS]
    every[:] = press[:] = 0.0
    weight, moment = 0.0, 0.0
    first = s + REGION_ROWS
    for k in range(first, s + scene.kinds.slots[scene.pairs.kind[scene.slots.pair[s]]]):
        if rows[k, 0] > 0.0:
            p, n, w = vector(rows[k, 1:4]), vector(rows[k, 4:7]), rows[k, 7]
            for side in range(2):
                lever(scene, L, y, i if side == 0 else j, p, n, none, one[side])
            add_two_sided(P, L.K, nb, i, j, -w * force / depth, one, one)
            weight += w
            moment += w * rows[k, 0]
            for side in range(2):
                for c in range(6):
                    every[side, c] += w * rows[k, 0] * one[side, c]
                    press[side, c] += w * force / depth * one[side, c]
    rest = (by_depth - force / depth) / (whole * depth * depth)
    add_two_sided(P, L.K, nb, i, j, -rest, every, every)
    for side in range(2):
        for c in range(6):
            press[side, c] += rest * moment * every[side, c]
    damp_tilting(scene, T, y, s)
    return force / depth * weight + rest * moment * moment


@jitable
def add_moves_of_place(scene, T, y, s, by_rate):
    """Add that friction acts elsewhere, and at another slip, where tilting moves the place.

    The place is sum w_i d_i p_i / sum w_i d_i: as point i gets deeper by 1, it moves by
    w_i (p_i - p) / sum w_i d_i. Rows 1 to 5 of `basis` are those of friction, `law` its slopes.
    """
    P, L, work, nb = T.pattern, T.linear, scene.work, len(scene.bodies.mass)
    i, j = contact_bodies(scene, s)
    point, none, weight = work.points[s], (0.0, 0.0, 0.0), 0.0
    p, n, tx = vector(point[1:4]), vector(point[4:7]), vector(work.t[s])
    ty, w_rel = cross(n, tx), sub(vector(work.w[i]), vector(work.w[j]))
    rub = sub(vector(work.slot[s, FORCE : FORCE + 3]), scale(work.slot[s, NORMAL], n))
    one, moved, first = L.basis[:, 7], L.basis[:, 8], s + REGION_ROWS
    last = s + scene.kinds.slots[scene.pairs.kind[scene.slots.pair[s]]]
    for k in range(first, last):
        weight += max(0.0, work.points[k, 0]) * work.points[k, 7]
    for k in range(first, last):
        row = work.points[k]
        if row[0] <= 0.0:
            continue
        q = sub(vector(row[1:4]), p)
        faster = cross(w_rel, q)
        slip_x, slip_y, rate = dot(faster, tx), dot(faster, ty), -dot(faster, n)
        torque = cross(q, rub)
        for side in range(2):
            b = i if side == 0 else j
            lever(scene, L, y, b, vector(row[1:4]), vector(row[4:7]), none, one[side])
            lever(scene, L, y, b, p, scale(by_rate * rate, n), torque, moved[side])
            for r in range(5):
                rise = L.law[r, 0] * slip_x + L.law[r, 1] * slip_y + L.law[r, 5] * by_rate * rate
                for c in range(6):
                    moved[side, c] += rise * L.basis[side, 1 + r, c]
        add_two_sided(P, L.K, nb, i, j, -row[7] / weight, moved, one)


@jitable
def add_contact_slopes(scene, T, t, h, y, s):
    """Add what the incident in slot s does, as `contact.add_contact` left it; return a code."""
    P, L, contacts, work = T.pattern, T.linear, scene.contacts, scene.work
    nb, c = len(scene.bodies.mass), contact_of(scene, s)
    gi, gj = sides(scene, s)
    i, j = scene.graphics.body[gi], scene.graphics.body[gj]
    point = work.points[s]
    depth, p, n = point[0], (point[1], point[2], point[3]), (point[4], point[5], point[6])
    share, out, none = point[7], work.law_out, (0.0, 0.0, 0.0)
    rate = -dot(sub(velocity_at(scene, y, i, p), velocity_at(scene, y, j, p)), n)

    # the normal law by depth and rate
    user = contacts.user_normal[c]
    if user != 0:
        place = floats_at(user, PLACE)
        place[MODE], place[AREA] = SLOPES, patch(scene, s)
    step = _PART * depth
    call = (depth + step, rate, contacts.normal_par[c], out)
    code = call_int(contacts.normal_law[c], call)
    upper = out[0]
    code += call_int(contacts.normal_law[c], (depth - step, rate, contacts.normal_par[c], out))
    by_depth = share * (upper - out[0]) / (2.0 * step)
    step = _PART * abs(rate) + _PART_OF_SPEED * scene.world.scale[1]
    code += call_int(contacts.normal_law[c], (depth, rate + step, contacts.normal_par[c], out))
    upper = out[0]
    code += call_int(contacts.normal_law[c], (depth, rate - step, contacts.normal_par[c], out))
    by_rate = share * (upper - out[0]) / (2.0 * step)
    if user != 0:
        floats_at(user, PLACE)[MODE] = EXPLORE
    if code != 0:
        return code

    # depth and its rate are -n . of displacement and velocity
    normal, region = L.basis, face_weight_of(scene, s) > 0.0
    if region:
        slope = by_depth / share
        by_depth = add_region_stiffness(scene, T, y, s, work.slot[s, NORMAL] / share, slope)
    for side in range(2):
        lever(scene, L, y, i if side == 0 else j, p, n, none, normal[side, 0])
    u, v = normal[:, 0], normal[:, 0]
    if not region:
        add_two_sided(P, L.K, nb, i, j, -by_depth, u, v)
    add_two_sided(P, L.D, nb, i, j, -by_rate, u, v)
    if contacts.friction_law[c] == 0:
        return 0

    tx = vector(work.t[s])
    ty = cross(n, tx)
    v_rel = sub(velocity_at(scene, y, i, p), velocity_at(scene, y, j, p))
    w_rel = sub(vector(work.w[i]), vector(work.w[j]))
    given = L.rise[0:6]
    given[0], given[1] = dot(v_rel, tx), dot(v_rel, ty)
    given[2], given[3], given[4] = dot(w_rel, tx), dot(w_rel, ty), dot(w_rel, n)
    given[5] = max(work.slot[s, 2], 0.0)
    around = (none, none)
    if contacts.framed[c] == 1:
        half = scale(0.5 * depth, n)
        around = (in_marker(scene, y, gi, sub(p, half)), in_marker(scene, y, gj, add(p, half)))
    code = friction_slopes(scene, t, h, y, s, c, around, given, L.law)
    if code != 0:
        return code
    # of rigid friction slopes grow as slip gets slow, and tell nothing where it begins. But errors
    # of its direction, whichever way, take from what rubs along the slip: what nearly rests creeps
    counts = 1.0
    if contacts.rigid[c] == 1:
        slow = min(math.hypot(given[0], given[1]), rigid_slip(scene, s, c))
        counts = min(1.0, slow / (SLOW * scene.world.scale[1]))
    for k in range(4):
        work.grip[s, k] = counts * L.law[k // 2, k % 2] / given[5] if given[5] > 0.0 else 0.0
    for side in range(2):
        b = i if side == 0 else j
        rows = L.basis[side]
        lever(scene, L, y, b, p, tx, none, rows[1])
        lever(scene, L, y, b, p, ty, none, rows[2])
        lever(scene, L, y, b, p, none, tx, rows[3])
        lever(scene, L, y, b, p, none, ty, rows[4])
        lever(scene, L, y, b, p, none, n, rows[5])
    for r in range(5):
        u = L.basis[:, 1 + r]
        for column in range(5):
            if L.law[r, column] != 0.0:
                add_two_sided(P, L.D, nb, i, j, L.law[r, column], u, L.basis[:, 1 + column])
        by_normal = L.law[r, 5]
        if by_normal != 0.0:
            if region:
                add_two_sided(P, L.K, nb, i, j, -by_normal, u, L.basis[:, PRESS])
            else:
                add_two_sided(P, L.K, nb, i, j, -by_normal * by_depth, u, L.basis[:, 0])
            add_two_sided(P, L.D, nb, i, j, -by_normal * by_rate, u, L.basis[:, 0])
    if region:
        add_moves_of_place(scene, T, y, s, by_rate)
    if scene.world.hooks[Hook.MEMORY] != 0 and (scene.slots.x[s] >= 0 or scene.slots.z[s] >= 0):
        K = T.keeps
        count = K.held[len(K.held) - 1]
        K.held[count], K.press[count, 0], K.press[count, 1] = s, by_depth, by_rate
        return call_int(scene.world.hooks[Hook.MEMORY], (scene, Memory.FILL, y, y))
    return 0


@jitable
def add_contacts_slopes(scene, T, t, h, y):
    """Add what all incidents do; return a code."""
    hit = scene.work.hit
    T.keeps.held[len(T.keeps.held) - 1] = 0
    for k in range(hit[len(hit) - 1]):
        code = add_contact_slopes(scene, T, t, h, y, hit[k])
        if code != 0:
            return code
    return 0


@jitable
def sides_of(scene, f):
    """Return the bodies that applied force f acts on; ground for what acts on I alone."""
    i, j = scene.markers.body[scene.applied.i[f]], scene.markers.body[scene.applied.j[f]]
    return i, (len(scene.bodies.mass) if scene.applied.alone[f] == 1 else j)


@jitable
def depends_on(scene, T, f, k):
    """Return program k (0 to 6) of applied force f, -1 for none."""
    return scene.applied.program[f] if k == 6 else scene.applied.components[f, k]


@jitable
def couple_applied(scene, P, T):
    """Couple the bodies between which forces act, and those that they look at."""
    nb = len(scene.bodies.mass)
    for f in range(len(scene.applied.kind)):
        i, j = sides_of(scene, f)
        if i < nb and j < nb and i != j and not couple(P, i, j):
            return False
        # whose axes a force is along
        axes = (
            scene.applied.axes[f] if scene.applied.kind[f] == VECTOR_FORCE else scene.applied.j[f]
        )
        along = scene.markers.body[axes]
        for a in (i, j):
            if a < nb and along < nb and a != along and not couple(P, a, along):
                return False
        for k in range(7):
            program = depends_on(scene, T, f, k)
            if program < 0:
                continue
            for at in range(T.depends.body_start[program], T.depends.body_start[program + 1]):
                b = T.depends.body[at]
                for a in (i, j):
                    if a < nb and a != b and not couple(P, a, b):
                        return False
    return True


@jitable
def pushed(scene, y, body, direction, size):
    """Change one number of pose or velocity of a body in y, where `direction` is as in slopes."""
    at = BODY_SIZE * body
    axis = direction % 3
    if direction < 3:
        y[at + axis] += size
    elif direction < POSES:
        # half a turn of the quaternion, global: q + (0, e) q size/2
        w, x, yy, z = y[at + 3], y[at + 4], y[at + 5], y[at + 6]
        half = 0.5 * size
        if axis == 0:
            rise = (-x, w, -z, yy)
        elif axis == 1:
            rise = (-yy, z, w, -x)
        else:
            rise = (-z, -yy, x, w)
        for k in range(4):
            y[at + 3 + k] += half * rise[k]
    elif direction < 9:
        y[at + 7 + axis] += size
    else:
        R = scene.work.R[body]
        for k in range(3):
            y[at + 10 + k] += size * R[axis, k]
    place_body(scene, y, body)


@jitable
def keep_spin(scene, y, body, axis, size):
    """Change the angular velocity in body axes so that a turn of the body leaves it as it is."""
    R, at = scene.work.R[body], BODY_SIZE * body + 10
    w = (y[at], y[at + 1], y[at + 2])
    change = cross((R[axis, 0], R[axis, 1], R[axis, 2]), w)
    for k in range(3):
        y[at + k] -= size * change[k]


@jitable
def value_anew(scene, t, y, program):
    """Return the value of a program, where a subroutine is called for each of its results."""
    programs = scene.programs
    for at in range(programs.quick_start[program], programs.quick_start[program + 1]):
        code = programs.quick[at]
        if code[0] == USER and code[2] > 0:
            # which only reads what a call for the first result has left
            user_result(scene, t, y, code[1], 0, 0)
    return value(scene, t, y, program)


@jitable
def program_rise(scene, T, t, y, program, body, row):
    """Fill the derivatives of a program by the displacement (6) and velocity (6) of a body.

    Both as spatial vectors about O of the body: angular, linear.
    """
    at = BODY_SIZE * body
    for direction in range(DIRECTIONS):
        if T.depends.user[program] == 1:
            size = _PUSH * (1.0 if direction % POSES >= 3 else scene.world.scale[0])
            if direction >= POSES:
                size *= scene.world.scale[1] / scene.world.scale[0]
            before = value_anew(scene, t, y, program)
            kept = (y[at], y[at + 1], y[at + 2], y[at + 3], y[at + 4], y[at + 5], y[at + 6])
            speed = (y[at + 7], y[at + 8], y[at + 9], y[at + 10], y[at + 11], y[at + 12])
            if 3 <= direction < POSES:
                keep_spin(scene, y, body, direction - 3, size)
            pushed(scene, y, body, direction, size)
            rise = (value_anew(scene, t, y, program) - before) / size
            for k in range(7):
                y[at + k] = kept[k]
            for k in range(6):
                y[at + 7 + k] = speed[k]
            place_body(scene, y, body)
        else:
            run(scene, t, y, program, body, direction)
            rise = scene.programs.stack[0, 1]
        # (linear, angular) to (angular, linear)
        row[(direction // POSES) * POSES + (direction % POSES + 3) % POSES] = rise
    r = vector(T.linear.r[body])
    for part in range(2):
        first = part * POSES
        linear = (row[first + 3], row[first + 4], row[first + 5])
        moment = cross(r, linear)
        for k in range(3):
            row[first + k] += moment[k]


@jitable
def add_program_slopes(scene, T, t, y, f, program, u):
    """Add d(value)/d(bodies and states) times the wrench u of its unit on the bodies of force f."""
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    i, j = sides_of(scene, f)
    for at in range(T.depends.body_start[program], T.depends.body_start[program + 1]):
        b = T.depends.body[at]
        program_rise(scene, T, t, y, program, b, L.rise)
        for side in range(2):
            a = i if side == 0 else j
            if a < nb:
                sign = 1.0 if side == 0 else -1.0
                add_product(L.K[P.place[a, b]], sign, u[side], L.rise[0:6])
                add_product(L.D[P.place[a, b]], sign, u[side], L.rise[6:12])
    first = len(scene.equations.program)
    for at in range(T.depends.state_start[program], T.depends.state_start[program + 1]):
        z = T.depends.state[at]
        rise = state_rise(scene, T, t, y, program, z)
        for side in range(2):
            a = i if side == 0 else j
            if a < nb:
                for k in range(6):
                    L.column[first + z, a, k] += (rise if side == 0 else -rise) * u[side, k]


@jitable
def state_rise(scene, T, t, y, program, z):
    """Return the derivative of a program by state z."""
    place = scene.states.place[z]
    if T.depends.user[program] == 0:
        run(scene, t, y, program, A_STATE, place)
        return scene.programs.stack[0, 1]
    before, kept = value_anew(scene, t, y, program), y[place]
    size = _PUSH * max(abs(kept), scene.states.scale[z])
    y[place] = kept + size
    rise = (value_anew(scene, t, y, program) - before) / size
    y[place] = kept
    return rise


@jitable
def fill_unit(scene, T, y, f, force, torque, at_j):
    """Fill the wrenches of a unit force and torque: on I at its origin, on J at its own or I's."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    u = T.linear.basis[:, 0]
    lever(scene, T.linear, y, bi, marker_point(scene, y, i), force, torque, u[0])
    p = marker_point(scene, y, j if at_j == 1 else i)
    lever(scene, T.linear, y, bj, p, force, torque, u[1])
    return u


@jitable
def from_origin(scene, L, y, b, p):
    """Return point p from O of body b."""
    return add(sub(p, position(scene, y, b)), vector(L.r[b]))


@jitable
def add_turn(scene, T, y, b, by, p, force, torque, sign):
    """Add that force at p and torque on body b turn with body `by`."""
    nb = len(scene.bodies.mass)
    if b == nb or by == nb:
        return
    block, at = T.linear.K[T.pattern.place[b, by]], from_origin(scene, T.linear, y, b, p)
    for k in range(3):
        turned = cross(unit(k), force)
        moment = add(cross(at, turned), cross(unit(k), torque))
        for i in range(3):
            block[i, k] += sign * moment[i]
            block[3 + i, k] += sign * turned[i]


@jitable
def add_lever(scene, T, y, b, by, p, force, sign):
    """Add that the point p of a force on body b moves with body `by`, less that b's cg moves.

    The balance of inertia takes all forces along with the cg.
    """
    if b == len(scene.bodies.mass):
        return
    if by < len(scene.bodies.mass):
        carry(scene, T, b, by, from_origin(scene, T.linear, y, by, p), force, sign)
    carry(scene, T, b, b, vector(T.linear.r[b]), force, -sign)


@jitable
def carry(scene, T, b, by, at, force, sign):
    """Add the moment on body b of a force whose point, at from O, moves with body `by`."""
    block = T.linear.K[T.pattern.place[b, by]]
    for k in range(3):
        moment, slide = cross(cross(unit(k), at), force), cross(unit(k), force)
        for i in range(3):
            block[i, k] += sign * moment[i]
            block[i, 3 + k] += sign * slide[i]


@jitable
def add_geometry(scene, T, y, f, axes, at_j):
    """Add that force f turns with a marker's body (none if negative), and its points with theirs.

    `at_j`: what acts on J does so at J's origin, not at I's.
    """
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    row = scene.work.applied[f]
    force, torque = vector(row), (row[3], row[4], row[5])
    p = marker_point(scene, y, i)
    q, follows = (marker_point(scene, y, j), bj) if at_j == 1 else (p, bi)
    add_lever(scene, T, y, bi, bi, p, force, 1.0)
    add_lever(scene, T, y, bj, follows, q, force, -1.0)
    if axes >= 0:
        by = scene.markers.body[axes]
        add_turn(scene, T, y, bi, by, p, force, torque, 1.0)
        add_turn(scene, T, y, bj, by, q, force, torque, -1.0)


@jitable
def add_rate_by_pose(scene, T, f, u, by_rate, n):
    """Add how the rate n . (v_I - v_J) of a damper along n changes as the arms of points turn.

    theta . (arm x (n x w)); what the turning of n adds is left to its own.
    """
    P, L, nb = T.pattern, T.linear, len(scene.bodies.mass)
    markers, both = (scene.applied.i[f], scene.applied.j[f]), sides_of(scene, f)
    for side in range(2):
        b = both[side]
        if b == nb:
            continue
        w = vector(scene.work.w[b])
        rise = cross(marker_arm(scene, markers[side]), cross(n, w))
        for k in range(3):
            L.rise[k] = rise[k]
            L.rise[3 + k] = 0.0
        add_one_sided(P, L, nb, both, b, by_rate if side == 0 else -by_rate, u)


@jitable
def add_one_sided(P, L, nb, both, b, factor, u):
    """Add factor times the row in `L.rise`, of displacements of body b, to both bodies."""
    for other in range(2):
        a = both[other]
        if a < nb:
            add_product(L.K[P.place[a, b]], factor if other == 0 else -factor, u[other], L.rise)


@jitable
def add_turning_rate(scene, T, y, f, by_rate, n, d, u):
    """Add how the rate changes as the line turns: (v across)/d . (dP_I - dP_J)."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    bi, bj = sides_of(scene, f)
    v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    across = scale(1.0 / d, sub(v, scale(dot(v, n), n)))
    rows = T.linear.basis[:, 1]
    none = (0.0, 0.0, 0.0)
    lever(scene, T.linear, y, bi, marker_point(scene, y, i), across, none, rows[0])
    lever(scene, T.linear, y, bj, marker_point(scene, y, j), across, none, rows[1])
    nb = len(scene.bodies.mass)
    add_two_sided(T.pattern, T.linear.K, nb, bi, bj, by_rate, u, rows)


@jitable
def add_axis_rate(scene, T, f, by_rate, n, u, turns):
    """Add how the rate along J's axis n changes as that turns: theta_J . (n x v)."""
    i, j = scene.applied.i[f], scene.applied.j[f]
    b, nb, both = scene.markers.body[j], len(scene.bodies.mass), sides_of(scene, f)
    if b == nb:
        return
    if turns:
        w = scene.work.w
        v = sub(vector(w[both[0]]), vector(w[both[1]]))
    else:
        v = sub(marker_velocity(scene, i), marker_velocity(scene, j))
    rise = cross(n, v)
    for k in range(3):
        T.linear.rise[k] = rise[k]
        T.linear.rise[3 + k] = 0.0
    add_one_sided(T.pattern, T.linear, nb, both, b, by_rate, u)


@jitable
def add_vector_slopes(scene, T, t, y, f):
    """Add a vector force by expressions."""
    none = (0.0, 0.0, 0.0)
    for k in range(6):
        program = scene.applied.components[f, k]
        if program < 0:
            continue
        e = marker_axis(scene, scene.applied.axes[f], k % 3)
        u = fill_unit(scene, T, y, f, e if k < 3 else none, none if k < 3 else e, 0)
        add_program_slopes(scene, T, t, y, f, program, u)
    add_geometry(scene, T, y, f, scene.applied.axes[f], 0)


@jitable
def limit_slopes(scene, f, x, rate):
    """Return dF/dx and dF/dx' of a limit."""
    step = _PUSH * max(abs(x), 1e-3 * scene.world.scale[0])
    fast = _PART_OF_SPEED * scene.world.scale[1] + _PART * abs(rate)
    by_x = at_limit(scene, f, x + step, rate)[0] - at_limit(scene, f, x - step, rate)[0]
    by_rate = at_limit(scene, f, x, rate + fast)[0] - at_limit(scene, f, x, rate - fast)[0]
    return by_x / (2.0 * step), by_rate / (2.0 * fast)


@jitable
def add_scalar_slopes(scene, T, t, y, f):
    """Add a force along a line, along an axis or about one."""
    P, L, nb, kind = T.pattern, T.linear, len(scene.bodies.mass), scene.applied.kind[f]
    bi, bj = sides_of(scene, f)
    none, x, rate = (0.0, 0.0, 0.0), 0.0, 0.0
    if kind == LINE_FORCE:
        n, x, rate = along_line(scene, y, f)
    elif kind == AXIS_FORCE:
        n = marker_axis(scene, scene.applied.j[f], 2)
    elif kind == SLIDE_LIMIT:
        n, x, rate = along_slide(scene, y, f)
    else:
        n, x, rate = along_axis(scene, f)
    turns = kind == AXIS_TORQUE or kind == TURN_LIMIT
    u = fill_unit(scene, T, y, f, none if turns else n, n if turns else none, 1)
    if kind == SLIDE_LIMIT or kind == TURN_LIMIT:
        by_x, by_rate = limit_slopes(scene, f, x, rate)
    elif scene.applied.program[f] >= 0:
        add_program_slopes(scene, T, t, y, f, scene.applied.program[f], u)
        by_x, by_rate = 0.0, 0.0
    else:
        by_x, by_rate = -scene.applied.par[f, 0], -scene.applied.par[f, 1]
    if by_x != 0.0:
        add_two_sided(P, L.K, nb, bi, bj, by_x, u, u)
    line = kind == LINE_FORCE
    if by_rate != 0.0:
        add_two_sided(P, L.D, nb, bi, bj, by_rate, u, u)
        if not turns:
            add_rate_by_pose(scene, T, f, u, by_rate, n)
        if not line:
            add_axis_rate(scene, T, f, by_rate, n, u, turns)
        elif x > 0.0:
            add_turning_rate(scene, T, y, f, by_rate, n, x, u)
    add_geometry(scene, T, y, f, -1 if line else scene.applied.j[f], 1)
    if line and x > 0.0:
        # the line turns: F/d across it
        tension = dot(vector(scene.work.applied[f]), n) / x
        a = cross(n, (1.0, 0.0, 0.0) if abs(n[0]) < 0.6 else (0.0, 1.0, 0.0))
        a = scale(1.0 / norm(a), a)
        for e in (a, cross(n, a)):
            u = fill_unit(scene, T, y, f, e, none, 1)
            add_two_sided(P, L.K, nb, bi, bj, tension, u, u)


@jitable
def add_dry_slopes(scene, T, y, f):
    """Add dry friction: a spring where it sticks, in slip nothing but that its axis turns."""
    n, x, _ = dry_motion(scene, y, f)
    none, turns = (0.0, 0.0, 0.0), scene.applied.kind[f] == DRY_TURN
    _, gives = dry_now(scene, f, x)
    if gives == 0.0 and scene.applied.equation[f] >= 0:
        return
    if gives == 0.0:
        u = fill_unit(scene, T, y, f, none if turns else n, n if turns else none, 0)
        bi, bj = sides_of(scene, f)
        k = scene.applied.par[f, STIFFNESS]
        add_two_sided(T.pattern, T.linear.K, len(scene.bodies.mass), bi, bj, -k, u, u)
    add_geometry(scene, T, y, f, scene.applied.j[f], 0)


@jitable
def add_applied_slopes(scene, T, t, y):
    """Add what forces between markers do, but for marker forces and friction in joints."""
    for f in range(len(scene.applied.kind)):
        kind = scene.applied.kind[f]
        if kind == VECTOR_FORCE:
            add_vector_slopes(scene, T, t, y, f)
        elif is_dry(kind):
            add_dry_slopes(scene, T, y, f)
        elif kind != MARKER_FORCE and kind != RESIDUAL and scene.applied.connection[f] < 0:
            add_scalar_slopes(scene, T, t, y, f)
    return 0


@jitable
def fill_state_slopes(scene, T, t, y):
    """Fill how the slopes of the user's own states change with bodies and with each other."""
    L, first = T.linear, len(scene.equations.program)
    for z in range(len(scene.states.program)):
        program = scene.states.program[z]
        for other in range(len(scene.states.program)):
            L.slopes[z, other] = 0.0
        for at in range(T.depends.body_start[program], T.depends.body_start[program + 1]):
            b = T.depends.body[at]
            program_rise(scene, T, t, y, program, b, L.rise)
            for k in range(6):
                L.row[first + z, b, k] = L.rise[k]
                L.row_rate[first + z, b, k] = L.rise[6 + k]
        for at in range(T.depends.state_start[program], T.depends.state_start[program + 1]):
            other = T.depends.state[at]
            L.slopes[z, other] = state_rise(scene, T, t, y, program, other)
