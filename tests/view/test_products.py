"""What `view`, `report`, `plot` and `run --report` write: whole or not at all, in the place of its
like only; and what is read for it: damaged files, names that are no text, odd files."""

from __future__ import annotations

import http.client
import os
import shutil
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import h5py
import pytest
from click.testing import CliRunner, Result

from helpers.ends import small_disk
from helpers.views import run_balls
from mbsim.cli.main import main
from mbsim.results.products import write_product
from mbsim.view.serve import HOST, Served, server

LINUX = sys.platform == "linux"
#: Commands that write a file made of a result, and what it begins with.
WRITERS = {
    "view": (["view"], "-o", b"<!doctype html"),
    "report": (["report"], "-o", b"<!doctype html"),
    "gltf": (["view"], "--gltf", b"glTF"),
    "plot": (["plot", "--", "bodies/2/position"], "-o", b"\x89PNG"),
}
SUFFIX = {"view": ".html", "report": ".html", "gltf": ".glb", "plot": ".png"}


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_balls(tmp_path_factory.mktemp("balls"))


def line(writer: str, source: Path, target: Path) -> list[str]:
    """Return the command line that writes a product."""
    (command, *rest), option, _ = WRITERS[writer]
    return [command, str(source), *rest[1:], option, str(target)]


def asked(*arguments: str) -> Result:
    """Run a command line; no traceback comes of it, and one message where it fails."""
    found = CliRunner().invoke(main, arguments)
    assert found.exception is None or isinstance(found.exception, SystemExit), found.exc_info
    assert found.stderr.count("mbsim: error: ") == (found.exit_code != 0)
    return found


@pytest.mark.parametrize("writer", WRITERS)
def test_a_file_of_another_kind_is_left_alone(file: Path, tmp_path: Path, writer: str) -> None:
    """The result itself, a deck, or notes under a name that is mistyped."""
    result = shutil.copy(file, tmp_path / f"a{SUFFIX[writer]}")
    notes = tmp_path / f"notes{SUFFIX[writer]}"
    notes.write_text("to be kept")
    for target in (result, notes):
        before = target.read_bytes()
        found = asked(*line(writer, result, target))
        assert found.exit_code == 2
        assert "left alone" in found.stderr
        assert target.read_bytes() == before


@pytest.mark.parametrize("writer", WRITERS)
def test_its_like_and_an_empty_file_are_replaced(file: Path, tmp_path: Path, writer: str) -> None:
    target = tmp_path / f"a{SUFFIX[writer]}"
    target.touch()
    for _ in range(2):
        assert asked(*line(writer, file, target)).exit_code == 0
        assert target.read_bytes().lower().startswith(WRITERS[writer][2].lower())
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no FIFOs")
@pytest.mark.parametrize("writer", WRITERS)
def test_fifos_folders_and_links_in_its_place(file: Path, tmp_path: Path, writer: str) -> None:
    """A FIFO or folder is refused; of a link the name is taken, not what it leads to."""
    names = {name: tmp_path / f"{name}{SUFFIX[writer]}" for name in ("fifo", "folder", "link")}
    os.mkfifo(names["fifo"])
    names["folder"].mkdir()
    names["link"].symlink_to(tmp_path / "elsewhere")
    (tmp_path / f".link{SUFFIX[writer]}.tmp").symlink_to(tmp_path / "elsewhere")
    assert asked(*line(writer, file, names["fifo"])).exit_code == 5
    assert asked(*line(writer, file, names["folder"])).exit_code == 2
    assert asked(*line(writer, file, names["link"])).exit_code == 0
    assert names["link"].is_file()
    assert not names["link"].is_symlink()
    assert not (tmp_path / "elsewhere").exists()


@pytest.mark.parametrize("writer", WRITERS)
def test_a_folder_that_cannot_be_written(file: Path, tmp_path: Path, writer: str) -> None:
    (tmp_path / "taken").touch()
    for folder in ("missing", "taken"):
        found = asked(*line(writer, file, tmp_path / folder / f"a{SUFFIX[writer]}"))
        assert found.exit_code == 5
        assert "cannot be written" in found.stderr


@pytest.mark.skipif(not LINUX or os.geteuid() != 0, reason="mounts small disks")
@pytest.mark.parametrize("writer", WRITERS)
def test_a_full_disk_leaves_the_earlier_one(file: Path, tmp_path: Path, writer: str) -> None:
    with small_disk(tmp_path / "disk", 3.0) as disk:
        target = disk / f"a{SUFFIX[writer]}"
        assert asked(*line(writer, file, target)).exit_code == 0
        before = target.read_bytes()
        found = os.statvfs(disk)
        (disk / "ballast").write_bytes(bytes(found.f_bavail * found.f_frsize))
        found = asked(*line(writer, file, target))
        assert found.exit_code == 5
        assert "No space left" in found.stderr
        assert target.read_bytes() == before
        assert sorted(path.name for path in disk.iterdir()) == [target.name, "ballast"]


