"""S9: the mesh of a torus, and whether two tori are linked."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from mbsim.bench import parameters as p
from mbsim.bench.peers import drake_tori
from mbsim.bench.scenes.s09_tori import SCENES, linking_number
from mbsim.model.mass_properties import polyhedron
from mbsim.model.mesh import solid_fault
from mbsim.reader.xml import read_model

VERTICES, FACES = p.torus_mesh(p.S9)


def test_the_torus_is_that_of_trimesh() -> None:
    assert solid_fault(VERTICES, FACES) == ""
    around, across = p.S9.sections
    other = trimesh.creation.torus(
        p.S9.ring, p.S9.tube, major_sections=around, minor_sections=across
    )
    assert (len(VERTICES), len(FACES)) == (len(other.vertices), len(other.faces))
    assert polyhedron(VERTICES, FACES).volume == pytest.approx(other.volume, rel=1e-12)


def gauss_linking(position: np.ndarray, R: np.ndarray, n: int = 400) -> float:
    """Return Gauss' integral over both centre circles."""
    t = 2.0 * np.pi * (np.arange(n) + 0.5) / n
    circle = p.S9.ring * np.column_stack([np.cos(t), np.sin(t), 0 * t])
    along = p.S9.ring * np.column_stack([-np.sin(t), np.cos(t), 0 * t]) * 2.0 * np.pi / n
    a, da = position + circle @ R.T, along @ R.T
    b, db = np.array(p.S9.fixed) + circle, along
    r = a[:, None] - b[None]
    top = np.einsum("ijk,ijk->ij", r, np.cross(da[:, None], db[None]))
    return float((top / np.linalg.norm(r, axis=2) ** 3).sum() / (4.0 * np.pi))


def test_linking_number_against_gauss_integral() -> None:
    chance = np.random.default_rng(0)
    seen = set()
    for _ in range(60):
        q = chance.normal(size=4)
        q /= np.linalg.norm(q)
        w, x, y, z = q
        R = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        position = np.array(p.S9.fixed) + chance.uniform(-0.15, 0.15, 3)
        whole = gauss_linking(position, R)
        if abs(abs(whole) - round(abs(whole))) > 0.05:
            continue  # the circles come too near for the integral
        linked = linking_number(position[None], q[None])[0]
        assert linked == round(abs(whole))
        seen.add(int(linked))
    assert seen == {0, 1}


def test_tetrahedra_fill_the_torus() -> None:
    lines = drake_tori._volume().splitlines()
    points = np.array([line.split() for line in lines[5 : 5 + 2664]], dtype=float)
    rows = [line.split()[1:] for line in lines if line.startswith("4 ")]
    corners = points[np.array(rows, dtype=int)]
    volumes = np.linalg.det(corners[:, 1:] - corners[:, :1]) / 6.0
    assert volumes.min() > 0.0
    assert volumes.sum() == pytest.approx(polyhedron(VERTICES, FACES).volume, rel=1e-12)


@pytest.mark.parametrize("scene", SCENES, ids=[scene.name for scene in SCENES])
def test_the_decks_are_read(tmp_path, scene) -> None:
    path = tmp_path / "deck.xml"
    path.write_text(scene.deck({}), encoding="utf-8")
    model = read_model(path)
    assert model.warnings == ()
    assert all(len(g.faces) == 5184 for g in model.graphics.values() if g.faces is not None)
