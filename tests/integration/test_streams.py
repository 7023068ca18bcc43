"""What a command line prints, and what becomes of it where nobody can read it."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from helpers.decks import GRAVITY, GROUND, contact, sphere, write_deck
from mbsim.cli.messages import printable
from mbsim.results.reading import open_results

BOUNCE = GROUND + sphere(0.15) + contact() + GRAVITY
CLI = f'"{sys.executable}" -m mbsim'


def shell(command: str, folder: Path) -> subprocess.CompletedProcess[bytes]:
    """Run a line of a shell."""
    return subprocess.run(["sh", "-c", command], cwd=folder, capture_output=True, check=False)


@pytest.mark.skipif(sys.platform == "win32", reason="closes streams as a POSIX shell does")
@pytest.mark.parametrize("closed", [">&-", "2>&-", ">&- 2>&- <&-"])
def test_closed_streams_do_not_get_a_result_files_bytes(tmp_path: Path, closed: str) -> None:
    write_deck(tmp_path, BOUNCE, end_time=0.02)
    done = shell(f"{CLI} run deck.xml -o out {closed}", tmp_path)
    assert done.returncode == 0
    with open_results(tmp_path / "out/deck.h5") as results:
        assert results.status == "finished"
        assert len(results["bodies/2/position"]) == len(results["time"])


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full")
@pytest.mark.parametrize(
    ("line", "code"),
    [
        ("run deck.xml -o out 2>/dev/full", 0),
        ("run deck.xml -o out >/dev/full 2>/dev/full", 5),
        ("run nothing.xml 2>/dev/full", 2),
        ("run --nonsense 2>/dev/full", 2),
        ("check deck.xml >/dev/full 2>/dev/full", 5),
        ("--help >/dev/full", 5),
        ("run --help >/dev/full 2>/dev/full", 5),
    ],
)
def test_streams_on_a_full_disk(tmp_path: Path, line: str, code: int) -> None:
    """Messages that nobody can read end no run; results that cannot be printed are told."""
    write_deck(tmp_path, BOUNCE, end_time=0.02)
    done = shell(f"{CLI} {line}", tmp_path)
    assert done.returncode == code
    assert b"Traceback" not in done.stderr
    if "deck.xml -o" in line:
        with open_results(tmp_path / "out/deck.h5") as results:
            assert results.status == "finished"


@pytest.mark.skipif(sys.platform != "linux", reason="names that are no text")
def test_a_file_name_that_is_no_text(tmp_path: Path) -> None:
    deck = write_deck(tmp_path, BOUNCE, end_time=0.02)
    name = os.fsdecode(b"b\xffll.xml")
    Path(deck).rename(tmp_path / name)
    done = subprocess.run(
        [sys.executable, "-m", "mbsim", "run", name], cwd=tmp_path, capture_output=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert b"b\\xffll.h5" in done.stdout
    with open_results(tmp_path / os.fsdecode(b"b\xffll") / os.fsdecode(b"b\xffll.h5")) as results:
        assert results.attributes["model_file"] == "b\\udcffll.xml"


@pytest.mark.parametrize(
    "arguments",
    [["run", "a\x1b[31m.xml"], ["r\x1bn"], ["run", "--t\x9bl", "1"], ["info", "a\u202eb.h5"]],
)
def test_what_was_typed_does_not_command_the_terminal(tmp_path: Path, arguments: list[str]) -> None:
    done = subprocess.run(
        [sys.executable, "-m", "mbsim", *arguments],
        cwd=tmp_path,
        capture_output=True,
        check=False,
        env={**os.environ, "PYTHONIOENCODING": "utf-8"},
    )
    assert done.returncode in (2, 5)
    said = (done.stderr + done.stdout).decode("utf-8")
    assert "Traceback" not in said
    assert printable(said) == said
    assert "\\x1b" in said or "\\x9b" in said or "\\u202e" in said


def test_printable_keeps_what_can_be_read() -> None:
    kept = "body 2 (Kugel ä, 球)\n\tx = 1 µm²"
    assert printable(kept) == kept
    assert printable("\x07\r\x7f\u2066\udc80") == "\\x07\\x0d\\x7f\\u2066\\x80"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--end-time", "1e300"], "1e+302 output rows"),
        (["--print-interval", "1e-15"], "output rows"),
    ],
)
def test_rows_that_cannot_be_kept_are_refused(
    tmp_path: Path, options: list[str], said: str
) -> None:
    write_deck(tmp_path, BOUNCE, end_time=1.0)
    done = subprocess.run(
        [sys.executable, "-m", "mbsim", "run", "deck.xml", "-o", "out", *options],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert said in done.stderr
    assert "GB are free; give a longer --print-interval" in done.stderr
    assert "Traceback" not in done.stderr
    assert list((tmp_path / "out").iterdir()) == []
