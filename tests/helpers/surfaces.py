"""Meshes that need not be convex, packed, and their pairs called by name."""

from __future__ import annotations

import numpy as np

from helpers.pairs import entry, frame
from mbsim.geometry.catalog import AREA, MEAN_DEPTH, PAIRS, POINT, REGION_ROWS
from mbsim.model.elements import Graphic
from mbsim.model.surface import pack
from mbsim.model.surface_layer import layer
from mbsim.model.tessellation import triangles_of


class Meshed:
    """A mesh with its packed surface; the layer where it is asked for."""

    def __init__(self, vertices, faces, layered=True):
        self.vertices, self.faces = np.asarray(vertices, dtype=float), np.asarray(faces)
        bare = (self.vertices, np.zeros(len(self.vertices)))
        self.data = pack(
            self.vertices, self.faces, *(layer(self.vertices, self.faces) if layered else bare)
        )
        self.size = np.array([0.0, 0.0, 0.0, self.data.ctypes.data])

    @property
    def corners(self):
        return self.vertices[self.faces]


def sphere(radius, halvings):
    """Return an icosphere whose vertices have the radius; 20 4^halvings triangles."""
    import mbsim.model.tessellation as made

    kept, made.HALVINGS = made.HALVINGS, halvings
    try:
        vertices, faces = triangles_of(Graphic(id=1, shape="SPHERE", size=(1.0,)))
    finally:
        made.HALVINGS = kept
    return radius * vertices / np.linalg.norm(vertices, axis=1)[:, None], faces


def box(*edges):
    return triangles_of(Graphic(id=1, shape="BOX", size=edges))


def torus(large, small, around, across):
    """Return a torus about z."""
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    wide = large + small * np.cos(v)
    vertices = np.stack([wide * np.cos(u), wide * np.sin(u), small * np.sin(v)], axis=2)
    k = (i * across + j).ravel()
    right = (((i + 1) % around) * across + j).ravel()
    up = (i * across + (j + 1) % across).ravel()
    both = (((i + 1) % around) * across + (j + 1) % across).ravel()
    faces = np.vstack([np.column_stack([k, right, both]), np.column_stack([k, both, up])])
    return vertices.reshape(-1, 3), faces


def call(name, frame_i, size_i, frame_j, size_j):
    """Return all rows of a pair."""
    points = np.full((PAIRS[name].slots, POINT), np.nan)
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (frame_i, size_i, frame_j, size_j)]
    entry(name)(*(a.ctypes.data for a in (*arrays, points)))
    return points


def incidents(points):
    """Return the touching incidents of patches and the rows of their numbers."""
    first, numbers = points[::REGION_ROWS], points[1::REGION_ROWS]
    down = first[:, 0] > 0.0
    return first[down], numbers[down]


def overlap_volume(points):
    """Return the volume and the area of patches on a plane."""
    _, numbers = incidents(points)
    return float((numbers[:, AREA] * numbers[:, MEAN_DEPTH]).sum()), float(numbers[:, AREA].sum())


def wrench(points, step=1, about=(0.0, 0.0, 0.0)):
    """Return force and torque on I of springs of stiffness 1."""
    down = points[::step]
    down = down[down[:, 0] > 0.0]
    force = (down[:, 7] * down[:, 0])[:, None] * down[:, 4:7]
    torque = np.cross(down[:, 1:4] - np.asarray(about), force)
    return np.concatenate([force.sum(axis=0), torque.sum(axis=0)])


PLANE = (frame(np.zeros(3), np.eye(3)), np.zeros(4))
