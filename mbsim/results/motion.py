"""Bodies over output rows, and rotations over many rows at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mbsim.core.layout import AT_Q, AT_V, AT_W, BODY_SIZE
from mbsim.model.elements import Array


def rotate(q: Array, v: Array) -> Array:
    """Return the vectors v (..., 3) turned by the unit quaternions q (..., 4), w first."""
    # v + 2 u x (u x v + w v), u the vector part: no matrix is needed
    u, w = q[..., 1:], q[..., :1]
    turned: Array = v + 2.0 * _cross(u, _cross(u, v) + w * v)
    return turned


def _cross(a: Array, b: Array) -> Array:
    """Return cross products of vectors (..., 3), as `numpy.cross` does in three times the time."""
    shape = np.broadcast_shapes(a.shape, b.shape)
    # each component of all vectors lies together
    found = np.moveaxis(np.empty((3, *shape[:-1])), 0, -1)
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1))):
        np.subtract(a[..., i] * b[..., j], a[..., j] * b[..., i], out=found[..., k])
    return found


def matrices(q: Array) -> Array:
    """Return the rotation matrices (..., 3, 3) of unit quaternions (..., 4), w first."""
    axes = [rotate(q, np.broadcast_to(axis, (*q.shape[:-1], 3))) for axis in np.eye(3)]
    return np.stack(axes, axis=-1)


@dataclass(frozen=True)
class Motion:
    """Moving bodies over n rows, all in the global frame: cg, and angular values.

    `p`, `v`, `w`, `a`, `alpha` are (n, nb, 3), `q` is (n, nb, 4), w first.
    """

    body_ids: Sequence[int]
    p: Array
    q: Array
    v: Array
    own_w: Array  # in cg axes
    a: Array
    alpha: Array

    @cached_property
    def w(self) -> Array:
        """Angular velocities: found where they are asked for."""
        return rotate(self.q, self.own_w)

    @property
    def rows(self) -> int:
        """Number of rows."""
        return len(self.p)


def motion(body_ids: Sequence[int], y: Array, accel: Array) -> Motion:
    """Return the bodies' motion from rows of the ODE vector and of accelerations.

    Parameters
    ----------
    body_ids : sequence of int
        Of the moving bodies, in the order of y.
    y : ndarray, shape (n, ny)
        As in `arrays.scene`: angular velocity in cg axes.
    accel : ndarray, shape (n, 6 nb)
        Of the cg and angular, global.
    """
    n, nb = len(y), len(body_ids)
    bodies: np.ndarray[Any, Any] = y[:, : BODY_SIZE * nb].reshape(n, nb, BODY_SIZE)
    rates = accel.reshape(n, nb, 6)
    q = bodies[..., AT_Q:AT_V]
    return Motion(
        body_ids=body_ids,
        p=bodies[..., 0:3],
        q=q,
        v=bodies[..., AT_V:AT_W],
        own_w=bodies[..., AT_W:],
        a=rates[..., 0:3],
        alpha=rates[..., 3:6],
    )
