"""A closed mesh with its normals and neighbours, as `mesh_contact` needs it."""

from __future__ import annotations

from typing import Any

import numpy as np

#: Numbers at once in the test of points against all triangles.
_CHUNK = 2_000_000

Array = np.ndarray[Any, np.dtype[np.float64]]
Indices = np.ndarray[Any, np.dtype[np.int64]]

#: A vertex this far above a triangle's plane, as part of the mesh's size, is still in it.
FLAT = 1e-6
#: A direction is allowed at a vertex if no neighbour is this much (as a slope) above it.
SLOPE = 1e-3


class Surface:
    """A closed mesh with its normals and neighbours.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions in the mesh's axes [L].
    faces : ndarray of int, shape (m, 3)
        Vertex indices, counter-clockwise seen from outside.
    convex : bool
    """

    def __init__(self, vertices: Array, faces: Indices, convex: bool) -> None:
        self.vertices, self.faces, self.convex = vertices, faces, convex
        a, b, c = (vertices[faces[:, k]] for k in range(3))
        normals = np.cross(b - a, c - a)
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        self.normals: Array = normals / np.where(length > 0.0, length, 1.0)
        self.size = float(np.abs(vertices).max())
        self.beside = self._neighbours()
        order = np.argsort(faces.ravel(), kind="stable")
        self._at_vertex = order // 3
        self._first = np.searchsorted(faces.ravel()[order], np.arange(len(vertices) + 1))

    def _neighbours(self) -> Indices:
        """Return the face beyond each edge of each face, shape (m, 3)."""
        count = len(self.vertices)
        start, end = self.faces.ravel(), np.roll(self.faces, -1, axis=1).ravel()
        ahead, back = start * count + end, end * count + start
        order = np.argsort(ahead)
        beside: Indices = (order[np.searchsorted(ahead[order], back)] // 3).reshape(-1, 3)
        return beside

    def faces_at(self, vertex: int) -> Indices:
        """Return the faces around a vertex."""
        return self._at_vertex[self._first[vertex] : self._first[vertex + 1]]

    def allows(self, vertex: int, n: Array) -> bool:
        """Whether n, in the mesh's axes, is a normal at a vertex: no neighbour is higher."""
        ways = self.vertices[self.faces[self.faces_at(vertex)].ravel()] - self.vertices[vertex]
        return bool((ways @ n <= SLOPE * np.linalg.norm(ways, axis=1)).all())

    def groups(self, touched: Indices) -> list[tuple[Indices, list[Indices]]]:
        """Return the touched faces in one piece each, with its convex pieces where it is not.

        A convex piece grows over edges while all its vertices stay below all its planes.
        """
        if self.convex:
            return [(touched, [])]
        flat = FLAT * self.size
        return [
            (group, [] if self._rise(group, group) <= flat else self._split(group))
            for group in self._connected(touched)
        ]

    def _connected(self, touched: Indices) -> list[Indices]:
        """Return the touched faces grouped by common edges."""
        left, groups = set(touched.tolist()), []
        for seed in touched.tolist():
            if seed not in left:
                continue
            left.remove(seed)
            group, k = [seed], 0
            while k < len(group):
                for f in self.beside[group[k]].tolist():
                    if f in left:
                        left.remove(f)
                        group.append(f)
                k += 1
            groups.append(np.array(group))
        return groups

    def _rise(self, planes: Indices, points: Indices) -> float:
        """Return how far vertices of faces are above the planes of other faces at most."""
        m = self.normals[planes]
        offset = (m * self.vertices[self.faces[planes, 0]]).sum(axis=1)
        corners = np.unique(self.faces[points])
        return float((self.vertices[corners] @ m.T - offset).max())

    def _split(self, group: Indices) -> list[Indices]:
        """Return a connected group of faces as convex pieces."""
        flat = FLAT * self.size
        left, pieces = set(group.tolist()), []
        for seed in group.tolist():
            if seed not in left:
                continue
            left.remove(seed)
            piece, refused, k = [seed], set(), 0
            while k < len(piece):
                for f in self.beside[piece[k]].tolist():
                    if f not in left or f in refused:
                        continue
                    so_far, new = np.array(piece), np.array([f])
                    if max(self._rise(so_far, new), self._rise(new, so_far)) <= flat:
                        left.remove(f)
                        piece.append(f)
                    else:
                        refused.add(f)
                k += 1
            pieces.append(np.array(piece))
        return pieces

    def contains(self, points: Array) -> np.ndarray[Any, np.dtype[np.bool_]]:
        """Return which points (k, 3), in the mesh's axes, are inside.

        For a mesh that is not convex by its winding number, the sum of the solid angles of its
        triangles over 4 pi: tan(angle / 2) = a.(b x c) / (abc + (a.b)c + (b.c)a + (c.a)b).
        """
        low, high = self.vertices.min(axis=0), self.vertices.max(axis=0)
        inside = ((points > low) & (points < high)).all(axis=1)
        offset = (self.normals * self.vertices[self.faces[:, 0]]).sum(axis=1)
        within = np.flatnonzero(inside)
        for few in np.array_split(within, 1 + len(within) * len(self.faces) // _CHUNK):
            if self.convex:
                inside[few] = (points[few] @ self.normals.T < offset).all(axis=1)
                continue
            ways = self.vertices[None, :, :] - points[few, None, :]
            length = np.linalg.norm(ways, axis=2)
            a, b, c = (ways[:, self.faces[:, k]] for k in range(3))
            la, lb, lc = (length[:, self.faces[:, k]] for k in range(3))
            over = (a * np.cross(b, c)).sum(axis=2)
            under = la * lb * lc + (a * b).sum(axis=2) * lc
            under += (b * c).sum(axis=2) * la + (c * a).sum(axis=2) * lb
            inside[few] = np.arctan2(over, under).sum(axis=1) > np.pi
        return inside
