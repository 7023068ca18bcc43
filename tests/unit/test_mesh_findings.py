"""What is wrong with a mesh, with counts and places, and mending it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from click.testing import CliRunner

from helpers.minimal_deck import added, deck
from mbsim.cli.main import main
from mbsim.errors import ModelError
from mbsim.model import mesh_crossings
from mbsim.model.mass_properties import polyhedron
from mbsim.model.mesh import merge_vertices, solid_fault, winding_number
from mbsim.model.mesh_crossings import crossings, near_pairs
from mbsim.model.mesh_findings import crossing_findings, mesh_findings
from mbsim.model.mesh_repair import mend

Mesh = tuple[np.ndarray, np.ndarray]


def of(mesh: trimesh.Trimesh) -> Mesh:
    return merge_vertices(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64))


BALL = of(trimesh.creation.icosphere(subdivisions=3))
TORUS = of(trimesh.creation.torus(0.1, 0.03, major_sections=24, minor_sections=12))
BOX = of(trimesh.creation.box())


def one_missing(mesh: Mesh) -> Mesh:
    return mesh[0], np.delete(mesh[1], 17 % len(mesh[1]), axis=0)


def three_that_meet(mesh: Mesh) -> Mesh:
    """Take three triangles away that meet in a vertex and not in an edge, as far as there are."""
    at = np.flatnonzero((mesh[1] == mesh[1][0, 0]).any(axis=1))
    chosen = [at[0]]
    for face in at:
        if all(len(set(mesh[1][face]) & set(mesh[1][other])) == 1 for other in chosen):
            chosen.append(face)
    return mesh[0], np.delete(mesh[1], chosen, axis=0)


def some_turned(mesh: Mesh) -> Mesh:
    faces = mesh[1].copy()
    faces[3:7] = faces[3:7, ::-1]
    return mesh[0], faces


def inside_out(mesh: Mesh) -> Mesh:
    return mesh[0], mesh[1][:, ::-1]


def some_twice(mesh: Mesh) -> Mesh:
    return mesh[0], np.vstack([mesh[1], mesh[1][2:4], mesh[1][6:7, ::-1]])


def soup(mesh: Mesh) -> Mesh:
    """Give each triangle corners of its own, off by 1e-7 of the size."""
    noise = np.random.default_rng(1).normal(size=(3 * len(mesh[1]), 3))
    points = mesh[0][mesh[1]].reshape(-1, 3) + 1e-7 * np.ptp(mesh[0]) * noise
    return points, np.arange(len(points)).reshape(-1, 3)


def with_t_joint(mesh: Mesh) -> Mesh:
    """Split one triangle at the middle of an edge and not the one beside it."""
    (a, b, c), new = mesh[1][0], len(mesh[0])
    middle = mesh[0][[a, b]].mean(axis=0)
    halves = [[a, new, c], [new, b, c]]
    return np.vstack([mesh[0], middle]), np.vstack([mesh[1][1:], halves])


DAMAGE: dict[Callable[[Mesh], Mesh], tuple[str, str]] = {
    one_missing: ("3 edges belong to one triangle only", "closed"),
    three_that_meet: ("edges belong to one triangle only", "closed"),
    some_turned: ("wound the other way", "turned 4 triangles"),
    inside_out: ("inside out", "turned"),
    some_twice: ("3 triangles are there twice", "removed 3"),
    soup: ("belong to one triangle only", "merged"),
    with_t_joint: ("1 T-joints", "split"),
}


@pytest.mark.parametrize("mesh", [BALL, TORUS, BOX], ids=["ball", "torus", "box"])
@pytest.mark.parametrize("damage", list(DAMAGE))
def test_damage_is_told_and_mended(mesh: Mesh, damage: Callable[[Mesh], Mesh]) -> None:
    said, did = DAMAGE[damage]
    vertices, faces = damage(mesh)
    found = [str(finding) for finding in mesh_findings(vertices, faces)]
    assert any(said in text for text in found)
    assert solid_fault(vertices, faces)
    mended = mend(vertices, faces)
    assert any(did in line for line in mended.done)
    assert solid_fault(mended.vertices, mended.faces) == ""
    whole = polyhedron(*mesh).volume
    assert polyhedron(mended.vertices, mended.faces).volume == pytest.approx(whole, rel=1e-2)


def test_places_lie_on_the_damage() -> None:
    vertices, faces = one_missing(BOX)
    corners = {tuple(p) for p in BOX[0][BOX[1][17 % len(BOX[1])]].tolist()}
    (finding,) = mesh_findings(vertices, faces)
    assert finding.count == 3
    for place in finding.places:
        ends = [
            tuple(float(x) for x in part.strip("() ").split(", "))
            for part in place.removeprefix("from ").split(" to ")
        ]
        assert set(ends) <= corners


def moebius() -> Mesh:
    n = 20
    t = np.linspace(0.0, 2.0 * np.pi, n, endpoint=False)
    rims = [
        np.column_stack([(1 + w * np.cos(t / 2)) * np.cos(t), (1 + w * np.cos(t / 2)) * np.sin(t),
                         w * np.sin(t / 2)])
        for w in (-0.2, 0.2)
    ]  # fmt: skip
    k, after = np.arange(n), (np.arange(n) + 1) % n
    # after one turn the rims change places
    low, high = np.where(k < n - 1, after, n), np.where(k < n - 1, after + n, 0)
    faces = np.vstack([np.column_stack([k, low, k + n]), np.column_stack([k + n, low, high])])
    return np.vstack(rims), faces


def sheet() -> Mesh:
    x, y = (each.ravel() for each in np.meshgrid(np.arange(5.0), np.arange(5.0)))
    corner = np.array([5 * j + i for j in range(4) for i in range(4)])
    faces = np.vstack(
        [np.column_stack([corner, corner + 1, corner + 6]),
         np.column_stack([corner, corner + 6, corner + 5])]
    )  # fmt: skip
    return np.column_stack([x, y, np.zeros(25)]), faces


def far_corner() -> Mesh:
    """Return a cube with a corner so far away that all others are one beside it."""
    corners = 0.5 * np.array(
        [(-1, -1, -1), (-1, -1, 1), (-1, 1, -1), (-1, 1, 1), (0, -1, -1), (1, -1, -1),
         (1, -1, 1), (1, 0, 0), (1, 1, -1), (1, 1, 1)]
    )  # fmt: skip
    faces = np.array(
        [(2, 4, 1), (6, 2, 1), (5, 4, 3), (3, 6, 1), (2, 10, 4), (7, 2, 6),
         (7, 10, 2), (4, 10, 3), (9, 6, 3), (3, 10, 9), (9, 8, 0), (10, 7, 9)]
    )  # fmt: skip
    return np.vstack([[-8e6, 8e31, -0.5], corners]), faces


def both_sides(mesh: Mesh) -> Mesh:
    return mesh[0], np.vstack([mesh[1], mesh[1][:, ::-1]])


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (moebius(), "one side"),
        (sheet(), "an open sheet is no solid"),
        (both_sides(sheet()), "an open sheet is no solid"),
        ((BOX[0], np.delete(BOX[1], [0, 1], axis=0)), "a hole of 4 edges is 1 wide"),
        ((BOX[0], BOX[1][:0]), "no triangles"),
        (far_corner(), "shells enclose nothing"),
    ],
    ids=["moebius", "sheet", "doubled sheet", "open box", "nothing", "far corner"],
)
def test_what_cannot_be_mended_is_refused(mesh: Mesh, words: str) -> None:
    assert solid_fault(*mesh)
    assert mesh_findings(*mesh)
    with pytest.raises(ModelError, match=words):
        mend(*mesh)


def two(second: Mesh) -> Mesh:
    """Return the ball and a second shell in one mesh."""
    return np.vstack([BALL[0], second[0]]), np.vstack([BALL[1], second[1] + len(BALL[0])])


def test_shells_within_and_beside_each_other() -> None:
    small = (0.5 * BALL[0], BALL[1])
    beside = (BALL[0] + 3.0, BALL[1])
    assert solid_fault(*two(inside_out(small))) == ""  # a cavity
    assert solid_fault(*two(beside)) == ""
    assert "1 of 2 closed shells lie within another" in solid_fault(*two(small))
    assert "1 of 2 closed shells are turned inside out" in solid_fault(*two(inside_out(beside)))
    mended = mend(*two(inside_out(beside)))
    expected = 2.0 * polyhedron(*BALL).volume
    assert polyhedron(mended.vertices, mended.faces).volume == pytest.approx(expected)
    with pytest.raises(ModelError, match="within another"):
        mend(*two(small))


def test_winding_number() -> None:
    assert winding_number(np.array([0.1, 0.2, 0.0]), *TORUS) == 0
    assert winding_number(np.array([0.1, 0.0, 0.005]), *TORUS) == 1
    assert winding_number(np.array([0.1, 0.0, 0.005]), *inside_out(TORUS)) == -1


def test_near_pairs_are_those_whose_boxes_overlap() -> None:
    points = np.random.default_rng(3).normal(size=(200, 1, 3)) + np.random.default_rng(4).normal(
        size=(200, 3, 3), scale=0.1
    )
    found = {
        tuple(sorted(pair))
        for i, j in near_pairs(points)
        for pair in zip(i.tolist(), j.tolist(), strict=True)
    }
    lower, upper = points.min(axis=1), points.max(axis=1)
    overlap = ((lower[:, None] <= upper) & (lower <= upper[:, None])).all(axis=2)
    assert found == {(i, j) for i, j in np.argwhere(overlap).tolist() if i < j}


@pytest.mark.parametrize("shift", [(0.9, 0.8, 0.7), (0.1, 0.2, 1.93)])
def test_crossings_of_two_balls_are_those_that_fcl_sees(shift: tuple[float, float, float]) -> None:
    import fcl

    other = (BALL[0] + shift, BALL[1])
    pairs, places = crossings(*two(other))
    models = []
    for vertices, faces in (BALL, other):
        model = fcl.BVHModel()
        model.beginModel(len(vertices), len(faces))
        model.addSubModel(vertices, faces)
        model.endModel()
        models.append(fcl.CollisionObject(model, fcl.Transform()))
    request = fcl.CollisionRequest(num_max_contacts=100_000, enable_contact=True)
    result = fcl.CollisionResult()
    fcl.collide(*models, request, result)
    seen = {(contact.b1, contact.b2 + len(BALL[1])) for contact in result.contacts}
    assert {tuple(sorted(pair)) for pair in pairs.tolist()} == seen
    for centre in (np.zeros(3), np.array(shift)):
        away = np.linalg.norm(places - centre, axis=1)
        assert 0.98 < away.min()
        assert away.max() < 1.0 + 1e-12


@pytest.mark.parametrize("mesh", [BALL, TORUS, BOX, with_t_joint(BOX)])
def test_a_mesh_that_only_touches_itself_has_no_crossings(mesh: Mesh) -> None:
    assert crossing_findings(*mesh) == []


def test_few_near_triangles_are_looked_at_closely(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fans of a gear's sides: triangles of one plane, whose boxes overlap by the thousand."""
    flat = of(trimesh.creation.cylinder(radius=1.0, height=0.2, sections=200))
    tried = []
    whole = mesh_crossings._through

    def counted(*given: Any) -> Any:
        tried.append(len(given[0]))
        return whole(*given)

    monkeypatch.setattr(mesh_crossings, "_through", counted)
    assert len(crossings(*flat)[0]) == 0
    near = sum(len(i) for i, _ in near_pairs(flat[0][flat[1]]))
    assert sum(tried) < 0.1 * near
    tried.clear()
    shifted = (flat[0] + (0.7, 0.1, 0.05), flat[1])
    assert len(crossings(*two(shifted))[0]) > 0
    assert sum(tried) > 0


