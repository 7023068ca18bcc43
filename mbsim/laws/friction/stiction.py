"""STICTION: Coulomb friction that holds, by a spring between the surfaces that slips at its limit.

z is what the spring is stretched by, X less what slipped, and v the velocity of slip:

    stick    F = -k z - c v, at most mu_s N     while k |z| <= mu_s N
    slip     F = -mu_d N z/|z|,  |z| = mu_d N/k   while v goes on along z

A step of the integrator keeps to one of these and ends where it changes. At the end of a step that
slips, z is brought back to what the force needs (return mapping). Within it, z/|z| follows the
direction of slip over the length mu_d N/k, as z' = v - (v.z) z/|z|^2 asks.

k is `tangential_stiffness`, or 2 (1 - nu)/(2 - nu) times the stiffness of the normal force at its
depth (Mindlin), with nu `poisson_ratio`. Where k grows with the depth the force in the spring
stays, where it falls z does, so that no energy comes of it (Thornton). With `incremental` FALSE z
always stays, F = -k z: the rebound of impacts is nearer to measured ones, but a load that comes
and goes may give energy by it (Elata). c is `tangential_damping`,
or a fifth of what is critical for the mass that slips, 0.4 sqrt(k m): more would let it slip late.
With `rotational_stiffness` and `torsion_radius` r a torque about the normal holds in the same way,
up to mu_s N r. With `cff_fnc_name` the size of what that function returns takes the place of
mu_d N.
With k INFINITE there is no spring: what sticks is held by equations (`dynamics.rigid_contact`), and
what slips has F = -mu_d N v/|v|, d in place of v where that is 0:

    F = -mu_d N u/|u|,  u = d + v, mirrored where it goes against d,

d being the direction in which it slipped at the committed state, of a length that is rounding of
velocities. A step that goes on past a reversal, which it will be cut at, thus goes on smoothly.
Sources: R. D. Mindlin, J. Appl. Mech. 16 (1949) 259-268; C. Thornton, K. W. Yin, Powder Technology
65 (1991) 153-166; D. Elata, J. G. Berryman, Mechanics of Materials 24 (1996) 229-240; J. C. Simo,
T. J. R. Hughes, Computational Inelasticity (1998), ch. 1.
"""

from __future__ import annotations

import math

from mbsim.core.jitable import jitable
from mbsim.laws.catalog import BEGUN, SLIP, STICK, FrictionLaw, Parameter, friction_law

#: Damping over the critical one where none is given.
DAMPING = 0.2

# what is kept: spring x, y, twist; X then; stiffness then; mode
_X, _STIFFNESS, _MODE = 3, 6, 7


@jitable
def _direction(zx, zy, kept, v, k, limit):
    """Return the unit vector against which a slipping spring pulls."""
    length, speed = math.hypot(zx, zy), math.hypot(v[0], v[1])
    if zx * v[0] + zy * v[1] > 0.0 and limit > 0.0:
        # the spring follows the slip over its own length
        gone = math.hypot(zx - kept[0], zy - kept[1]) * k / limit
        rest = math.exp(-gone)
        zx = kept[0] * rest + (1.0 - rest) * limit / k * v[0] / speed
        zy = kept[1] * rest + (1.0 - rest) * limit / k * v[1] / speed
        length = math.hypot(zx, zy)
    if length > 0.0:
        return zx / length, zy / length
    return (v[0] / speed, v[1] / speed) if speed > 0.0 else (0.0, 0.0)


@jitable
def _turn(inputs, memory, mode, mu, k, c, radius):
    """Return the torque about the normal and what is left of the twist."""
    twist = memory[2] + inputs.x[2] - memory[_X + 2]
    torque = -k * twist - (c * radius * radius * inputs.xdot[2] if mode == STICK else 0.0)
    most = mu * inputs.nforce * radius
    if abs(torque) > most:
        torque = math.copysign(most, torque)
        twist = -torque / k
    return torque, twist


@jitable
def _dynamic_limit(inputs, mu_dynamic):
    """Return the friction of sliding: that of the user's function, where there is one."""
    return mu_dynamic * inputs.nforce if math.isnan(inputs.limit) else inputs.limit


#: What `rigid` keeps: mode, d, and the force that held, which is given where it is to be shown; in
#: place of that force, while it slips, the speed at the committed state.
KEPT_MODE, KEPT_X, KEPT_Y, HELD_X, HELD_Y = range(5)
KEPT_SPEED = HELD_X
#: Slip across d that is less than this part of the committed speed is rounding. It is to stay so
#: where v goes through 0: there it is compared with a part of that speed at least.
STRAIGHT, PART = 1e-6, 0.7


@jitable
def _least_speed(across, speed):
    """Return what slip across d is compared with at least."""
    return PART * speed * max(0.0, 1.0 - abs(across) / (STRAIGHT * speed)) if speed > 0.0 else 0.0


