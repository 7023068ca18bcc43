"""Mesh files of every format: triangles, units of length, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh

from helpers.minimal_deck import added, deck, read
from helpers.three_mf import mesh_text, write_3mf
from mbsim.errors import DeckError, ModelError
from mbsim.model.elements import Graphic
from mbsim.model.mass_properties import polyhedron
from mbsim.model.mesh_file import load_mesh
from mbsim.reader.xml import read_model

CUBE = trimesh.creation.box((1.0, 2.0, 3.0))
ITEM = '<item objectid="1"/>'


def graphic(folder: Path, name: str, more: str = "", unit: str = "METER") -> Graphic:
    """Return the TriaMesh of a deck in this unit of length."""
    statement = f'<Post_Graphic id="6" type="TriaMesh" rm_id="20" file="{name}" {more}/>'
    text = added(statement).replace('length_unit="METER"', f'length_unit="{unit}"', 1)
    return read(folder, text).graphics[6]


def extent(mesh: Graphic) -> np.ndarray:
    assert mesh.vertices is not None
    return np.ptp(mesh.vertices, axis=0)


def cube_3mf(folder: Path, unit: str = "millimeter", build: str = ITEM, more: str = "") -> Path:
    path = folder / "part.3mf"
    cube = mesh_text(CUBE.vertices, CUBE.faces)
    write_3mf(path, f'<object id="1" type="model">{cube}</object>{more}', build, unit)
    return path


def glb(folder: Path) -> Path:
    """Write two cubes, one mirrored and moved, as a scene with nodes."""
    scene = trimesh.Scene()
    scene.add_geometry(CUBE)
    move = np.diag([-1.0, 1.0, 1.0, 1.0])
    move[0, 3] = 5.0
    scene.add_geometry(CUBE, transform=move)
    path = folder / "part.glb"
    path.write_bytes(scene.export(file_type="glb"))
    return path


@pytest.mark.parametrize(
    ("unit", "size"), [("METER", 1.0), ("MILLIMETER", 1e3), ("INCH", 1 / 0.0254)]
)
def test_glb_is_in_metres_whatever_the_deck(tmp_path: Path, unit: str, size: float) -> None:
    glb(tmp_path)
    mesh = graphic(tmp_path, "part.glb", unit=unit)
    np.testing.assert_allclose(extent(mesh), np.array([6.0, 2.0, 3.0]) * size, rtol=1e-7)
    assert polyhedron(mesh.vertices, mesh.faces).volume == pytest.approx(12.0 * size**3, rel=1e-6)


def test_a_note_says_that_a_mesh_was_scaled(tmp_path: Path) -> None:
    glb(tmp_path)
    path = tmp_path / "deck.xml"
    statement = '<Post_Graphic id="6" type="TriaMesh" rm_id="20" file="part.glb"{}/>'
    path.write_text(added(statement.format("")), encoding="utf-8")
    assert not any("METER" in note for note in read_model(path).notes)
    path.write_text(added(statement.format("")).replace("METER", "MILLIMETER", 1), encoding="utf-8")
    assert any("METER by its format, taken times 1000" in note for note in read_model(path).notes)
    path.write_text(added(statement.format(' length_unit="INCH"')), encoding="utf-8")
    assert any("goes before METER" in note for note in read_model(path).notes)


@pytest.mark.parametrize(
    ("unit", "metres"),
    [("micron", 1e-6), ("millimeter", 1e-3), ("inch", 0.0254), ("foot", 0.3048), ("meter", 1.0)],
)
def test_3mf_names_its_unit(tmp_path: Path, unit: str, metres: float) -> None:
    cube_3mf(tmp_path, unit)
    np.testing.assert_allclose(
        extent(graphic(tmp_path, "part.3mf")), np.array([1.0, 2.0, 3.0]) * metres, rtol=1e-15
    )


def test_3mf_puts_components_in_their_places(tmp_path: Path) -> None:
    more = (
        '<object id="2" type="model"><components>'
        '<component objectid="1" transform="0 1 0 -1 0 0 0 0 1 0 0 0"/>'
        '<component objectid="1" transform="-1 0 0 0 1 0 0 0 1 10 0 0"/></components></object>'
    )
    cube_3mf(tmp_path, "meter", '<item objectid="2" transform="1 0 0 0 1 0 0 0 1 0 0 7"/>', more)
    mesh = graphic(tmp_path, "part.3mf")
    # x of the object goes to y: the first is 2 wide in x; both stand 7 high
    np.testing.assert_allclose(mesh.vertices.min(axis=0), (-1.0, -1.0, 5.5))
    np.testing.assert_allclose(mesh.vertices.max(axis=0), (10.5, 1.0, 8.5))
    assert polyhedron(mesh.vertices, mesh.faces).volume == pytest.approx(12.0)


@pytest.mark.parametrize("kind", ["stl", "obj", "off", "ply"])
def test_other_files_are_in_the_decks_unit_unless_it_says_theirs(tmp_path: Path, kind: str) -> None:
    CUBE.export(tmp_path / f"part.{kind}")
    name = f"part.{kind}"
    np.testing.assert_array_equal(extent(graphic(tmp_path, name, unit="MILLIMETER")), (1, 2, 3))
    mesh = graphic(tmp_path, name, 'length_unit="millimeter"')
    np.testing.assert_allclose(extent(mesh), (0.001, 0.002, 0.003), rtol=1e-15)


def test_an_embedded_gltf_is_read_and_files_beside_it_are_not(tmp_path: Path) -> None:
    from trimesh.exchange.gltf import export_gltf

    data = export_gltf(CUBE.scene(), embed_buffers=True)["model.gltf"]
    (tmp_path / "part.gltf").write_bytes(data)
    np.testing.assert_allclose(extent(graphic(tmp_path, "part.gltf")), (1, 2, 3))
    parts = export_gltf(CUBE.scene())
    for name, part in parts.items():
        (tmp_path / name).write_bytes(part)
    with pytest.raises(DeckError, match="its buffers are in other files"):
        graphic(tmp_path, "model.gltf")


def test_a_unit_of_a_mesh_without_a_file_is_refused(tmp_path: Path) -> None:
    text = added(
        '<Post_Graphic id="6" type="TriaMesh" rm_id="20" length_unit="INCH"><Nodes>0 0 0 1 0 0 0 1 '
        "0 0 0 1</Nodes><Faces>0 2 1 0 1 3 0 3 2 1 2 3</Faces></Post_Graphic>"
    )
    with pytest.raises(DeckError, match='length_unit="INCH": is for a file'):
        read(tmp_path, text)
    with pytest.raises(DeckError, match="has no such attribute"):
        read(tmp_path, deck(('radius="0.108"', 'radius="0.108" length_unit="INCH"')))


def nested(depth: int) -> str:
    """Return objects of which each holds the one before ten times."""
    return "".join(
        f'<object id="{k + 2}"><components>' + f'<component objectid="{k + 1}"/>' * 10
        + "</components></object>"
        for k in range(depth)
    )  # fmt: skip


@pytest.mark.parametrize(
    ("build", "more", "words"),
    [
        ('<item objectid="5"/>', "", "no such object"),
        ("", "", "no object with triangles"),
        ('<item objectid="9"/>', nested(8), "more than can be meant"),
        (
            '<item objectid="2"/>',
            '<object id="2"><components><component objectid="2"/></components></object>',
            "more than can be meant",
        ),
        ('<item objectid="1" transform="1 2 3"/>', "", "must be 12 numbers"),
        ('<item objectid="1" transform="1 0 0 0 1 0 0 0 1 nan 0 0"/>', "", "not finite"),
    ],
    ids=["no object", "empty", "bomb", "ring", "transform", "nan"],
)
def test_3mf_that_cannot_be(tmp_path: Path, build: str, more: str, words: str) -> None:
    path = cube_3mf(tmp_path, "meter", build, more)
    with pytest.raises(ModelError, match=words):
        load_mesh(path)


def test_3mf_opens_no_other_file(tmp_path: Path) -> None:
    secret = tmp_path / "secret.txt"
    secret.write_text("1", encoding="utf-8")
    path = tmp_path / "part.3mf"
    cube = mesh_text(CUBE.vertices, CUBE.faces)
    write_3mf(path, f'<object id="1">{cube}</object>', ITEM)
    import zipfile

    with zipfile.ZipFile(path) as archive:
        texts = {name: archive.read(name).decode() for name in archive.namelist()}
    entity = f'<!DOCTYPE model [<!ENTITY x SYSTEM "{secret.as_uri()}">]>'
    texts["3D/part.model"] = entity + texts["3D/part.model"].replace('id="1"', 'id="&x;"', 1)
    with zipfile.ZipFile(path, "w") as archive:
        for name, text in texts.items():
            archive.writestr(name, text)
    with pytest.raises(ModelError, match="is no readable 3MF file"):
        load_mesh(path)


@pytest.mark.parametrize("suffix", ["glb", "gltf", "3mf"])
@pytest.mark.parametrize("data", [b"", b"glTF", b"PK\x03\x04", b"{}", json.dumps([1]).encode()])
def test_damaged_files_of_scenes(tmp_path: Path, suffix: str, data: bytes) -> None:
    path = tmp_path / f"part.{suffix}"
    path.write_bytes(data)
    with pytest.raises(ModelError) as caught:
        load_mesh(path)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("kind", ["stl_ascii", "obj", "off", "ply", "ply_ascii"])
@pytest.mark.parametrize("code", ["latin-1", "utf-8"])
def test_names_in_a_mesh_file_may_be_in_any_code(tmp_path: Path, kind: str, code: str) -> None:
    name = "Gehäuse groß".encode(code)
    binary, _, _ = kind.partition("_")
    how = {"encoding": "ascii"} if kind == "ply_ascii" else {}
    data = CUBE.export(file_type="stl_ascii" if kind == "stl_ascii" else binary, **how)
    data = data if isinstance(data, bytes) else data.encode()
    _, _, rest = data.partition(b"\n")
    comment = {"stl": b"solid " + name, "obj": b"# " + name, "off": b"OFF\n# " + name}
    head = comment.get(binary, b"ply")
    if binary == "ply":
        rest = rest.replace(b"element vertex", b"comment " + name + b"\nelement vertex", 1)
    path = tmp_path / f"part.{binary}"
    path.write_bytes(head + b"\n" + rest)
    mesh = load_mesh(path)
    assert polyhedron(mesh.vertices, mesh.faces).volume == pytest.approx(6.0)


@pytest.mark.parametrize("change", [slice(None, -7), slice(None, 200)])
def test_a_cut_stl_tells_its_bytes(tmp_path: Path, change: slice) -> None:
    path = tmp_path / "part.stl"
    path.write_bytes(CUBE.export(file_type="stl")[change])
    size = path.stat().st_size
    with pytest.raises(ModelError, match=f"{size} bytes, where a binary one of 12 triangles has"):
        load_mesh(path)