def meshed(folder: Path, mesh: Mesh, name: str = "part.off") -> Path:
    """Write a deck whose contact has this mesh in place of the sphere."""
    trimesh.Trimesh(*mesh, process=False).export(folder / name)
    path = folder / "deck.xml"
    text = added(f'<Post_Graphic id="400" type="TriaMesh" rm_id="20" file="{name}"/>')
    path.write_text(text.replace('i_graphics_id="200"', 'i_graphics_id="400"'), encoding="utf-8")
    return path


def test_check_lists_all_that_is_wrong(tmp_path: Path) -> None:
    path = meshed(tmp_path, one_missing(some_turned(some_twice(TORUS))))
    found = CliRunner().invoke(main, ["check", str(path)])
    assert found.exit_code == 2
    for words in ("one triangle only: from (", "there twice", "wound the other way", "--repair"):
        assert words in found.output


def test_check_repair_writes_a_copy_once_that_a_run_takes(tmp_path: Path) -> None:
    path = meshed(tmp_path, one_missing(some_turned(TORUS)))
    before = (tmp_path / "part.off").read_bytes()
    found = CliRunner().invoke(main, ["check", str(path), "--repair"])
    assert found.exit_code == 0
    assert "turned 4 triangles over" in found.output
    assert 'file="part_repaired.obj"' in found.output
    assert (tmp_path / "part.off").read_bytes() == before
    again = CliRunner().invoke(main, ["check", str(path), "--repair"])
    assert again.exit_code == 2
    assert "File exists" in again.output

    text = path.read_text(encoding="utf-8").replace("part.off", "part_repaired.obj")
    path.write_text(text, encoding="utf-8")
    found = CliRunner().invoke(main, ["check", str(path)])
    assert found.exit_code == 0
    assert "costly" not in found.output
    assert "Post_Graphic[400]: 576 triangles, 0.26 x 0.26 x 0.06, volume" in found.output
    found = CliRunner().invoke(main, ["check", str(path), "--repair"])
    assert found.exit_code == 0
    assert "nothing to mend" in found.output


