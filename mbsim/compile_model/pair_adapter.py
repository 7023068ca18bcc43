"""Pair functions as C functions of plain pointers.

What these close over is part of the key of their compiled code, so it is functions of the project
and numbers alone: an intrinsic among them would have another key in every process.
"""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any

from mbsim.core.address import table_at, vector_at
from mbsim.core.arrays import Pointer
from mbsim.core.signature import INT, POINTER
from mbsim.geometry.catalog import POINT, REGION_ROWS, SIZE
from mbsim.geometry.motion import MOTION
from mbsim.geometry.region import sum_points

SIGNATURE = INT(POINTER, POINTER, POINTER, POINTER, POINTER)


@functools.cache
def adapt_pair(points: Callable[..., int], slots: int) -> Any:
    """Return a pair function as a C function of plain pointers."""

    def entry(
        frame_i: Pointer, size_i: Pointer, frame_j: Pointer, size_j: Pointer, out: Pointer
    ) -> int:
        return points(
            vector_at(frame_i, 12),
            vector_at(size_i, SIZE),
            vector_at(frame_j, 12),
            vector_at(size_j, SIZE),
            table_at(out, slots, POINT),
        )

    return entry


@functools.cache
def adapt_region(region: Callable[..., tuple[int, float]], whole: float, slots: int) -> Any:
    """Return a pair function with area as a C function that writes its one incident ahead."""

    def entry(
        frame_i: Pointer, size_i: Pointer, frame_j: Pointer, size_j: Pointer, out: Pointer
    ) -> int:
        rows = table_at(out, slots, POINT)
        count, area = region(
            vector_at(frame_i, 12),
            vector_at(size_i, SIZE),
            vector_at(frame_j, 12),
            vector_at(size_j, SIZE),
            rows[REGION_ROWS:],
        )
        count += REGION_ROWS
        sum_points(rows[:count], whole, area)
        return count

    return entry


@functools.cache
def adapt_motion_bound(bound: Callable[..., int]) -> Any:
    """Return a motion bound as a C function of plain pointers."""

    def entry(
        frame_i: Pointer, size_i: Pointer, frame_j: Pointer, size_j: Pointer, motion: Pointer
    ) -> int:
        return bound(
            vector_at(frame_i, 12),
            vector_at(size_i, SIZE),
            vector_at(frame_j, 12),
            vector_at(size_j, SIZE),
            vector_at(motion, MOTION),
        )

    return entry
