"""Facts and signals of a result file that another program has changed are refused by name."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pytest
from click.testing import CliRunner

from helpers.fake_run import SETTINGS, add_rows, fake_system
from mbsim.cli.main import main
from mbsim.results.recorder import Recorder

REQUESTS = (
    '<Post_Request id="7" type="MARKER_DISPLACEMENT" i_marker_id="20" label="ball"/>'
    '<Post_Request id="8" type="EXPRESSION" expr2="TIME" expr3="DZ(20)"/>'
    '<Constraint_Joint id="3" type="REVOLUTE" i_marker_id="20" j_marker_id="10" label="hinge"/>'
)


def fact(name: str, attribute: str, value: Any) -> Callable[[h5py.File], None]:
    """Return what gives an attribute another value."""

    def change(file: h5py.File) -> None:
        file[name].attrs[attribute] = value

    return change


def table(name: str, value: Any) -> Callable[[h5py.File], None]:
    """Return what puts another dataset in the place of one."""

    def change(file: h5py.File) -> None:
        del file[name]
        file[name] = value

    return change


@pytest.mark.parametrize("options", [[], ["--json"]])
@pytest.mark.parametrize(
    "change",
    [
        *(fact("requests/8", "measures", value) for value in ("", "text", 7, [1.0] * 8, ["a"])),
        *(fact("requests/7", "columns", value) for value in ("", 7, ["a"])),
        *(fact("requests/7", name, value) for name in ("type", "label") for value in (7, [1, 2])),
        *(table(f"joints/{name}", np.ones((1, 2))) for name in ("type", "label")),
        *(table("joints/label", value) for value in (np.ones(1), 3.0, "text")),
        *(table("bodies/position", value) for value in (b"text", 7, np.array([b"a"] * 10))),
        *(table("bodies/velocity", np.full((10, 1), value)) for value in (b"a", 1j)),
        table("bodies/quaternion", np.zeros((10, 1), dtype=[("a", "f8"), ("b", "S3")])),
    ],
)
def test_info_of_a_file_of_another_form(
    tmp_path: Path, change: Callable[[h5py.File], None], options: list[str]
) -> None:
    system = fake_system(tmp_path, REQUESTS)
    recorder = Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 10)
    recorder.take()
    recorder.close("finished", {"steps": 1}, system.scene.log.contacts).close()
    with h5py.File(tmp_path / "deck.h5", "r+") as file:
        change(file)
    found = CliRunner().invoke(main, ["info", str(tmp_path / "deck.h5"), *options])
    assert found.exception is None or isinstance(found.exception, SystemExit)
    if found.exit_code:
        assert found.exit_code == 5
        assert "cannot be read, the file is damaged" in found.output


@pytest.mark.parametrize("value", [np.ones((1, 3)), np.ones(2), "text", b"", 2.0])
@pytest.mark.parametrize(
    "name", ["contacts/peak_force", "contacts/peak_slip_speed", "joints/label"]
)
def test_tables_that_have_no_value_for_each_id_are_refused(
    tmp_path: Path, name: str, value: Any
) -> None:
    """By every command that opens the file: `plot` asks for a peak where it draws a force."""
    system = fake_system(tmp_path, REQUESTS)
    recorder = Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 10)
    recorder.take()
    recorder.close("finished", {"steps": 1}, system.scene.log.contacts).close()
    with h5py.File(tmp_path / "deck.h5", "r+") as file:
        table(name, value)(file)
    path = str(tmp_path / "deck.h5")
    for line in (
        ["plot", path, "contacts/*/force/mag", "-o", str(tmp_path / "a.png")],
        ["info", path],
    ):
        found = CliRunner().invoke(main, line)
        assert found.exception is None or isinstance(found.exception, SystemExit)
        assert (found.exit_code, "the file is damaged" in found.output) == (5, True)


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_plot_of_a_file_and_a_fact_whose_bytes_are_no_text(tmp_path: Path, suffix: str) -> None:
    """No font has them: they are shown by their numbers."""
    system = fake_system(tmp_path, REQUESTS)
    recorder = Recorder(system, SETTINGS, tmp_path)
    add_rows(system, 0, 10)
    recorder.take()
    recorder.close("finished", {"steps": 1}, system.scene.log.contacts).close()
    odd = tmp_path / "a\udcff.h5"
    try:
        (tmp_path / "deck.h5").rename(odd)
    except (OSError, ValueError):
        pytest.skip("names of files are texts here")
    with h5py.File(odd, "r+") as file:
        file.attrs["mbsim_version"] = b"\xff"
    picture = tmp_path / f"a{suffix}"
    line = ["plot", str(odd), "bodies/*/position", "-o", str(picture)]
    found = CliRunner().invoke(main, line)
    assert found.exit_code == 0, found.output
    assert picture.stat().st_size > 1000
