"""Triangle meshes: merging vertices, and whether they bound a solid.

`solid_fault` is what every run asks; `model.mesh_findings` tells all that is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array
from mbsim.model.mass_properties import polyhedron

Faces = npt.NDArray[np.int64]
Marks = npt.NDArray[np.bool_]

_PLACES = 3  # so many positions of one kind of fault are told


@dataclass(frozen=True)
class Finding:
    """One kind of thing that is wrong with a mesh: how often, and the first few places."""

    what: str
    count: int
    places: tuple[str, ...]

    def __str__(self) -> str:
        """Return the finding as one line."""
        if not self.places:
            return self.what
        first = "" if len(self.places) == self.count else "the first "
        return f"{self.what}: {first}{', '.join(self.places)}"


class Edges(NamedTuple):
    """Edges of a mesh, each once: ends (n, 2) with the smaller index first, and triangles on it.

    `of_face` (m, 3) is the edge that begins at each corner of each face; `along` (m, 3) says
    whether it runs there from the smaller index to the larger.
    """

    ends: npt.NDArray[np.int64]
    uses: npt.NDArray[np.int64]
    of_face: npt.NDArray[np.int64]
    along: npt.NDArray[np.bool_]


def merge_vertices(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Return the mesh with equal vertices made one, and without faces that then have no area.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L]; only bitwise equal ones (0 and -0 too) are merged.
    faces : ndarray of int, shape (m, 3)
        Vertex indices.
    """
    unique, merged = equal_as_one(vertices, faces)
    return unique, merged[three_corners(merged)]


