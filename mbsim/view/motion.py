"""Poses of bodies over rows as a view has them, and between rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from mbsim.model.elements import Array


class Poses(NamedTuple):
    """Positions (n, bodies, 3) [L] and unit quaternions (n, bodies, 4), w first, continuous."""

    p: Array
    q: Array


def continuous(q: Array) -> Array:
    """Return unit quaternions (n, bodies, 4) of the same rotations without jumps of their sign."""
    if len(q) < 2:
        return q
    turned = (q[1:] * q[:-1]).sum(axis=2) < 0.0
    signs = np.where(np.cumsum(turned, axis=0) % 2 == 1, -1.0, 1.0)
    found: Array = q.copy()
    found[1:] *= signs[:, :, None]
    return found


def between(poses: Poses, first: int, last: int, share: Array) -> Poses:
    """Return poses at shares (m,) of the way from one row to another, linear, q of unit length."""
    s = share[:, None, None]
    p = (1.0 - s) * poses.p[first] + s * poses.p[last]
    q = (1.0 - s) * poses.q[first] + s * poses.q[last]
    length = np.linalg.norm(q, axis=2, keepdims=True)
    # opposite ones have nothing between them
    return Poses(p, q / np.where(length > 0.0, length, 1.0))
