"""Friction of a solid of revolution that stands on a plane: its law is asked all round the rim.

The normal force has three points of a rim, which follow the tilt (`geometry.pairs.revolution`).
They tell height and tilt alike in all directions; of a body that slides and spins friction at three
points would depend on where these are, and an upright one has no lowest point. So each point's
friction is that of its normal force N spread over the whole rim, of centre c and radius r: where
the rim slips with v, at AROUND places q at even angles, halves of a pace from the direction of v,

    N_q = N (1 + 2 a cos(q, lowest))        F = mean f(v + w n x (q - c), N_q)

and the torque about n is that of these forces. a is how far the centre of pressure is from c, over
r, by the elastic forces of the three points: the sum has the centre of the pressure. So force and
torque are the same whichever way the solid's own axes lie, and go through an upright pose without a
jump. From a = 1/2 on, where a linear pressure would be 0 at one place, the point's own friction
comes in, and is all there is from where one of the three points leaves (a = 1).

A law that integrates its memory z, a stretch, keeps of the stretch over the rim what a rigid rim
can make of it,

    z_q = z + y (n x (q - c))/r             z' = mean z'_q        y' = mean z'_q . (n x (q - c))/r

so it has a number more: y [L]. Where a point has its own friction that law knows z alone, and y is
forgotten over a way of r.

A law that tells sticking from slipping has one place for each point, which keeps its angle in the
incident marker: the first lies where the middle of the rim slips to when it touches, the others 120
degrees to both sides. What rubs there is the part of N that the linear pressure has at them.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import AROUND_RIM, FRICTION_CALLS, STRETCH
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.contact.forces import PRESSED_PART, contact_of
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT
from mbsim.laws.abi import (
    ELASTIC,
    FORCE_X_OUT,
    FORCE_Y_OUT,
    FRICTION_INPUTS,
    MEMORY_OUT,
    NFORCE_IN,
    SIZE_OUT,
    STORED_OUT,
    TORQUE_X_OUT,
    TORQUE_Y_OUT,
    TORQUE_Z_OUT,
    XDOT_IN,
)

#: Places on a rim.
AROUND = 8
TURN = 2.0 * math.pi
#: Points of a rim that have a normal force.
POINTS = 3
#: Slip of this part of the speed of a fall by a radius is none.
AT_REST = 1e-6
#: Numbers that a law keeps all round a rim that integrates a stretch.
KEPT = STRETCH + 1


@jitable
def first_of_rim(scene: Scene, s: int) -> int:
    """Return the slot of the lowest point of the rim of slot s, -1 if its pair has no rims."""
    pair = scene.slots.pair[s]
    if scene.kinds.rims[scene.pairs.kind[pair]] == 0:
        return -1
    return s - (s - scene.pairs.slot[pair]) % POINTS


@jitable
def is_touched(scene: Scene, first: int) -> bool:
    """Return whether all points of a rim touch."""
    for k in range(first, first + POINTS):
        if scene.work.points[k, AT_DEPTH] <= 0.0:
            return False
    return True


@jitable
def pressure_of(scene: Scene, c: int, depth: float) -> float:
    """Return the elastic force of contact c at a depth; of a user's law the depth stands for it."""
    if scene.contacts.user_normal[c] != 0:
        return depth
    out = scene.work.law_out
    call_int(scene.contacts.normal_law[c], (depth, 0.0, scene.contacts.normal_par[c], out))
    return out[ELASTIC]


@jitable
def eccentricity(scene: Scene, c: int, first: int) -> float:
    """Return how far the centre of pressure of a rim is from its middle, over its radius: 0..1."""
    points = scene.work.points
    low = pressure_of(scene, c, points[first, AT_DEPTH])
    high = pressure_of(scene, c, points[first + 1, AT_DEPTH])
    total = low + 2.0 * high
    return max(0.0, min(1.0, (low - high) / total)) if total > 0.0 else 1.0


@jitable
def in_frame(scene: Scene, s: int, p: V3) -> V2:
    """Return a vector along x and y of the incident marker of slot s."""
    tx = vector(scene.work.t[s])
    return dot(p, tx), dot(p, cross(vector(scene.work.points[s, AT_NORMAL:]), tx))


@jitable
def levers(scene: Scene, s: int, first: int) -> tuple[V2, V2]:
    """Return where slot s and the lowest point are from the rim's centre, along x and y [L]."""
    points, centre = scene.work.points, (0.0, 0.0, 0.0)
    for k in range(POINTS):
        centre = add(centre, scale(1.0 / POINTS, vector(points[first + k, AT_POINT:])))
    own = in_frame(scene, s, sub(vector(points[s, AT_POINT:]), centre))
    return own, in_frame(scene, s, sub(vector(points[first, AT_POINT:]), centre))


@jitable
def add_number(scene: Scene, c: int, value: float) -> None:
    """Add the number that a rim keeps to those that the law of contact c left in `law_out`."""
    out, at = scene.work.law_out, MEMORY_OUT + scene.contacts.memory[c]
    # rates follow behind
    out[at + 1], out[at] = out[at], out[at - 1]
    out[at - 1] = value


