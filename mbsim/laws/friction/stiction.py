"""STICTION: Coulomb friction that holds, by a spring that slips at its limit.

z is what the spring is stretched by, X less what slipped, and v the velocity of slip:

    stick    F = -k z - s c v,  z' = v                     while k |z| <= mu_s N
             s = g(r) max{s <= 1: |F| <= mu_s N},  r = 1 - k |z|/(mu_s N)
             g = x (2 - x), x = min(1, 4 r)
    slip     F = -mu_d N e,  z = rho e,  rho = mu_d N/k    while v.e >= rho'
             e' = (v - (v.e) e)/rho = w - (w.e) e,  w = v/rho

e, a unit vector, is dragged along behind the slip (`laws.tractrix`), and rho' is what the spring
grows by itself: where it would have to be stretched faster than it is, it sticks.
z in stick and the integral M of w in slip are integrated with the motion. From e and w at the
committed state, M and w at the point follows e there: however much shorter than a step the spring
is, no step is to follow it. A step of the integrator keeps to stick or slip and ends where that
changes.

k is `tangential_stiffness`, or 2 (1 - nu)/(2 - nu) times the stiffness of the normal force at its
depth (Mindlin), with nu `poisson_ratio`. Where k grows with the depth the force in the spring
stays, z' = v - z k'/k, where it falls z does, so that no energy comes of it (Thornton): there it
slips while v.e >= (mu_d N)'/k. With `incremental` FALSE z
always stays, F = -k z: the rebound of impacts is nearer to measured ones, but a load that comes
and goes may give energy by it (Elata). c is `tangential_damping`,
or a fifth of what is critical for the mass that slips, 0.4 sqrt(k m): more would let it slip late.
It has the part of c v that mu_s N has room for, and fades over the last quarter of the way there:
where the spring is at the limit F is what it is in slip, whatever v. Were it -k z - c v, cut to
mu_s N, it would jump where slip that turns comes to stick with v across e, or with v against e as
N falls, and be thrown back to slip by that: steps then fall to nothing.
With `rotational_stiffness` and `torsion_radius` r a torque about the normal holds in the same way,
up to mu_s N r. With `cff_fnc_name` the size of what that function returns takes the place of
mu_d N.
With k INFINITE there is no spring: what sticks is held by equations (`stiction.rigid_contact`), and
what slips has F = -mu_d N v/|v|, d in place of v where that is 0:

    F = -mu_d N u/|u|,  u = d + v, mirrored where it goes against d,

d being the direction in which it slipped at the committed state, of a length that the tolerance
explains. A step that goes on past a reversal, which it will be cut at, thus goes on smoothly, and
so does slip that begins: of its way across, whose friction is the steeper the slower it slips,
less than d is none.
Sources: R. D. Mindlin, J. Appl. Mech. 16 (1949) 259-268; C. Thornton, K. W. Yin, Powder Technology
65 (1991) 153-166; D. Elata, J. G. Berryman, Mechanics of Materials 24 (1996) 229-240; J. C. Simo,
T. J. R. Hughes, Computational Inelasticity (1998), ch. 1.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import V2
from mbsim.core.jitable import jitable
from mbsim.laws.catalog import (
    BEGUN,
    BRANCHES,
    LASTS,
    SLIP,
    STICK,
    UNDECIDED,
    FrictionInput,
    FrictionLaw,
    Parameter,
    friction_law,
)
from mbsim.laws.tractrix import dragged

#: Damping over the critical one where none is given.
DAMPING = 0.2

#: The damper fades from this part below the spring's limit.
FADES = 0.25

#: A spring is taken to be no shorter than slip over so many times the frequency of what slips.
SHORTEST = 1e6
#: Slip so many times faster than the spring changes by itself goes on its way, without a look at
#: how fast that is.
CLEAR = 100.0
#: Nearer to its limit than this part of it a spring that sticks slips only if it goes on towards
#: it: one that has just come to stick is at the limit but for rounding of the normal force.
NEAR = 1e-6
#: Slip over so many times the frequency of what slips is too short for what the spring is over its
#: limit to be known, but for twice as much: what it goes on towards decides then. Where two bodies
#: have just touched not even that is known: both begin at 0 within a step, which may be any number
#: of times as long as the touch. The spring is at its limit then at most.
EARLY = 1e-3

#: What is kept: z, or M; z where it slips, M and its rate w then; time then; twist less turn since
#: touch, and the sign of its slip; mode; how far it is beyond the committed branch, a smooth number
#: that is 0 where the branch changes, or 0 where none is known.
KEPT_Z, _M, KEPT_W, _TIME, _TWIST, _TURNS, _MODE, _LEFT = 2, 4, 6, 8, 9, 10, 11, 12


@jitable
def _held(sx: float, sy: float, dx: float, dy: float, most: float) -> V2:
    """Return the force against a spring's s and the part of a damper's d that there is room for.

    At the limit that is none, whichever way it slips: the force of what comes to stick, or begins
    to slip, does not jump.
    """
    spring = math.hypot(sx, sy)
    if spring >= most:
        part = most / spring if spring > 0.0 else 0.0
        return -part * sx, -part * sy
    # |s + part d| = most, by a root that loses no digits
    square, along = dx * dx + dy * dy, sx * dx + sy * dy
    inside, part = (most - spring) * (most + spring), 1.0
    if square + 2.0 * along > inside:
        root = math.sqrt(along * along + square * inside)
        part = inside / (along + root) if along > 0.0 else (root - along) / square
    near = (most - spring) / (FADES * most)
    if near < 1.0:
        part *= near * (2.0 - near)
    return -sx - part * dx, -sy - part * dy


@jitable
def _turn(
    inputs: FrictionInput,
    memory: tuple[float, ...],
    mu: float,
    k: float,
    damping: float,
    radius: float,
) -> tuple[float, float, float, int]:
    """Return the torque about the normal, the twist left, the sign of its slip, and if that is so.

    The last is 0 where the sign follows only from how fast N changes.
    """
    twist, sign, sure = memory[_TWIST] + inputs.x[2], memory[_TURNS], 1
    most, rate = mu * inputs.nforce * radius, inputs.xdot[2]
    torque, _ = _held(k * twist, 0.0, damping * rate, 0.0, most)
    if inputs.frozen == 1.0 and sign != 0.0:
        torque, twist = -sign * most, sign * most / k
        if math.isnan(inputs.nforce_rate):
            sure = 0
        elif sign * rate * k < mu * inputs.nforce_rate * radius:
            sign = 0.0
        return torque, twist, sign, sure
    sign = 0.0
    if k * abs(twist) > most:
        sign = math.copysign(1.0, twist)
        twist = sign * most / k
    return torque, twist, sign, sure


@jitable
def _dynamic_limit(inputs: FrictionInput, mu_dynamic: float) -> float:
    """Return the friction of sliding: that of the user's function, where there is one."""
    return mu_dynamic * inputs.nforce if math.isnan(inputs.limit) else inputs.limit


