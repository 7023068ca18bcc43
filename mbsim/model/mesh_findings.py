"""All that is wrong with a mesh, with counts and the first few places."""

from __future__ import annotations

import numpy as np

from mbsim.model.elements import Array
from mbsim.model.mesh import (
    Edges,
    Faces,
    Finding,
    Marks,
    edges_of,
    point_text,
    shell_findings,
    topology_findings,
)
from mbsim.model.mesh_crossings import crossings
from mbsim.model.mesh_winding import wound_outwards

#: How near to an edge, relative to the mesh's size, a vertex counts as lying on it.
NEAR = 1e-5
_PLACES = 3


def mesh_findings(vertices: Array, faces: Faces) -> list[Finding]:
    """Return all that keeps the mesh from being a solid; nothing where it is one.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Vertex indices.
    """
    if len(faces) == 0:
        return [Finding("the mesh has no triangles", 1, ())]
    edges = edges_of(faces, len(vertices))
    found = topology_findings(vertices, edges)
    if not found:
        return shell_findings(vertices, faces, edges)
    found += _t_joints(vertices, edges)
    double = doubles(faces)
    found += _at_faces(vertices, faces, double, "{} triangles are there twice")
    turned = wound_outwards(vertices, faces, edges)
    if turned is None:
        found.append(Finding("no winding is consistent: the surface has one side only", 1, ()))
    else:
        found += _at_faces(vertices, faces, turned, "{} triangles are wound the other way")
    return found


def crossing_findings(vertices: Array, faces: Faces) -> list[Finding]:
    """Return where the mesh runs through itself, nothing where it does not."""
    pairs, places = crossings(vertices, faces)
    if len(pairs) == 0:
        return []
    first = tuple(f"at {point_text(place)}" for place in places[:_PLACES])
    return [Finding(f"{len(pairs)} pairs of triangles intersect", len(pairs), first)]


def _at_faces(vertices: Array, faces: Faces, bad: Marks, what: str) -> list[Finding]:
    """Return a finding about the faces that are marked, placed at their centroids."""
    count = int(bad.sum())
    if count == 0:
        return []
    centres = vertices[faces[bad][:_PLACES]].mean(axis=1)
    return [Finding(what.format(count), count, tuple(f"at {point_text(p)}" for p in centres))]


def doubles(faces: Faces) -> Marks:
    """Return which faces have the three corners of an earlier one, shape (m,)."""
    _, first = np.unique(np.sort(faces, axis=1), axis=0, return_index=True)
    again = np.ones(len(faces), dtype=bool)
    again[first] = False
    return again


def on_open_edges(vertices: Array, edges: Edges) -> list[tuple[int, list[int]]]:
    """Return the open edges (rows of `edges.ends`) that have vertices of others on them.

    The vertices, which are ends of open edges too, are in their order from the edge's first end.
    """
    rows = np.flatnonzero(edges.uses == 1)
    rim = np.unique(edges.ends[rows])
    near = NEAR * float(np.ptp(vertices, axis=0).max(initial=0.0))
    found = []
    for row in rows.tolist():
        a, b = vertices[edges.ends[row, 0]], vertices[edges.ends[row, 1]]
        along = b - a
        length = float(np.linalg.norm(along))
        if length <= 2.0 * near:
            continue
        s = (vertices[rim] - a) @ (along / length)
        away = np.linalg.norm(vertices[rim] - a - s[:, None] * (along / length), axis=1)
        on = (s > near) & (s < length - near) & (away < near)
        if on.any():
            found.append((row, rim[on][np.argsort(s[on])].tolist()))
    return found


def _t_joints(vertices: Array, edges: Edges) -> list[Finding]:
    """Return vertices that lie on an open edge of others."""
    on = [vertex for _, inside in on_open_edges(vertices, edges) for vertex in inside]
    if not on:
        return []
    places = tuple(f"at {point_text(vertices[vertex])}" for vertex in on[:_PLACES])
    return [Finding(f"{len(on)} T-joints, vertices on an open edge", len(on), places)]
