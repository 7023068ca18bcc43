"""Vectors as 3-tuples, unit quaternions (w first) as 4-tuples, rotation matrices as arrays.

Tuples keep compiled code free of allocation and read like the formulas.
`rotate(R, a)` is R a, `unrotate(R, a)` is R' a.
"""

from __future__ import annotations

import math

from mbsim.core.arrays import F1, F2, V3, V4
from mbsim.core.jitable import jitable


@jitable
def add(a: V3, b: V3) -> V3:
    """Return a + b."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


@jitable
def sub(a: V3, b: V3) -> V3:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@jitable
def scale(s: float, a: V3) -> V3:
    """Return s a."""
    return (s * a[0], s * a[1], s * a[2])


@jitable
def dot(a: V3, b: V3) -> float:
    """Return a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@jitable
def cross(a: V3, b: V3) -> V3:
    """Return a x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@jitable
def norm(a: V3) -> float:
    """Return |a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


@jitable
def vector(array: F1, at: int = 0) -> V3:
    """Return three numbers of an array, from place `at` on, as a tuple.

    A slice of an array takes several times as long to make as they take to read.
    """
    return (array[at], array[at + 1], array[at + 2])


@jitable
def rotate(R: F2, a: V3) -> V3:
    """Return R a for a 3x3 array."""
    return (
        R[0, 0] * a[0] + R[0, 1] * a[1] + R[0, 2] * a[2],
        R[1, 0] * a[0] + R[1, 1] * a[1] + R[1, 2] * a[2],
        R[2, 0] * a[0] + R[2, 1] * a[1] + R[2, 2] * a[2],
    )


@jitable
def unrotate(R: F2, a: V3) -> V3:
    """Return R' a for a 3x3 array."""
    return (
        R[0, 0] * a[0] + R[1, 0] * a[1] + R[2, 0] * a[2],
        R[0, 1] * a[0] + R[1, 1] * a[1] + R[2, 1] * a[2],
        R[0, 2] * a[0] + R[1, 2] * a[1] + R[2, 2] * a[2],
    )


@jitable
def matrix_from_quaternion(q: F1, R: F2) -> None:
    """Write the rotation of quaternion q (array or tuple, any length but 0) into R."""
    w, x, y, z = q[0], q[1], q[2], q[3]
    # dividing by |q|^2 makes R orthonormal for the stages, whose q is not quite unit
    s = 2.0 / (w * w + x * x + y * y + z * z)
    R[0, 0] = 1.0 - s * (y * y + z * z)
    R[0, 1] = s * (x * y - w * z)
    R[0, 2] = s * (x * z + w * y)
    R[1, 0] = s * (x * y + w * z)
    R[1, 1] = 1.0 - s * (x * x + z * z)
    R[1, 2] = s * (y * z - w * x)
    R[2, 0] = s * (x * z - w * y)
    R[2, 1] = s * (y * z + w * x)
    R[2, 2] = 1.0 - s * (x * x + y * y)


@jitable
def vector_of_turn(q: V4, q0: F1) -> V3:
    """Return the vector part of q q0*: along the axis of the turn from q0 to q, sin(half) long.

    It is exact to rounding for the smallest turns, of which q.q0 is 1.
    """
    return (
        -q[0] * q0[1] + q[1] * q0[0] - q[2] * q0[3] + q[3] * q0[2],
        -q[0] * q0[2] + q[1] * q0[3] + q[2] * q0[0] - q[3] * q0[1],
        -q[0] * q0[3] - q[1] * q0[2] + q[2] * q0[1] + q[3] * q0[0],
    )


@jitable
def turn_about(q: V4, q0: F1, w: V3, w0: V3, n: V3, n0: V3, h: float) -> float:
    """Return the angle by which a body turned about a unit vector on its way: the integral of w.n.

    From q0, w0, n0 to q, w, n in a time h, w the angular velocity in the global frame. The rotation
    vector of q q0* is the integral of w less h^2 w0 x w/12 (Magnus), and in the integral of its
    product with n counts what both change together. The error is h^5 where n stays, else h^3.
    """
    c = q[0] * q0[0] + q[1] * q0[1] + q[2] * q0[2] + q[3] * q0[3]
    r = vector_of_turn(q, q0)
    if c < 0.0:
        r, c = scale(-1.0, r), -c
    s = norm(r)
    over = 2.0 * math.atan2(s, c) / s if s > 0.0 else 0.0
    turn = add(scale(over, r), scale(h * h / 12.0, cross(w0, w)))
    return 0.5 * dot(turn, add(n0, n)) + h / 12.0 * dot(sub(w, w0), sub(n, n0))


@jitable
def turn_with_normal(t: V3, n0: V3, n: V3) -> V3:
    """Return the tangent t at unit normal n0 carried to unit normal n by the shortest rotation."""
    # R = I + [c]x + [c]x^2 / (1 + n0.n), c = n0 x n
    c = cross(n0, n)
    k = 1.0 / (1.0 + dot(n0, n)) if dot(n0, n) > -0.999999 else 0.0
    ct = cross(c, t)
    turned = add(t, add(ct, scale(k, cross(c, ct))))
    # rounding must not let the frame drift out of the tangent plane
    turned = sub(turned, scale(dot(turned, n), n))
    length = norm(turned)
    if length < 1e-12:
        return any_tangent(n)
    return scale(1.0 / length, turned)


@jitable
def spin(t: V3, n: V3, angle: float) -> V3:
    """Return the tangent t turned by `angle` about the unit normal n."""
    c, s = math.cos(angle), math.sin(angle)
    return add(scale(c, t), scale(s, cross(n, t)))


@jitable
def any_tangent(n: V3) -> V3:
    """Return some unit vector at right angles to n."""
    if abs(n[0]) < 0.6:
        t = (0.0, n[2], -n[1])
    else:
        t = (-n[2], 0.0, n[0])
    return scale(1.0 / norm(t), t)