#: What `rigid` keeps: mode, d (before it touches, along x, a slip that is none to the tolerance),
#: and the force that held, which is given where it is to be shown; in place of that force, while it
#: slips, the speed at the committed state, and that at which it was
#: let go: what sticks moves as its neighbours let it, that is by how they turn over its depth.
KEPT_MODE, KEPT_X, KEPT_Y, STICKING_X, STICKING_Y = range(5)
KEPT_SPEED, KEPT_PLAY = STICKING_X, STICKING_Y
#: Its parameters.
_RIGID_PARAMETERS = ("mu_static", "mu_dynamic")
MU_STATIC = _RIGID_PARAMETERS.index("mu_static")
#: Slip across d that is less than this part of the committed speed is rounding. It is to stay so
#: where v goes through 0: there it is compared with a part of that speed at least.
STRAIGHT, PART = 1e-6, 0.7


@jitable
def _least_speed(across: float, speed: float) -> float:
    """Return what slip across d is compared with at least."""
    return PART * speed * max(0.0, 1.0 - abs(across) / (STRAIGHT * speed)) if speed > 0.0 else 0.0


@jitable
def rigid(
    inputs: FrictionInput, memory: tuple[float, ...], mu_static: float, mu_dynamic: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the same where k is infinite; what holds is not told but asked for by equations."""
    mode, dx, dy = memory[KEPT_MODE], memory[KEPT_X], memory[KEPT_Y]
    if mode == STICK:
        held = (memory[STICKING_X], memory[STICKING_Y], 0.0, 0.0, 0.0, 0.0, mode, mode, 1.0, 0.0)
        return held, memory
    limit = _dynamic_limit(inputs, mu_dynamic)
    ux, uy = inputs.xdot[0], inputs.xdot[1]
    if mode == BEGUN:
        # beside what sticks slip is rounding, whose way is none
        size = math.hypot(ux, uy) + dx
        part = limit / size if size > 0.0 else 0.0
        return (-part * ux, -part * uy, 0.0, 0.0, 0.0, 0.0, mode, mode, 1.0, 0.0), memory
    rest = math.hypot(dx, dy)
    dx, dy = dx / rest, dy / rest
    along, across = abs(ux * dx + uy * dy) + rest, uy * dx - ux * dy
    sine = across / max(math.hypot(along, across), _least_speed(across, memory[KEPT_SPEED]))
    cosine = math.sqrt(max(0.0, 1.0 - sine * sine))
    fx, fy = -limit * (cosine * dx - sine * dy), -limit * (cosine * dy + sine * dx)
    return (fx, fy, 0.0, 0.0, 0.0, 0.0, mode, mode, 1.0, 0.0), memory


@friction_law(
    "STICTION",
    "mu_static",
    "mu_dynamic",
    Parameter(
        "tangential_stiffness",
        math.nan,
        positive=True,
        infinite=True,
        about="stiffness while it sticks; INFINITE: no give at all",
        unit="F/L",
        usual="by Mindlin",
    ),
    Parameter(
        "tangential_damping",
        math.nan,
        about="damping while it sticks",
        unit="F T/L",
        usual="0.2 critical",
    ),
    Parameter("poisson_ratio", 0.3, ratio=True, about="Poisson's ratio in Mindlin's stiffness"),
    Parameter(
        "rotational_stiffness",
        0.0,
        needs="torsion_radius",
        about="stiffness against spin while it sticks",
        unit="F L/rad",
    ),
    Parameter(
        "torsion_radius",
        0.0,
        needs="rotational_stiffness",
        about="arm of the largest torque against spin, mu_s N r",
        unit="L",
    ),
    Parameter(
        "incremental",
        1.0,
        flag=True,
        about="whether the spring keeps its force, not its stretch, as N grows",
    ),
    memory=13,
    carried=2,
    uses_x=True,
    takes_function=True,
    modes=True,
    left=_LEFT,
    rigid=FrictionLaw(
        "STICTION", rigid, _RIGID_PARAMETERS, memory=5, takes_function=True, modes=True
    ),
)
def stiction(  # noqa: C901
    inputs: FrictionInput,
    memory: tuple[float, ...],
    mu_static: float,
    mu_dynamic: float,
    tangential_stiffness: float,
    tangential_damping: float,
    poisson_ratio: float,
    rotational_stiffness: float,
    torsion_radius: float,
    incremental: float,
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return (Fx, ..., energy of the springs, mode, branch, size, unit) and what is kept, rates.

    Long, and with many branches, because sticking and slipping begin from the same memory and end
    in the same one: cut in two, each half would take a dozen numbers and return as many.
    """
    k, growth, of_depth = tangential_stiffness, 0.0, math.isnan(tangential_stiffness)
    if of_depth:
        k = 2.0 * (1.0 - poisson_ratio) / (2.0 - poisson_ratio) * inputs.stiffness
        growth = inputs.growth
    before, time, v = memory[_MODE], inputs.time, inputs.xdot
    px, py = memory[0], memory[1]
    if k <= 0.0 or inputs.nforce <= 0.0:
        nothing = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, SLIP, SLIP, 1.0, 0.0)
        kept = (px, py) if before == SLIP else (0.0, 0.0)
        z = (memory[KEPT_Z], memory[KEPT_Z + 1])
        still = (*kept, *z, *kept, 0.0, 0.0, time, -inputs.x[2], 0.0, SLIP, 0.0)
        return nothing, (*still, 0.0, 0.0)
    c, heavy = tangential_damping, math.sqrt(k * inputs.mass)
    if math.isnan(c):
        c = 2.0 * DAMPING * heavy
    frozen = inputs.frozen == 1.0
    # where k grows the force stays, if it is to
    eases = of_depth and incremental == 1.0
    ease = max(0.0, growth) if eases else 0.0
    # and as it is known where modes are decided: that of a patch is no function of the depth
    changes = growth
    if of_depth and not math.isnan(inputs.stiffness_rate):
        changes = inputs.stiffness_rate / inputs.stiffness
    holds, limit = mu_static * inputs.nforce, _dynamic_limit(inputs, mu_dynamic)
    stretch = limit / k
    follows = max(stretch, math.hypot(v[0], v[1]) * heavy / (k * SHORTEST))
    wx, wy = (v[0] / follows, v[1] / follows) if follows > 0.0 else (0.0, 0.0)

    mode, sticks, sure, left = STICK, before != SLIP, 1, 0.0
    zx, zy = px, py
    if not sticks:
        # the spring's direction, behind the slip since the committed state
        since = time - memory[_TIME]
        mx, my = px - memory[_M], py - memory[_M + 1]
        long = math.hypot(memory[KEPT_Z], memory[KEPT_Z + 1])
        ex, ey = (memory[KEPT_Z] / long, memory[KEPT_Z + 1] / long) if long > 0.0 else (0.0, 0.0)
        ax, ay = since * memory[KEPT_W], since * memory[KEPT_W + 1]
        ex, ey = dragged(ex, ey, ax, ay, mx, my, since * wx, since * wy)
        along = v[0] * ex + v[1] * ey
        mode = SLIP
        if frozen:
            change = inputs.nforce_rate * mu_dynamic
            if not math.isnan(inputs.limit):
                change = inputs.limit_rate
            if not math.isnan(change):
                # how fast z grows by itself, or less where k grows and the force stays
                own = change / k - stretch * (changes - ease)
                mode, left = SLIP if along >= own else STICK, own - along
            elif since > 0.0:
                own = abs(stretch - long) / since + stretch * abs(growth)
                sure = 1 if abs(along) > CLEAR * own else 0
                mode = SLIP if along >= 0.0 or sure == 0 else STICK
            else:
                # what has just begun to slip: forces, and how fast they change, are others now
                sure = 0
        else:
            # as if nothing slipped since: it is held again where that is less than the limit
            length = long * math.exp(-ease * since) + stretch * (mx * ex + my * ey)
            if abs(length) < stretch:
                sticks, zx, zy = True, length * ex, length * ey
            elif length < 0.0:
                ex, ey = -ex, -ey
        if not sticks:
            zx, zy = stretch * ex, stretch * ey
            fx, fy = -limit * ex, -limit * ey
    if sticks:
        if before == BEGUN and eases:
            # the force is what was integrated
            zx, zy = px / k, py / k
        length = math.hypot(zx, zy)
        mode = STICK if k * length <= holds else SLIP
        left = k * length - holds if before != SLIP else 0.0
        early = EARLY * math.hypot(v[0], v[1]) * heavy / k
        near = NEAR * length + (early if before == BEGUN else min(0.5 * length, early))
        if before != SLIP and holds < k * length and k * (length - near) <= holds:
            mode = STICK
            if before == BEGUN:
                zx, zy = zx * holds / (k * length), zy * holds / (k * length)
            if frozen:
                own = mu_static * inputs.nforce_rate / k - holds / k * (changes - ease)
                sure = 0 if math.isnan(own) else 1
                mode = SLIP if zx * v[0] + zy * v[1] > own * length else STICK
        most = holds if mode == STICK or (frozen and before == STICK) else limit
        fx, fy = _held(k * zx, k * zy, c * v[0], c * v[1], most)
        if mode == SLIP:
            zx, zy = zx * stretch / length, zy * stretch / length

    torque, twist, sign = 0.0, 0.0, 0.0
    if rotational_stiffness > 0.0:
        mu, damping = mu_static, c * torsion_radius * torsion_radius
        if before == SLIP and not sticks:
            mu, damping = mu_dynamic, 0.0
        torque, twist, sign, known = _turn(
            inputs, memory, mu, rotational_stiffness, damping, torsion_radius
        )
        sure, left = min(sure, known), 0.0
    if sure == 0:
        mode = before
    branch = mode + BRANCHES * (sign if sign >= 0.0 else 2.0) if sure == 1 else UNDECIDED
    stored = 0.5 * (k * (zx * zx + zy * zy) + rotational_stiffness * twist * twist)

    # what is integrated: M, force or z
    if before == SLIP:
        size, unit, rx, ry = 1.0, LASTS * limit / heavy, wx, wy
    elif before == BEGUN and eases:
        size, unit, rx, ry = holds, LASTS / heavy, k * v[0], k * v[1]
    else:
        size, unit = holds / k, LASTS * k / heavy
        rx, ry = v[0] - ease * px, v[1] - ease * py
    if mode == STICK:
        px, py = zx, zy
    elif before != SLIP:
        px, py = 0.0, 0.0
    held = (px, py, zx, zy, px, py, wx, wy, time, twist - inputs.x[2], sign, mode, left)
    given = (fx, fy, 0.0, 0.0, torque, stored, mode, branch, size, unit)
    return given, (*held, rx, ry)
