"""Convex meshes as polyhedra: faces with their corners in order, edges, and a weight a corner.

Triangles in one plane become one face, and vertices inside faces and edges fall away, so that
contact does not depend on how a flat side is cut into triangles. The polyhedron is packed into
one array of numbers, as compiled pairs read it (`geometry.polyhedron`).
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.model.elements import Array
from mbsim.model.flat_sides import exterior_angles, part_of_side
from mbsim.model.mesh import Faces, solid_fault

#: A vertex this far (relative to the mesh's size) above a face's plane still counts as on it:
#: files with single precision scatter by 6e-8.
FLATNESS = 1e-6
#: Larger meshes are not looked at; the closed forms would not pay.
MOST_FACES = 5000
#: Contact points of a polyhedron on a plane; with more corners, one a patch of corners and the last
#: one for the deepest corner.
MOST_ROWS = 64

#: Numbers of the header: corners, faces, edges, colours, rows, most corners of a face, then
#: where these begin: corners (3), planes (4: outward normal, offset), first of each face in the
#: loops (faces + 1), loops (2: corner, face beyond the edge that starts there), edges (4:
#: corners, faces), corner data (3: weight, colour, row), weight of each row, how far each face is a
#: side that the body can lie on (0 to 1).
HEADER = 14
(
    CORNERS,
    FACES,
    EDGES,
    COLOURS,
    ROWS,
    WIDEST,
    AT_CORNERS,
    AT_PLANES,
    AT_STARTS,
    AT_LOOPS,
    AT_EDGES,
    AT_DATA,
    AT_WEIGHTS,
    AT_SIDES,
) = range(HEADER)


def _planes(vertices: Array, faces: Faces) -> tuple[Array, Array]:
    """Return unit normals and areas (twice) of triangles."""
    a, b, c = vertices[faces[:, 0]], vertices[faces[:, 1]], vertices[faces[:, 2]]
    normal = np.cross(b - a, c - a)
    area = np.linalg.norm(normal, axis=1)
    return normal / np.where(area > 0.0, area, 1.0)[:, None], area


def _groups(vertices: Array, faces: Faces, normals: Array, near: float) -> list[list[int]]:
    """Return triangles grouped into flat faces, each grown from its largest triangle."""
    owner = {}
    for f, face in enumerate(faces.tolist()):
        for k in range(3):
            owner[face[k], face[(k + 1) % 3]] = f
    _, area = _planes(vertices, faces)
    taken = np.full(len(faces), -1)
    groups: list[list[int]] = []
    for seed in np.argsort(-area).tolist():
        if taken[seed] >= 0:
            continue
        n, origin = normals[seed], vertices[faces[seed, 0]]
        group, waiting = [], [seed]
        taken[seed] = len(groups)
        while waiting:
            f = waiting.pop()
            group.append(f)
            face = faces[f].tolist()
            for k in range(3):
                g = owner[face[(k + 1) % 3], face[k]]
                if taken[g] < 0 and (abs((vertices[faces[g]] - origin) @ n) <= near).all():
                    taken[g] = len(groups)
                    waiting.append(g)
        groups.append(group)
    return groups


def _loop(faces: Faces, group: list[int]) -> list[int]:
    """Return the vertices around a group of triangles, or nothing if they are no single ring."""
    edges = {}
    for f in group:
        face = faces[f].tolist()
        for k in range(3):
            edges[face[k], face[(k + 1) % 3]] = f
    after = {a: b for a, b in edges if (b, a) not in edges}
    if not after:
        return []
    start = next(iter(after))
    loop = [start]
    while after.get(loop[-1], start) != start and len(loop) <= len(after):
        loop.append(after[loop[-1]])
    return loop if len(loop) == len(after) else []


def _colours(count: int, loops: list[list[int]], corners: Array) -> list[int]:
    """Return a small number a corner, no two alike in one face."""
    beside: list[set[int]] = [set() for _ in range(count)]
    for loop in loops:
        for corner in loop:
            beside[corner].update(loop)
    colour = [-1] * count
    # a corner first takes the colour of the one opposite: a box needs 4
    middle = corners.mean(axis=0)
    for corner in range(count):
        if colour[corner] >= 0:
            continue
        used = {colour[other] for other in beside[corner]}
        colour[corner] = next(k for k in range(count) if k not in used)
        opposite = int(np.linalg.norm(corners + corners[corner] - 2.0 * middle, axis=1).argmin())
        alike = {colour[other] for other in beside[opposite]}
        if colour[opposite] < 0 and opposite not in beside[corner] and colour[corner] not in alike:
            colour[opposite] = colour[corner]
    return colour


def _patches(corners: Array) -> Array:
    """Return the row of every corner: its own, or of the nearest of some spread corners.

    Then the last one of MOST_ROWS is left for the deepest corner.
    """
    if len(corners) <= MOST_ROWS:
        return np.arange(len(corners), dtype=np.float64)
    away = np.full(len(corners), math.inf)
    row = np.zeros(len(corners))
    seed = 0
    for k in range(MOST_ROWS - 1):
        distance = np.linalg.norm(corners - corners[seed], axis=1)
        row[distance < away] = k
        away = np.minimum(away, distance)
        seed = int(away.argmax())
    return row


def _side(corners: Array, loop: list[int], m: Array, beyond: Array) -> float:
    """Return how far a face is a side that a body can lie on (`flat_sides.part_of_side`).

    `m` is its normal, `beyond` (n, 3) those of its neighbours.
    """
    wide = np.ptp(corners[loop], axis=0).max() / np.ptp(corners, axis=0).max()
    bend = float(np.degrees(np.arccos(np.clip((beyond @ m).max(), -1.0, 1.0))))
    return part_of_side(float(wide), bend)


def polyhedron_of(vertices: Array, faces: Faces) -> Array | None:
    """Return a convex mesh as a packed polyhedron, None if it is not convex.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L], shape axes.
    faces : ndarray of int, shape (m, 3)
        Triangles, counter-clockwise seen from outside.

    Notes
    -----
    A closed surface is convex if no vertex is above the plane of a triangle; `FLATNESS` of the
    size is allowed. The weight of a corner is the mean of its exterior angle in its
    faces over a right angle: 1 for a box, 4/3 for a regular tetrahedron.
    """
    if len(faces) > MOST_FACES or solid_fault(vertices, faces):
        return None
    near = FLATNESS * float(np.ptp(vertices, axis=0).max())
    normals, area = _planes(vertices, faces)
    # what is thinner than the tolerance has no plane of its own
    longest = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, 1, axis=1)], axis=2).max(1)
    whole = area > near * longest
    offsets = (normals * vertices[faces[:, 0]]).sum(axis=1)
    for n, offset in zip(normals[whole], offsets[whole], strict=True):
        if (vertices @ n).max() > offset + near:
            return None

    rings = [_loop(faces, group) for group in _groups(vertices, faces, normals, near)]
    uses: dict[int, int] = {}
    for ring in rings:
        for vertex in ring:
            uses[vertex] = uses.get(vertex, 0) + 1
    # a vertex of two faces only lies within an edge
    names = sorted(vertex for vertex, count in uses.items() if count >= 3)
    number = {vertex: k for k, vertex in enumerate(names)}
    loops = [[number[vertex] for vertex in ring if vertex in number] for ring in rings]
    beyond = {}
    for f, loop in enumerate(loops):
        for k, corner in enumerate(loop):
            beyond[corner, loop[(k + 1) % len(loop)]] = f
    paired = all((b, a) in beyond for a, b in beyond)
    if min(map(len, loops), default=0) < 3 or not paired:
        return None
    return _pack(vertices[names], loops, beyond)


def _pack(corners: Array, loops: list[list[int]], beyond: dict[tuple[int, int], int]) -> Array:
    """Return the packed polyhedron."""
    planes, angles = [], [[0.0, 0] for _ in corners]
    for loop in loops:
        ring = corners[loop]
        n = np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0)
        n = n / np.linalg.norm(n)
        planes.append([*n, float((corners @ n).max())])
        for corner, angle in zip(loop, exterior_angles(ring), strict=True):
            angles[corner][0] += float(angle)
            angles[corner][1] += 1
    weight = np.array([total / count / (0.5 * math.pi) for total, count in angles])
    colour = _colours(len(corners), loops, corners)
    row = _patches(corners)
    rows = min(len(corners), MOST_ROWS)
    edges = [[a, b, f, beyond[b, a]] for (a, b), f in beyond.items() if a < b]
    table = [
        [corner, beyond[loop[(k + 1) % len(loop)], corner]]
        for loop in loops
        for k, corner in enumerate(loop)
    ]
    normals = np.array(planes)[:, :3]
    beside = [
        [beyond[loop[(k + 1) % len(loop)], corner] for k, corner in enumerate(loop)]
        for loop in loops
    ]
    sides = [_side(corners, loop, normals[f], normals[beside[f]]) for f, loop in enumerate(loops)]
    parts = [
        corners,
        np.array(planes),
        np.cumsum([0, *map(len, loops)]),
        np.array(table),
        np.array(edges),
        np.column_stack([weight, colour, row]),
        np.array([weight[row == k].mean() if (row == k).any() else 1.0 for k in range(rows)]),
        np.array(sides),
    ]
    head = [len(corners), len(loops), len(edges), max(colour) + 1, rows, max(map(len, loops))]
    at = HEADER + np.cumsum([0, *[part.size for part in parts]])
    return np.concatenate([head, at[:-1], *[part.ravel() for part in parts]]).astype(np.float64)
