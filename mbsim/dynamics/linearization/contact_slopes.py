"""How contacts change with displacements and velocities: more of K and D.

Incidents are frozen: contact point, normal and tangents stay where they are on the bodies, and X
and memory as they are. Laws are asked at neighbouring arguments.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from mbsim.arrays.codes import AT_FAULT, PRESS_BY_DEPTH, PRESS_BY_RATE, SCALE_LENGTH, SCALE_SPEED
from mbsim.arrays.hooks import FaceSlopes, Hook, Memory
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_float, call_int
from mbsim.core.arrays import F1, F2, F3, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
from mbsim.dynamics.contact.forces import (
    FORCE,
    NORMAL,
    TILTING,
    contact_of,
    face_weight_of,
    friction,
    gain_of,
    in_marker,
    patch,
    sides,
    stands_for_points,
    velocity_at,
)
from mbsim.dynamics.linearization.blocks import couple
from mbsim.dynamics.linearization.stiffness import PART, PART_OF_SPEED, add_two_sided, lever
from mbsim.geometry.catalog import (
    AT_DEPTH,
    AT_NORMAL,
    AT_POINT,
    AT_WEIGHT,
    COUPLE,
    COUPLE_OF_FORCE,
    LEAN_X,
    LEAN_Y,
    MOMENT_XX,
    MOMENT_XY,
    MOMENT_YY,
    REGION_ROWS,
    STIFF_XX,
    STIFF_XY,
    STIFF_YY,
    plane_axes,
)
from mbsim.laws.abi import DFLAG, LOAD
from mbsim.laws.catalog import SLIP
from mbsim.laws.friction.stiction import KEPT_MODE, KEPT_SPEED, KEPT_X, KEPT_Y
from mbsim.laws.user_normal import AREA, EXPLORE, MODE, NORMAL_INPUTS, SLOPES

if TYPE_CHECKING:
    from mbsim.compile_model.tangent import Pattern, Tangent


# rows of `basis`: levers of units along n, x, y, and about x, y, n; how the force of one incident
# for many points changes; of one of these points, and how far that moves the force
ALONG_N, ALONG_X, ALONG_Y, ABOUT_X, ABOUT_Y, ABOUT_N, PRESS, POINT, MOVED = range(9)
# columns of `law`, and what it is asked at
SLIP_X, SLIP_Y, SPIN_X, SPIN_Y, SPIN_N, PRESSED = range(6)
#: Slip, over the model's speed, below which directions of rigid friction converge only as far as
#: slip does that is so fast: its part across may be as large as there.
SLOW = 1e-3
#: Least difference of slip over the usual one: what is slower is at rest.
AT_REST = 1e-4
#: Differences of slip that is rigid, as a part of what it was at the committed state.
_PART_OF_SLIP = 1e-3


@jitable
def contact_bodies(scene: Scene, s: int) -> tuple[int, int]:
    """Return the bodies of a slot."""
    gi, gj = sides(scene, s)
    return scene.graphics.body[gi], scene.graphics.body[gj]


@jitable
def couple_contacts(scene: Scene, P: Pattern) -> bool:
    """Couple the bodies that touch; return whether there is room."""
    nb, hit = len(scene.bodies.mass), scene.work.hit
    for k in range(hit[len(hit) - 1]):
        i, j = contact_bodies(scene, hit[k])
        if i < nb and j < nb and i != j and not couple(P, i, j):
            return False
    return True


@jitable
def ask_friction(
    scene: Scene, t: float, h: float, y: F1, s: int, c: int, around: tuple[V3, V3], given: F1
) -> int:
    """Return code of the friction law; `given`: slip (2), spin rates (3), normal force."""
    loci, locj = around
    slip, spin = (given[0], given[1]), (given[2], given[3], given[4])
    scene.work.law_in[DFLAG] = 1.0
    code = friction(scene, t, h, y, s, c, loci, locj, spin, slip, given[PRESSED])
    scene.work.law_in[DFLAG] = 0.0
    return code


@jitable
def rigid_slip(scene: Scene, s: int, c: int) -> float:
    """Return over which slip the friction of slot s turns if it is rigid and slips, else 0."""
    kept = scene.state.memory[s]
    if scene.contacts.rigid[c] == 0 or kept[KEPT_MODE] != SLIP:
        return 0.0
    return kept[KEPT_SPEED] + math.hypot(kept[KEPT_X], kept[KEPT_Y])


@jitable
def friction_slopes(
    scene: Scene,
    t: float,
    h: float,
    y: F1,
    s: int,
    c: int,
    around: tuple[V3, V3],
    given: F1,
    table: F2,
) -> int:
    """Fill rows of d(Fx, Fy, Mx, My, Tz)/d(slip x, y, spin x, y, z, normal); return a code."""
    out, least = scene.work.law_out, PART_OF_SPEED * scene.world.scale[SCALE_SPEED]
    base, code, speed = table[:, 6:11], 0, rigid_slip(scene, s, c)
    if speed > 0.0:
        # it turns over a way in velocities as short as itself
        least = min(least, max(_PART_OF_SLIP * speed, AT_REST * least))
    for column in range(6):
        size = PART * abs(given[column])
        if column < 5:
            size += least if column < 2 else least / scene.world.scale[SCALE_LENGTH]
        elif size == 0.0:
            size = PART
        kept = given[column]
        # nothing presses with less than 0
        low = max(0.0, kept - size) if column == PRESSED else kept - size
        for side in range(2):
            given[column] = kept + size if side == 0 else low
            code = ask_friction(scene, t, h, y, s, c, around, given)
            if code != 0:
                return code
            for r in range(5):
                if side == 0:
                    base[column, r] = out[r]
                else:
                    table[r, column] = (base[column, r] - out[r]) / (kept + size - low)
        given[column] = kept
    return 0


@jitable
def lay_levers(scene: Scene, T: Tangent, y: F1, s: int) -> float:
    """Fill the levers along n and about both `plane_axes`; return which way these go round n."""
    point, none, L = scene.work.points[s], (0.0, 0.0, 0.0), T.linear
    bodies = contact_bodies(scene, s)
    p, n = vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
    ax, ay = plane_axes(n)
    for side in range(2):
        lever(scene, L, y, bodies[side], p, n, none, L.basis[side, ALONG_N])
        lever(scene, L, y, bodies[side], p, none, ax, L.basis[side, ABOUT_X])
        lever(scene, L, y, bodies[side], p, none, ay, L.basis[side, ABOUT_Y])
    return dot(cross(ax, ay), n)


@jitable
def add_tilting(
    scene: Scene, T: Tangent, matrix: F3, s: int, moments: tuple[float, float, float]
) -> None:
    """Add to K or D a couple against tilting by moments xx, xy, yy of slot s about its levers."""
    P, nb, (xx, xy, yy) = T.pattern, len(scene.bodies.mass), moments
    i, j = contact_bodies(scene, s)
    u, v = T.linear.basis[:, ABOUT_X], T.linear.basis[:, ABOUT_Y]
    add_two_sided(P, matrix, nb, i, j, -yy, u, u)
    add_two_sided(P, matrix, nb, i, j, xy, u, v)
    add_two_sided(P, matrix, nb, i, j, xy, v, u)
    add_two_sided(P, matrix, nb, i, j, -xx, v, v)


@jitable
def damp_tilting(scene: Scene, T: Tangent, y: F1, s: int) -> float:
    """Add the couple against tilting of `contact.tilting`; return what `lay_levers` does."""
    way, numbers = lay_levers(scene, T, y, s), scene.work.points[s + 1]
    c = scene.work.slot[s, TILTING]
    moments = (c * numbers[MOMENT_XX], c * numbers[MOMENT_XY], c * numbers[MOMENT_YY])
    add_tilting(scene, T, T.linear.D, s, moments)
    return way


@jitable
def resist_tilting(scene: Scene, T: Tangent, y: F1, s: int) -> None:
    """Add the couples of a patch that tilts: of its dampers, and as its centre moves.

    Where its depth changes along the patch, getting deeper moves the centre too.
    """
    way, numbers, basis = damp_tilting(scene, T, y, s), scene.work.points[s + 1], T.linear.basis
    for side in range(2):
        for c in range(6):
            along = way * basis[side, ALONG_N, c]
            basis[side, ABOUT_X, c] -= numbers[LEAN_Y] * along
            basis[side, ABOUT_Y, c] += numbers[LEAN_X] * along
    press = scene.work.slot[s, NORMAL] / scene.work.points[s, AT_WEIGHT]
    moments = (press * numbers[STIFF_XX], press * numbers[STIFF_XY], press * numbers[STIFF_YY])
    add_tilting(scene, T, T.linear.K, s, moments)


@jitable
def add_region_stiffness(
    scene: Scene, T: Tangent, y: F1, s: int, force: float, by_depth: float
) -> float:
    """Add how the force of one incident for many points changes with depth and tilt.

    With the energy S U(d), d^2 = sum w_i d_i^2 / S of `geometry.region` and g_i the displacement
    into the other body at point i, its second derivative is
    F/d sum w_i g_i g_i' + (F' - F/d) / (S d^2) g g' with g = sum w_i d_i g_i. `force` is F,
    `by_depth` F'; return how the whole force changes where all depths change alike. How it changes
    with displacements is left in row PRESS of `basis`.
    """
    P, L, rows, nb = T.pattern, T.linear, scene.work.points, len(scene.bodies.mass)
    i, j = contact_bodies(scene, s)
    depth, whole, none = rows[s, AT_DEPTH], face_weight_of(scene, s), (0.0, 0.0, 0.0)
    one, every, press = L.basis[:, POINT], L.basis[:, MOVED], L.basis[:, PRESS]
    every[:] = press[:] = 0.0
    weight, moment = 0.0, 0.0
    first = s + REGION_ROWS
    for k in range(first, s + scene.kinds.step[scene.pairs.kind[scene.slots.pair[s]]]):
        if rows[k, AT_DEPTH] > 0.0:
            p, n, w = vector(rows[k, AT_POINT:]), vector(rows[k, AT_NORMAL:]), rows[k, AT_WEIGHT]
            for side in range(2):
                lever(scene, L, y, i if side == 0 else j, p, n, none, one[side])
            add_two_sided(P, L.K, nb, i, j, -w * force / depth, one, one)
            weight += w
            moment += w * rows[k, AT_DEPTH]
            for side in range(2):
                for c in range(6):
                    every[side, c] += w * rows[k, AT_DEPTH] * one[side, c]
                    press[side, c] += w * force / depth * one[side, c]
    rest = (by_depth - force / depth) / (whole * depth * depth)
    add_two_sided(P, L.K, nb, i, j, -rest, every, every)
    for side in range(2):
        for c in range(6):
            press[side, c] += rest * moment * every[side, c]
    damp_tilting(scene, T, y, s)
    return force / depth * weight + rest * moment * moment


@jitable
def add_moves_of_centre(scene: Scene, T: Tangent, y: F1, s: int, by_rate: float) -> None:
    """Add that friction acts elsewhere, and at another slip, where tilting moves their centre.

    The centre is sum w_i d_i p_i / sum w_i d_i: as point i gets deeper by 1, it moves by
    w_i (p_i - p) / sum w_i d_i. Rows 1 to 5 of `basis` are those of friction, `law` its slopes.
    """
    P, L, work, nb = T.pattern, T.linear, scene.work, len(scene.bodies.mass)
    i, j = contact_bodies(scene, s)
    point, none, weight = work.points[s], (0.0, 0.0, 0.0), 0.0
    p, n, tx = vector(point[AT_POINT:]), vector(point[AT_NORMAL:]), vector(work.t[s])
    ty, w_rel = cross(n, tx), sub(vector(work.w[i]), vector(work.w[j]))
    tangential = sub(vector(work.slot[s, FORCE : FORCE + 3]), scale(work.slot[s, NORMAL], n))
    one, moved, first = L.basis[:, POINT], L.basis[:, MOVED], s + REGION_ROWS
    last = s + scene.kinds.step[scene.pairs.kind[scene.slots.pair[s]]]
    for k in range(first, last):
        weight += max(0.0, work.points[k, AT_DEPTH]) * work.points[k, AT_WEIGHT]
    for k in range(first, last):
        row = work.points[k]
        if row[AT_DEPTH] <= 0.0:
            continue
        q = sub(vector(row[AT_POINT:]), p)
        faster = cross(w_rel, q)
        slip_x, slip_y, rate = dot(faster, tx), dot(faster, ty), -dot(faster, n)
        torque = cross(q, tangential)
        for side in range(2):
            b = i if side == 0 else j
            lever(scene, L, y, b, vector(row[AT_POINT:]), vector(row[AT_NORMAL:]), none, one[side])
            lever(scene, L, y, b, p, scale(by_rate * rate, n), torque, moved[side])
            for r in range(5):
                rise = L.law[r, SLIP_X] * slip_x + L.law[r, SLIP_Y] * slip_y
                rise += L.law[r, PRESSED] * by_rate * rate
                for c in range(6):
                    moved[side, c] += rise * L.basis[side, ALONG_X + r, c]
        add_two_sided(P, L.K, nb, i, j, -row[AT_WEIGHT] / weight, moved, one)


@jitable
def has_couples(scene: Scene, s: int) -> bool:
    """Return whether the weight or the depth of slot s turns with the shapes."""
    point = scene.work.points[s]
    for k in range(3):
        if point[COUPLE + k] != 0.0 or point[COUPLE_OF_FORCE + k] != 0.0:
            return True
    return False


@jitable
def add_couples(scene: Scene, T: Tangent, y: F1, s: int, by_depth: float) -> None:
    """Add how the normal force and the couples of slot s change with depth and weight.

    With the energy w U(d) of `geometry.catalog` and the couples C of energy and B of force the
    displacements u along the depth and C about the weight give the second derivative
    w F' u u' + F (u C' + C u'), u = n + B / w; w itself turns about C once more, which is little
    beside F' where a contact is less deep than its levers are long. `by_depth` is w F'. How the
    force changes with displacements is left in row PRESS of `basis`.
    """
    P, L, point, nb = T.pattern, T.linear, scene.work.points[s], len(scene.bodies.mass)
    i, j = contact_bodies(scene, s)
    p, n, none = vector(point[AT_POINT:]), vector(point[AT_NORMAL:]), (0.0, 0.0, 0.0)
    force, gain = scene.work.slot[s, NORMAL] / point[AT_WEIGHT], gain_of(scene, s)
    turned = scale(1.0 / (point[AT_WEIGHT] * gain), vector(point[COUPLE_OF_FORCE:]))
    about, deeper, press = L.basis[:, POINT], L.basis[:, MOVED], L.basis[:, PRESS]
    for side in range(2):
        b = i if side == 0 else j
        lever(scene, L, y, b, p, none, vector(point[COUPLE:]), about[side])
        lever(scene, L, y, b, p, n, turned, deeper[side])
        for c in range(6):
            press[side, c] = by_depth * deeper[side, c] + force * about[side, c]
    add_two_sided(P, L.K, nb, i, j, -1.0, deeper, press)
    add_two_sided(P, L.K, nb, i, j, -force, about, deeper)


@jitable
def normal_slopes(
    scene: Scene, s: int, c: int, depth: float, rate: float
) -> tuple[int, float, float]:
    """Return code and how the normal force in slot s changes as bodies get nearer, and faster."""
    contacts, out, gain = scene.contacts, scene.work.law_out, gain_of(scene, s)
    weight = gain * gain * scene.work.points[s, AT_WEIGHT]
    user = contacts.user_normal[c]
    if user != 0:
        inputs = floats_at(user, NORMAL_INPUTS)
        inputs[MODE], inputs[AREA] = SLOPES, patch(scene, s)
    step = PART * depth
    call = (depth + step, rate, contacts.normal_par[c], out)
    code = call_int(contacts.normal_law[c], call)
    upper = out[LOAD]
    code += call_int(contacts.normal_law[c], (depth - step, rate, contacts.normal_par[c], out))
    by_depth = weight * (upper - out[LOAD]) / (2.0 * step)
    step = PART * abs(rate) + PART_OF_SPEED * scene.world.scale[SCALE_SPEED]
    code += call_int(contacts.normal_law[c], (depth, rate + step, contacts.normal_par[c], out))
    upper = out[LOAD]
    code += call_int(contacts.normal_law[c], (depth, rate - step, contacts.normal_par[c], out))
    by_rate = weight * (upper - out[LOAD]) / (2.0 * step)
    if user != 0:
        floats_at(user, NORMAL_INPUTS)[MODE] = EXPLORE
    return code, by_depth, by_rate


@jitable
def add_contact_slopes(  # noqa: C901
    scene: Scene, T: Tangent, t: float, h: float, y: F1, s: int
) -> int:
    """Add what the incident in slot s does, as `contact.add_contact` left it; return a code.

    Many branches because normal force, friction and its memory share levers and the law's slopes.
    """
    P, L, contacts, work = T.pattern, T.linear, scene.contacts, scene.work
    nb, c = len(scene.bodies.mass), contact_of(scene, s)
    gi, gj = sides(scene, s)
    i, j = scene.graphics.body[gi], scene.graphics.body[gj]
    point = work.points[s]
    depth, p, n = point[AT_DEPTH], vector(point[AT_POINT:]), vector(point[AT_NORMAL:])
    weight, none = point[AT_WEIGHT], (0.0, 0.0, 0.0)
    closing = -dot(sub(velocity_at(scene, y, i, p), velocity_at(scene, y, j, p)), n)
    rate = gain_of(scene, s) * closing

    code, by_depth, by_rate = normal_slopes(scene, s, c, depth, rate)
    if code != 0:
        return code

    # depth and its rate are -n . of displacement and velocity
    normal, region = L.basis, stands_for_points(scene, s)
    if face_weight_of(scene, s) > 0.0 and not region:
        asked = (scene, FaceSlopes.TILTING, s, 0.0, 0.0, y)
        call_float(scene.world.hooks[Hook.FACE_SLOPES], asked)
    if region:
        slope = by_depth / weight
        asked = (scene, FaceSlopes.STIFFNESS, s, work.slot[s, NORMAL] / weight, slope, y)
        by_depth = call_float(scene.world.hooks[Hook.FACE_SLOPES], asked)
    for side in range(2):
        lever(scene, L, y, i if side == 0 else j, p, n, none, normal[side, ALONG_N])
    u, v = normal[:, ALONG_N], normal[:, ALONG_N]
    coupled = not region and has_couples(scene, s)
    if coupled:
        add_couples(scene, T, y, s, by_depth)
    elif not region:
        add_two_sided(P, L.K, nb, i, j, -by_depth, u, v)
    add_two_sided(P, L.D, nb, i, j, -by_rate, u, v)
    if contacts.friction_law[c] == 0:
        return 0

    tx = vector(work.t[s])
    ty = cross(n, tx)
    v_rel = sub(velocity_at(scene, y, i, p), velocity_at(scene, y, j, p))
    w_rel = sub(vector(work.w[i]), vector(work.w[j]))
    given = L.rise[0:6]
    given[SLIP_X], given[SLIP_Y] = dot(v_rel, tx), dot(v_rel, ty)
    given[SPIN_X], given[SPIN_Y] = dot(w_rel, tx), dot(w_rel, ty)
    given[SPIN_N] = dot(w_rel, n)
    given[PRESSED] = max(work.slot[s, NORMAL], 0.0)
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
        slow = min(math.hypot(given[SLIP_X], given[SLIP_Y]), rigid_slip(scene, s, c))
        counts = min(1.0, slow / (SLOW * scene.world.scale[SCALE_SPEED]))
    # bristles that are damped rub by more than what presses as that falls to 0: velocities that
    # differ by rounding then change friction by much of it
    force = vector(work.slot[s, FORCE : FORCE + 3])
    pressed = max(given[PRESSED], math.hypot(dot(force, tx), dot(force, ty)))
    for k in range(4):
        slope = counts * L.law[k // 2, k % 2] / pressed if given[PRESSED] > 0.0 else 0.0
        work.friction_slope[s, k] = slope
    for side in range(2):
        b = i if side == 0 else j
        rows = L.basis[side]
        lever(scene, L, y, b, p, tx, none, rows[ALONG_X])
        lever(scene, L, y, b, p, ty, none, rows[ALONG_Y])
        lever(scene, L, y, b, p, none, tx, rows[ABOUT_X])
        lever(scene, L, y, b, p, none, ty, rows[ABOUT_Y])
        lever(scene, L, y, b, p, none, n, rows[ABOUT_N])
    for r in range(5):
        u = L.basis[:, ALONG_X + r]
        for column in range(5):
            if L.law[r, column] != 0.0:
                add_two_sided(P, L.D, nb, i, j, L.law[r, column], u, L.basis[:, ALONG_X + column])
        by_normal = L.law[r, PRESSED]
        if by_normal != 0.0:
            if region or coupled:
                add_two_sided(P, L.K, nb, i, j, -by_normal, u, L.basis[:, PRESS])
            else:
                add_two_sided(P, L.K, nb, i, j, -by_normal * by_depth, u, L.basis[:, ALONG_N])
            add_two_sided(P, L.D, nb, i, j, -by_normal * by_rate, u, L.basis[:, ALONG_N])
    if region:
        asked = (scene, FaceSlopes.CENTRE, s, by_rate, 0.0, y)
        call_float(scene.world.hooks[Hook.FACE_SLOPES], asked)
    if scene.world.hooks[Hook.MEMORY] != 0 and (scene.slots.x[s] >= 0 or scene.slots.z[s] >= 0):
        K = T.keeps
        count = K.held[len(K.held) - 1]
        K.held[count] = s
        K.press[count, PRESS_BY_DEPTH], K.press[count, PRESS_BY_RATE] = by_depth, by_rate
        return call_int(scene.world.hooks[Hook.MEMORY], (scene, Memory.FILL, y, y))
    return 0


@jitable
def add_contacts_slopes(scene: Scene, T: Tangent, t: float, h: float, y: F1) -> int:
    """Add what all incidents do; return a code."""
    hit = scene.work.hit
    for k in range(hit[len(hit) - 1]):
        code = add_contact_slopes(scene, T, t, h, y, hit[k])
        if code != 0:
            scene.work.diagnostics[AT_FAULT] = contact_of(scene, hit[k])
            return code
    return 0
