"""Rotations of markers, and where every marker stands at t = 0."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from mbsim.model.elements import Array, Marker, Model


class Frame(NamedTuple):
    """A frame in another: origin `p` (3,) [L] and axes `R` (3, 3) as columns."""

    p: Array
    R: Array


GLOBAL = Frame(np.zeros(3), np.eye(3))


def rotation_313(psi: float, theta: float, phi: float) -> Array:
    """Return Rz(psi) Rx(theta) Rz(phi), shape (3, 3).

    Parameters
    ----------
    psi, theta, phi : float
        Angles [rad] about the body's z, x and z axes, in this order.
    """
    c1, s1 = math.cos(psi), math.sin(psi)
    c2, s2 = math.cos(theta), math.sin(theta)
    c3, s3 = math.cos(phi), math.sin(phi)
    return np.array(
        [
            [c1 * c3 - s1 * c2 * s3, -c1 * s3 - s1 * c2 * c3, s1 * s2],
            [s1 * c3 + c1 * c2 * s3, -s1 * s3 + c1 * c2 * c3, -c1 * s2],
            [s2 * s3, s2 * c3, c2],
        ]
    )


def orthonormalise(matrix: Array) -> tuple[Array, float]:
    """Return the orthonormal matrix nearest to `matrix` and the error max |R'R - 1|.

    Parameters
    ----------
    matrix : ndarray, shape (3, 3)
        Axes as columns.

    Notes
    -----
    The orthogonal factor U V' of the singular value decomposition U S V' is the nearest
    orthonormal matrix in the Frobenius norm. A matrix exact to rounding is returned as it is.
    """
    error = float(np.max(np.abs(matrix.T @ matrix - np.eye(3))))
    if error < 1e-15:
        return matrix, error
    u, _, vt = np.linalg.svd(matrix)
    return u @ vt, error


def quaternion(R: Array) -> Array:
    """Return the unit quaternion (w, x, y, z), w >= 0, of a rotation matrix.

    Notes
    -----
    Of the four ways to begin, the one with the largest divisor is taken: 4 w^2 = 1 + tr R,
    4 x^2 = 1 + 2 R00 - tr R, and so on (S. W. Shepperd, J. Guidance and Control 1(3), 1978).
    """
    trace = float(np.trace(R))
    squares = np.array([trace, R[0, 0], R[1, 1], R[2, 2]])
    first = int(np.argmax(squares))
    if first == 0:
        q = np.array([1.0 + trace, R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    else:
        i = first - 1
        j, k = (i + 1) % 3, (i + 2) % 3
        q = np.zeros(4)
        q[0] = R[k, j] - R[j, k]
        q[1 + i] = 1.0 + R[i, i] - R[j, j] - R[k, k]
        q[1 + j] = R[j, i] + R[i, j]
        q[1 + k] = R[k, i] + R[i, k]
    q /= np.linalg.norm(q)
    return -q if q[0] < 0.0 else q


def parent_id(model: Model, marker: Marker) -> int | None:
    """Return the marker in whose frame `marker` is given, None for the global frame.

    `rm_id` goes first, then the body's `lprf_id`; the LPRF marker itself is global.
    """
    if marker.rm_id is not None:
        return marker.rm_id
    body = model.bodies.get(marker.body_id)
    if body is None or body.lprf_id == marker.id:
        return None
    return body.lprf_id


def marker_frames(model: Model) -> dict[int, Frame]:
    """Return the global frame of every marker at t = 0, by id.

    Parameters
    ----------
    model : Model
        The deck. Markers that hang on a ring or on a marker that does not exist have no
        place and are left out; `checks` reports them.
    """
    frames: dict[int, Frame] = {}
    seen: set[int] = set()
    for id in model.markers:
        # up the parents to one that was met before: placed, without a place, or a ring's first
        chain: list[Marker] = []
        step: int | None = id
        while step is not None and step in model.markers and step not in seen:
            seen.add(step)
            chain.append(model.markers[step])
            step = parent_id(model, chain[-1])
        if step is not None and step not in frames:
            continue

        # and down again, each in the frame of the one before
        parent = GLOBAL if step is None else frames[step]
        for marker in reversed(chain):
            parent = Frame(parent.p + parent.R @ np.array(marker.pos), parent.R @ marker.R)
            frames[marker.id] = parent
    return frames


def marker_loops(model: Model) -> Iterator[tuple[int, ...]]:
    """Yield every ring of markers once, as the ids around it; dangling parents end a chain."""
    finished: set[int] = set()
    for id in model.markers:
        path: dict[int, None] = {}  # an ordered set
        step: int | None = id
        while step is not None and step in model.markers and step not in finished:
            if step in path:
                ids = list(path)
                yield (*ids[ids.index(step) :], step)
                break
            path[step] = None
            step = parent_id(model, model.markers[step])
        finished.update(path)
