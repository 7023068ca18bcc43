"""Packed surfaces are made once: in a process, and for later ones in files."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
import trimesh

from mbsim.compile_model import kept_surfaces
from mbsim.compile_model.kept_surfaces import kept_surface
from mbsim.compile_model.surfaces import packed
from mbsim.model.elements import Graphic


def torus(sides: int) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a torus of 4 `sides`^2 triangles."""
    made = trimesh.creation.torus(1.0, 0.3, major_sections=2 * sides, minor_sections=sides)
    return np.asarray(made.vertices), np.asarray(made.faces)


@pytest.fixture
def made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """Return the numbers of triangles of what was packed, with an empty cache."""
    counts: list[int] = []
    plain = kept_surfaces.pack_mesh

    def counted(vertices: np.ndarray, faces: np.ndarray, layered: bool) -> np.ndarray:
        counts.append(len(faces))
        return plain(vertices, faces, layered)

    folder = tmp_path / "cache"
    folder.mkdir(mode=0o700)
    monkeypatch.setattr(kept_surfaces, "pack_mesh", counted)
    monkeypatch.setattr(kept_surfaces, "trusted_root", lambda: folder)
    monkeypatch.setattr(kept_surfaces, "_here", type(kept_surfaces._here)())
    sources = kept_surfaces.Sources(plain)
    monkeypatch.setattr(kept_surfaces, "_sources", lambda: sources)
    return counts


def files(tmp_path: Path) -> list[Path]:
    return sorted((tmp_path / "cache").glob("surfaces/*"))


def test_a_mesh_is_packed_once_in_a_process(made: list[int]) -> None:
    small, large = torus(3), torus(12)
    for layered in (True, False):
        first = [kept_surface(*mesh, layered) for mesh in (small, large)]
        again = [kept_surface(*mesh, layered) for mesh in (small, large)]
        assert all(a is b for a, b in zip(first, again, strict=True))
    assert made == [36, 576, 36, 576]
    # another mesh of as many triangles is another one
    kept_surface(1.5 * small[0], small[1], True)
    assert made[4:] == [36]


@pytest.mark.parametrize("sides", [3, 12])
def test_a_mesh_is_packed_once_for_later_processes(
    made: list[int], tmp_path: Path, sides: int
) -> None:
    first = kept_surface(*torus(sides), True)
    assert len(files(tmp_path)) == 1
    kept_surfaces.forget()
    again = kept_surface(*torus(sides), True)
    assert made == [4 * sides**2]
    assert again is not first
    assert np.array_equal(again, first)


@pytest.mark.parametrize("damage", ["cut", "bit", "empty", "folder"])
def test_a_damaged_file_is_packed_anew(made: list[int], tmp_path: Path, damage: str) -> None:
    large = torus(12)
    first = kept_surface(*large, True)
    kept_surfaces.forget()
    (path,) = files(tmp_path)
    text = bytearray(path.read_bytes())
    text[len(text) // 2] ^= 1
    if damage == "folder":
        path.unlink()
        path.mkdir()
    else:
        path.write_bytes({"cut": text[:-8], "bit": text, "empty": b""}[damage])
    assert np.array_equal(kept_surface(*large, True), first)
    assert made == [576, 576]
    if damage != "folder":
        kept_surfaces.forget()
        assert np.array_equal(kept_surface(*large, True), first)
        assert made == [576, 576]


def test_a_folder_that_others_can_write_is_not_used(made: list[int], tmp_path: Path) -> None:
    folder = tmp_path / "cache" / "surfaces"
    folder.mkdir()
    folder.chmod(0o777)
    kept_surface(*torus(12), True)
    assert files(tmp_path) == []
    assert made == [576]


def test_a_folder_that_takes_no_files_does_no_harm(made: list[int], tmp_path: Path) -> None:
    # a file in the folder's place takes none, whoever runs this; root writes to any folder
    (tmp_path / "cache" / "surfaces").touch(mode=0o600)
    assert len(kept_surface(*torus(12), True)) > 576
    assert made == [576]
    assert [path.name for path in (tmp_path / "cache").iterdir()] == ["surfaces"]


def test_a_disk_without_room_does_no_harm(
    made: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(kept_surfaces.os, "replace", full)
    assert len(kept_surface(*torus(12), True)) > 576
    assert files(tmp_path) == []


def test_what_was_asked_for_last_stays(
    made: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    meshes = [(scale * torus(12)[0], torus(12)[1]) for scale in (1.0, 2.0, 3.0)]
    size = len(kept_surface(*meshes[0], True))
    monkeypatch.setattr(kept_surfaces, "MOST_NUMBERS", 2.5 * size)
    monkeypatch.setattr(kept_surfaces, "MOST_BYTES", 2.5 * 8 * size)
    monkeypatch.setattr(kept_surfaces, "LEAST_BYTES", 0)
    kept_surface(*meshes[1], True)
    old = files(tmp_path)
    for age, path in enumerate(old):
        os.utime(path, (1e9 + age, 1e9 + age))
    kept_surface(*meshes[2], True)
    assert len(kept_surfaces._here) == 2
    left = files(tmp_path)
    assert len(left) == 2
    assert old[0] not in left
    assert made == [576, 576, 576]


def test_a_mesh_that_is_larger_than_all_files_may_be_costs_no_other(
    made: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    size = len(kept_surface(*torus(3), True))
    small = files(tmp_path)
    monkeypatch.setattr(kept_surfaces, "MOST_BYTES", 8 * size)
    monkeypatch.setattr(kept_surfaces, "LEAST_BYTES", 0)
    assert len(kept_surface(*torus(12), True)) > size
    assert len(small) == 1
    assert files(tmp_path) == small


def test_small_files_are_few(
    made: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # each counts for LEAST_BYTES, however small it is
    monkeypatch.setattr(kept_surfaces, "MOST_BYTES", 3 * kept_surfaces.LEAST_BYTES)
    for scale in range(1, 7):
        kept_surface(scale * torus(3)[0], torus(3)[1], True)
    assert len(files(tmp_path)) == 3


def test_what_a_run_gets_is_its_own(made: list[int]) -> None:
    vertices, faces = torus(3)
    graphic = Graphic(id=1, shape="MESH", vertices=vertices, faces=faces)
    mine = packed(graphic, layered=True)
    mine[:] = 0.0
    assert packed(graphic, layered=True).any()
    assert made == [36]
