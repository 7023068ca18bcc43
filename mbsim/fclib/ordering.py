"""The order of elimination: fronts of a sparse block matrix, by approximate minimum degree.

Works on the graph of contacts, of which several often have the same neighbours (the corners of one
face) and are eliminated together. The elements of the quotient graph (`minimum_degree`) are the
fronts, and the element that absorbs another is its parent, so no symbolic factorisation follows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable
from mbsim.fclib.minimum_degree import Elements, minimum_degree

if TYPE_CHECKING:
    from mbsim.fclib.problem import Flags, Indices


#: Unknowns of a node from which a front of so many pivots is not joined for being one node larger.
WIDE, JOINED = 6, 4


class Analysis(NamedTuple):
    """Fronts of a pattern in the order of their elimination (`analyse`).

    Nodes of front f are nodes[front_ptr[f]:front_ptr[f + 1]], its `pivots[f]` own ones first;
    `children[f]` fronts that end on the stack before it belong to it; rank[a] is the front of
    node a; its factors begin at factor_ptr[f]. `widest`: unknowns of the largest front; `stacked`:
    numbers on the stack, at most.
    """

    front_ptr: Indices
    nodes: Indices
    pivots: Indices
    children: Indices
    rank: Indices
    factor_ptr: Indices
    widest: int
    stacked: int


@jitable
def indistinguishable(size: int, ptr: Indices, col: Indices, last: Flags) -> Indices:
    """Return every node's representative: the first with the same row of the pattern (and last).

    Columns must rise; `last` says which nodes are to be eliminated last.
    """
    keys = np.empty(size, np.int64)
    for a in range(size):
        key = np.int64(ptr[a + 1] - ptr[a])
        for k in range(ptr[a], ptr[a + 1]):
            c = np.int64(col[k]) + 1
            key += c * c * 40503 + (c * 7919) % 10007
        keys[a] = key
    order = np.argsort(keys)
    leader = np.full(size, -1, np.int32)
    for k in range(size):
        a = order[k]
        if leader[a] >= 0:
            continue
        leader[a] = a
        for j in range(k + 1, size):
            b = order[j]
            if keys[b] != keys[a]:
                break
            if leader[b] >= 0 or ptr[b + 1] - ptr[b] != ptr[a + 1] - ptr[a] or last[a] != last[b]:
                continue
            same = True
            for m in range(ptr[a + 1] - ptr[a]):
                if col[ptr[a] + m] != col[ptr[b] + m]:
                    same = False
                    break
            if same:
                leader[b] = a
    return leader


@jitable
def analyse(size: int, ptr: Indices, col: Indices, d: int) -> Analysis:
    """Return the fronts of a symmetric pattern as `analyse_last` does, no node last."""
    return analyse_last(size, ptr, col, d, np.zeros(size, np.bool_))


@jitable
def analyse_last(size: int, ptr: Indices, col: Indices, d: int, last: Flags) -> Analysis:
    """Return the fronts (`Analysis`) of a symmetric pattern with diagonal.

    Parameters
    ----------
    size, ptr, col
        Nodes and compressed rows, columns rising.
    d
        Unknowns of a node.
    last
        Nodes to eliminate after all others that they are connected with.
    """
    leader = indistinguishable(size, ptr, col, last)
    order, elements, members, weight = minimum_degree(size, ptr, col, leader, last)
    joined, own = _amalgamated(size, order, elements, weight, last, d)
    top, root, first, following = _trees(size, order, elements.parent, joined)
    of_top = np.empty(size, np.int32)
    for a in range(size):
        of_top[a] = top[leader[a]]
    pivot_first, pivot_next = _lists(size, of_top)
    node_first, node_next = _lists(size, leader)
    fronts, entries = 0, 0
    for c in order:
        if joined[c] < 0:
            fronts += 1
            entries += own[c] + elements.mass[c]
    front_ptr = np.zeros(fronts + 1, np.int32)
    nodes = np.empty(entries, np.int32)
    pivots = np.zeros(fronts, np.int32)
    children = np.zeros(fronts, np.int32)
    rank = np.empty(size, np.int32)
    factor_ptr = np.zeros(fronts + 1, np.int64)
    path = np.empty(size + 1, np.int32)
    offspring = np.zeros(size, np.int32)
    freed = np.zeros(size, np.int64)
    done, at, widest = 0, 0, 0
    stack, stacked = 0, 0
    while root >= 0:
        path[0] = root
        depth = 1
        while depth > 0:
            c = path[depth - 1]
            if first[c] >= 0:
                child = first[c]
                first[c] = following[child]
                offspring[c] += 1
                path[depth] = child
                depth += 1
                continue
            depth -= 1
            a = pivot_first[c]
            while a >= 0:
                nodes[at] = a
                rank[a] = done
                at += 1
                a = pivot_next[a]
            pivots[done] = at - front_ptr[done]
            for m in range(elements.begin[c], elements.begin[c] + elements.length[c]):
                a = node_first[members[m]]
                while a >= 0:
                    nodes[at] = a
                    at += 1
                    a = node_next[a]
            front_ptr[done + 1] = at
            children[done] = offspring[c]
            n = d * (at - front_ptr[done])
            np_ = d * pivots[done]
            factor_ptr[done + 1] = factor_ptr[done] + np_ * n + (n - np_) * np_
            widest = max(widest, n)
            update = np.int64(n - np_) * (n - np_)
            stack += update
            stacked = max(stacked, stack)
            stack -= freed[c]
            if depth > 0:
                freed[path[depth - 1]] += update
            done += 1
        root = following[root]
    _sort_members(size, front_ptr, nodes, pivots)
    return Analysis(front_ptr, nodes, pivots, children, rank, factor_ptr, widest, stacked)


@jitable
def _amalgamated(
    size: int, order: Indices, elements: Elements, weight: Indices, last: Flags, d: int
) -> tuple[Indices, Indices]:
    """Join fronts with parents whose fronts are hardly larger.

    With WIDE nodes a chain, whose fronts grow by one node each, must not end in a single front.

    Returns what each one is joined with (-1: nothing), and the pivots of what is left.
    """
    own = weight.copy()
    joined = np.full(size, -1, np.int32)
    for k in range(len(order)):
        c = order[k]
        p = elements.parent[c]
        if p >= 0 and last[c] == last[p]:
            wider = weight[p] + elements.mass[p]
            extra = wider - elements.mass[c]
            one_more = extra <= 1 and (d < WIDE or own[c] <= JOINED)
            if one_more or own[c] * extra <= 4 + wider // 8:
                joined[c] = p
                own[p] += own[c]
    return joined, own


@jitable
def _trees(
    size: int, order: Indices, parent: Indices, joined: Indices
) -> tuple[Indices, int, Indices, Indices]:
    """Return the elimination trees of the fronts that are left.

    These are: the front that each element ends in, the first root, and every front's first child
    and next sibling (-1: none).
    """
    top = np.empty(size, np.int32)
    first = np.full(size, -1, np.int32)
    following = np.full(size, -1, np.int32)
    roots = -1
    for k in range(len(order) - 1, -1, -1):
        c = order[k]
        top[c] = c if joined[c] < 0 else top[joined[c]]
        if joined[c] < 0:
            p = parent[c]
            if p < 0:
                following[c] = roots
                roots = c
            else:
                following[c] = first[top[p]]
                first[top[p]] = c
    return top, roots, first, following


@jitable
def _lists(size: int, key: Indices) -> tuple[Indices, Indices]:
    """Return linked lists of the nodes with equal keys, rising: first of a key, next of a node."""
    first = np.full(size, -1, np.int32)
    following = np.full(size, -1, np.int32)
    for a in range(size - 1, -1, -1):
        following[a] = first[key[a]]
        first[key[a]] = a
    return first, following


@jitable
def _sort_members(size: int, front_ptr: Indices, nodes: Indices, pivots: Indices) -> None:
    """Sort members of fronts in the order of their elimination: children then fit in long runs."""
    position = np.empty(size, np.int32)
    count = 0
    for f in range(len(pivots)):
        for k in range(front_ptr[f], front_ptr[f] + pivots[f]):
            position[nodes[k]] = count
            count += 1
    by_position = np.empty(size, np.int32)
    for a in range(size):
        by_position[position[a]] = a
    for f in range(len(pivots)):
        lo, hi = front_ptr[f] + pivots[f], front_ptr[f + 1]
        for k in range(lo, hi):
            nodes[k] = position[nodes[k]]
        nodes[lo:hi].sort()
        for k in range(lo, hi):
            nodes[k] = by_position[nodes[k]]


@jitable
def elimination_flops(analysis: Analysis, d: int) -> float:
    """Return the floating-point operations of a factorisation with these fronts."""
    front_ptr, pivots = analysis.front_ptr, analysis.pivots
    total = 0.0
    for f in range(len(pivots)):
        n = float(d * (front_ptr[f + 1] - front_ptr[f]))
        own = float(d * pivots[f])
        total += 2.0 * own * n * (n - own) + 2.0 / 3.0 * own**3
    return total


@jitable
def elimination_cost(size: int, ptr: Indices, col: Indices, d: int) -> tuple[float, float]:
    """Return `elimination_flops` of a pattern, and the numbers in its factors."""
    analysis = analyse(size, ptr, col, d)
    return elimination_flops(analysis, d), float(analysis.factor_ptr[-1])
