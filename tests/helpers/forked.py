"""Many cases in a forked process: what ends it, or does not end, is a find and not the end."""

from __future__ import annotations

import os
import pickle
import select
import signal
import struct
import time
import traceback
from collections.abc import Callable
from typing import NamedTuple

#: How many times as long as it may work a process may be waited for.
_PATIENCE = 12


class Find(NamedTuple):
    """A case that went wrong, and how."""

    case: int
    what: str


def finds(do: Callable[[int], None], cases: range, seconds: float = 5.0) -> list[Find]:
    """Return the cases that raise, kill the process, or take longer than that.

    Another process takes over after one that had to be killed.
    """
    found: list[Find] = []
    while cases:
        reading, writing = os.pipe()
        child = os.fork()
        if child == 0:
            os.close(reading)
            _work(do, cases, writing)
        os.close(writing)
        done, find = _watch(reading, child, cases, seconds)
        os.close(reading)
        if find is not None:
            os.kill(child, signal.SIGKILL)
            found.append(find)
        found += done.said
        os.waitpid(child, 0)
        cases = cases[done.count :]
    return found


class _Done(NamedTuple):
    count: int
    said: list[Find]


def _work(do: Callable[[int], None], cases: range, writing: int) -> None:
    """Do the cases, tell what each raised, and leave."""
    for case in cases:
        said = ""
        try:
            do(case)
        except BaseException:
            said = traceback.format_exc()
        packed = pickle.dumps((case, said))
        os.write(writing, struct.pack("<I", len(packed)) + packed)
    os._exit(0)


def _used(child: int) -> float:
    """Return the processor time of a process [s], where the system says it, else the time."""
    try:
        with open(f"/proc/{child}/stat", encoding="ascii") as file:
            fields = file.read().rpartition(")")[2].split()
    except OSError:
        return time.monotonic()
    return sum(map(int, fields[11:15])) / os.sysconf("SC_CLK_TCK")


def _waits(reading: int, child: int, seconds: float) -> bool:
    """Return whether a process says something before it has worked for so long.

    Of a machine with other work a process may get little; one that waits for ever hangs too.
    """
    began = _used(child)
    for _ in range(_PATIENCE):
        if select.select([reading], [], [], seconds)[0]:
            return True
        if _used(child) - began > seconds:
            return False
    return False


def _watch(reading: int, child: int, cases: range, seconds: float) -> tuple[_Done, Find | None]:
    """Return how many cases were done, what they said, and what ended the rest."""
    said: list[Find] = []
    for count, case in enumerate(cases):
        if not _waits(reading, child, seconds):
            return _Done(count + 1, said), Find(case, f"hangs for more than {seconds} s")
        head = os.read(reading, 4)
        if len(head) < 4:
            return _Done(count + 1, said), Find(case, "ends the process")
        (size,) = struct.unpack("<I", head)
        packed = b""
        while len(packed) < size:
            packed += os.read(reading, size - len(packed))
        text = pickle.loads(packed)[1]
        if text:
            said.append(Find(case, text))
    return _Done(len(cases), said), None
