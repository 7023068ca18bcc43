"""Runs of the command line that are ended from outside: at an instant, or at a change of a file."""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import signal
import struct
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from mbsim.results.reading import open_results

#: Of <sys/inotify.h>: names that come and go, and bytes that change.
_CAME = 0x80
_NAMES, _BYTES = 0x40 | _CAME | 0x100 | 0x200, 0x2


def command(deck: str, options: Sequence[str], out: Path, *more: str) -> list[str]:
    """Return the command line of a run."""
    base = [sys.executable, "-m", "mbsim", "run", deck, "-o", str(out), "--progress", "off"]
    return [*base, *options, *more]


class Changes:
    """Counts what happens to the files of a folder, as Linux tells it."""

    def __init__(self, folder: Path, with_bytes: bool) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self._libc = ctypes.CDLL(None, use_errno=True)
        self.handle = self._libc.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
        mask = _NAMES | (_BYTES if with_bytes else 0)
        assert self._libc.inotify_add_watch(self.handle, os.fsencode(folder), mask) >= 0
        self.count = 0
        self.published = False  # whether a result file came

    def wait(self, seconds: float) -> None:
        """Wait for changes, at most so long, and count them."""
        if select.select([self.handle], [], [], seconds)[0]:
            data, at = os.read(self.handle, 1 << 16), 0
            while at < len(data):
                _, mask, _, size = struct.unpack_from("iIII", data, at)
                name = data[at + 16 : at + 16 + size].rstrip(b"\0")
                at += 16 + size
                self.count += 1
                if mask & _CAME and name.endswith(b".h5") and not name.startswith(b"."):
                    self.published = True

    def close(self) -> None:
        os.close(self.handle)


def run_until(
    line: list[str],
    after: float = 900.0,
    number: int = signal.SIGKILL,
    changes: Changes | None = None,
    at: int | None = None,
) -> tuple[int, str]:
    """Run a command, sent a signal in time; return its code and messages.

    The time is `after` so many seconds, of `changes` at so many, or so long after the first result.
    """
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        while changes is not None and process.poll() is None:
            if changes.count >= at if at is not None else changes.published:
                break
            changes.wait(0.2)
        try:
            soon = changes is not None and at is not None and process.poll() is None
            _, said = process.communicate(timeout=0.0 if soon else after)
        except subprocess.TimeoutExpired:
            process.send_signal(number)
            _, said = process.communicate(timeout=900.0)
    return process.returncode, said.decode()


def run_beside(line: list[str], out: Path, ballast: Path, left: int) -> tuple[int, str]:
    """Run a command; after its first result another file leaves so many bytes of the disk."""
    changes = Changes(out, with_bytes=False)
    with subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE) as process:
        while process.poll() is None and not changes.published:
            changes.wait(0.2)
        found = os.statvfs(out)
        with ballast.open("wb") as file:
            size = found.f_bavail * found.f_frsize - left
            with contextlib.suppress(OSError):  # the run takes some of it meanwhile
                for at in range(0, size, 1 << 16):
                    os.posix_fallocate(file.fileno(), at, 1 << 16)
        _, said = process.communicate(timeout=900.0)
    changes.close()
    return process.returncode, said.decode()


def visible(folder: Path) -> list[str]:
    """Return the names of the files that a user sees."""
    return sorted(path.name for path in folder.iterdir() if not path.name.startswith("."))


def hidden(folder: Path) -> list[str]:
    """Return the names of the others."""
    return sorted(path.name for path in folder.iterdir() if path.name.startswith("."))


def looked_at(folder: Path) -> str:
    """Read all of a folder's result file, if there is one, and return its status."""
    for file in folder.glob("*.h5"):
        with open_results(file) as results:
            rows = len(results["time"])
            for name in results.signals():
                assert len(results[name]) == rows, name
            assert results.status != "finished" or len(visible(folder)) >= 2
            return results.status
    return ""


def can_go_on(folder: Path) -> bool:
    """Return whether a folder's result file has a checkpoint."""
    for file in folder.glob("*.h5"):
        with open_results(file) as results:
            return results.has_checkpoint
    return False


def same(one: Path, other: Path) -> None:
    """Compare all signals and the .csv of two finished results, bit for bit."""
    name = next(one.glob("*.h5")).name
    with open_results(one / name) as a, open_results(other / name) as b:
        assert a.status == b.status == "finished"
        assert a.keys() == b.keys()
        for key in a.keys():
            np.testing.assert_array_equal(a[key], b[key], err_msg=key)
        assert a.stats["steps"] == b.stats["steps"]
    csvs = [sorted(folder.glob("*.csv")) for folder in (one, other)]
    assert [path.name for path in csvs[0]] == [path.name for path in csvs[1]]
    for left, right in zip(*csvs, strict=True):
        assert left.read_bytes() == right.read_bytes()


@contextlib.contextmanager
def small_disk(folder: Path, megabytes: float) -> Iterator[Path]:
    """Yield a folder on a disk of its own, of that size; needs root on Linux."""
    folder.mkdir()
    size = f"size={int(megabytes * 1024)}k"
    subprocess.run(["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(folder)], check=True)
    try:
        yield folder
    finally:
        subprocess.run(["umount", "-l", str(folder)], check=True)


def resized(folder: Path, options: str) -> None:
    """Mount a `small_disk` anew with other options."""
    subprocess.run(["mount", "-o", f"remount,{options}", str(folder)], check=True)
