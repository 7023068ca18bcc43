"""One contact point as the solver reads it: a row of numbers, its velocity, and its own law.

With n, x, z the axes of a point, a_I and a_J its arms, u = H v has the rows

    u_a = e_a . (v_I - v_J) + (a_I x e_a) . w_I - (a_J x e_a) . w_J

so a row keeps the axes once and both turns; what an impulse does to free bodies are inverse masses
and I^-1 of these turns.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, F3, F4, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import cross, dot
from mbsim.stepping.arrays import (
    ALONG,
    AXES,
    DRIFT,
    HELD,
    HELD_ALONG,
    LIGHT,
    SCHUR,
    SPIN,
    STOPS,
    TURN,
    W_NN,
    W_NX,
    W_NZ,
    W_XX,
    W_XZ,
    W_ZZ,
    Points,
)

#: A determinant is none below this part of the product of a matrix' diagonal.
SINGULAR = 1e-12
#: The same of what of W is left across n.
FLAT = 1e-14
#: A guess of s that is so many times off is none.
FAR = 3.0
#: Newton iterations for the slip of a point at most, and where its friction is on the cone: the
#: next visit begins with the iteration's last step.
MOST_SLIPS, ON_CONE = 60, 1e-12
#: What of W couples n with the plane of contact, or tells its directions apart, is none below this
#: part: of round bodies that is what rounding leaves.
ROUND = 1e-14
#: Joints hold what an impulse moves by less than this part of what it would move free bodies by:
#: what rounding leaves. A link of a mechanism that is so many times as heavy moves by as little.
HELD_PART = 1e-12
#: Slip along what joints hold below so many times half of what it changes by in a step is of the
#: step: arms of points are those of its begin.
OF_STEP = 2.0


@jitable
def velocity_of(p: Points, k: int, a: int, v: F2) -> float:
    """Return component a of u at point k."""
    row, i, j = p.given[k], p.body[k, 0], p.body[k, 1]
    e, s, t = AXES + 3 * a, TURN + 3 * a, TURN + 9 + 3 * a
    # three sums that do not wait for each other
    x = row[e] * (v[i, 0] - v[j, 0]) + row[e + 1] * (v[i, 1] - v[j, 1])
    y = row[s] * v[i, 3] + row[s + 1] * v[i, 4] + row[s + 2] * v[i, 5]
    z = row[t] * v[j, 3] + row[t + 1] * v[j, 4] + row[t + 2] * v[j, 5]
    return (x + row[e + 2] * (v[i, 2] - v[j, 2])) + (y - z)


@jitable
def apply(p: Points, k: int, v: F2, r: V3) -> None:
    """Add what an impulse at point k does to the velocities of bodies that have points."""
    if p.wide[k] >= 0:
        for row in range(p.wide[k], p.wide[k] + p.near[k]):
            b, moves = p.moved[row], p.moves[row]
            for c in range(6):
                v[b, c] += moves[0, c] * r[0] + moves[1, c] * r[1] + moves[2, c] * r[2]
        return
    row, i, j = p.given[k], p.body[k, 0], p.body[k, 1]
    x = row[0] * r[0] + row[3] * r[1] + row[6] * r[2]
    y = row[1] * r[0] + row[4] * r[1] + row[7] * r[2]
    z = row[2] * r[0] + row[5] * r[1] + row[8] * r[2]
    s, m = SPIN, row[LIGHT]
    a = row[s] * r[0] + row[s + 3] * r[1] + row[s + 6] * r[2]
    b = row[s + 1] * r[0] + row[s + 4] * r[1] + row[s + 7] * r[2]
    c = row[s + 2] * r[0] + row[s + 5] * r[1] + row[s + 8] * r[2]
    v[i, 0] += m * x
    v[i, 1] += m * y
    v[i, 2] += m * z
    v[i, 3] += a
    v[i, 4] += b
    v[i, 5] += c
    s, m = SPIN + 9, row[LIGHT + 1]
    a = row[s] * r[0] + row[s + 3] * r[1] + row[s + 6] * r[2]
    b = row[s + 1] * r[0] + row[s + 4] * r[1] + row[s + 7] * r[2]
    c = row[s + 2] * r[0] + row[s + 5] * r[1] + row[s + 8] * r[2]
    v[j, 0] -= m * x
    v[j, 1] -= m * y
    v[j, 2] -= m * z
    v[j, 3] -= a
    v[j, 4] -= b
    v[j, 5] -= c


@jitable
def apply_farther(p: Points, k: int, v: F2, r: V3) -> None:
    """Add what an impulse at point k does to the velocities of bodies without points."""
    if p.wide[k] >= 0:
        for row in range(p.wide[k] + p.near[k], p.wide[k] + p.many[k]):
            b, moves = p.moved[row], p.moves[row]
            for c in range(6):
                v[b, c] += moves[0, c] * r[0] + moves[1, c] * r[1] + moves[2, c] * r[2]


@jitable
def direction(p: Points, k: int, side: int, a: int, c: int) -> float:
    """Return the part in u_a at point k of component c of the velocity of one of its bodies."""
    row, sign = p.given[k], 1.0 - 2.0 * side
    return sign * (row[AXES + 3 * a + c] if c < 3 else row[TURN + 9 * side + 3 * a + c - 3])


@jitable
def alone(p: Points, k: int, side: int, a: int, c: int) -> float:
    """Return component c of the velocity that r_a of point k gives one of its bodies, if free."""
    row, sign = p.given[k], 1.0 - 2.0 * side
    if c < 3:
        return sign * row[LIGHT + side] * row[AXES + 3 * a + c]
    return sign * row[SPIN + 9 * side + 3 * a + c - 3]


@jitable
def row_of(p: Points, k: int, side: int) -> int:
    """Return the row in which what point k moves has one of its bodies, -1 for none."""
    for at in range(p.wide[k], p.wide[k] + p.near[k]):
        if p.moved[at] == p.body[k, side]:
            return at
    return -1


@jitable
def answer_of(p: Points, k: int, a: int, e: int, rows: tuple[int, int]) -> float:
    """Return u_a by r_e at point k, where joints hold its bodies, which have these rows."""
    total = 0.0
    for side in range(2):
        at = rows[side]
        if at >= 0:
            for c in range(6):
                total += direction(p, k, side, a, c) * p.moves[at, e, c]
    return total


@jitable
def fill_directions(p: Points, k: int, ground: int, H: F3) -> None:
    """Fill H (2, 3, 6) of point k where it is not of ground: see `directions`."""
    for side in range(2):
        if p.body[k, side] != ground:
            for a in range(3):
                for c in range(6):
                    H[side, a, c] = direction(p, k, side, a, c)


@jitable
def directions(p: Points, count: int, ground: int) -> F4:
    """Return H (count, 2, 3, 6): u along (n, x, z) by the velocities of I and J, 0 for ground."""
    H = np.zeros((count, 2, 3, 6))
    for k in range(count):
        fill_directions(p, k, ground, H[k])
    return H


@jitable
def fill_inverse(row: F1, free: tuple[float, float]) -> None:
    """Fill the inverse of W, 0 where it has none to speak of, and W_TT - W_TN W_NT / W_NN.

    `free` is W of the bodies without joints, along n and across: what is nothing beside that joints
    hold, see `let_hold`.
    """
    if row[W_NN] <= HELD_PART * free[0]:
        # nothing moves along n
        row[W_NN] = row[W_NX] = row[W_NZ] = 0.0
    a = (row[W_NN], row[W_NX], row[W_NZ])
    b = (row[W_NX], row[W_XX], row[W_XZ])
    c = (row[W_NZ], row[W_XZ], row[W_ZZ])
    x, y, z = cross(b, c), cross(c, a), cross(a, b)
    determinant = dot(a, x)
    some = a[0] > 0.0
    part = 1.0 / a[0] if some else 0.0
    row[ALONG] = part
    row[ALONG + 1], row[ALONG + 2] = part * a[1], part * a[2]
    s11, s12, s22 = b[1] - part * a[1] * a[1], b[2] - part * a[1] * a[2], c[2] - part * a[2] * a[2]
    couples = part * max(abs(a[1]), abs(a[2]))
    if couples <= ROUND and max(abs(s12), abs(s11 - s22)) <= ROUND * s11:
        row[ALONG + 1] = row[ALONG + 2] = s12 = 0.0
        s22 = s11
    row[SCHUR], row[SCHUR + 1], row[SCHUR + 2] = s11, s12, s22
    let_hold(row, HELD_PART * free[1])
    some = some and row[HELD] == 0.0 and determinant > SINGULAR * a[0] * b[1] * c[2]
    part = 1.0 / determinant if some else 0.0
    row[STOPS], row[STOPS + 1], row[STOPS + 2] = part * x[0], part * x[1], part * x[2]
    row[STOPS + 3], row[STOPS + 4], row[STOPS + 5] = part * y[1], part * y[2], part * z[2]


@jitable
def let_hold(row: F1, least: float) -> None:
    """Take directions of the plane of contact out of SCHUR that joints hold while n is held.

    Along these S has eigenvalues below `least`, of rounding: friction there moves nothing. Of free
    bodies that is 0.
    """
    row[HELD] = row[HELD_ALONG] = row[HELD_ALONG + 1] = row[DRIFT] = row[DRIFT + 1] = 0.0
    if least == 0.0:
        return
    s11, s12, s22 = row[SCHUR], row[SCHUR + 1], row[SCHUR + 2]
    half = 0.5 * (s11 - s22)
    root = math.sqrt(half * half + s12 * s12)
    large, small = 0.5 * (s11 + s22) + root, 0.5 * (s11 + s22) - root
    if large <= least:
        row[HELD] = 2.0
        row[SCHUR] = row[SCHUR + 1] = row[SCHUR + 2] = 0.0
    elif small <= least:
        # of both columns of S - small the longer one is along what moves
        x, z = (half + root, s12) if half >= 0.0 else (s12, root - half)
        size = math.sqrt(x * x + z * z)
        x, z = x / size, z / size
        row[HELD], row[HELD_ALONG], row[HELD_ALONG + 1] = 1.0, -z, x
        row[SCHUR], row[SCHUR + 1], row[SCHUR + 2] = large * x * x, large * x * z, large * z * z


@jitable
def held_part(row: F1, x: float, z: float) -> tuple[float, float]:
    """Return the part of (x, z) along what joints hold."""
    if row[HELD] == 2.0:
        return x, z
    along = x * row[HELD_ALONG] + z * row[HELD_ALONG + 1]
    return along * row[HELD_ALONG], along * row[HELD_ALONG + 1]


@jitable
def fill_drift(p: Points, k: int, before: F2, free: F2) -> None:
    """Fill by how much u along what joints hold is off at the step's end.

    What no impulse changes is what joints leave: that is so in the midst of the step, where they
    hold (`forces.hold_by_joints`). Velocities at its end are those of where bodies are then, so
    that a wheel on an arm that turns would slip along the arm by the way it turns in half a step.
    """
    row = p.given[k]
    if row[HELD] == 0.0:
        return
    n = velocity_of(p, k, 0, free) - velocity_of(p, k, 0, before)
    x = velocity_of(p, k, 1, free) - velocity_of(p, k, 1, before) - row[ALONG + 1] * n
    z = velocity_of(p, k, 2, free) - velocity_of(p, k, 2, before) - row[ALONG + 2] * n
    x, z = held_part(row, x, z)
    row[DRIFT], row[DRIFT + 1] = 0.5 * x, 0.5 * z


@jitable
def slip_at(p: Points, k: int, v: F2) -> tuple[float, float]:
    """Return the slip velocity of point k along x and z, without `fill_drift`'s."""
    row = p.given[k]
    return velocity_of(p, k, 1, v) - row[DRIFT], velocity_of(p, k, 2, v) - row[DRIFT + 1]