@jitable
def rigid(inputs, memory, mu_static, mu_dynamic):
    """Return the same where k is infinite; what holds is not told but asked for by equations."""
    mode, dx, dy = memory[KEPT_MODE], memory[KEPT_X], memory[KEPT_Y]
    if mode == STICK:
        return (memory[HELD_X], memory[HELD_Y], 0.0, 0.0, 0.0, 0.0, mode), memory
    limit = _dynamic_limit(inputs, mu_dynamic)
    ux, uy = inputs.xdot[0], inputs.xdot[1]
    if mode == BEGUN:
        size = math.hypot(ux, uy)
        part = limit / size if size > 0.0 else 0.0
        return (-part * ux, -part * uy, 0.0, 0.0, 0.0, 0.0, mode), memory
    rest = math.hypot(dx, dy)
    dx, dy = dx / rest, dy / rest
    along, across = abs(ux * dx + uy * dy) + rest, uy * dx - ux * dy
    sine = across / max(math.hypot(along, across), _least_speed(across, memory[KEPT_SPEED]))
    cosine = math.sqrt(max(0.0, 1.0 - sine * sine))
    fx, fy = -limit * (cosine * dx - sine * dy), -limit * (cosine * dy + sine * dx)
    return (fx, fy, 0.0, 0.0, 0.0, 0.0, mode), memory


@friction_law(
    "STICTION",
    "mu_static",
    "mu_dynamic",
    Parameter("tangential_stiffness", math.nan, positive=True, infinite=True),
    Parameter("tangential_damping", math.nan),
    Parameter("poisson_ratio", 0.3, ratio=True),
    Parameter("rotational_stiffness", 0.0, needs="torsion_radius"),
    Parameter("torsion_radius", 0.0, needs="rotational_stiffness"),
    Parameter("incremental", 1.0, flag=True),
    memory=8,
    uses_x=True,
    takes_function=True,
    modes=True,
    rigid=FrictionLaw(
        "STICTION", rigid, ("mu_static", "mu_dynamic"), memory=5, takes_function=True, modes=True
    ),
)
def stiction(
    inputs,
    memory,
    mu_static,
    mu_dynamic,
    tangential_stiffness,
    tangential_damping,
    poisson_ratio,
    rotational_stiffness,
    torsion_radius,
    incremental,
):
    """Return (Fx, Fy, Mx, My, Tz, energy of the springs, mode) and what is kept."""
    k = tangential_stiffness
    if math.isnan(k):
        k = 2.0 * (1.0 - poisson_ratio) / (2.0 - poisson_ratio) * inputs.stiffness
    if k <= 0.0 or inputs.nforce <= 0.0:
        still = (0.0, 0.0, 0.0, inputs.x[0], inputs.x[1], inputs.x[2], 0.0, SLIP)
        return (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, SLIP), still
    c = tangential_damping
    if math.isnan(c):
        c = 2.0 * DAMPING * math.sqrt(k * inputs.mass)

    # the spring as it would be if nothing slipped
    ease = memory[_STIFFNESS] / k if incremental == 1.0 and 0.0 < memory[_STIFFNESS] < k else 1.0
    kept = (memory[0] * ease, memory[1] * ease)
    zx = kept[0] + inputs.x[0] - memory[_X]
    zy = kept[1] + inputs.x[1] - memory[_X + 1]
    v = inputs.xdot
    length = math.hypot(zx, zy)
    goes_back = zx * v[0] + zy * v[1] < 0.0

    slips = memory[_MODE] == SLIP and (inputs.frozen == 1.0 or not goes_back)
    if slips:
        mode = STICK if goes_back else SLIP
        limit = _dynamic_limit(inputs, mu_dynamic)
        ux, uy = _direction(zx, zy, kept, v, k, limit)
        # less where the normal force grew faster than the spring follows; at the slip's begin
        # that is a kink, of which derivatives are to see the side that lies ahead
        size = limit if inputs.dflag == 1.0 else min(limit, k * length)
        fx, fy = -size * ux, -size * uy
        zx, zy = size / k * ux, size / k * uy
    else:
        limit = mu_static * inputs.nforce
        mode = STICK if k * length <= limit else SLIP
        if mode == SLIP and (inputs.frozen == 0.0 or memory[_MODE] != STICK):
            limit = _dynamic_limit(inputs, mu_dynamic)
        fx, fy = -k * zx - c * v[0], -k * zy - c * v[1]
        force = math.hypot(fx, fy)
        if force > limit:
            fx, fy = fx * limit / force, fy * limit / force
        if mode == SLIP:
            rest = _dynamic_limit(inputs, mu_dynamic) / (k * length)
            zx, zy = rest * zx, rest * zy
    torque, twist = 0.0, 0.0
    if rotational_stiffness > 0.0:
        mu = mu_dynamic if slips else mu_static
        torque, twist = _turn(inputs, memory, mode, mu, rotational_stiffness, c, torsion_radius)
    stored = 0.5 * (k * (zx * zx + zy * zy) + rotational_stiffness * twist * twist)
    held = (zx, zy, twist, inputs.x[0], inputs.x[1], inputs.x[2], k, mode)
    return (fx, fy, 0.0, 0.0, torque, stored, mode), held
