"""The parts of the mesh decks: solids, their files, and the flanks of the gears."""

from __future__ import annotations

import numpy as np
import pytest

from helpers.folders import MODELS
from helpers.mesh_parts import PARTS, gear
from mbsim.model.mass_properties import polyhedron
from mbsim.model.mesh import merge_vertices, solid_fault
from mbsim.model.mesh_file import load_mesh
from mbsim.model.mesh_findings import crossing_findings


@pytest.mark.parametrize("name", list(PARTS))
def test_a_part_is_a_solid_and_its_file_holds_it(name: str) -> None:
    vertices, faces = merge_vertices(*PARTS[name]())
    assert solid_fault(vertices, faces) == ""
    assert crossing_findings(vertices, faces) == []
    path = MODELS / name
    if path.exists():
        mesh = load_mesh(path)
        assert len(mesh.faces) == len(faces)
        volume = polyhedron(vertices, faces).volume
        assert polyhedron(mesh.vertices, mesh.faces).volume == pytest.approx(volume, rel=1e-6)


@pytest.mark.parametrize("teeth", [20, 30])
def test_flanks_are_involutes_of_one_base_circle(teeth: int) -> None:
    """The normal of a chord of the flank is tangent to the base circle at its middle's place."""
    points, module = 40, 2.0
    vertices, _ = gear(teeth, module, 10.0, points)
    flank = vertices[1 : points + 1, :2]  # of the first tooth, after its foot
    chord, middle = np.diff(flank, axis=0), 0.5 * (flank[1:] + flank[:-1])
    chord /= np.linalg.norm(chord, axis=1)[:, None]
    away = np.abs((middle * chord).sum(axis=1))
    # distance of the flank's normal from the centre; chords of the involute are off by their square
    base = 0.5 * module * teeth * np.cos(np.deg2rad(20.0))
    np.testing.assert_allclose(away, base, rtol=2e-4)


def test_pairs_of_gears_have_one_pitch() -> None:
    """Thickness on the pitch circle is half the pitch less the backlash."""
    for teeth in (20, 30):
        vertices, _ = gear(teeth, 2.0, 10.0, 60)
        flank = vertices[1:61, :2]
        radius, angle = np.linalg.norm(flank, axis=1), -np.arctan2(flank[:, 1], flank[:, 0])
        half = np.interp(float(teeth), radius, angle)
        assert 2.0 * half * teeth == pytest.approx(np.pi - 0.02 * 2.0, rel=1e-3)
