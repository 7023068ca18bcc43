"""Solids of revolution, ellipsoids and boxes as closed triangle meshes."""

from __future__ import annotations

import math

import numpy as np

from mbsim.model.elements import Array, Graphic
from mbsim.model.mesh import Faces

#: Sides of a round solid, and how often the triangles of an icosahedron are cut into four.
SIDES, HALVINGS = 96, 4


def _box(half: Array) -> tuple[Array, Faces]:
    signs = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)], dtype=float)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)])
    return signs * half, faces


def _frustum(bottom: float, top: float, half: float) -> tuple[Array, Faces]:
    """Return a frustum whose polygons have the area of its circles."""
    n = SIDES
    angle = 2.0 * np.pi * np.arange(n) / n
    wide = math.sqrt(2.0 * math.pi / n / math.sin(2.0 * math.pi / n))
    ring = wide * np.column_stack([np.cos(angle), np.sin(angle)])
    k, m = np.arange(n), (np.arange(n) + 1) % n
    rows = [np.column_stack([r * ring, np.full(n, z)]) for r, z in ((bottom, -half), (top, half))]
    centres = np.array([[0.0, 0.0, -half], [0.0, 0.0, half]])
    low, high = np.full(n, 2 * n), np.full(n, 2 * n + 1)
    sides = [np.column_stack([k, m, n + m]), np.column_stack([k, n + m, n + k])]
    ends = [np.column_stack([low, m, k]), np.column_stack([high, n + k, n + m])]
    vertices, faces = np.vstack([*rows, centres]), np.vstack([*sides, *ends])
    # a cone's tip is one vertex
    for r, first, centre in ((bottom, 0, 2 * n), (top, n, 2 * n + 1)):
        if r == 0.0:
            faces[(faces >= first) & (faces < first + n)] = centre
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used, index = np.unique(faces, return_inverse=True)
    return vertices[used], index.reshape(-1, 3)


def _ellipsoid(axes: Array) -> tuple[Array, Faces]:
    """Return an icosphere, scaled, whose volume is that of the ellipsoid."""
    t = 0.5 * (1.0 + math.sqrt(5.0))
    vertices = np.array([
        [-1, t, 0], [1, t, 0], [-1, -t, 0], [1, -t, 0], [0, -1, t], [0, 1, t],
        [0, -1, -t], [0, 1, -t], [t, 0, -1], [t, 0, 1], [-t, 0, -1], [-t, 0, 1],
    ])  # fmt: skip
    faces = np.array([
        [0, 11, 5], [0, 5, 1], [0, 1, 7], [0, 7, 10], [0, 10, 11], [1, 5, 9], [5, 11, 4],
        [11, 10, 2], [10, 7, 6], [7, 1, 8], [3, 9, 4], [3, 4, 2], [3, 2, 6], [3, 6, 8],
        [3, 8, 9], [4, 9, 5], [2, 4, 11], [6, 2, 10], [8, 6, 7], [9, 8, 1],
    ])  # fmt: skip
    vertices = vertices / np.linalg.norm(vertices, axis=1)[:, None]
    for _ in range(HALVINGS):
        ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2), axis=2)
        edges, middle = np.unique(ends.reshape(-1, 2), axis=0, return_inverse=True)
        points = vertices[edges].sum(axis=1)
        points /= np.linalg.norm(points, axis=1)[:, None]
        ab, bc, ca = (len(vertices) + middle.reshape(-1, 3)).T
        a, b, c = faces.T
        faces = np.vstack([
            np.column_stack(rows) for rows in ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        ])  # fmt: skip
        vertices = np.vstack([vertices, points])
    p, q, r = (vertices[faces[:, k]] for k in range(3))
    volume = float((p * np.cross(q, r)).sum()) / 6.0
    return vertices * (4.0 / 3.0 * math.pi / volume) ** (1.0 / 3.0) * axes, faces


def triangles_of(graphic: Graphic) -> tuple[Array, Faces]:
    """Return vertices (n, 3) [L] and faces (m, 3) of a graphic that is no plane, shape axes."""
    size = graphic.size
    if graphic.shape == "BOX":
        return _box(0.5 * np.array(size))
    if graphic.shape == "CYLINDER":
        return _frustum(size[0], size[0], 0.5 * size[1])
    if graphic.shape == "FRUSTUM":
        return _frustum(size[0], size[1], 0.5 * size[2])
    if graphic.shape in ("ELLIPSOID", "SPHERE"):
        return _ellipsoid(np.array(size if graphic.shape == "ELLIPSOID" else 3 * size))
    assert graphic.vertices is not None
    assert graphic.faces is not None
    return graphic.vertices, graphic.faces
