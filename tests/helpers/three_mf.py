"""Small 3MF archives, written as the specification says."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

CORE = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
RELATION = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
RELS = (
    '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
    f'<Relationship Target="/3D/part.model" Id="rel0" Type="{RELATION}"/></Relationships>'
)


def mesh_text(vertices: np.ndarray, faces: np.ndarray) -> str:
    """Return the <mesh> of an object."""
    points = "".join(f'<vertex x="{x!r}" y="{y!r}" z="{z!r}"/>' for x, y, z in vertices.tolist())
    corners = "".join(f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in faces.tolist())
    return f"<mesh><vertices>{points}</vertices><triangles>{corners}</triangles></mesh>"


def write_3mf(
    path: Path,
    resources: str,
    build: str,
    unit: str = "millimeter",
    compression: int = zipfile.ZIP_DEFLATED,
) -> None:
    """Write an archive with one model part."""
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("_rels/.rels", RELS)
        archive.writestr(
            "3D/part.model",
            f'<model unit="{unit}" xmlns="{CORE}"><resources>{resources}</resources>'
            f"<build>{build}</build></model>",
        )
