"""Counts in compiled code."""

from __future__ import annotations

from mbsim.core.jitable import jitable


@jitable
def number_of_parts(whole: int, part: int) -> int:
    """Return how many parts of a length begin in a whole: as many as ``range(0, whole, part)`` has.

    `range` raises where the step is 0. What may raise calls Numba's runtime, so that a process that
    finds it compiled imports Numba to load it. Here parts without length are none.
    """
    return (whole + part - 1) // part if part > 0 else 0