@jitable
def ask_point(scene: Scene, s: int, c: int) -> int:
    """Ask the friction law of contact c at the point of slot s; return its code."""
    contacts, work = scene.contacts, scene.work
    call = (contacts.id[c], work.law_in, contacts.friction_par[c], work.law_out)
    code = call_int(contacts.friction_law[c], call)
    if contacts.memory[c] > 0:
        add_number(scene, c, work.law_in[FRICTION_INPUTS + contacts.memory[c] - 1])
        if contacts.carried[c] == KEPT:
            work.law_out[MEMORY_OUT + KEPT + STRETCH] = 0.0
    return code


@jitable
def ask_over_rim(scene: Scene, s: int, c: int) -> int:
    """Ask the friction law of contact c for slot s, all over its rim where that is touched.

    `law_in` is filled for the point of slot s, and stays. Results are left in `law_out` as a law
    leaves them, torques about the point; returns the law's code. Long because forces, torque and
    what is kept are sums over the same places.
    """
    contacts, given, out = scene.contacts, scene.work.law_in, scene.work.law_out
    first = first_of_rim(scene, s)
    if first < 0 or not is_touched(scene, first):
        return ask_point(scene, s, c)
    off = eccentricity(scene, c, first)
    part = min(1.0, 2.0 * (1.0 - off))
    if part <= 0.0:
        return ask_point(scene, s, c)
    keeps, z = contacts.memory[c] == KEPT, FRICTION_INPUTS
    (px, py), (lx, ly) = levers(scene, s, first)
    r = math.hypot(lx, ly)
    slip_x, slip_y, spin = given[XDOT_IN], given[XDOT_IN + 1], given[XDOT_IN + 2]
    normal = given[NFORCE_IN]
    fx, fy, mx, my, tz, stored = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    zx, zy, twist, size, rate_x, rate_y, rate_twist = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    if keeps:
        zx, zy, twist = given[z], given[z + 1], given[z + STRETCH]
    if part < 1.0:
        code = ask_point(scene, s, c)
        if code != 0:
            return code
        rest = 1.0 - part
        fx, fy, tz = rest * out[FORCE_X_OUT], rest * out[FORCE_Y_OUT], rest * out[TORQUE_Z_OUT]
        mx, my = rest * out[TORQUE_X_OUT], rest * out[TORQUE_Y_OUT]
        if keeps:
            stored, size = rest * out[STORED_OUT], rest * out[SIZE_OUT]
            rate_x, rate_y = rest * out[MEMORY_OUT + KEPT], rest * out[MEMORY_OUT + KEPT + 1]
            rate_twist = -rest * math.hypot(slip_x, slip_y) / r * twist
    # the middle of the rim
    ux, uy = slip_x + spin * py, slip_y - spin * px
    speed = math.hypot(ux, uy)
    ex, ey = (ux / speed, uy / speed) if speed > 0.0 else (1.0, 0.0)
    # the tip of a cone is a rim of no radius
    uneven = 2.0 * min(off, 0.5) / r if r > 0.0 else 0.0
    share, code = part / AROUND, 0
    call = (contacts.id[c], given, contacts.friction_par[c], out)
    scene.log.counters[FRICTION_CALLS] += AROUND - 1
    for k in range(AROUND):
        angle = TURN / AROUND * (k + 0.5)
        a, b = math.cos(angle), math.sin(angle)
        # along the place's radius; its way round is (-b, a)
        a, b = a * ex - b * ey, a * ey + b * ex
        given[XDOT_IN], given[XDOT_IN + 1] = ux - spin * r * b, uy + spin * r * a
        given[NFORCE_IN] = normal * max(0.0, 1.0 + uneven * (a * lx + b * ly))
        if keeps:
            given[z], given[z + 1] = zx - twist * b, zy + twist * a
        code = call_int(contacts.friction_law[c], call)
        if code != 0:
            break
        gx, gy = share * out[FORCE_X_OUT], share * out[FORCE_Y_OUT]
        fx, fy = fx + gx, fy + gy
        mx, my = mx + share * out[TORQUE_X_OUT], my + share * out[TORQUE_Y_OUT]
        tz += share * out[TORQUE_Z_OUT] + (r * a - px) * gy - (r * b - py) * gx
        if keeps:
            stored, size = stored + share * out[STORED_OUT], size + share * out[SIZE_OUT]
            dx, dy = share * out[MEMORY_OUT + STRETCH], share * out[MEMORY_OUT + STRETCH + 1]
            rate_x, rate_y, rate_twist = rate_x + dx, rate_y + dy, rate_twist + a * dy - b * dx
    given[XDOT_IN], given[XDOT_IN + 1], given[NFORCE_IN] = slip_x, slip_y, normal
    out[FORCE_X_OUT], out[FORCE_Y_OUT] = fx, fy
    out[TORQUE_X_OUT], out[TORQUE_Y_OUT], out[TORQUE_Z_OUT] = mx, my, tz
    if keeps:
        given[z], given[z + 1] = zx, zy
        out[STORED_OUT], out[SIZE_OUT] = stored, size
        at = MEMORY_OUT
        out[at], out[at + 1], out[at + STRETCH] = zx, zy, twist
        out[at + KEPT], out[at + KEPT + 1], out[at + KEPT + STRETCH] = rate_x, rate_y, rate_twist
    return code


