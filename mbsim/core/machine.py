"""How much memory there is."""

from __future__ import annotations

import os

_MEMINFO = "/proc/meminfo"


def first_bytes(path: str) -> bytes:
    """Return the first 4096 bytes of a file, which is all that the system says of itself in one."""
    opened = os.open(path, os.O_RDONLY)
    try:
        return os.read(opened, 4096)
    finally:
        os.close(opened)


def free_memory() -> int | None:
    """Return how many bytes of memory a process may still take, None where nobody says.

    On Linux what the kernel calls available: files that it only remembers (often most of the
    memory) give way. Elsewhere the pages that nobody uses.
    """
    try:
        _, found, rest = first_bytes(_MEMINFO).partition(b"MemAvailable:")
        if found:
            return int(rest.split(None, 1)[0]) * 1024
    except (OSError, ValueError, IndexError):
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None
