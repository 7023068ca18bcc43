"""Two convex shapes and the direction along which they overlap least.

Along a unit vector n from J into I the overlap is f(n) = n . (far_J(n) - far_I(-n)), with
far(d) the farthest point of a shape in direction d. Every f(n) bounds the depth from above,
and where it is negative its size is a lower bound of the distance. f is least

* at a normal of a face or an end disc (`flat`),
* where the normals of two ruled features meet: an edge allows all n with n.e = 0, the
  straight side of a solid of revolution all n with n.a = constant (`crossings`),
* on one such circle of normals, against a corner, a rim or a smooth surface (`along_circle`),
* or between two round features, where Newton finds it (`between_round`).

So no direction has to be searched on a grid, and the normal is exact to rounding.
A shape is a tuple (kind, centre, x, y, z, size): its frame as vectors, and its half edges,
semi-axes, or bottom radius, top radius, half length.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, sub, vector
from mbsim.geometry.catalog import axis

#: A crowned solid of revolution is one that bulges (`geometry.crowned`).
BOX, ROTOR, ELLIPSOID, CROWNED = 0, 1, 2, 3

Shape = tuple[int, V3, V3, V3, V3, V3]


@jitable
def placed(kind: int, frame: F1, size: V3) -> Shape:
    """Return a shape as a tuple; `size` is a tuple of three."""
    return (kind, vector(frame), axis(frame, 0), axis(frame, 1), axis(frame, 2), size)


@jitable
def far(shape: Shape, d: V3) -> V3:
    """Return the farthest point of a shape in the unit direction d."""
    kind, centre, x, y, z, size = shape
    a, b, c = dot(d, x), dot(d, y), dot(d, z)
    if kind == BOX:
        a = size[0] if a >= 0.0 else -size[0]
        b = size[1] if b >= 0.0 else -size[1]
        c = size[2] if c >= 0.0 else -size[2]
    elif kind == ELLIPSOID:
        a, b, c = size[0] * a, size[1] * b, size[2] * c
        length = math.sqrt(a * a + b * b + c * c)
        a, b, c = size[0] * a / length, size[1] * b / length, size[2] * c / length
    else:
        t = math.sqrt(a * a + b * b)
        top = size[2] * c + size[1] * t >= -size[2] * c + size[0] * t
        # along the axis the whole end disc is farthest; its centre stands for it
        r = (size[1] if top else size[0]) / t if t > 1e-300 else 0.0
        a, b, c = r * a, r * b, size[2] if top else -size[2]
    return add(centre, add(scale(a, x), add(scale(b, y), scale(c, z))))


@jitable
def overlap(i: Shape, j: Shape, n: V3) -> tuple[float, V3]:
    """Return f(n) and the difference of farthest points far_J(n) - far_I(-n)."""
    d = sub(far(j, n), far(i, scale(-1.0, n)))
    return dot(n, d), d


@jitable
def bend(shape: Shape, d: V3, t: V3, s: V3) -> float:
    """Return t . (d far / dd) s: how the farthest point moves, for tangents t, s of d.

    Ellipsoid with A = R diag(size) R': At.As/|Ad| - (At.Ad)(As.Ad)/|Ad|^3; rim of radius r:
    r (y.t)(y.s)/|a x d| with y along a x d; a corner stays where it is.
    """
    kind, _, x, y, z, size = shape
    if kind == ELLIPSOID:
        tt = (size[0] * dot(t, x), size[1] * dot(t, y), size[2] * dot(t, z))
        ss = (size[0] * dot(s, x), size[1] * dot(s, y), size[2] * dot(s, z))
        dd = (size[0] * dot(d, x), size[1] * dot(d, y), size[2] * dot(d, z))
        length = norm(dd)
        return dot(tt, ss) / length - dot(tt, dd) * dot(ss, dd) / length**3
    if kind == ROTOR:
        around = cross(z, d)
        length = norm(around)
        if length < 1e-12:
            return 0.0
        c = dot(d, z)
        top = size[2] * c + size[1] * length >= -size[2] * c + size[0] * length
        r = size[1] if top else size[0]
        return r * dot(around, t) * dot(around, s) / length**3
    return 0.0


@jitable
def between_round(i: Shape, j: Shape, n: V3, far_apart: float) -> tuple[float, V3]:
    """Return (f, n) of least overlap near n by Newton on the unit sphere.

    In tangents t, s of n the gradient of f is (t.d, s.d) and its curvature
    bend_I + bend_J - f. The curvature is made positive where it is not, and a step that does not
    lower f is halved, so f never rises. Shapes more than `far_apart` apart are left at that:
    f is a bound of their distance already.
    """
    f, d = overlap(i, j, n)
    size = norm(d) + abs(f) + 1e-300
    held = 0
    for _ in range(40):
        if f < -far_apart:
            break
        t = any_tangent(n)
        s = cross(n, t)
        gt, gs = dot(t, d), dot(s, d)
        # d is a difference of points: below its rounding there is nothing to gain
        if gt * gt + gs * gs <= (1e-15 * size) ** 2:
            break
        m = scale(-1.0, n)
        tt = bend(i, m, t, t) + bend(j, n, t, t) - f
        ss = bend(i, m, s, s) + bend(j, n, s, s) - f
        ts = bend(i, m, t, s) + bend(j, n, t, s)
        # smallest curvature = mean - spread
        mean = 0.5 * (tt + ss)
        spread = math.sqrt(0.25 * (tt - ss) ** 2 + ts * ts)
        least = 1e-3 * (abs(mean) + spread) + 1e-300
        if mean - spread < least:
            tt += least - (mean - spread)
            ss += least - (mean - spread)
        det = tt * ss - ts * ts
        a, b = (ts * gs - ss * gt) / det, (ts * gt - tt * gs) / det
        length = math.sqrt(a * a + b * b)
        part = min(1.0, 0.7 / length)
        lower = False
        for _ in range(12):
            v = add(n, add(scale(part * a, t), scale(part * b, s)))
            v = scale(1.0 / norm(v), v)
            g, e = overlap(i, j, v)
            if g <= f:
                lower = True
                break
            # near the end f is flat to rounding: the gradient decides
            if part * length < 1e-6 and g - f <= 1e-15 * size:
                et, es = dot(e, t) - g * dot(v, t), dot(e, s) - g * dot(v, s)
                lower = et * et + es * es < gt * gt + gs * gs
                break
            part *= 0.3
        if not lower:
            break
        n, f, d = v, g, e
        # steps cut again and again: a ridge between two features, where Newton has no business
        held = held + 1 if part < 0.5 else 0
        if part * length < 1e-15 or held > 8:
            break
    return f, n


@jitable
def on_circle(base: V3, u: V3, v: V3, k: float, p: float) -> V3:
    """Return base + k (u cos p + v sin p)."""
    return add(base, add(scale(k * math.cos(p), u), scale(k * math.sin(p), v)))


@jitable
def slope_at(
    i: Shape, j: Shape, base: V3, u: V3, v: V3, k: float, p: float
) -> tuple[V3, float, float]:
    """Return n(p), f and f'(p) = n'.d on a circle of normals."""
    n = on_circle(base, u, v, k, p)
    f, d = overlap(i, j, n)
    return n, f, k * (math.cos(p) * dot(v, d) - math.sin(p) * dot(u, d))


@jitable
def bracket_near(i: Shape, j: Shape, base: V3, u: V3, v: V3, k: float) -> tuple[bool, float, float]:
    """Return (found, a, b): places on a circle of normals around a minimum of f, from 0 downhill.

    Shapes that barely overlap have one valley, and its floor is near what is known.
    """
    _, _, slope = slope_at(i, j, base, u, v, k, 0.0)
    sign = -1.0 if slope > 0.0 else 1.0
    here, step = 0.0, 0.01
    for _ in range(7):
        there = here + sign * step
        _, _, slope = slope_at(i, j, base, u, v, k, there)
        if sign * slope >= 0.0:
            return True, min(here, there), max(here, there)
        here, step = there, 2.0 * step
    return False, here, here


@jitable
def bracket_all(i: Shape, j: Shape, base: V3, u: V3, v: V3, k: float) -> tuple[bool, float, float]:
    """Return (True, a, b): the neighbours of the lowest of twelve places on a circle."""
    best, low = 0, math.inf
    width = math.pi / 6.0
    for m in range(12):
        f, _ = overlap(i, j, on_circle(base, u, v, k, m * width))
        if f < low:
            best, low = m, f
    return True, (best - 1) * width, (best + 1) * width


@jitable
def valley_bound(f: float, fa: float, g: float, fb: float, w: float) -> float:
    """Return a lower bound of f between two places w apart with values f, g and slopes fa, fb.

    On an edge's circle f is a support function: f(p + s) >= f cos s + f' sin s from both sides,
    and the larger of both bounds is least where they meet.
    """
    p = f - g * math.cos(w) + fb * math.sin(w)
    q = fa - g * math.sin(w) - fb * math.cos(w)
    s = math.atan2(p, -q)
    if 0.0 < s < w:
        return f * math.cos(s) + fa * math.sin(s)
    return -math.inf


@jitable
def along_circle(
    i: Shape, j: Shape, c: V3, gamma: float, known: float, n_known: V3
) -> tuple[float, V3]:
    """Return the better of (known, n_known) and the least overlap on the circle n.c = gamma.

    n(p) = gamma c + sqrt(1 - gamma^2) (u cos p + v sin p). The minimum is bracketed, then the
    root of f' is closed in on. On an edge's circle (gamma 0) a bracket is left when it cannot
    beat what is known.
    """
    k = math.sqrt(max(0.0, 1.0 - gamma * gamma))
    base = scale(gamma, c)
    near = 0.0 < known < shallow(i, j)
    # begun at what is known or at the line of centres: the answer goes with the scene
    apart = n_known if near else sub(i[1], j[1])
    u = sub(apart, scale(dot(apart, c), c))
    length = norm(u)
    if near and length < 1e-3:
        return known, n_known
    u = scale(1.0 / length, u) if length > 1e-9 * norm(apart) else any_tangent(c)
    v = cross(c, u)
    if near:
        found, a, b = bracket_near(i, j, base, u, v, k)
    else:
        found, a, b = bracket_all(i, j, base, u, v, k)
    if not found:
        return known, n_known
    n, f, fa = slope_at(i, j, base, u, v, k, a)
    _, g, fb = slope_at(i, j, base, u, v, k, b)
    # a hump beside the bracket: then only halving is safe
    humps = fa >= 0.0 or fb <= 0.0
    value_a, value_b, slope_a, slope_b = f, g, fa, fb
    side = 0
    for step in range(60):
        if gamma == 0.0 and not humps and step % 3 == 0:
            if valley_bound(value_a, slope_a, value_b, slope_b, b - a) >= known - 1e-14 * abs(
                known
            ):
                return known, n_known
        # Illinois rule, with a halving in between
        halve = humps or step % 5 == 4
        p = 0.5 * (a + b) if halve else (a * fb - b * fa) / (fb - fa)
        n, f, slope = slope_at(i, j, base, u, v, k, p)
        if slope == 0.0 or b - a < 1e-15:
            break
        if slope < 0.0:
            # the other end stays: halve its weight if it stayed before
            moved = p - a
            a, fa, value_a, slope_a = p, slope, f, slope
            fb = 0.5 * fb if side == -1 else fb
            side = -1
        else:
            moved = b - p
            b, fb, value_b, slope_b = p, slope, f, slope
            fa = 0.5 * fa if side == 1 else fa
            side = 1
        if moved < 1e-15:
            break
    return (f, n) if f < known else (known, n_known)


@jitable
def slant(size: V3) -> float:
    """Return n.a of the straight side of a solid of revolution: (r_bottom - r_top) / slant."""
    fall = size[0] - size[1]
    return fall / math.sqrt(fall * fall + 4.0 * size[2] * size[2])


@jitable
def flat(i: Shape, j: Shape, shape: Shape, sign: float, f: float, n: V3) -> tuple[float, V3]:
    """Return the better of (f, n) and the normals of the faces or end discs of `shape`.

    `sign` is 1 where the shape is J (its outward normal is n), -1 where it is I.
    """
    kind, _, x, y, z, _ = shape
    apart = sub(i[1], j[1])
    for k in range(3):
        a = x if k == 0 else (y if k == 1 else z)
        if kind == ROTOR and k < 2:
            continue
        toward = 1.0 if dot(apart, a) >= 0.0 else -1.0
        m = scale(toward, a)
        g, _ = overlap(i, j, m)
        if g < f:
            f, n = g, m
        if kind == ROTOR:
            # a tapered solid's centre is not in the middle: look at both ends
            m = scale(-toward, a)
            g, _ = overlap(i, j, m)
            if g < f:
                f, n = g, m
    return f, n


@jitable
def meeting(
    i: Shape, j: Shape, a: V3, ga: float, b: V3, gb: float, f: float, n: V3
) -> tuple[float, V3]:
    """Return the better of (f, n) and the unit vectors m with m.a = ga and m.b = gb."""
    across = cross(a, b)
    square = dot(across, across)
    if square < 1e-12:
        # parallel: the circles are one or none; the direction between both axes
        apart = sub(i[1], j[1])
        w = sub(apart, scale(dot(apart, a), a))
        length = norm(w)
        if length == 0.0 or abs(ga - gb * dot(a, b)) > 1e-6:
            return f, n
        m = add(scale(ga, a), scale(math.sqrt(1.0 - ga * ga) / length, w))
        g, _ = overlap(i, j, m)
        return (g, m) if g < f else (f, n)
    # m = p a + q b +- size across
    ab = dot(a, b)
    p, q = (ga - gb * ab) / square, (gb - ga * ab) / square
    rest = 1.0 - (p * ga + q * gb)
    if rest < 0.0:
        return f, n
    size = math.sqrt(rest / square)
    for k in range(2):
        m = add(add(scale(p, a), scale(q, b)), scale(size if k == 0 else -size, across))
        m = scale(1.0 / norm(m), m)
        g, _ = overlap(i, j, m)
        if g < f:
            f, n = g, m
    return f, n


@jitable
def shallow(i: Shape, j: Shape) -> float:
    """Return the overlap up to which a direction of locally least overlap is the least of all.

    A twentieth of the smallest size: another one as shallow needs shapes that thin.
    """
    least = math.inf
    for k in range(3):
        for shape in (i, j):
            # the tip of a cone has no size
            if shape[5][k] > 0.0:
                least = min(least, shape[5][k])
    return 0.05 * least


@jitable
def line_of_centres(i: Shape, j: Shape) -> V3:
    """Return the unit vector from the centre of J to that of I, any where they coincide."""
    apart = sub(i[1], j[1])
    length = norm(apart)
    return scale(1.0 / length, apart) if length > 0.0 else (0.0, 0.0, 1.0)


@jitable
def point_in_solid(centre: V3, a: V3, size: V3, p: V3) -> tuple[float, V3, float, float]:
    """Return (distance, unit normal, r, z) of point p to a solid of revolution.

    In the half plane through the axis the solid is a trapezoid: outside, the nearest of
    its three sides; inside (distance < 0) the way out through the nearest of them.
    `r`, `z` are p's distance from the axis and its height over the middle.
    """
    d = sub(p, centre)
    z = dot(d, a)
    across = sub(d, scale(z, a))
    r = norm(across)
    radial = scale(1.0 / r, across) if r > 1e-300 else any_tangent(a)
    bottom, top, half = size
    fall = bottom - top
    slope = math.sqrt(fall * fall + 4.0 * half * half)
    nr, nz = 2.0 * half / slope, fall / slope
    # heights over the side line and over both ends
    side = (r - bottom) * nr + (z + half) * nz
    up, down = z - half, -half - z
    if side <= 0.0 and up <= 0.0 and down <= 0.0:
        if side >= up and side >= down:
            return side, add(scale(nr, radial), scale(nz, a)), r, z
        if up >= down:
            return up, a, r, z
        return down, scale(-1.0, a), r, z
    # outside: the nearest point on the slanted side, and on the end that p looks at
    along = min(1.0, max(0.0, ((z + half) * nr - (r - bottom) * nz) / slope))
    qr, qz = bottom - along * fall, 2.0 * half * along - half
    best = (r - qr) ** 2 + (z - qz) ** 2
    if up > 0.0:
        er = min(r, top)
        other = (r - er) ** 2 + up * up
        if other < best:
            best, qr, qz = other, er, half
    if down > 0.0:
        er = min(r, bottom)
        other = (r - er) ** 2 + down * down
        if other < best:
            best, qr, qz = other, er, -half
    distance = math.sqrt(best)
    if distance < 1e-300:
        return 0.0, add(scale(nr, radial), scale(nz, a)), r, z
    n = add(scale((r - qr) / distance, radial), scale((z - qz) / distance, a))
    return distance, n, r, z