@jitable
def pace(scene: Scene, s: int, first: int) -> float:
    """Return the angle from each point of a rim to the next in the incident marker of slot s."""
    points = scene.work.points
    low = vector(points[first, AT_POINT:])
    ax, ay = in_frame(scene, s, sub(vector(points[first + 1, AT_POINT:]), low))
    bx, by = in_frame(scene, s, sub(vector(points[first + 2, AT_POINT:]), low))
    return math.copysign(TURN / POINTS, ax * by - ay * bx)


@jitable
def angle_of_place(scene: Scene, s: int, first: int, r: float, slip: V2) -> float:
    """Return the angle of the place of slot s in its incident marker [rad].

    It was chosen when the slot began to touch: 120 degrees from those of its rim that touched
    before, else along the solid's slip at the middle of the rim, of radius r; where it does
    not slip along gravity, which will make it.
    """
    state = scene.state
    last = scene.contacts.memory[contact_of(scene, s)] - 1
    if state.touching[s] == 1:
        return scene.work.law_in[FRICTION_INPUTS + last]
    for k in range(first, first + POINTS):
        if state.touching[k] == 1:
            n, tx, angle = vector(state.n[k]), vector(state.t[k]), state.memory[k, last]
            ty = cross(n, tx)
            x, y = in_frame(scene, s, add(scale(math.cos(angle), tx), scale(math.sin(angle), ty)))
            return math.atan2(y, x) + pace(scene, s, first) * (s - k)
    # of the solid on the plane, whichever of them is I
    way = -1.0 if scene.kinds.swapped[scene.pairs.kind[scene.slots.pair[s]]] == 1 else 1.0
    x, y = in_frame(scene, s, vector(scene.world.gravity))
    size = norm(vector(scene.world.gravity))
    falls = AT_REST * math.sqrt(r / size) if size > 0.0 else 0.0
    return math.atan2(way * slip[1] + falls * y, way * slip[0] + falls * x) + pace(
        scene, s, first
    ) * (s - first)


@jitable
def ask_at_place(scene: Scene, s: int, c: int) -> int:
    """Ask the friction law of contact c for slot s, at its place on the rim; return its code.

    As `ask_over_rim`.
    """
    contacts, given, out = scene.contacts, scene.work.law_in, scene.work.law_out
    first, times, qx, qy, angle = first_of_rim(scene, s), 1.0, 0.0, 0.0, 0.0
    slip_x, slip_y, spin = given[XDOT_IN], given[XDOT_IN + 1], given[XDOT_IN + 2]
    normal = given[NFORCE_IN]
    if first >= 0:
        (px, py), (lx, ly) = levers(scene, s, first)
        r = math.hypot(lx, ly)
        angle = angle_of_place(scene, s, first, r, (slip_x + spin * py, slip_y - spin * px))
        off = eccentricity(scene, c, first) if is_touched(scene, first) else 1.0
        part = min(1.0, 2.0 * (1.0 - off))
        if part > 0.0:
            a, b = math.cos(angle), math.sin(angle)
            # from the point to the place
            qx, qy = part * (r * a - px), part * (r * b - py)
            # of the mean of the three, what the pressure has at the place and at the point
            there = 1.0 + (2.0 * min(off, 0.5) * (a * lx + b * ly) / r if r > 0.0 else 0.0)
            here = 1.0 + 2.0 * off if s == first else 1.0 - off
            times = part * there / here + 1.0 - part
    given[XDOT_IN], given[XDOT_IN + 1] = slip_x - spin * qy, slip_y + spin * qx
    # how fast that changes is found with it: `events.switching`
    given[NFORCE_IN] = times * normal
    call = (contacts.id[c], given, contacts.friction_par[c], out)
    code = call_int(contacts.friction_law[c], call)
    add_number(scene, c, angle)
    given[XDOT_IN], given[XDOT_IN + 1] = slip_x, slip_y
    given[NFORCE_IN] = normal
    out[TORQUE_Z_OUT] += qx * out[FORCE_Y_OUT] - qy * out[FORCE_X_OUT]
    scene.work.slot[s, PRESSED_PART] = times
    return code


@jitable
def ask_on_rim(scene: Scene, s: int, c: int) -> int:
    """Ask the friction law of contact c for slot s as it is asked on rims; return its code."""
    if scene.contacts.rims[c] == AROUND_RIM:
        return ask_over_rim(scene, s, c)
    return ask_at_place(scene, s, c)