@jitable
def sticks_beside(
    row: F1, height: float, c: tuple[float, float]
) -> tuple[bool, float, float, float]:
    """Return whether friction (x, z) brings to rest what W as a whole has no inverse for, and r_N.

    That is asked where W has none.
    """
    s11, s12, s22 = row[SCHUR], row[SCHUR + 1], row[SCHUR + 2]
    determinant = s11 * s22 - s12 * s12
    if row[STOPS] > 0.0 or not determinant > FLAT * abs(s11 * s22):
        return False, 0.0, 0.0, 0.0
    x = (s12 * c[1] - s22 * c[0]) / determinant
    z = (s12 * c[0] - s11 * c[1]) / determinant
    return True, x, z, height - row[ALONG + 1] * x - row[ALONG + 2] * z


@jitable
def sticks_by_joints(
    row: F1, height: float, c: tuple[float, float], mu: float, least: float
) -> tuple[bool, float, float]:
    """Return whether friction (x, z) is this, where joints hold directions of the plane of contact.

    It is along what moves alone, unless something else moves the bodies by more than `least` along
    what is held: then it slips (`slip_of`).
    """
    x, z = held_part(row, c[0], c[1])
    of_step = OF_STEP * OF_STEP * (row[DRIFT] * row[DRIFT] + row[DRIFT + 1] * row[DRIFT + 1])
    if x * x + z * z > max(least * least, of_step):
        return False, 0.0, 0.0
    if row[HELD] == 2.0:
        return True, 0.0, 0.0
    q1, q2 = row[HELD_ALONG + 1], -row[HELD_ALONG]
    along = q1 * c[0] + q2 * c[1]
    r = -along / (row[SCHUR] + row[SCHUR + 2])
    w = row[ALONG + 1] * q1 + row[ALONG + 2] * q2
    if abs(r) > mu * (height - w * r):
        sign = -1.0 if along > 0.0 else 1.0
        slope = 1.0 + mu * w * sign
        # see `solve_point`
        r = sign * mu * height / slope if slope > 1e-9 else 0.0
    return True, r * q1, r * q2


