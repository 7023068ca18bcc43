"""The order of elimination: fronts of a sparse block matrix, by approximate minimum degree.

Works on the graph of contacts, of which several often have the same neighbours (the corners of one
face) and are eliminated together. The quotient graph is that of Amestoy, Davis and Duff (An
approximate minimum degree ordering algorithm, SIAM J. Matrix Anal. 17, 1996); its elements are the
fronts, and the element that absorbs another is its parent, so no symbolic factorisation follows.
"""

from __future__ import annotations

import numpy as np

from mbsim.core.jitable import jitable


@jitable
def twins(size, ptr, col, late):
    """Return for every node the first with the same row of the pattern (columns rising) and rank.

    `late` says which nodes are to be eliminated last.
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
            if leader[b] >= 0 or ptr[b + 1] - ptr[b] != ptr[a + 1] - ptr[a] or late[a] != late[b]:
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
def minimum_degree(size, ptr, col, leader, late):
    """Eliminate the leaders' graph, late nodes last; every pivot becomes an element.

    Returns the pivots in order, each element's parent (-1: none), where its members begin and how
    many they are, the members (leaders), and the weight (number of twins) of each leader.
    """
    weight = np.zeros(size, np.int32)
    for a in range(size):
        weight[leader[a]] += 1
    start = np.zeros(size, np.int32)
    elements = np.zeros(size, np.int32)
    variables = np.zeros(size, np.int32)
    graph = np.empty(max(ptr[size], 1), np.int32)
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
                graph[at] = b
                at += 1
                degree[a] += weight[b]
        variables[a] = at - start[a]
    # buckets of equal degree, doubly linked
    first = np.full(2 * size + 1, -1, np.int32)
    following = np.full(size, -1, np.int32)
    previous = np.full(size, -1, np.int32)
    for a in range(size - 1, -1, -1):
        if leader[a] == a:
            degree[a] += size if late[a] else 0
            _put(first, following, previous, degree[a], a)
    pivots = np.empty(leaders, np.int32)
    parent = np.full(size, -1, np.int32)
    open_element = np.zeros(size, np.bool_)
    begin = np.zeros(size, np.int64)
    count = np.zeros(size, np.int32)
    mass = np.zeros(size, np.int32)
    members = np.empty(4 * max(ptr[size], 1), np.int32)
    used = 0
    in_pivot = np.full(size, -1, np.int32)
    outside = np.zeros(size, np.int32)
    stamp = np.full(size, -1, np.int32)
    kept = np.empty(size, np.int32)
    left = size
    lowest = 0
    for step in range(leaders):
        while first[lowest] < 0:
            lowest += 1
        p = first[lowest]
        _take(first, following, previous, degree[p], p)
        pivots[step] = p
        left -= weight[p]
        in_pivot[p] = step
        # the pivot's members: its variables and those of its elements, which it absorbs
        room = variables[p]
        for k in range(start[p], start[p] + elements[p]):
            room += count[graph[k]]
        members = _grown(members, used + room)
        begin[p] = used
        total = 0
        for k in range(start[p] + elements[p], start[p] + elements[p] + variables[p]):
            b = graph[k]
            if in_pivot[b] != step:
                in_pivot[b] = step
                members[used] = b
                used += 1
                total += weight[b]
        for k in range(start[p], start[p] + elements[p]):
            e = graph[k]
            parent[e] = p
            open_element[e] = False
            for m in range(begin[e], begin[e] + count[e]):
                b = members[m]
                if in_pivot[b] != step:
                    in_pivot[b] = step
                    members[used] = b
                    used += 1
                    total += weight[b]
        count[p] = used - begin[p]
        mass[p] = total
        open_element[p] = True
        for m in range(begin[p], used):
            b = members[m]
            for k in range(start[b], start[b] + elements[b]):
                e = graph[k]
                if open_element[e]:
                    if stamp[e] != step:
                        stamp[e] = step
                        outside[e] = mass[e]
                    outside[e] -= weight[b]
        for m in range(begin[p], used):
            b = members[m]
            new = 0
            degree_b = total - weight[b]
            kept[new] = p
            new += 1
            for k in range(start[b], start[b] + elements[b]):
                e = graph[k]
                if open_element[e]:
                    if outside[e] > 0:
                        kept[new] = e
                        new += 1
                        degree_b += outside[e]
                    elif e != p:
                        parent[e] = p
                        open_element[e] = False
            new_elements = new
            for k in range(start[b] + elements[b], start[b] + elements[b] + variables[b]):
                v = graph[k]
                if in_pivot[v] != step:
                    kept[new] = v
                    new += 1
                    degree_b += weight[v]
            for k in range(new):
                graph[start[b] + k] = kept[k]
            elements[b] = new_elements
            variables[b] = new - new_elements
            _take(first, following, previous, degree[b], b)
            offset = size if late[b] else 0
            degree_b = min(degree_b, degree[b] - offset + total - weight[b], left - weight[b])
            degree[b] = max(degree_b, 0) + offset
            _put(first, following, previous, degree[b], b)
            lowest = min(lowest, degree[b])
    return pivots, parent, begin, count, mass, members, weight


@jitable
def _put(first, following, previous, bucket, a):
    """Put node `a` into a bucket."""
    head = first[bucket]
    following[a] = head
    previous[a] = -1
    if head >= 0:
        previous[head] = a
    first[bucket] = a


@jitable
def _take(first, following, previous, bucket, a):
    """Take node `a` out of its bucket."""
    before, after = previous[a], following[a]
    if before >= 0:
        following[before] = after
    else:
        first[bucket] = after
    if after >= 0:
        previous[after] = before


@jitable
def analyse(size, ptr, col, d):
    """Return the fronts of a symmetric pattern as `analyse_late` does, no node last."""
    return analyse_late(size, ptr, col, d, np.zeros(size, np.bool_))


@jitable
def analyse_late(size, ptr, col, d, late):
    """Return the fronts of a symmetric pattern with diagonal, in the order of their elimination.

    Parameters
    ----------
    size, ptr, col
        Nodes and compressed rows, columns rising.
    d
        Unknowns of a node.
    late
        Nodes to eliminate after all others that they are connected with.

    Returns
    -------
    front_ptr, nodes, pivots, children, rank, factor_ptr, room
        Nodes of front f are nodes[front_ptr[f]:front_ptr[f + 1]], its `pivots[f]` own ones first;
        `children[f]` fronts that end on the stack before it belong to it; rank[a] is the front of
        node a; its factors begin at factor_ptr[f]. room: largest front, numbers on the stack.
    """
    leader = twins(size, ptr, col, late)
    order, parent, begin, count, mass, members, weight = minimum_degree(
        size, ptr, col, leader, late
    )
    # fronts whose parent's front is hardly larger become part of it
    own = weight.copy()
    joined = np.full(size, -1, np.int32)
    for k in range(len(order)):
        c = order[k]
        p = parent[c]
        if p >= 0 and late[c] == late[p]:
            wider = weight[p] + mass[p]
            extra = wider - mass[c]
            if extra <= 1 or own[c] * extra <= 4 + wider // 8:
                joined[c] = p
                own[p] += own[c]
    # trees of what is left, children first
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
    twin_first = np.full(size, -1, np.int32)
    twin_next = np.full(size, -1, np.int32)
    for a in range(size - 1, -1, -1):
        t = top[leader[a]]
        twin_next[a] = twin_first[t]
        twin_first[t] = a
    fronts = 0
    entries = 0
    for k in range(len(order)):
        c = order[k]
        if joined[c] < 0:
            fronts += 1
            entries += own[c] + mass[c]
    class_first = np.full(size, -1, np.int32)
    class_next = np.full(size, -1, np.int32)
    for a in range(size - 1, -1, -1):
        class_next[a] = class_first[leader[a]]
        class_first[leader[a]] = a
    front_ptr = np.zeros(fronts + 1, np.int32)
    nodes = np.empty(entries, np.int32)
    pivots = np.zeros(fronts, np.int32)
    children = np.zeros(fronts, np.int32)
    rank = np.empty(size, np.int32)
    factor_ptr = np.zeros(fronts + 1, np.int64)
    way = np.empty(size + 1, np.int32)
    depth = 0
    done = 0
    at = 0
    largest = 0
    stack = 0
    highest = 0
    offspring = np.zeros(size, np.int32)
    freed = np.zeros(size, np.int64)
    root = roots
    while root >= 0:
        way[0] = root
        depth = 1
        while depth > 0:
            c = way[depth - 1]
            if first[c] >= 0:
                child = first[c]
                first[c] = following[child]
                offspring[c] += 1
                way[depth] = child
                depth += 1
                continue
            depth -= 1
            a = twin_first[c]
            while a >= 0:
                nodes[at] = a
                rank[a] = done
                at += 1
                a = twin_next[a]
            pivots[done] = at - front_ptr[done]
            for m in range(begin[c], begin[c] + count[c]):
                a = class_first[members[m]]
                while a >= 0:
                    nodes[at] = a
                    at += 1
                    a = class_next[a]
            front_ptr[done + 1] = at
            children[done] = offspring[c]
            n = d * (at - front_ptr[done])
            np_ = d * pivots[done]
            factor_ptr[done + 1] = factor_ptr[done] + np_ * n + (n - np_) * np_
            largest = max(largest, n)
            update = np.int64(n - np_) * (n - np_)
            stack += update
            highest = max(highest, stack)
            stack -= freed[c]
            if depth > 0:
                freed[way[depth - 1]] += update
            done += 1
        root = following[root]
    # members of a front in the order of their elimination: children then fit in long runs
    position = np.empty(size, np.int32)
    count_ = 0
    for f in range(fronts):
        for k in range(front_ptr[f], front_ptr[f] + pivots[f]):
            position[nodes[k]] = count_
            count_ += 1
    by_position = np.empty(size, np.int32)
    for a in range(size):
        by_position[position[a]] = a
    for f in range(fronts):
        lo, hi = front_ptr[f] + pivots[f], front_ptr[f + 1]
        for k in range(lo, hi):
            nodes[k] = position[nodes[k]]
        nodes[lo:hi].sort()
        for k in range(lo, hi):
            nodes[k] = by_position[nodes[k]]
    room = np.empty(2, np.int64)
    room[0] = largest
    room[1] = highest
    return front_ptr, nodes, pivots, children, rank, factor_ptr, room


@jitable
def elimination_flops(symbolic, d):
    """Return the floating-point operations of a factorisation with these fronts."""
    front_ptr, _, pivots, _, _, _, _ = symbolic
    total = 0.0
    for f in range(len(pivots)):
        n = float(d * (front_ptr[f + 1] - front_ptr[f]))
        own = float(d * pivots[f])
        total += 2.0 * own * n * (n - own) + 2.0 / 3.0 * own**3
    return total
