"""Triangle meshes: reading files, merging vertices, and whether they bound a solid.

The one file that imports trimesh, and only when a deck names a mesh file.
"""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import numpy.typing as npt

from mbsim.core.stored import read_regular
from mbsim.errors import ModelError
from mbsim.model.elements import Array
from mbsim.model.mass_properties import polyhedron

Faces = npt.NDArray[np.int64]

FORMATS = ("stl", "obj", "off", "ply")
MAX_BYTES = 512 * 2**20
_LARGEST = 1e40


def load_mesh(path: Path) -> tuple[Array, Faces]:
    """Return vertices (n, 3) [L] and faces (m, 3) of a mesh file, equal vertices merged.

    Parameters
    ----------
    path : Path
        An STL, OBJ, OFF or PLY file; its numbers are taken in the model's length unit.

    Raises
    ------
    ModelError
        If the file is missing, too large, of another format, damaged or empty.
    """
    kind = path.suffix.lower().lstrip(".")
    if kind not in FORMATS:
        raise ModelError(f"must be a file of type {', '.join(FORMATS)}")
    try:
        if not path.is_file():
            raise ModelError(f"no such file: {path}")
        if path.stat().st_size > MAX_BYTES:
            raise ModelError(f"larger than {MAX_BYTES // 2**20} MiB: {path}")
        data = read_regular(path)
    except (OSError, ValueError) as error:
        raise ModelError(f"cannot be read: {error}") from None
    vertices, faces = _decode(data, kind)
    if len(faces) == 0:
        raise ModelError("holds no triangles")
    if not (np.abs(vertices) < _LARGEST).all():
        raise ModelError(f"holds vertices that are not finite numbers below {_LARGEST:g}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ModelError("holds faces that name vertices it does not have")
    return merge_vertices(vertices, faces)


def _decode(data: bytes, kind: str) -> tuple[Array, Faces]:
    """Return the triangles of a file's bytes as trimesh reads them."""
    import trimesh

    try:
        # from memory and without a resolver, so that no file named in `data` is opened
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type=kind, process=False)
        vertices = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
        faces = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    except Exception as error:  # a damaged file makes its parser raise anything
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise ModelError(f"is no readable {kind.upper()} file: {reason}") from None
    return vertices, faces


def merge_vertices(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """Return the mesh with equal vertices made one, and without faces that then have no area.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L]; only bitwise equal ones (0 and -0 too) are merged.
    faces : ndarray of int, shape (m, 3)
        Vertex indices.
    """
    unique, index = np.unique(vertices + 0.0, axis=0, return_inverse=True)
    merged = index.reshape(-1)[faces]
    a, b, c = merged.T
    whole = (a != b) & (b != c) & (c != a)
    return unique, merged[whole].astype(np.int64)


def solid_fault(vertices: Array, faces: Faces) -> str:
    """Return why the mesh bounds no solid, or an empty string where it does.

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
    count = len(vertices)
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    directed = start * count + end
    edges, uses = np.unique(
        np.minimum(start, end) * count + np.maximum(start, end), return_counts=True
    )

    open_edges = edges[uses == 1]
    if len(open_edges):
        p, q = (vertices[k] for k in divmod(int(open_edges[0]), count))
        where = f"the first from {_point(p)} to {_point(q)}"
        return f"the mesh is open: {len(open_edges)} edges belong to one triangle only, {where}"
    crowded = edges[uses > 2]
    if len(crowded):
        p, q = (vertices[k] for k in divmod(int(crowded[0]), count))
        where = f"the first from {_point(p)} to {_point(q)}"
        return (
            f"the mesh is no surface: {len(crowded)} edges belong to 3 or more triangles, {where}"
        )
    same = len(directed) - len(np.unique(directed))
    if same:
        return f"the mesh's winding is not consistent: {same} edges run one way in both triangles"
    volume = polyhedron(vertices, faces).volume
    if not volume > 0.0:
        return f"the mesh is turned inside out: its enclosed volume is {volume:.6g}, must be > 0"
    return ""


def _point(p: Array) -> str:
    return f"({p[0]:g}, {p[1]:g}, {p[2]:g})"