@jitable
def slip_of(row: F1, height: float, c: tuple[float, float], mu: float, s: float) -> V3:
    """Return friction (x, z) of a point that slips, and s for its next visit.

    (S + s I) r_T = -c with |r_T| = mu r_N, r_N = height - w . r_T (`fclib.one_contact`); s is a
    guess. A root is bracketed: |r_T| - mu r_N is positive at s = 0 and negative at infinity.
    """
    w1, w2 = row[ALONG + 1], row[ALONG + 2]
    s11, s12, s22 = row[SCHUR], row[SCHUR + 1], row[SCHUR + 2]
    size = math.sqrt(c[0] * c[0] + c[1] * c[1])
    if w1 == 0.0 and w2 == 0.0 and s12 == 0.0 and s11 == s22:
        # W is the same in all directions: friction is against c
        part = -mu * height / size
        return part * c[0], part * c[1], s
    low, high = 0.0, -1.0
    usual = size / (mu * height) - 0.5 * (s11 + s22)
    if not FAR * s >= usual or not s <= FAR * usual:
        s = usual
        if s <= 0.0:
            s = 1e-3 * (abs(s11) + abs(s22)) + 1e-300
    x, z = 0.0, 0.0
    for _ in range(MOST_SLIPS):
        d11, d22 = s11 + s, s22 + s
        determinant = d11 * d22 - s12 * s12
        if determinant <= 0.0:
            low = s
            s = 2.0 * s + 1e-300 if high < 0.0 else 0.5 * (low + high)
            continue
        part = 1.0 / determinant
        x, z = part * (s12 * c[1] - d22 * c[0]), part * (s12 * c[0] - d11 * c[1])
        n = height - w1 * x - w2 * z
        square = x * x + z * z
        length = math.sqrt(square)
        value = mu * n / length - 1.0
        if value < 0.0:
            low = s
        else:
            high = s
        # derivatives along s: (S + s I) r_T' = -r_T
        y1, y2 = part * (s12 * z - d22 * x), part * (s12 * x - d11 * z)
        slope = -mu * ((w1 * y1 + w2 * y2) + n * (x * y1 + z * y2) / square) / length
        step = s - value / slope if slope > 0.0 else -1.0
        if step <= low or (high >= 0.0 and step >= high):
            step = 2.0 * s if high < 0.0 else 0.5 * (low + high)
        done = abs(value) < ON_CONE or abs(step - s) <= 1e-15 * s
        s = step
        if done:
            break
    return x, z, s


