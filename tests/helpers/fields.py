"""Potentials of overlapping meshes by other means than the kernels: slices and clipped pieces."""

from __future__ import annotations

import itertools

import numpy as np

from mbsim.geometry.catalog import COUPLE_OF_FORCE
from mbsim.model.surface import pack
from mbsim.model.surface_layer import layer, tetrahedra

_GAUSS = np.polynomial.legendre.leggauss(4)


class Shape:
    """A mesh packed for the kernels, and the convex pieces that it is made of."""

    def __init__(self, vertices, faces, pieces=()):
        self.vertices = np.array(vertices, dtype=float)
        self.faces = np.array(faces, dtype=np.int64)
        self.pieces = pieces  # lists of half-spaces (normal, offset): x.n <= offset
        self.layer = layer(self.vertices, self.faces)
        self.packed = pack(self.vertices, self.faces, *self.layer)
        self.size = np.array([0.0, 0.0, 0.0, float(self.packed.ctypes.data)])

    def field(self):
        """Return corners (k, 4, 3) and psi (k, 4) of the tetrahedra of its layer."""
        points = np.concatenate([self.vertices, self.layer.inner])
        psi = np.concatenate([np.zeros(len(self.vertices)), self.layer.depth])
        cut = tetrahedra(self.faces)
        return points[cut], psi[cut]


def box_planes(low, high):
    """Return the half-spaces of a box along the axes."""
    planes = []
    for k in range(3):
        n = np.zeros(3)
        n[k] = 1.0
        planes += [(n, float(high[k])), (-n, -float(low[k]))]
    return planes


def sliced(vertices, faces, height):
    """Return volume and integral of the depth of a mesh below z = height, slice by slice."""
    z = vertices[:, 2]
    levels = np.unique(np.append(z[z < height], height))
    volume = potential = 0.0
    for low, high in itertools.pairwise(levels):
        for x, w in zip(*_GAUSS, strict=True):
            t = 0.5 * (low + high) + 0.5 * (high - low) * x
            area = _section(vertices[faces], t)
            volume += 0.5 * (high - low) * w * area
            potential += 0.5 * (high - low) * w * area * (height - t)
    return volume, potential


def _section(triangles, t):
    """Return the area of the cut of a closed mesh with z = t."""
    over = triangles[:, :, 2] > t
    crossed = triangles[over.any(axis=1) & ~over.all(axis=1)]
    total = 0.0
    for k in range(3):
        # where edges go down the cut begins, where they come up it ends: the solid is on its left
        a, b, c = (crossed[:, (k + m) % 3] for m in range(3))
        alone = (a[:, 2] > t) != (b[:, 2] > t)
        alone &= (a[:, 2] > t) != (c[:, 2] > t)
        a, b, c = a[alone], b[alone], c[alone]
        x = (a + ((t - a[:, 2]) / (b[:, 2] - a[:, 2]))[:, None] * (b - a))[:, :2]
        y = (a + ((t - a[:, 2]) / (c[:, 2] - a[:, 2]))[:, None] * (c - a))[:, :2]
        down = np.where(a[:, 2] > t, 1.0, -1.0)
        total += 0.5 * float((down * (x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0])).sum())
    return total


def _clipped(corners, psi, n, offset):
    """Return tetrahedra (corners, psi) of the part of one where x.n <= offset."""
    out = corners @ n - offset
    order = np.argsort(out)
    corners, psi, out = corners[order], psi[order], out[order]
    inside = int((out <= 0.0).sum())
    if inside == 0:
        return []
    if inside == 4:
        return [(corners, psi)]

    def between(i, j):
        part = out[i] / (out[i] - out[j])
        return corners[i] + part * (corners[j] - corners[i]), psi[i] + part * (psi[j] - psi[i])

    own = [(corners[k], psi[k]) for k in range(4)]
    if inside == 1:
        made = [[own[0], between(0, 1), between(0, 2), between(0, 3)]]
    elif inside == 3:
        x, y, z = (between(k, 3) for k in range(3))
        made = [[*own[:3], z], [own[0], own[1], y, z], [own[0], x, y, z]]
    else:
        a, b, c, d = between(0, 2), between(0, 3), between(1, 2), between(1, 3)
        made = [[own[0], own[1], c, d], [own[0], a, c, d], [own[0], a, b, d]]
    return [(np.array([p for p, _ in each]), np.array([v for _, v in each])) for each in made]


def in_pieces(shape, pieces, p, R):
    """Return the integral of a shape's psi over convex pieces that are moved by p, R."""
    total = 0.0
    for piece in pieces:
        planes = [(R @ n, offset + (R @ n) @ p) for n, offset in piece]
        for corners, psi in zip(*shape.field(), strict=True):
            left = [(corners, psi)]
            for n, offset in planes:
                left = [part for each in left for part in _clipped(*each, n, offset)]
            for q, value in left:
                size = abs(np.linalg.det(q[1:] - q[0])) / 6.0
                total += size * value.mean()
    return total


def potential(i, j, p, R):
    """Return U of shape i, moved by p and R, on shape j that stands."""
    back = -R.T @ p
    return 0.5 * (in_pieces(j, i.pieces, p, R) + in_pieces(i, j.pieces, back, R.T))


def slopes(function, p, R, turned, step):
    """Return minus the slope of function(p, R) by translation, and by rotation about p."""
    found = np.zeros((2, 3))
    for k in range(3):
        e = np.eye(3)[k]

        def along(s, e=e):
            return function(p + s * e, R)

        def about(s, e=e):
            return function(p, turned(e, s) @ R)

        for row, f in enumerate((along, about)):
            wide = (f(2.0 * step) - f(-2.0 * step)) / (4.0 * step)
            near = (f(step) - f(-step)) / (2.0 * step)
            found[row, k] = -(4.0 * near - wide) / 3.0
    return found


def wrench(points, about):
    """Return force and torque about a point of a linear law of unit stiffness, and its energy."""
    force, torque, energy = np.zeros(3), np.zeros(3), 0.0
    for row in points[::2]:
        if row[0] > 0.0:
            own = row[7] * row[0] * row[4:7]
            force += own
            of_force = row[COUPLE_OF_FORCE : COUPLE_OF_FORCE + 3]
            torque += np.cross(row[1:4] - about, own) + row[0] * of_force
            energy += 0.5 * row[7] * row[0] ** 2
    return force, torque, energy
