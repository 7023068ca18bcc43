"""How much memory there is."""

from __future__ import annotations

import os


def free_memory() -> int | None:
    """Return how many bytes of memory are free, None where the system does not say."""
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None
