"""Approximate minimum degree: the order in which a graph's nodes are eliminated.

The quotient graph is that of Amestoy, Davis and Duff (An approximate minimum degree ordering
algorithm, SIAM J. Matrix Anal. 17, 1996).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable

if TYPE_CHECKING:
    from mbsim.fclib.problem import Flags, Indices


class _Graph(NamedTuple):
    """The quotient graph of variables (representatives) and elements (eliminated ones).

    Neighbours of variable a are adjacent[start[a]:], elements[a] elements and then variables[a]
    variables; weight[a] nodes are indistinguishable from it.
    """

    weight: Indices
    start: Indices
    elements: Indices
    variables: Indices
    adjacent: Indices
    degree: Indices


class Elements(NamedTuple):
    """Each element's parent (-1: none), whether it is not absorbed yet, and its members.

    These are `length` variables from `begin` on in a list of all members, and `mass` nodes.
    """

    parent: Indices
    alive: Flags
    begin: Indices
    length: Indices
    mass: Indices


class _Buckets(NamedTuple):
    """Variables of equal degree, doubly linked (-1: none)."""

    first: Indices
    following: Indices
    previous: Indices


@jitable
def _grown(array: Indices, size: int) -> Indices:
    """Return an array with room for `size` entries, its contents kept."""
    if size <= len(array):
        return array
    bigger = np.empty(2 * size, array.dtype)
    bigger[: len(array)] = array
    return bigger


@jitable
def _quotient_graph(size: int, ptr: Indices, col: Indices, leader: Indices) -> tuple[_Graph, int]:
    """Return the graph of the representatives alone, and how many these are."""
    weight = np.zeros(size, np.int32)
    for a in range(size):
        weight[leader[a]] += 1
    start = np.zeros(size, np.int32)
    variables = np.zeros(size, np.int32)
    adjacent = np.empty(max(ptr[size], 1), np.int32)
    degree = np.zeros(size, np.int32)
    at = 0
    leaders = 0
    for a in range(size):
        start[a] = at
        if leader[a] != a:
            continue
        leaders += 1
        for k in range(ptr[a], ptr[a + 1]):
            b = col[k]
            if b != a and leader[b] == b:
                adjacent[at] = b
                at += 1
                degree[a] += weight[b]
        variables[a] = at - start[a]
    elements = np.zeros(size, np.int32)
    return _Graph(weight, start, elements, variables, adjacent, degree), leaders


@jitable
def minimum_degree(
    size: int, ptr: Indices, col: Indices, leader: Indices, last: Flags
) -> tuple[Indices, Elements, Indices, Indices]:
    """Eliminate the representatives' graph, `last` nodes last; every pivot becomes an element.

    Returns the pivots in order, the elements, their members (representatives), and the weight of
    each representative.
    """
    graph, leaders = _quotient_graph(size, ptr, col, leader)
    weight, degree = graph.weight, graph.degree
    buckets = _Buckets(
        np.full(2 * size + 1, -1, np.int32),
        np.full(size, -1, np.int32),
        np.full(size, -1, np.int32),
    )
    for a in range(size - 1, -1, -1):
        if leader[a] == a:
            degree[a] += size if last[a] else 0
            _put(buckets, degree[a], a)
    elements = Elements(
        np.full(size, -1, np.int32),
        np.zeros(size, np.bool_),
        np.zeros(size, np.int64),
        np.zeros(size, np.int32),
        np.zeros(size, np.int32),
    )
    pivots = np.empty(leaders, np.int32)
    members = np.empty(4 * max(ptr[size], 1), np.int32)
    used = 0
    in_pivot = np.full(size, -1, np.int32)
    outside = np.zeros(size, np.int32)
    stamp = np.full(size, -1, np.int32)
    kept = np.empty(size, np.int32)
    left = size
    lowest = 0
    for step in range(leaders):
        while buckets.first[lowest] < 0:
            lowest += 1
        p = buckets.first[lowest]
        _take(buckets, degree[p], p)
        pivots[step] = p
        left -= weight[p]
        members, used = _make_element(graph, elements, members, used, p, step, in_pivot)
        _count_outside(graph, elements, members, p, step, outside, stamp)
        for m in range(elements.begin[p], used):
            b = members[m]
            bound = _update_neighbours(graph, elements, b, p, step, in_pivot, outside, kept)
            _take(buckets, degree[b], b)
            offset = size if last[b] else 0
            grown = degree[b] - offset + elements.mass[p] - weight[b]
            degree[b] = max(min(bound, grown, left - weight[b]), 0) + offset
            _put(buckets, degree[b], b)
            lowest = min(lowest, degree[b])
    return pivots, elements, members, weight


@jitable
def _make_element(
    graph: _Graph,
    elements: Elements,
    members: Indices,
    used: int,
    p: int,
    step: int,
    in_pivot: Indices,
) -> tuple[Indices, int]:
    """Make pivot p an element that absorbs its own; return the members of all, and how many.

    Its members are its variables and those of its elements, which get `step` in in_pivot.
    """
    weight, start, adjacent = graph.weight, graph.start, graph.adjacent
    begin, length = elements.begin, elements.length
    in_pivot[p] = step
    after = start[p] + graph.elements[p]
    room = graph.variables[p]
    for k in range(start[p], after):
        room += length[adjacent[k]]
    members = _grown(members, used + room)
    begin[p] = used
    total = 0
    for k in range(after, after + graph.variables[p]):
        b = adjacent[k]
        if in_pivot[b] != step:
            in_pivot[b] = step
            members[used] = b
            used += 1
            total += weight[b]
    for k in range(start[p], after):
        e = adjacent[k]
        elements.parent[e] = p
        elements.alive[e] = False
        for m in range(begin[e], begin[e] + length[e]):
            b = members[m]
            if in_pivot[b] != step:
                in_pivot[b] = step
                members[used] = b
                used += 1
                total += weight[b]
    length[p] = used - begin[p]
    elements.mass[p] = total
    elements.alive[p] = True
    return members, used


@jitable
def _count_outside(
    graph: _Graph,
    elements: Elements,
    members: Indices,
    p: int,
    step: int,
    outside: Indices,
    stamp: Indices,
) -> None:
    """Write how many nodes of each element near pivot p are no members of p."""
    for m in range(elements.begin[p], elements.begin[p] + elements.length[p]):
        b = members[m]
        for k in range(graph.start[b], graph.start[b] + graph.elements[b]):
            e = graph.adjacent[k]
            if elements.alive[e]:
                if stamp[e] != step:
                    stamp[e] = step
                    outside[e] = elements.mass[e]
                outside[e] -= graph.weight[b]


@jitable
def _update_neighbours(
    graph: _Graph,
    elements: Elements,
    b: int,
    p: int,
    step: int,
    in_pivot: Indices,
    outside: Indices,
    kept: Indices,
) -> int:
    """Replace by pivot p what variable b reaches through it; return a bound of b's degree.

    Elements without nodes outside p are absorbed by it. `kept` is room for a list.
    """
    start, adjacent = graph.start, graph.adjacent
    after = start[b] + graph.elements[b]
    bound: int = elements.mass[p] - graph.weight[b]
    kept[0] = p
    new = 1
    for k in range(start[b], after):
        e = adjacent[k]
        if elements.alive[e]:
            if outside[e] > 0:
                kept[new] = e
                new += 1
                bound += outside[e]
            elif e != p:
                elements.parent[e] = p
                elements.alive[e] = False
    new_elements = new
    for k in range(after, after + graph.variables[b]):
        v = adjacent[k]
        if in_pivot[v] != step:
            kept[new] = v
            new += 1
            bound += graph.weight[v]
    for k in range(new):
        adjacent[start[b] + k] = kept[k]
    graph.elements[b] = new_elements
    graph.variables[b] = new - new_elements
    return bound


@jitable
def _put(buckets: _Buckets, degree: int, a: int) -> None:
    """Put variable `a` into the bucket of a degree."""
    first, following, previous = buckets
    head = first[degree]
    following[a] = head
    previous[a] = -1
    if head >= 0:
        previous[head] = a
    first[degree] = a


@jitable
def _take(buckets: _Buckets, degree: int, a: int) -> None:
    """Take variable `a` out of the bucket of its degree."""
    first, following, previous = buckets
    before, after = previous[a], following[a]
    if before >= 0:
        following[before] = after
    else:
        first[degree] = after
    if after >= 0:
        previous[after] = before
