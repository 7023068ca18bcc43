"""Mesh files: STL, OBJ, OFF, PLY, GLB, glTF and 3MF, read without opening any other file.

The one file that imports trimesh, and only when a deck names a mesh file.
"""

from __future__ import annotations

import codecs
import io
from pathlib import Path
from typing import NamedTuple

import numpy as np

from mbsim.core.stored import read_regular
from mbsim.errors import ModelError
from mbsim.model.elements import Array
from mbsim.model.mesh import Faces, equal_as_one, three_corners

FORMATS = ("stl", "obj", "off", "ply", "glb", "gltf", "3mf")
MAX_BYTES = 512 * 2**20
_LARGEST = 1e40
_NORMALS = "normals"
#: Bytes of a binary STL before its triangles, and of each; where the first facet of a text is.
_STL_HEADER, _STL_TRIANGLE, _STL_LOOK = 84, 50, 4096


class MeshFile(NamedTuple):
    """A mesh as its file has it.

    `vertices` (n, 3) in the file's unit of length, `faces` (m, 3), equal vertices merged;
    `length_unit` is that unit where the format says it, else empty. `normals` (m, 3, 3) are those
    that the file has at the corners of the faces, of whatever length, NaN where one of its parts
    has none; None where the whole file has none.
    """

    vertices: Array
    faces: Faces
    length_unit: str
    normals: Array | None = None


def load_mesh(path: Path) -> MeshFile:
    """Return the triangles of a mesh file; several parts of one file become one mesh.

    Parameters
    ----------
    path : Path
        A file of one of `FORMATS`.

    Raises
    ------
    ModelError
        If the file is missing, too large, of another format, damaged or empty.

    Notes
    -----
    glTF is in metres (glTF 2.0 specification, 3.4). 3MF names its unit. The others have none.
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
    vertices, faces, unit, normals = _decode(data, kind)
    if len(faces) == 0:
        raise ModelError("holds no triangles")
    if not (np.abs(vertices) < _LARGEST).all():
        raise ModelError(f"holds vertices that are not finite numbers below {_LARGEST:g}")
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ModelError("holds faces that name vertices it does not have")
    vertices, faces = equal_as_one(vertices, faces)
    whole = three_corners(faces)
    if not whole.any():
        raise ModelError("holds no triangle with three different corners")
    return MeshFile(vertices, faces[whole], unit, None if normals is None else normals[whole])


def _decode(data: bytes, kind: str) -> MeshFile:
    """Return what a file's bytes hold; whatever a parser raises becomes one line."""
    try:
        if kind == "3mf":
            from mbsim.model.mesh_3mf import read_3mf

            return MeshFile(*read_3mf(data, MAX_BYTES))
        return _by_trimesh(_in_utf8(data, kind), kind)
    except Exception as error:  # a damaged file makes its parser raise anything
        reason = " ".join(str(error).split())[:100] or type(error).__name__
        raise ModelError(f"is no readable {kind.upper()} file: {reason}") from None


def _in_utf8(data: bytes, kind: str) -> bytes:
    """Return a file with its text in UTF-8: names and comments may be in another code."""
    if kind == "stl" and not _is_text_stl(data):
        return data
    if kind in ("stl", "obj", "off"):
        return data if data.isascii() else _text(data).encode()
    if kind == "ply":
        header, end, body = data.partition(b"end_header")
        return _text(header).encode() + end + body
    return data


def _text(data: bytes) -> str:
    """Return text in UTF-8, in UTF-16 with its mark, else in Latin-1, where any byte is a sign."""
    if data[:2] in (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE):
        return data.decode("utf-16")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _is_text_stl(data: bytes) -> bool:
    """Return whether an STL is text; a binary one has as many bytes as its header tells."""
    count = int.from_bytes(data[80:84], "little")
    whole = _STL_HEADER + _STL_TRIANGLE * count
    if len(data) == whole:
        return False
    if b"facet" in data[:_STL_LOOK].lower() or not data.strip(b"\0 \r\n\t"):
        return True
    if data[:5].lower() == b"solid" and data.isascii():
        return True
    raise ValueError(
        f"{len(data)} bytes, where a binary one of {count} triangles has {whole}; nor is it text "
        "with facets"
    )


def _by_trimesh(data: bytes, kind: str) -> MeshFile:
    """Return the triangles of a file's bytes as trimesh reads them."""
    import trimesh

    if kind == "gltf" and _names_files(data):
        raise ValueError("its buffers are in other files; save it as one .glb file")
    # from memory and without a resolver, so that no file named in `data` is opened
    scene = trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False)
    parts = [part for part in scene.geometry.values() if isinstance(part, trimesh.Trimesh)]
    # normals that were not in the file are made when they are asked for
    told = ["vertex_normals" in part._cache for part in parts]
    for part, own in zip(parts, told, strict=True):
        normals = part.vertex_normals if own else np.full((len(part.vertices), 3), np.nan)
        part.vertex_attributes = {_NORMALS: normals}
    mesh = scene.to_mesh()
    vertices = np.array(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.array(mesh.faces, dtype=np.int64).reshape(-1, 3)
    normals = None
    if any(told) and len(faces) and faces.max() < len(mesh.vertex_attributes[_NORMALS]):
        normals = np.array(mesh.vertex_attributes[_NORMALS], dtype=np.float64)[faces]
    return MeshFile(vertices, faces, "METER" if kind in ("glb", "gltf") else "", normals)


def _names_files(data: bytes) -> bool:
    """Return whether a glTF has numbers in files beside it."""
    import json

    buffers = json.loads(data).get("buffers", ())
    return any(not str(each.get("uri", "data:")).startswith("data:") for each in buffers)
