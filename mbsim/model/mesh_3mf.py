"""3MF: a ZIP archive with triangles in XML (3MF Core Specification 1.3).

Read here and not through trimesh, which would need networkx for it.
"""

from __future__ import annotations

import io
import posixpath
import zipfile
from collections.abc import Iterator

import numpy as np
from lxml import etree

from mbsim.model.elements import Array
from mbsim.model.mesh import Faces

_CORE = "{http://schemas.microsoft.com/3dmanufacturing/core/2015/02}"
_PATH = "{http://schemas.microsoft.com/3dmanufacturing/production/2015/06}path"
_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_UNITS = {
    "micron": "MICROMETER",
    "millimeter": "MILLIMETER",
    "centimeter": "CENTIMETER",
    "inch": "INCH",
    "foot": "FOOT",
    "meter": "METER",
}
_MOST_PARTS = 10_000
_MOST_TRIANGLES = 20_000_000
_DEEPEST = 20


def read_3mf(data: bytes, most: int) -> tuple[Array, Faces, str]:
    """Return vertices (n, 3), faces (m, 3) and the name of their unit of length.

    Parameters
    ----------
    data : bytes
        The archive.
    most : int
        Bytes that its parts may have together, unpacked.

    Raises
    ------
    ValueError
        If the archive is none, lacks what it names, or is too large.

    Notes
    -----
    Items of the build are put in their places; objects for support are left out.
    """
    archive = _Archive(data, most)
    start = archive.first()
    root = archive.part(start)
    unit = root.get("unit", "millimeter").strip().lower()
    if unit not in _UNITS:
        raise ValueError(f'unit="{unit}", must be one of {", ".join(_UNITS)}')
    vertices: list[Array] = []
    faces: list[Faces] = []
    count = triangles = 0
    for item in root.iterfind(f"{_CORE}build/{_CORE}item"):
        for points, corners in archive.meshes(start, item, 0):
            vertices.append(points)
            faces.append(corners + count)
            count += len(points)
            triangles += len(corners)
            if triangles > _MOST_TRIANGLES or len(vertices) > _MOST_PARTS:
                raise ValueError("its components unfold to more than can be meant")
    if not faces:
        raise ValueError("its build has no object with triangles")
    return np.concatenate(vertices), np.concatenate(faces), _UNITS[unit]


class _Archive:
    """The parts of a 3MF file, each unpacked and read once."""

    def __init__(self, data: bytes, most: int) -> None:
        self._zip = zipfile.ZipFile(io.BytesIO(data))
        self._left = most
        self._parts: dict[str, etree._Element] = {}
        self._read: dict[tuple[str, str], tuple[Array, Faces]] = {}
        self._visits = 0

    def part(self, name: str) -> etree._Element:
        """Return the root of an XML part."""
        if name not in self._parts:
            with self._zip.open(name.lstrip("/")) as stream:
                data = stream.read(self._left + 1)
            self._left -= len(data)
            if self._left < 0:
                raise ValueError("unpacked it is too large")
            # no entities, no network: a file may come from anywhere
            parser = etree.XMLParser(resolve_entities=False, no_network=True, huge_tree=True)
            self._parts[name] = etree.fromstring(data, parser)
        return self._parts[name]

    def first(self) -> str:
        """Return the name of the part that has the build."""
        for link in self.part("_rels/.rels"):
            if link.get("Type") == _MODEL:
                return posixpath.normpath("/" + link.get("Target", ""))
        raise ValueError("it names no 3D model")

    def meshes(self, part: str, use: etree._Element, depth: int) -> Iterator[tuple[Array, Faces]]:
        """Yield the triangles of an item or component, moved to where it puts its object."""
        self._visits += 1
        if depth > _DEEPEST or self._visits > _MOST_PARTS:
            raise ValueError("its components unfold to more than can be meant")
        part = posixpath.normpath("/" + (use.get(_PATH) or part))
        id = use.get("objectid", "")
        T = _transform(use.get("transform"))
        objects = self.part(part).iterfind(f"{_CORE}resources/{_CORE}object")
        found = next((each for each in objects if each.get("id") == id), None)
        if found is None:
            raise ValueError(f'objectid="{id}": no such object')
        if found.get("type") == "support":
            return
        if (mesh := found.find(f"{_CORE}mesh")) is not None:
            if (part, id) not in self._read:
                self._read[part, id] = _triangles(mesh)
            vertices, faces = self._read[part, id]
            # a mirror turns the triangles over
            turned = faces if np.linalg.det(T[:3]) > 0.0 else faces[:, ::-1]
            yield vertices @ T[:3] + T[3], turned
        for component in found.iterfind(f"{_CORE}components/{_CORE}component"):
            for vertices, faces in self.meshes(part, component, depth + 1):
                turned = faces if np.linalg.det(T[:3]) > 0.0 else faces[:, ::-1]
                yield vertices @ T[:3] + T[3], turned


def _triangles(mesh: etree._Element) -> tuple[Array, Faces]:
    """Return the vertices and faces of one <mesh>."""
    vertices = [[each.get(axis, "") for axis in "xyz"] for each in mesh.iter(f"{_CORE}vertex")]
    faces = [
        [each.get(name, "") for name in ("v1", "v2", "v3")]
        for each in mesh.iter(f"{_CORE}triangle")
    ]
    corners = np.array(faces, dtype=np.int64).reshape(-1, 3)
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    if len(corners) and (corners.min() < 0 or corners.max() >= len(points)):
        raise ValueError("a triangle names a vertex that its object does not have")
    return points, corners


def _transform(text: str | None) -> Array:
    """Return the matrix (4, 3) of a transform: a row vector (x y z 1) times it is moved."""
    if text is None:
        return np.eye(4)[:, :3]
    T = np.array(text.split(), dtype=np.float64)
    if T.shape != (12,):
        raise ValueError(f'transform="{text[:40]}": must be 12 numbers')
    return T.reshape(4, 3)
