"""Nearest points on triangles, many at once."""

from __future__ import annotations

import numpy as np

from mbsim.model.elements import Array


def nearest_on(points: Array, triangles: Array) -> Array:
    """Return the point of each triangle (k, 3, 3) nearest to its point (k, 3), shape (k, 3).

    Notes
    -----
    The foot on the plane where it is within the triangle, else the nearest point of the edges.
    """
    a, b, c = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    ab, ac, ap = b - a, c - a, points - a
    aa, bb, ab_ac = _dot(ab, ab), _dot(ac, ac), _dot(ab, ac)
    d1, d2 = _dot(ab, ap), _dot(ac, ap)
    square = aa * bb - ab_ac * ab_ac
    flat = square <= 1e-24 * aa * bb
    safe = np.where(flat, 1.0, square)
    u, v = (bb * d1 - ab_ac * d2) / safe, (aa * d2 - ab_ac * d1) / safe
    inside = ~flat & (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0)
    best: Array = a + u[:, None] * ab + v[:, None] * ac
    out = np.flatnonzero(~inside)
    if len(out):
        best[out] = _nearest_on_edges(points[out], triangles[out])
    return best


def _dot(a: Array, b: Array) -> Array:
    product: Array = np.einsum("kx,kx->k", a, b)
    return product


def _nearest_on_edges(points: Array, triangles: Array) -> Array:
    best, least = np.empty_like(points), np.full(len(points), np.inf)
    for k in range(3):
        p, e = triangles[:, k], triangles[:, (k + 1) % 3] - triangles[:, k]
        part = _dot(points - p, e) / np.maximum(_dot(e, e), 1e-300)
        q = p + np.clip(part, 0.0, 1.0)[:, None] * e
        away = _dot(points - q, points - q)
        closer = away < least
        best[closer], least[closer] = q[closer], away[closer]
    return best
