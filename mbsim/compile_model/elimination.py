"""The order in which a sparse symmetric matrix is eliminated, and what its factor fills in."""

from __future__ import annotations

import heapq
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mbsim.arrays.graph import Pattern

Ints = np.ndarray[Any, np.dtype[np.int64]]

#: Of a factor that changes blocks more often than that nothing is to be gained.
MOST_UPDATES = 500_000


@dataclass
class Order:
    """An order of elimination, and for each step what is still coupled with what is eliminated."""

    order: list[int] = field(default_factory=list)
    below: list[list[int]] = field(default_factory=list)

    @property
    def place(self) -> dict[int, int]:
        """When each is eliminated."""
        return {k: at for at, k in enumerate(self.order)}


def eliminate(
    near: Sequence[set[int]], rows: Sequence[int], after: Sequence[set[int]] | None = None
) -> Order | None:
    """Return an order in which little is filled in; None where a factor changes too many blocks.

    Of those that may be next the one with the fewest rows to couple is taken (minimum degree).

    Parameters
    ----------
    near : sequence of sets
        For each node those that it is coupled with.
    rows : sequence of int
        How many rows each has.
    after : sequence of sets, optional
        For each node those that come before it.
    """
    n = len(near)
    beside = [set(those) for those in near]
    waits = [set(those) for those in after] if after is not None else [set[int]() for _ in near]
    leads: list[list[int]] = [[] for _ in near]
    for k, those in enumerate(waits):
        for other in those:
            leads[other].append(k)
    done, found, updates = [False] * n, Order(), 0

    def degree(k: int) -> int:
        return sum(rows[other] for other in beside[k])

    heap = [(degree(k), k) for k in range(n) if not waits[k]]
    heapq.heapify(heap)
    while heap:
        size, k = heapq.heappop(heap)
        if done[k]:
            continue
        if size != degree(k):
            heapq.heappush(heap, (degree(k), k))
            continue
        done[k] = True
        updates += len(beside[k]) * (len(beside[k]) + 1) // 2
        if updates > MOST_UPDATES:
            return None
        found.order.append(k)
        found.below.append(sorted(beside[k]))
        for other in beside[k]:
            beside[other] |= beside[k]
            beside[other] -= {k, other}
            if not waits[other]:
                heapq.heappush(heap, (degree(other), other))
        for other in leads[k]:
            waits[other].discard(k)
            if not waits[other]:
                heapq.heappush(heap, (degree(other), other))
    return found


def ints(values: Sequence[int] | Sequence[Sequence[int]], *shape: int) -> Ints:
    """Return whole numbers as an array."""
    return np.array(values, dtype=np.int64).reshape(*shape or (-1,))


def pattern(order: Order, meets: Iterable[tuple[int, int, int, int]]) -> Pattern:
    """Return the pattern of a factor.

    Parameters
    ----------
    order : Order
    meets : iterable of tuples
        What adds to blocks: two places in the order, and the incidence of each.
    """
    n, place = len(order.order), order.place
    first, row = [0], list[int]()
    block: dict[tuple[int, int], int] = {(k, k): k for k in range(n)}
    for column, below in enumerate(order.below):
        for at in sorted(place[k] for k in below):
            block[at, column] = n + len(row)
            row.append(at)
        first.append(len(row))
    target = []
    for column in range(n):
        those = row[first[column] : first[column + 1]]
        target += [block[i, j] for p, i in enumerate(those) for j in those[: p + 1]]
    sums = []
    for i, j, a, b in meets:
        sums.append((a, b, block[i, j]) if i >= j else (b, a, block[j, i]))
    return Pattern(
        first=ints(first),
        row=ints(row),
        target=ints(target),
        meets=ints(sums, -1, 3),
        block=np.zeros((n + len(row), 6, 6)),
        size=ints([0] * n),
        x=np.zeros((n, 6)),
    )


def products(order: Order, rows: Sequence[int]) -> float:
    """Return how many products of numbers a factor takes."""
    total = 0.0
    for k, below in zip(order.order, order.below, strict=True):
        m, beside = rows[k], sum(rows[other] for other in below)
        total += m * (m * m / 6.0 + m * beside / 2.0 + beside * beside / 2.0)
    return total


def coupled(groups: Sequence[Sequence[int]], n: int) -> list[set[int]]:
    """Return for each of n nodes those that share a group with it."""
    near: list[set[int]] = [set() for _ in range(n)]
    for group in groups:
        for k in group:
            near[k].update(other for other in group if other != k)
    return near
