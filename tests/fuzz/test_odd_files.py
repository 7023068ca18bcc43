"""What is no regular file, and HDF5 that says more than it holds, is refused at once."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner

from helpers.forked import finds
from helpers.minimal_deck import added, deck
from mbsim.cli.main import main
from mbsim.core import stored
from mbsim.core.stored import apart, read_regular
from mbsim.errors import ResultsError
from mbsim.results.reading import open_results

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="makes FIFOs, forks")


def fifo(path: Path) -> None:
    os.mkfifo(path)


def loop(path: Path) -> None:
    path.symlink_to(path.name)


def to_fifo(path: Path) -> None:
    os.mkfifo(path.with_suffix(".fifo"))
    path.symlink_to(path.with_suffix(".fifo").name)


def to_nothing(path: Path) -> None:
    path.symlink_to("nothing")


def refuses(*line: str) -> None:
    """Run a command line, which ends with a message and an exit code of ours, at once."""

    def run(case: int) -> None:
        found = CliRunner().invoke(main, line)
        assert isinstance(found.exception, SystemExit), found.exception
        assert found.exit_code in (2, 5), found.output

    assert not finds(run, range(1), 20.0)


MESH = '<Post_Graphic id="400" type="TriaMesh" rm_id="20" file="a.stl"/>'
CFF = deck(
    ('cff_type="COULOMB_ON" mu_static="0.3"', 'cff_type="USERCFF" mu_static="0.3"'),
    ('mu_dynamic="0.2"', 'mu_dynamic="0.2" cff_fnc_name="CFFSUB" {}'),
)
SPLINE = '<Reference_Spline id="5" file="points.csv"/>'


@pytest.mark.slow
@pytest.mark.parametrize("odd", [fifo, loop, to_fifo, to_nothing, Path.mkdir])
@pytest.mark.parametrize("name", ["deck.xml", "deck.adm", "out.h5", "out"])
def test_in_the_place_of_what_a_command_names(
    tmp_path: Path, odd: Callable[[Path], None], name: str
) -> None:
    odd(tmp_path / name)
    for command in ("check", "info", "run", "request"):
        refuses(command, str(tmp_path / name), *(["--list"] if command == "request" else []))
    refuses("plot", str(tmp_path / name), "time")
    for command in ("view", "report"):
        refuses(command, str(tmp_path / name), "-o", str(tmp_path / "page.html"))


@pytest.mark.slow
@pytest.mark.parametrize("odd", [fifo, loop, to_fifo, to_nothing, Path.mkdir])
@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("a.stl", added(MESH)),
        ("points.csv", added(SPLINE)),
        ("law.py", CFF.format('script_name="law.py"')),
        ("law.m", CFF.format('interpreter="MATLAB" script_name="law.m"')),
        ("law.so", CFF.format('cff_dll_name="law.so"')),
    ],
)
def test_in_the_place_of_what_a_deck_names(
    tmp_path: Path, odd: Callable[[Path], None], name: str, text: str
) -> None:
    path = tmp_path / "deck.xml"
    path.write_text(text, encoding="utf-8")
    odd(tmp_path / name)
    refuses("run", str(path), "-o", str(tmp_path / "out"))


def test_a_dataset_that_says_more_than_it_holds(tmp_path: Path) -> None:
    import h5py

    path = tmp_path / "big.h5"
    with h5py.File(path, "w") as file:
        file.attrs["mbsim_version"] = "0.1.0"
        # HDF5 would fill 64 GiB with ones
        file.create_dataset("time", (2**33,), "f8", chunks=True, fillvalue=1.0)
        file.create_dataset("events", (0,), [("time", "f8"), ("kind", "S8")])
    with open_results(path) as results, pytest.raises(ResultsError, match="larger than what"):
        results["time"]
    refuses("info", str(path))
    refuses("plot", str(path), "time", "-o", str(tmp_path / "a.png"))


def test_a_reader_that_loops_or_crashes_ends(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stored, "_SECONDS", 0.1)
    path = tmp_path / "a.h5"
    path.write_bytes(b"")

    def loops() -> None:
        while True:
            pass

    with pytest.raises(ResultsError, match="not done after"):
        apart(loops, path)
    with pytest.raises(ResultsError, match="crashes"):
        apart(os.abort, path)
    with pytest.raises(ResultsError, match="mine"):
        apart(lambda: open_results(tmp_path / "mine"), path)
    assert apart(lambda: {"rows": 3}, path) == {"rows": 3}


def test_regular_files_only(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    for place in (tmp_path / "fifo", tmp_path, Path("/dev/zero")):
        with pytest.raises(OSError, match=r"is no regular file|is a folder|Is a directory"):
            read_regular(place)
