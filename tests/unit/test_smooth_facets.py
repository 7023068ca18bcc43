"""Smooth facets: exact on spheres, real edges stay, the mesh stays closed."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

from helpers.minimal_deck import added
from mbsim.model.mesh import solid_fault
from mbsim.model.smooth_facets import corner_normals, smooth
from mbsim.reader.xml import read_model


def made(mesh: trimesh.Trimesh) -> tuple[Any, Any]:
    return np.array(mesh.vertices, dtype=float), np.array(mesh.faces, dtype=np.int64)


def test_normals_are_exact_on_a_sphere_however_it_is_cut() -> None:
    rng = np.random.default_rng(1)
    points = rng.normal(size=(80, 3))
    points /= np.linalg.norm(points, axis=1)[:, None]
    vertices, faces = made(trimesh.convex.convex_hull(points))
    normals = corner_normals(vertices, faces, 80.0)
    np.testing.assert_allclose(normals, vertices[faces], atol=1e-12)


@pytest.mark.parametrize(
    ("shape", "volume", "part"),
    [
        (trimesh.creation.icosphere(3), 4.0 / 3.0 * np.pi, 3e-4),
        (trimesh.creation.cylinder(0.5, 1.0, sections=32), 0.25 * np.pi, 2e-4),
        (trimesh.creation.torus(1.0, 0.3), 2.0 * np.pi**2 * 0.09, 1e-3),
    ],
    ids=["sphere", "cylinder", "torus"],
)
def test_the_volume_of_round_solids_is_near_that_of_the_true_ones(
    shape: trimesh.Trimesh, volume: float, part: float
) -> None:
    vertices, faces = smooth(*made(shape), most=60_000)
    assert solid_fault(vertices, faces) == ""
    found = trimesh.Trimesh(vertices, faces, process=False).volume
    assert abs(found / volume - 1.0) < part < 0.2 * abs(shape.volume / volume - 1.0)


def test_what_is_flat_stays_as_it_is() -> None:
    vertices, faces = made(trimesh.creation.box((1.0, 2.0, 3.0)).subdivide())
    same, cut = smooth(vertices, faces)
    assert same is vertices
    assert cut is faces


def test_the_rim_of_a_cylinder_stays_a_circle_and_its_ends_flat() -> None:
    vertices, _ = smooth(*made(trimesh.creation.cylinder(0.5, 1.0, sections=32)), most=20_000)
    rim = np.isclose(np.abs(vertices[:, 2]), 0.5) & (np.hypot(*vertices[:, :2].T) > 0.49)
    inward = np.hypot(*vertices[:, :2].T)[rim]
    assert np.abs(vertices[:, 2]).max() == pytest.approx(0.5, abs=1e-12)
    assert (inward > 0.499999).sum() > 200
    assert inward.max() < 0.5 + 1e-7


def test_a_smaller_crease_angle_keeps_all_edges() -> None:
    vertices, faces = made(trimesh.creation.icosphere(1))
    assert len(smooth(vertices, faces, 5.0)[1]) == len(faces)
    assert len(smooth(vertices, faces)[1]) > len(faces)


def test_the_triangles_are_no_more_than_asked_for() -> None:
    vertices, faces = made(trimesh.creation.icosphere(3))
    assert 0.5 * 30_000 < len(smooth(vertices, faces, most=30_000)[1]) <= 30_000


BALL = trimesh.creation.icosphere(3)


def written(folder: Path, shape: trimesh.Trimesh, kind: str, normals: bool) -> str:
    """Write a mesh with or without its normals at vertices; return its name."""
    name = f"part.{kind}"
    more = {"ply": {"vertex_normal": normals}, "stl": {}}.get(kind, {"include_normals": normals})
    data = shape.export(file_type=kind, **more)
    (folder / name).write_bytes(data.encode() if isinstance(data, str) else data)
    return name


def triangles(folder: Path, name: str, more: str = "") -> tuple[int, list[str]]:
    """Return of how many triangles a deck's mesh is, and the notes about it."""
    path = folder / "deck.xml"
    path.write_text(
        added(f'<Post_Graphic id="6" type="TriaMesh" rm_id="20" file="{name}" {more}/>'),
        encoding="utf-8",
    )
    model = read_model(path)
    faces = model.graphics[6].faces
    assert faces is not None
    return len(faces), [note for note in model.notes if "Post_Graphic" in note]


@pytest.mark.parametrize("kind", ["obj", "ply", "glb"])
def test_normals_in_a_file_say_that_it_is_smooth(tmp_path: Path, kind: str) -> None:
    name = written(tmp_path, BALL, kind, True)
    count, notes = triangles(tmp_path, name)
    assert count > 10 * len(BALL.faces)
    assert any("normals say where it is smooth" in note for note in notes)
    assert triangles(tmp_path, name, 'facets="FLAT"')[0] == len(BALL.faces)
    assert triangles(tmp_path, name, 'facets="SMOOTH"')[0] == count
    # all edges of this ball bend by 4 to 5 degrees
    assert triangles(tmp_path, name, 'crease_angle="3"')[0] == len(BALL.faces)


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "stl"])
def test_a_file_without_normals_is_flat(tmp_path: Path, kind: str) -> None:
    assert triangles(tmp_path, written(tmp_path, BALL, kind, False)) == (len(BALL.faces), [])
    assert triangles(tmp_path, f"part.{kind}", 'facets="SMOOTH"')[0] > len(BALL.faces)


def test_normals_of_faces_say_that_all_edges_are_sharp(tmp_path: Path) -> None:
    flat = trimesh.Trimesh(
        BALL.triangles.reshape(-1, 3),
        np.arange(3 * len(BALL.faces)).reshape(-1, 3),
        vertex_normals=np.repeat(BALL.face_normals, 3, axis=0),
        process=False,
    )
    assert triangles(tmp_path, written(tmp_path, flat, "ply", True)) == (len(BALL.faces), [])


def test_normals_keep_an_edge_that_bends_little() -> None:
    # a ball whose normals below its equator are told to be 6 degrees off those above
    ways = np.vstack([np.eye(3), -np.eye(3)])
    ball = trimesh.convex.convex_hull(ways).subdivide().subdivide()
    vertices, faces = made(ball)
    vertices /= np.linalg.norm(vertices, axis=1)[:, None]
    corners = vertices[faces]
    told = corners + np.where(corners.mean(axis=1) < 0.0, [0.0, 0.0, 0.1], 0.0)[:, None, :]
    equator = np.abs(corners[:, :, 2]) < 1e-9
    assert equator.sum() >= 32
    plain = corner_normals(vertices, faces)
    np.testing.assert_allclose(plain[equator], corners[equator], atol=1e-12)
    kept = corner_normals(vertices, faces, told=told)
    above = (corners.mean(axis=1)[:, 2] > 0.0)[:, None] & equator
    below = (corners.mean(axis=1)[:, 2] < 0.0)[:, None] & equator
    assert kept[above][:, 2].min() > 0.02
    assert kept[below][:, 2].max() < -0.02