def equal_as_one(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Return the mesh with equal vertices made one, and all of its faces."""
    unique, index = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    return unique, index.reshape(-1)[faces].astype(np.int64)


def three_corners(faces: Faces) -> npt.NDArray[np.bool_]:
    """Return which faces (m, 3) have three different corners, shape (m,)."""
    a, b, c = faces.T
    return np.asarray((a != b) & (b != c) & (c != a))


def in_order(faces: Faces) -> Faces:
    """Return the faces by their least corner, which is the first of each."""
    first = faces.argmin(axis=1)
    turned = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    ordered: Faces = turned[np.lexsort(turned.T[::-1])]
    return ordered


def edges_of(faces: Faces, count: int) -> Edges:
    """Return the edges of faces (m, 3) over so many vertices."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    keys = np.minimum(start, end) * count + np.maximum(start, end)
    unique, of_face, uses = np.unique(keys, return_inverse=True, return_counts=True)
    ends = np.column_stack(np.divmod(unique, count))
    shape = faces.shape
    return Edges(ends, uses, of_face.reshape(shape), (start < end).reshape(shape))


def shells(edges: Edges, faces: int) -> npt.NDArray[np.int64]:
    """Return for each of so many faces the number of its shell: faces joined through edges."""
    owner = np.repeat(np.arange(faces), 3)
    order = np.argsort(edges.of_face, axis=None, kind="stable")
    at, edge = owner[order], edges.of_face.ravel()[order]
    beside = edge[1:] == edge[:-1]
    return joined(at[:-1][beside], at[1:][beside], faces)


def joined(a: npt.NDArray[np.int64], b: npt.NDArray[np.int64], count: int) -> npt.NDArray[np.int64]:
    """Return for each of so many things the number of what hangs together by pairs a, b (k,)."""
    # each hangs on one with a smaller number; trees are joined at their roots
    root = np.arange(count)
    while True:
        low, high = np.minimum(root[a], root[b]), np.maximum(root[a], root[b])
        if (low == high).all():
            return np.unique(root, return_inverse=True)[1].reshape(-1).astype(np.int64)
        np.minimum.at(root, high, low)
        while (root[root] != root).any():
            root = root[root]


def winding_number(point: Array, vertices: Array, faces: Faces) -> int:
    """Return how often closed faces (m, 3) wind around a point (3,): 0 outside, 1 inside.

    Notes
    -----
    The sum of signed solid angles over 4 pi (A. van Oosterom and J. Strackee, IEEE
    Transactions on Biomedical Engineering 30(2), 1983).
    """
    corners = vertices[faces] - point
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    la, lb, lc = (np.linalg.norm(each, axis=1) for each in (a, b, c))
    top = np.einsum("ij,ij->i", a, np.cross(b, c))
    low = la * lb * lc + np.einsum("ij,ij->i", a, b) * lc
    low += np.einsum("ij,ij->i", b, c) * la + np.einsum("ij,ij->i", c, a) * lb
    return round(float(np.arctan2(top, low).sum()) / (2.0 * np.pi))


def surroundings(vertices: Array, faces: Faces, shell: npt.NDArray[np.int64]) -> list[int]:
    """Return for each shell how often the others wind around it: 0 for one that stands alone."""
    count = int(shell.max()) + 1
    if count == 1:
        return [0]
    points = vertices[faces]
    lower = np.full((count, 3), np.inf)
    upper = np.full((count, 3), -np.inf)
    np.minimum.at(lower, shell, points.min(axis=1))
    np.maximum.at(upper, shell, points.max(axis=1))
    found = []
    for k in range(count):
        point = points[shell == k][0, 0]
        near = ((lower < point) & (point < upper)).all(axis=1)
        near[k] = False
        others = near[shell]
        found.append(winding_number(point, vertices, faces[others]) if others.any() else 0)
    return found


def topology_findings(vertices: Array, edges: Edges) -> list[Finding]:
    """Return why the edges bound no solid: open, of too many triangles, of changing winding."""
    found = []
    for bad, what in (
        (edges.uses == 1, "the mesh is open: {} edges belong to one triangle only"),
        (edges.uses > 2, "the mesh is no surface: {} edges belong to 3 or more triangles"),
        (
            (edges.uses == 2) & (_one_way(edges) != 1),
            "the mesh's winding is not consistent: {} edges run one way in both triangles",
        ),
    ):
        count = int(bad.sum())
        if count:
            places = (edge_text(*vertices[pair]) for pair in edges.ends[bad][:_PLACES])
            found.append(Finding(what.format(count), count, tuple(places)))
    return found


def _one_way(edges: Edges) -> npt.NDArray[np.int64]:
    """Return in how many triangles each edge runs from its smaller index to its larger."""
    return np.bincount(edges.of_face.ravel(), edges.along.ravel(), len(edges.ends)).astype(np.int64)


def shell_findings(vertices: Array, faces: Faces, edges: Edges) -> list[Finding]:
    """Return which shells of a closed mesh of one winding bound no solid.

    Notes
    -----
    A shell turned inwards is a cavity: what is around it must wind around it once more
    than what is within, so never less than once. One turned outwards stands alone.
    """
    shell = shells(edges, len(faces))
    around = surroundings(vertices, faces, shell)
    empty, inward, doubled = [], [], []
    for k, times in enumerate(around):
        own = faces if len(around) == 1 else faces[shell == k]
        volume = polyhedron(vertices, own).volume
        size = float(np.ptp(vertices[own].reshape(-1, 3), axis=0).max())
        if abs(volume) <= 1e-12 * size**3:
            empty.append(point_text(vertices[own[0, 0]]))
        elif len(around) == 1 and volume < 0.0:
            what = "the mesh is turned inside out: its enclosed volume is {:.6g}, must be > 0"
            return [Finding(what.format(volume), 1, ())]
        elif volume < 0.0 and times < 1:
            inward.append(point_text(vertices[own[0, 0]]))
        elif volume > 0.0 and times > 0:
            doubled.append(point_text(vertices[own[0, 0]]))
    found = []
    for places, what in (
        (empty, "{} of {} closed shells enclose nothing, sheets without thickness"),
        (inward, "{} of {} closed shells are turned inside out"),
        (doubled, "{} of {} closed shells lie within another and would count twice"),
    ):
        if places:
            text = "the mesh is no solid: " + what.format(len(places), len(around))
            found.append(Finding(text, len(places), tuple(places[:_PLACES])))
    return found


def solid_fault(vertices: Array, faces: Faces) -> str:
    """Return the first reason why the mesh bounds no solid, an empty string where it does.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Vertex indices; a solid's are counter-clockwise seen from outside.

    Notes
    -----
    In a closed mesh of one winding every directed edge occurs once, and so does its reverse.
    """
    if len(faces) == 0:
        return "the mesh has no triangles"
    edges = edges_of(faces, len(vertices))
    found = topology_findings(vertices, edges) or shell_findings(vertices, faces, edges)
    return str(found[0]) if found else ""


def point_text(p: Array) -> str:
    """Return a point as messages show it."""
    return f"({p[0]:g}, {p[1]:g}, {p[2]:g})"


def edge_text(p: Array, q: Array) -> str:
    """Return an edge as messages show it."""
    return f"from {point_text(p)} to {point_text(q)}"