def test_check_repair_of_what_cannot_be_mended(tmp_path: Path) -> None:
    path = meshed(tmp_path, sheet())
    found = CliRunner().invoke(main, ["check", str(path), "--repair"])
    assert found.exit_code == 2
    assert "an open sheet is no solid" in found.output
    assert not list(tmp_path.glob("*_repaired*"))


def test_check_tells_intersections_of_a_solid_and_a_run_takes_it(tmp_path: Path) -> None:
    path = meshed(tmp_path, two((BALL[0] + 0.9, BALL[1])))
    found = CliRunner().invoke(main, ["check", str(path)])
    assert found.exit_code == 0
    assert "126 pairs of triangles intersect: the first at (" in found.output


def test_check_repair_of_a_mesh_in_the_deck(tmp_path: Path) -> None:
    path = tmp_path / "deck.xml"
    nodes = "<Nodes>0 0 0 1 0 0 0 1 0 0 0 1</Nodes><Faces>0 2 1 0 1 3 0 3 2</Faces>"
    statement = f'<Post_Graphic id="7" type="TriaMesh" rm_id="20">{nodes}</Post_Graphic>'
    path.write_text(deck(("</Model>", f"{statement}</Model>")), encoding="utf-8")
    found = CliRunner().invoke(main, ["check", str(path), "--repair"])
    assert found.exit_code == 0
    assert (tmp_path / "deck_7_repaired.obj").exists()


def test_costly_pairs_are_told(tmp_path: Path) -> None:
    ball = trimesh.creation.icosphere(3, 0.1)
    (tmp_path / "ball.stl").write_bytes(ball.export(file_type="stl"))
    text = added(
        '<Post_Graphic id="6" type="TriaMesh" rm_id="20" file="ball.stl"/>'
        '<Post_Graphic id="7" type="Ellipsoid" center_marker_id="10" x_scale="1" y_scale="1" '
        'z_scale="1"/>'
        '<Force_Contact id="8" i_graphics_id="6" j_graphics_id="7" cnf_type="IMPACT" '
        'stiffness="1e5"/>'
    )
    path = tmp_path / "deck.xml"
    path.write_text(text, encoding="utf-8")
    found = CliRunner().invoke(main, ["check", str(path)])
    assert found.exit_code == 0, found.output
    assert "Force_Contact[8]: Post_Graphic[7] Post_Graphic[6]: closed form ELLIPSOID-MESH" in (
        found.output
    )
    assert "costly, 1 pair: Post_Graphic[6] has 1920 edges" in found.output
