"""What markers measure, from poses by SciPy's rotations, for many states at once.

A frame is origin and axes with their first and second derivatives; what is seen from a marker's
body is differentiated as components along axes that it carries.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial.transform import Rotation


class Frame(NamedTuple):
    """Of a marker in n states: origin (n, 3), axes as columns (n, 3, 3), their derivatives."""

    p: np.ndarray
    R: np.ndarray
    v: np.ndarray
    R1: np.ndarray
    a: np.ndarray
    R2: np.ndarray
    w: np.ndarray  # angular velocity and its derivative
    alpha: np.ndarray


def skew(w):
    """Return the matrices of cross products with vectors (n, 3)."""
    zero = np.zeros(len(w))
    x, y, z = w.T
    return np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)


def times(M, u):
    """Return matrices (n, 3, 3) times vectors (n, 3) or (3,)."""
    return np.einsum("nij,nj->ni", M, np.broadcast_to(u, (len(M), 3)))


class Motion(NamedTuple):
    """Bodies in n states, in columns: positions, quaternions (w, x, y, z), v, w, a, alpha."""

    p: np.ndarray
    q: np.ndarray
    v: np.ndarray
    w: np.ndarray
    a: np.ndarray
    alpha: np.ndarray

    def frame(self, pos, axes, after=0.0):
        """Return the frame of a marker, `after` a time of moving on with v and w."""
        start = Rotation.from_quat(self.q, scalar_first=True)
        R = (Rotation.from_rotvec(after * self.w) * start).as_matrix()
        W = skew(self.w)
        R1, R2 = W @ R, (skew(self.alpha) + W @ W) @ R
        return Frame(
            self.p + after * self.v + times(R, pos),
            R @ axes,
            self.v + times(R1, pos),
            R1 @ axes,
            self.a + times(R2, pos),
            R2 @ axes,
            self.w,
            self.alpha,
        )


def fixed(n, pos=(0, 0, 0), axes=None):
    """Return the frame of a marker on ground."""
    zero, still = np.zeros((n, 3)), np.zeros((n, 3, 3))
    R = np.broadcast_to(np.eye(3) if axes is None else axes, (n, 3, 3))
    return Frame(zero + np.array(pos), R, zero, still, zero, still, zero, zero)


def size(u):
    """Return the lengths of vectors."""
    return np.linalg.norm(u, axis=-1)


def along(u, k, axis):
    """Return components along an axis of k."""
    return np.einsum("ni,ni->n", u, k.R[:, :, axis])


def seen(i, j, observer):
    """Return first and second derivative of P_i - P_j as components that the observer carries."""
    r, v, a = i.p - j.p, i.v - j.v, i.a - j.a
    back, back1, back2 = (M.transpose(0, 2, 1) for M in (observer.R, observer.R1, observer.R2))
    first = times(back1, r) + times(back, v)
    second = times(back2, r) + 2 * times(back1, v) + times(back, a)
    return times(observer.R, first), times(observer.R, second)


def spin_up(i, j, observer):
    """Return the derivative of w_i - w_j as components that the observer carries."""
    back, back1 = (M.transpose(0, 2, 1) for M in (observer.R, observer.R1))
    return times(observer.R, times(back1, i.w - j.w) + times(back, i.alpha - j.alpha))


def turn(i, j):
    """Return the rotations that take j's axes to i's."""
    return Rotation.from_matrix(j.R.transpose(0, 2, 1) @ i.R)


def about(i, j, axis, near):
    """Return AX, AY, AZ with the whole turns that bring it nearest to another angle.

    Of the deck's language: atan2(-z_i.y_j, z_i.z_j), atan2(z_i.x_j, z_i.z_j),
    atan2(x_i.y_j, x_i.x_j).
    """
    M = j.R.transpose(0, 2, 1) @ i.R
    s, c = [(-M[:, 1, 2], M[:, 2, 2]), (M[:, 0, 2], M[:, 2, 2]), (M[:, 1, 0], M[:, 0, 0])][axis]
    angle = np.angle(c + 1j * s)
    return angle + 2 * np.pi * np.round((near - angle) / (2 * np.pi))


def included(i, j, k):
    """Return the angle at j by Kahan's formula, exact for all angles."""
    a, b = i.p - j.p, k.p - j.p
    a, b = a / size(a)[:, None], b / size(b)[:, None]
    return 2 * np.arctan2(size(a - b), size(a + b))


def measure(name, *args, near=0.0):
    """Return a displacement, velocity or acceleration of markers; `args` are frames."""
    axis = "XYZ".find(name[-1])
    if name == "ORIENT":
        which, i, j = args
        return turn(i, j).as_quat(canonical=True, scalar_first=True)[:, which - 1]
    i, j, *more = args
    k = more[0] if more else fixed(len(i.p))
    observer = more[1] if len(more) > 1 else fixed(len(i.p))
    if name in ("PSI", "THETA", "PHI"):
        return turn(i, j).as_euler("ZXZ")[:, ("PSI", "THETA", "PHI").index(name)]
    if name in ("YAW", "PITCH", "ROLL"):
        return turn(i, j).as_euler("ZYX")[:, ("YAW", "PITCH", "ROLL").index(name)]
    if name == "INCANG":
        return included(i, j, k)
    if name in ("AX", "AY", "AZ"):
        return about(i, j, axis, near)
    if name in ("DM", "DX", "DY", "DZ"):
        return size(i.p - j.p) if axis < 0 else along(i.p - j.p, k, axis)
    if name == "VR":
        r = i.p - j.p
        return np.einsum("ni,ni->n", r / size(r)[:, None], i.v - j.v)
    if name[0] == "V":
        return size(seen(i, j, k)[0]) if axis < 0 else along(seen(i, j, observer)[0], k, axis)
    if name[:3] == "ACC":
        return size(seen(i, j, k)[1]) if axis < 0 else along(seen(i, j, observer)[1], k, axis)
    if name[:3] == "WDT":
        return size(spin_up(i, j, k)) if axis < 0 else along(spin_up(i, j, observer), k, axis)
    assert name[0] == "W"
    return size(i.w - j.w) if axis < 0 else along(i.w - j.w, k, axis)


def component(force, torque, k, comp):
    """Return component 1 to 8 of forces and torques (n, 3) along k."""
    u = force if comp <= 4 else torque
    return size(u) if comp in (1, 5) else along(u, k, (comp - 1) % 4 - 1)


def opposite(i, j, force, torque):
    """Return what acts on j at its origin, so that all about the global origin adds up to 0."""
    return -force, -(torque + np.cross(i.p, force) - np.cross(j.p, force))