@pytest.mark.skipif(not LINUX, reason="names are bytes")
@pytest.mark.parametrize("writer", WRITERS)
def test_names_that_are_no_text(file: Path, tmp_path: Path, writer: str) -> None:
    """They are shown as escapes, in messages and on pages, which are UTF-8."""
    odd = Path(os.fsdecode(os.fsencode(tmp_path) + b"/\xff\x1b[31m.h5"))
    shutil.copy(file, odd)
    target = odd.with_suffix(SUFFIX[writer])
    found = asked(*line(writer, odd, target))
    assert found.exit_code == 0
    assert "\x1b" not in found.output
    if SUFFIX[writer] == ".html":
        assert "\\udcff" in target.read_bytes().decode("utf-8")


@pytest.mark.parametrize("writer", WRITERS)
def test_what_is_no_result_or_damaged(file: Path, tmp_path: Path, writer: str) -> None:
    data = file.read_bytes()
    broken = bytearray(data)
    broken[len(data) // 2] ^= 1
    files = {
        "cut": data[: len(data) // 2],
        "broken": bytes(broken),
        "text": b"<Model/>\n",
        "empty": b"",
    }
    target = tmp_path / f"a{SUFFIX[writer]}"
    for name, held in files.items():
        (tmp_path / f"{name}.h5").write_bytes(held)
        assert asked(*line(writer, tmp_path / f"{name}.h5", target)).exit_code == 5, name
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["x"] = 1.0
    assert asked(*line(writer, tmp_path / "other.h5", target)).exit_code in (2, 5)
    assert asked(*line(writer, tmp_path / "missing.h5", target)).exit_code in (2, 5)
    assert not target.exists()


@pytest.mark.skipif(not LINUX, reason="pipes that nobody reads")
@pytest.mark.parametrize("arguments", [["view", "-o", "a.html"], ["report", "-o", "a.html"]])
def test_nobody_reads_what_is_printed(file: Path, tmp_path: Path, arguments: list[str]) -> None:
    command, *rest = arguments
    reading, writing = os.pipe()
    os.close(reading)
    base = [sys.executable, "-m", "mbsim", command, str(file), *rest]
    found = subprocess.run(base, cwd=tmp_path, stdout=writing, stderr=subprocess.PIPE, check=False)
    os.close(writing)
    assert found.returncode == 0, found.stderr
    assert not found.stderr
    assert (tmp_path / "a.html").stat().st_size > 1e5


def test_a_report_that_cannot_be_written_keeps_the_run(tmp_path: Path) -> None:
    deck = run_balls(tmp_path).with_name("balls.xml")
    (tmp_path / "balls-report.html").write_text("to be kept")
    found = asked("run", str(deck), "-o", str(tmp_path), "--report", "--end-time", "0.01")
    assert found.exit_code == 2
    assert "left alone" in found.stderr
    assert (tmp_path / "balls-report.html").read_text() == "to be kept"
    assert asked("info", str(tmp_path / "balls.h5")).exit_code == 0


def test_a_failure_in_the_midst_of_a_product(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """What is there stays."""
    target = tmp_path / "a.html"
    write_product(target, "<!doctype html>1", "page")

    def fails(*given: object) -> None:
        raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "replace", fails)
    with pytest.raises(Exception, match="Input/output error"):
        write_product(target, "<!doctype html>2", "page")
    assert target.read_text() == "<!doctype html>1"
    assert [path.name for path in tmp_path.iterdir()] == ["a.html"]


@pytest.fixture
def port(file: Path, tmp_path: Path) -> Iterator[int]:
    """Serve a copy of the result, named `live.h5`, and yield the port."""
    shutil.copy(file, tmp_path / "live.h5")
    with server(Served([tmp_path / "live.h5"])) as made:
        thread = threading.Thread(target=made.serve_forever)
        thread.start()
        yield made.server_port
        made.shutdown()
        thread.join()


def answer(port: int, path: str, host: str = "localhost") -> tuple[int, bytes]:
    """Return code and body of what is asked for."""
    connection = http.client.HTTPConnection(HOST, port, timeout=60.0)
    connection.putrequest("GET", path, skip_host=True)
    connection.putheader("Host", host)
    connection.endheaders()
    found = connection.getresponse()
    return found.status, found.read()


def test_a_server_goes_on(port: int, tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """Whatever is asked for, whoever hangs up, and whatever becomes of the file."""
    assert b'"runs": 1' in answer(port, "/state")[1]
    for path in ("/pack/" + "1" * 5000, "/pack/9", "/pack/-1", "/../live.h5", "/%00"):
        assert answer(port, path)[0] == 404
    assert answer(port, "/state", "elsewhere.example")[0] == 403
    for _ in range(3):
        with socket.create_connection((HOST, port)) as rude:
            # the answer finds nobody
            rude.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")
            rude.sendall(b"GET /pack/0 HTTP/1.0\r\nHost: localhost\r\n\r\n")
    with h5py.File(tmp_path / "other.h5", "w") as other:
        other["time"] = [0.0, 1.0]
        other["bodies/id"] = [2]
        other["bodies/position"] = [[0.0, 1.0]]
        other["bodies/quaternion"] = [1.0]
    os.replace(tmp_path / "other.h5", tmp_path / "live.h5")
    code, body = answer(port, "/state")
    assert code == 200
    assert b"live.h5" in body
    (tmp_path / "live.h5").unlink()
    assert answer(port, "/state")[0] == 200
    assert answer(port, "/pack/0")[0] == 200  # as it was last
    assert "Traceback" not in capfd.readouterr().err
