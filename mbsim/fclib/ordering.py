"""The order of elimination: fronts of a sparse block matrix, by approximate minimum degree.

Works on the graph of contacts, of which several often have the same neighbours (the corners of one
face) and are eliminated together. The quotient graph is that of Amestoy, Davis and Duff (An
approximate minimum degree ordering algorithm, SIAM J. Matrix Anal. 17, 1996); its elements are the
fronts, and the element that absorbs another is its parent, so no symbolic factorisation follows.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from mbsim.core.jitable import jitable

if TYPE_CHECKING:
    from mbsim.fclib.problem import Flags, Indices


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


class _Elements(NamedTuple):
    """Each element's parent (-1: none), whether it is not absorbed yet, and its members.

    These are `count` variables from `begin` on in a list of all members, and `mass` nodes.
    """

    parent: Indices
    alive: Flags
    begin: Indices
    count: Indices
    mass: Indices


class _Buckets(NamedTuple):
    """Variables of equal degree, doubly linked (-1: none)."""

    first: Indices
    following: Indices
    previous: Indices


@jitable
def indistinguishable(size, ptr, col, last):
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
def _grown(array, size):
    """Return an array with room for `size` entries, its contents kept."""
    if size <= len(array):
        return array
    bigger = np.empty(2 * size, array.dtype)
    bigger[: len(array)] = array
    return bigger


@jitable
def _quotient_graph(size, ptr, col, leader):
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
def minimum_degree(size, ptr, col, leader, last):
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
    elements = _Elements(
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
def _make_element(graph, elements, members, used, p, step, in_pivot):
    """Make pivot p an element that absorbs its own; return the members of all, and how many.

    Its members are its variables and those of its elements, which get `step` in in_pivot.
    """
    weight, start, adjacent = graph.weight, graph.start, graph.adjacent
    begin, count = elements.begin, elements.count
    in_pivot[p] = step
    after = start[p] + graph.elements[p]
    room = graph.variables[p]
    for k in range(start[p], after):
        room += count[adjacent[k]]
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
        for m in range(begin[e], begin[e] + count[e]):
            b = members[m]
            if in_pivot[b] != step:
                in_pivot[b] = step
                members[used] = b
                used += 1
                total += weight[b]
    count[p] = used - begin[p]
    elements.mass[p] = total
    elements.alive[p] = True
    return members, used


@jitable
def _count_outside(graph, elements, members, p, step, outside, stamp):
    """Write how many nodes of each element near pivot p are no members of p."""
    for m in range(elements.begin[p], elements.begin[p] + elements.count[p]):
        b = members[m]
        for k in range(graph.start[b], graph.start[b] + graph.elements[b]):
            e = graph.adjacent[k]
            if elements.alive[e]:
                if stamp[e] != step:
                    stamp[e] = step
                    outside[e] = elements.mass[e]
                outside[e] -= graph.weight[b]


@jitable
def _update_neighbours(graph, elements, b, p, step, in_pivot, outside, kept):
    """Replace by pivot p what variable b reaches through it; return a bound of b's degree.

    Elements without nodes outside p are absorbed by it. `kept` is room for a list.
    """
    start, adjacent = graph.start, graph.adjacent
    after = start[b] + graph.elements[b]
    bound = elements.mass[p] - graph.weight[b]
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
def _put(buckets, degree, a):
    """Put variable `a` into the bucket of a degree."""
    first, following, previous = buckets
    head = first[degree]
    following[a] = head
    previous[a] = -1
    if head >= 0:
        previous[head] = a
    first[degree] = a


@jitable
def _take(buckets, degree, a):
    """Take variable `a` out of the bucket of its degree."""
    first, following, previous = buckets
    before, after = previous[a], following[a]
    if before >= 0:
        following[before] = after
    else:
        first[degree] = after
    if after >= 0:
        previous[after] = before


@jitable
def analyse(size, ptr, col, d):
    """Return the fronts of a symmetric pattern as `analyse_last` does, no node last."""
    return analyse_last(size, ptr, col, d, np.zeros(size, np.bool_))


@jitable
def analyse_last(size, ptr, col, d, last):
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
    joined, own = _amalgamated(size, order, elements, weight, last)
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
            for m in range(elements.begin[c], elements.begin[c] + elements.count[c]):
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
def _amalgamated(size, order, elements, weight, last):
    """Join fronts with parents whose fronts are hardly larger.

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
            if extra <= 1 or own[c] * extra <= 4 + wider // 8:
                joined[c] = p
                own[p] += own[c]
    return joined, own


@jitable
def _trees(size, order, parent, joined):
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
def _lists(size, key):
    """Return linked lists of the nodes with equal keys, rising: first of a key, next of a node."""
    first = np.full(size, -1, np.int32)
    following = np.full(size, -1, np.int32)
    for a in range(size - 1, -1, -1):
        following[a] = first[key[a]]
        first[key[a]] = a
    return first, following


@jitable
def _sort_members(size, front_ptr, nodes, pivots):
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
def elimination_flops(analysis, d):
    """Return the floating-point operations of a factorisation with these fronts."""
    front_ptr, pivots = analysis.front_ptr, analysis.pivots
    total = 0.0
    for f in range(len(pivots)):
        n = float(d * (front_ptr[f + 1] - front_ptr[f]))
        own = float(d * pivots[f])
        total += 2.0 * own * n * (n - own) + 2.0 / 3.0 * own**3
    return total
