"""Boxes and meshes as pairs take them."""

from __future__ import annotations

import ctypes

import numpy as np

from mbsim.compile_model.contacts import pair_address
from mbsim.geometry.catalog import PAIRS, POINT
from mbsim.model.hull import polyhedron_of

POINTER = ctypes.c_void_p
CUBE = np.array([0.1, 0.1, 0.1])


def box_mesh(half, cuts=1):
    """Return vertices and triangles of a box, every side cut into cuts x cuts squares."""
    grid = np.linspace(-1.0, 1.0, cuts + 1)
    vertices, faces = [], []
    for k in range(3):
        for sign in (-1.0, 1.0):
            first = len(vertices)
            for a in grid:
                for b in grid:
                    p = np.zeros(3)
                    p[k], p[(k + 1) % 3], p[(k + 2) % 3] = sign, a, b
                    vertices.append(p * half)
            for i in range(cuts):
                for j in range(cuts):
                    a = first + i * (cuts + 1) + j
                    b, c, d = a + cuts + 1, a + cuts + 2, a + 1
                    quad = [[a, b, c], [a, c, d]] if sign > 0 else [[a, c, b], [a, d, c]]
                    faces.extend(quad)
    unique, index = np.unique(np.array(vertices), axis=0, return_inverse=True)
    return unique, index.reshape(-1)[np.array(faces)]


class Shape:
    """A box or a mesh as pairs take it; it keeps its polyhedron alive."""

    def __init__(self, kind, size=None, hull=None):
        self.kind, self.hull = kind, hull
        self.size = np.asarray(size, dtype=float) if hull is None else self._at(hull)

    @staticmethod
    def _at(hull):
        return np.array([float(hull.ctypes.data), float(len(hull)), 0.0])


def box(half):
    return Shape("BOX", half)


def mesh(vertices, faces):
    return Shape("MESH", hull=polyhedron_of(vertices, faces))


PLANE = Shape("PLANE", np.zeros(3))


def points_of(i, frame_i, j, frame_j, plain=False):
    """Return the rows of shape I on shape J, compiled or as plain Python."""
    pair = PAIRS[f"{i.kind}-{j.kind}"]
    out = np.full((pair.slots, POINT), np.nan)
    if plain:
        count = pair.points(frame_i, i.size, frame_j, j.size, out)
    else:
        call = ctypes.CFUNCTYPE(ctypes.c_int64, *[POINTER] * 5)(pair_address(pair))
        count = call(*[a.ctypes.data for a in (frame_i, i.size, frame_j, j.size, out)])
    return out[:count]


def rotation(w):
    """Return the rotation by vector w."""
    w = np.asarray(w, dtype=float)
    angle = np.linalg.norm(w)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = w / angle
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
