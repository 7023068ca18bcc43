"""Mending a mesh: merging, splitting, turning and closing, until it bounds a solid or cannot."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbsim.errors import ModelError
from mbsim.model.elements import Array, Graphic
from mbsim.model.mesh import Faces, edges_of, solid_fault, three_corners
from mbsim.model.mesh_findings import NEAR, doubles, on_open_edges
from mbsim.model.mesh_winding import wound_outwards

#: A hole of more than three edges is closed if it is no wider than this part of the mesh.
_SMALL = 0.1
_MOST_SPLITS = 100


class Mended(NamedTuple):
    """A mesh that bounds a solid, and what was done to it, one line each."""

    vertices: Array
    faces: Faces
    done: list[str]


def repair(graphic: Graphic, deck: Path) -> tuple[list[str], Path | None]:
    """Write a mended copy of a graphic's mesh beside the deck.

    Parameters
    ----------
    graphic : Graphic
        A mesh.
    deck : Path
        The deck that has it.

    Returns
    -------
    done : list of str
        What was mended.
    target : Path or None
        The copy's name, relative to the deck's folder; None where the mesh bounds a solid as it is.

    Raises
    ------
    ModelError
        If the mesh cannot be mended, or the file to write exists.
    """
    assert graphic.vertices is not None
    assert graphic.faces is not None
    if not solid_fault(graphic.vertices, graphic.faces):
        return [], None
    mended = mend(graphic.vertices, graphic.faces)
    name = Path(graphic.mesh_file).stem if graphic.mesh_file else f"{deck.stem}_{graphic.id}"
    target = Path(f"{name}_repaired.obj")
    try:
        with (deck.parent / target).open("x", encoding="ascii") as file:
            file.writelines(f"v {x!r} {y!r} {z!r}\n" for x, y, z in mended.vertices.tolist())
            file.writelines(f"f {a} {b} {c}\n" for a, b, c in (mended.faces + 1).tolist())
    except OSError as error:
        raise ModelError(f"{target}: is not written: {error.strerror}") from None
    return mended.done, target


def mend(vertices: Array, faces: Faces) -> Mended:
    """Return a copy of a mesh that bounds a solid.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Vertex indices.

    Raises
    ------
    ModelError
        With what was tried and why the mesh still bounds no solid.

    Notes
    -----
    Vertices of open edges nearer than 1e-5 of the mesh's size become one. T-joints are split. Of
    equal triangles one is kept. Holes of three edges, and planar enough ones up to a
    tenth of the mesh's size, are filled. Intersections of the mesh with itself stay.
    """
    if len(faces) == 0:
        raise ModelError("cannot be mended: the mesh has no triangles")
    done: list[str] = []
    vertices, faces = vertices.copy(), faces.copy()
    faces = _merge(vertices, faces, done)
    if len(faces) == 0:
        raise ModelError("cannot be mended: no triangle is left where near vertices become one")
    again = doubles(faces)
    if again.any():
        done.append(f"removed {int(again.sum())} triangles that were there twice")
        faces = faces[~again]
    faces = _split(vertices, faces, done)
    faces = _turn(vertices, faces, done)
    faces = _fill(vertices, faces, done)
    faces = _turn(vertices, faces, done)
    # of what is left: vertices that no triangle has say nothing of its size
    used, index = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], index.reshape(-1, 3).astype(np.int64)
    fault = solid_fault(vertices, faces)
    if fault:
        tried = f" after this: {'; '.join(done)}" if done else ""
        raise ModelError(f"cannot be mended: {fault}{tried}")
    return Mended(vertices, faces, done)


def _merge(vertices: Array, faces: Faces, done: list[str]) -> Faces:
    """Return the faces with near vertices of open edges made one."""
    edges = edges_of(faces, len(vertices))
    rim = np.unique(edges.ends[edges.uses == 1])
    near = NEAR * float(np.ptp(vertices, axis=0).max(initial=0.0))
    if len(rim) == 0 or near == 0.0:
        return faces
    from scipy.spatial import cKDTree

    name = np.arange(len(vertices))
    for a, b in sorted(cKDTree(vertices[rim]).query_pairs(near)):
        name[name == name[rim[b]]] = name[rim[a]]
    merged = int((name != np.arange(len(vertices))).sum())
    if merged == 0:
        return faces
    size = f"{near:.3g}"
    done.append(f"merged {merged} vertices that lay nearer than {size} to another")
    faces = name[faces]
    whole = three_corners(faces)
    if not whole.all():
        done.append(f"removed {int((~whole).sum())} triangles that then had no area")
    return np.asarray(faces[whole])


def _split(vertices: Array, faces: Faces, done: list[str]) -> Faces:
    """Return the faces with those split that have vertices of others on an open edge."""
    count = 0
    for _ in range(_MOST_SPLITS):
        edges = edges_of(faces, len(vertices))
        split: set[int] = set()
        new: list[list[int]] = []
        for row, inside in on_open_edges(vertices, edges):
            face, corner = (int(k) for k in np.argwhere(edges.of_face == row)[0])
            # another edge of a face that is split has its turn in the next round
            if face in split:
                continue
            split.add(face)
            a, b, c = (int(faces[face, (corner + k) % 3]) for k in range(3))
            inside = inside if a < b else inside[::-1]
            ring = [a, *(vertex for vertex in inside if vertex != c), b]
            new += [[p, q, c] for p, q in pairwise(ring)]
            count += len(ring) - 2
        if not split:
            break
        kept = np.delete(faces, sorted(split), axis=0)
        faces = np.concatenate([kept, np.array(new, dtype=np.int64)])
    if count:
        done.append(f"split triangles at {count} T-joints")
    return faces


def _turn(vertices: Array, faces: Faces, done: list[str]) -> Faces:
    """Return the faces wound consistently and outwards."""
    turned = wound_outwards(vertices, faces, edges_of(faces, len(vertices)))
    if turned is None:
        raise ModelError("cannot be mended: no winding is consistent, the surface has one side")
    if turned.any():
        done.append(f"turned {int(turned.sum())} triangles over")
    return np.where(turned[:, None], faces[:, ::-1], faces)


def _fill(vertices: Array, faces: Faces, done: list[str]) -> Faces:
    """Return the faces with small holes closed.

    Raises
    ------
    ModelError
        If a hole is too large, or not flat enough to be filled.
    """
    size = float(np.ptp(vertices, axis=0).max(initial=0.0))
    new: list[list[int]] = []
    sizes = []
    for loop in _loops(vertices, faces):
        wide = float(np.ptp(vertices[loop], axis=0).max())
        if len(loop) > 3 and wide > _SMALL * size:
            raise ModelError(
                f"cannot be mended: a hole of {len(loop)} edges is {wide:.3g} wide, over "
                f"{_SMALL:g} of the mesh: close it where it was drawn; an open sheet is no solid"
            )
        triangles = _cap(vertices, loop)
        if triangles is None:
            raise ModelError(
                f"cannot be mended: a hole of {len(loop)} edges, {wide:.3g} wide, is too bent"
            )
        new += triangles
        sizes.append(len(loop))
    if not new:
        return faces
    counts = ", ".join(str(k) for k in sizes[:10]) + (" ..." if len(sizes) > 10 else "")
    done.append(f"closed holes by triangles: {len(sizes)} by {len(new)} (edges: {counts})")
    return np.concatenate([faces, np.array(new, dtype=np.int64)])


def _loops(vertices: Array, faces: Faces) -> list[list[int]]:
    """Return the rings of open edges, each in the order in which new faces run along it."""
    edges = edges_of(faces, len(vertices))
    after: dict[int, list[int]] = {}
    for face, corner in np.argwhere(edges.uses[edges.of_face] == 1).tolist():
        a, b = int(faces[face, corner]), int(faces[face, (corner + 1) % 3])
        after.setdefault(b, []).append(a)
    loops = []
    while after:
        path = [next(iter(after))]
        while path:
            steps = after.get(path[-1])
            if not steps:
                raise ModelError("cannot be mended: its open edges form no ring")
            step = steps.pop()
            if not steps:
                del after[path[-1]]
            if step in path:
                # holes that meet in a vertex are rings of their own
                at = path.index(step)
                loops.append(path[at:])
                path = path[: at + 1] if at else []
            else:
                path.append(step)
    return loops


def _cap(vertices: Array, loop: list[int]) -> list[list[int]] | None:
    """Return triangles that fill a ring by cutting off its ears, None where it is too bent."""
    points = vertices[loop]
    normal = np.cross(points - points[0], np.roll(points, -1, axis=0) - points[0]).sum(axis=0)
    length = float(np.linalg.norm(normal))
    if len(loop) == 3:
        return [list(loop)]
    if length == 0.0:
        return None
    normal = normal / length
    x = np.cross(normal, np.eye(3)[int(np.abs(normal).argmin())])
    x /= np.linalg.norm(x)
    flat = dict(zip(loop, np.column_stack([points @ x, points @ np.cross(normal, x)]), strict=True))

    def turn(p: int, q: int, r: int) -> float:
        a, b = flat[q] - flat[p], flat[r] - flat[p]
        return float(a[0] * b[1] - a[1] * b[0])

    left, found = list(loop), []
    while len(left) > 3:
        for k in range(len(left)):
            p, q, r = left[k - 1], left[k], left[(k + 1) % len(left)]
            others = (s for s in left if s not in (p, q, r))
            if turn(p, q, r) > 0.0 and not any(
                min(turn(p, q, s), turn(q, r, s), turn(r, p, s)) >= 0.0 for s in others
            ):
                break
        else:
            return None
        found.append([p, q, r])
        left.remove(q)
    return [*found, left] if turn(left[0], left[1], left[2]) > 0.0 else None
