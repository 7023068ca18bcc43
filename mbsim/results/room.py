"""Whether there is room for the rows of a run, before it begins."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from mbsim.core.machine import free_memory
from mbsim.errors import ModelError

#: Memory that an output time takes while its rows are not there yet [bytes].
TIME_BYTES = 32
#: So many bytes are free, or nothing would run here.
SURELY_FREE = 1 << 24
#: What a row of a request takes at most [bytes]; signals take no number of a row more than twice.
REQUEST_BYTES = 8 * 8


def check(
    rows: float,
    at_most: int,
    size_of: Callable[[], int],
    disk: tuple[Path | None, int | None] | None,
) -> None:
    """Raise `ModelError` where so many output rows cannot be kept.

    Parameters
    ----------
    rows : float
        Of a mistyped end time there may be more than integers count.
    at_most : int
        What a row surely does not exceed [bytes].
    size_of : callable
        Returns what it takes, which is asked for only where that matters.
    disk : (Path, int or None), optional
        The folder where they go, and the bytes that are free there; else they stay in memory.
    """
    if disk is None and rows * at_most < SURELY_FREE:
        return
    memory = free_memory()
    if disk is None and memory is not None and rows * at_most < memory:
        return
    size = size_of()
    place, free = ("in memory", memory) if disk is None else (f"in {disk[0]}", disk[1])
    if memory is not None and rows * TIME_BYTES > memory:
        # the times themselves are kept in memory
        size, place, free = TIME_BYTES, "in memory", memory
    if free is not None and rows * size > free:
        raise ModelError(
            f"{rows:.9g} output rows of {size} bytes would take {rows * size / 1e9:.3g} GB "
            f"{place}, where {max(free, 0) / 1e9:.3g} GB are free; give a longer "
            "--print-interval, an earlier --end-time, or --signals"
        )