@jitable
def solve_point(p: Points, v: F2, k: int) -> float:
    """Let point k obey its law; return by how much that changes its velocity."""
    r, row = p.r[k], p.given[k]
    rn, rx, rz = r[0], r[1], r[2]
    un = velocity_of(p, k, 0, v) + p.ahead[k]
    if un >= 0.0 and rn == 0.0 and rx == 0.0 and rz == 0.0:
        return 0.0
    ux, uz = velocity_of(p, k, 1, v), velocity_of(p, k, 2, v)
    wnn, wnx, wnz = row[W_NN], row[W_NX], row[W_NZ]
    wxx, wxz, wzz = row[W_XX], row[W_XZ], row[W_ZZ]
    mu = p.mu[k]
    # its velocity without its impulse
    bn = un - (wnn * rn + wnx * rx + wnz * rz)
    sn, sx, sz = 0.0, 0.0, 0.0
    # where nothing moves along n nothing presses
    if bn < 0.0 and row[ALONG] > 0.0:
        # what brings it to rest: r - W^-1 u
        i = STOPS
        sn = rn - (row[i] * un + row[i + 1] * ux + row[i + 2] * uz)
        sx = rx - (row[i + 1] * un + row[i + 3] * ux + row[i + 4] * uz)
        sz = rz - (row[i + 2] * un + row[i + 4] * ux + row[i + 5] * uz)
        most = mu * sn
        if not (sn >= 0.0 and sx * sx + sz * sz <= most * most and row[STOPS] > 0.0):
            height = -row[ALONG] * bn
            bx = ux - (wnx * rn + wxx * rx + wxz * rz)
            bz = uz - (wnz * rn + wxz * rx + wzz * rz)
            c = (bx + wnx * height - row[DRIFT], bz + wnz * height - row[DRIFT + 1])
            sn, sx, sz = height, 0.0, 0.0
            some, x, z, n = sticks_beside(row, height, c)
            held = False
            if row[HELD] > 0.0:
                held, x, z = sticks_by_joints(row, height, c, mu, 1.0 / p.counts[k])
                n = height - row[ALONG + 1] * x - row[ALONG + 2] * z
            if held:
                sn, sx, sz = n, x, z
            elif some and n >= 0.0 and x * x + z * z <= mu * mu * n * n:
                sn, sx, sz = n, x, z
            elif mu > 0.0 and (c[0] != 0.0 or c[1] != 0.0):
                x, z, p.slides[k] = slip_of(row, height, c, mu, p.slides[k])
                part = 1.0 / math.sqrt(x * x + z * z)
                x, z = part * x, part * z
                slope = 1.0 + mu * (row[ALONG + 1] * x + row[ALONG + 2] * z)
                if not slope > 1e-9:
                    # W is not positive, and no impulse of this point alone will do
                    return 0.0
                # exactly on the cone, the normal equation kept
                sn = height / slope
                sx, sz = mu * sn * x, mu * sn * z
    dn, dx, dz = sn - rn, sx - rx, sz - rz
    if dn == 0.0 and dx == 0.0 and dz == 0.0:
        return 0.0
    r[0], r[1], r[2] = sn, sx, sz
    apply(p, k, v, (dn, dx, dz))
    return max(wnn * abs(dn), max(wxx * abs(dx), wzz * abs(dz)))
