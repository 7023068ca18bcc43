"""Winding of a mesh: which triangles to turn so that all face outwards."""

from __future__ import annotations

from collections import deque

import numpy as np

from mbsim.model.elements import Array
from mbsim.model.mass_properties import polyhedron
from mbsim.model.mesh import Edges, Faces, Marks, shells, surroundings


def wound_outwards(vertices: Array, faces: Faces, edges: Edges) -> Marks | None:
    """Return which faces (m,) to turn, None where no winding is consistent (a Moebius strip).

    Notes
    -----
    Each shell is made consistent from face to face over edges of two faces. A closed shell that
    stands alone is then turned so that it encloses a positive volume. All others, open ones and
    those within another (which may be cavities), keep the winding that more of their area has.
    """
    turned = _consistent(faces, edges)
    if turned is None:
        return None
    now = np.where(turned[:, None], faces[:, ::-1], faces)
    shell = shells(edges, len(faces))
    open_shells = set(np.unique(shell[(edges.uses[edges.of_face] != 2).any(axis=1)]).tolist())
    around = surroundings(vertices, now, shell)
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    for k, times in enumerate(around):
        own = shell == k
        if k not in open_shells and times == 0:
            wrong = polyhedron(vertices, now[own]).volume < 0.0
        else:
            wrong = area[own & turned].sum() > area[own & ~turned].sum()
        if wrong:
            turned[own] = ~turned[own]
    return turned


def _consistent(faces: Faces, edges: Edges) -> Marks | None:
    """Return which faces to turn so that neighbours over edges of two faces agree."""
    beside: list[list[tuple[int, bool]]] = [[] for _ in range(len(faces))]
    first = np.full(len(edges.ends), -1)
    first_way = np.zeros(len(edges.ends), dtype=bool)
    for face, (own, ways) in enumerate(
        zip(edges.of_face.tolist(), edges.along.tolist(), strict=True)
    ):
        for edge, way in zip(own, ways, strict=True):
            if edges.uses[edge] != 2:
                continue
            if first[edge] < 0:
                first[edge], first_way[edge] = face, way
            else:
                # both run along it one way: one of them must be turned
                differ = bool(first_way[edge] == way)
                beside[face].append((int(first[edge]), differ))
                beside[int(first[edge])].append((face, differ))
    turned = np.zeros(len(faces), dtype=bool)
    seen = np.zeros(len(faces), dtype=bool)
    for start in range(len(faces)):
        if seen[start]:
            continue
        seen[start] = True
        waiting = deque([start])
        while waiting:
            face = waiting.popleft()
            for other, differ in beside[face]:
                way = bool(turned[face]) != differ
                if not seen[other]:
                    seen[other], turned[other] = True, way
                    waiting.append(other)
                elif bool(turned[other]) != way:
                    return None
    return turned
