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
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import FRICTION_CALLS
from mbsim.arrays.scene import Scene
from mbsim.core.address import call_int
from mbsim.core.arrays import V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, scale, sub, vector
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
#: Points of a rim that have a normal force.
POINTS = 3
#: Numbers of a law's memory that are a stretch, and all of it on a rim.
STRETCH, KEPT = 2, 3


@jitable
def first_of_rim(scene: Scene, s: int) -> int:
    """Return the slot of the lowest point of the rim of slot s, -1 if not all of it is touched."""
    pair = scene.slots.pair[s]
    if scene.kinds.rims[scene.pairs.kind[pair]] == 0:
        return -1
    first = s - (s - scene.pairs.slot[pair]) % POINTS
    for k in range(first, first + POINTS):
        if scene.work.points[k, AT_DEPTH] <= 0.0:
            return -1
    return first


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
def ask_point(scene: Scene, s: int, c: int) -> int:
    """Ask the friction law of contact c at the point of slot s; return its code."""
    contacts, work = scene.contacts, scene.work
    call = (contacts.id[c], work.law_in, contacts.friction_par[c], work.law_out)
    code = call_int(contacts.friction_law[c], call)
    if contacts.memory[c] == KEPT:
        # the law knows of two numbers
        given, out = work.law_in, work.law_out
        for k in range(STRETCH):
            out[MEMORY_OUT + KEPT + 1 - k] = out[MEMORY_OUT + STRETCH + 1 - k]
        out[MEMORY_OUT + STRETCH] = given[FRICTION_INPUTS + STRETCH]
        out[MEMORY_OUT + KEPT + STRETCH] = 0.0
    return code


@jitable
def ask_over_rim(scene: Scene, s: int, c: int) -> int:  # noqa: C901
    """Ask the friction law of contact c for slot s, all over its rim where that is touched.

    `law_in` is filled for the point of slot s, and stays. Results are left in `law_out` as a law
    leaves them, torques about the point; returns the law's code. Long because forces, torque and
    what is kept are sums over the same places.
    """
    contacts, given, out = scene.contacts, scene.work.law_in, scene.work.law_out
    first = first_of_rim(scene, s)
    if first < 0:
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
    uneven, share, code = 2.0 * min(off, 0.5) / r, part / AROUND, 0
    call = (contacts.id[c], given, contacts.friction_par[c], out)
    scene.log.counters[FRICTION_CALLS] += AROUND - 1
    for k in range(AROUND):
        angle = 2.0 * math.pi / AROUND * (k + 0.5)
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
