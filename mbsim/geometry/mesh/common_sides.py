"""What flat sides of two meshes have in common where they lie on each other, and how it presses.

The corners of what both have in common are those of one border inside of the other, and where
edges cross. Those of its convex hull hold the bodies, with the law of `sides`. Depths are measured
along the mean of both normals. What a corner of I is pushed by is along J's normal, one of J along
I's, a crossing along the common normal of its edges: the slopes of these depths.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, V3
from mbsim.core.blend import step, step_derivative
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, any_tangent, cross, dot, norm, scale, sub, vector
from mbsim.geometry.mesh.merging import PEAK_NUMBERS
from mbsim.geometry.mesh.oriented import place, turn
from mbsim.geometry.mesh.record import PATCH_NUMBERS, PEAK, add_patch
from mbsim.geometry.mesh.sides import (
    ALONG,
    ASIDE,
    CORNER,
    DEPTH,
    LEANING,
    LYING,
    PART,
    WHERE,
    how_far,
    lean_of,
    no_sides,
    shallow,
    side_at,
    side_of,
    write_side,
)
from mbsim.model.flat_sides import (
    AT_BORDER,
    AT_LEANING,
    AT_LEAVING,
    BORDER_COUNT,
    BORDER_EDGE,
    HEIGHT,
    NORMAL,
)
from mbsim.model.surface import AT_SIDES, SIDES

#: Columns of a corner of what two sides have in common: place in J's side, the edges of I and of J
#: that cross there, `NONE` for a corner of the other one.
COMMON, NONE = 4, -1
X, Y, EDGE_I, EDGE_J = range(COMMON)
#: Part of a border's size by which a corner may be beyond the other border and be on it: files in
#: single precision are.
TIE = 1e-6
#: Sine of the angle of two edges below which their common normal gives way to that of a side.
ASLANT = 0.01
#: Two sides lie as far as pieces of their surfaces reach this part of the depth of their corners,
#: and what they have in common is wider than deep, by these factors: where one slides off the
#: other, or edges overlap, they do not.
REACHED = 0.5
NARROW, WIDE = 2.0, 6.0
#: Cosines of the angle of two sides at which their corners begin to hold (12 degrees) and hold (8).
APART, ALIKE = 0.9781, 0.9903


@jitable
def put_edges(
    mesh: F1, side: int, pose: F1, moves: bool, origin: V3, x: V3, y: V3, edges: F2
) -> None:
    """Write the border of a side along x, y of J's axes from `origin`: two ends an edge."""
    at = side_at(mesh, side)
    first = int(mesh[AT_SIDES]) + int(mesh[at + AT_BORDER])
    for k in range(len(edges)):
        for end in range(2):
            p = vector(mesh, first + BORDER_EDGE * k + 3 * end)
            p = sub(place(pose, p) if moves else p, origin)
            edges[k, 2 * end], edges[k, 2 * end + 1] = dot(p, x), dot(p, y)


@jitable
def edge_way(mesh: F1, side: int, edge: int) -> V3:
    """Return an edge of a side's border as a vector in the mesh's axes."""
    at = int(mesh[AT_SIDES]) + int(mesh[side_at(mesh, side) + AT_BORDER]) + BORDER_EDGE * edge
    return sub(vector(mesh, at + 3), vector(mesh, at))


@jitable
def within(edges: F2, x: float, y: float, tie: float) -> bool:
    """Return whether a point is inside of a border, or beyond it by `tie` at most."""
    inside = False
    for k in range(len(edges)):
        ax, ay, bx, by = edges[k, 0] - x, edges[k, 1] - y, edges[k, 2] - x, edges[k, 3] - y
        if (ay > 0.0) != (by > 0.0):
            side = ax * by - ay * bx
            if (side > 0.0) == (by > ay):
                inside = not inside
        if min(ax, bx) <= tie and max(ax, bx) >= -tie and min(ay, by) <= tie:
            if max(ay, by) >= -tie:
                ex, ey = bx - ax, by - ay
                square = ex * ex + ey * ey
                part = -(ax * ex + ay * ey) / square if square > 0.0 else 0.0
                part = min(1.0, max(0.0, part))
                if math.hypot(ax + part * ex, ay + part * ey) <= tie:
                    return True
    return inside


@jitable
def lies_before(found: F2, a: int, b: int) -> bool:
    """Return whether row a is before row b in the order of x, then y."""
    return found[a, X] < found[b, X] or (found[a, X] == found[b, X] and found[a, Y] < found[b, Y])


@jitable
def sorted_rows(found: F2, count: int) -> I1:
    """Return the first `count` rows in the order of x, then y (Shell's sort)."""
    order = np.arange(count)
    gap = count // 2
    while gap > 0:
        for k in range(gap, count):
            moving, j = order[k], k
            while j >= gap and lies_before(found, moving, order[j - gap]):
                order[j] = order[j - gap]
                j -= gap
            order[j] = moving
        gap //= 2
    return order


@jitable
def turns_left(found: F2, a: int, b: int, k: int, near: float) -> bool:
    """Return whether the way over rows a, b, k turns to the left, by more than `near` at b."""
    ex, ey = found[k, X] - found[a, X], found[k, Y] - found[a, Y]
    dx, dy = found[b, X] - found[a, X], found[b, Y] - found[a, Y]
    return ex * dy - ey * dx < -near * math.hypot(ex, ey)


@jitable
def hull(found: F2, count: int, near: float) -> int:
    """Move the corners of the convex hull of the first `count` rows to the front, in order.

    Those that are not farther than `near` from what is left are no corners. Andrew's chain.
    """
    order, chain, many = sorted_rows(found, count), np.empty(2 * count + 2, np.int64), 0
    for way in range(2):
        begin = many
        for m in range(count):
            k = order[m] if way == 0 else order[count - 1 - m]
            while many - begin > 1 and not turns_left(
                found, chain[many - 2], chain[many - 1], k, near
            ):
                many -= 1
            last = chain[many - 1] if many > begin else -1
            if last >= 0 and abs(found[k, X] - found[last, X]) <= near:
                if abs(found[k, Y] - found[last, Y]) <= near:
                    continue
            chain[many] = k
            many += 1
        many -= 1
    many = max(many, 1)
    kept = found[chain[:many]]
    found[:many] = kept
    return many


@jitable
def put_common(
    found: F2, count: int, near: float, x: float, y: float, edge_i: int, edge_j: int
) -> int:
    """Add a corner; where there is no room only those of the hull are kept."""
    if count == len(found):
        count = hull(found, count, near)
    if count < len(found):
        found[count, X], found[count, Y] = x, y
        found[count, EDGE_I], found[count, EDGE_J] = edge_i, edge_j
        count += 1
    return count


@jitable
def common_hull(edges_i: F2, edges_j: F2, found: F2) -> int:
    """Write the corners of the hull of what two borders have in common; return their number."""
    size = 0.0
    for k in range(len(edges_i)):
        size = max(size, abs(edges_i[k, 0] - edges_i[0, 0]), abs(edges_i[k, 1] - edges_i[0, 1]))
    other = 0.0
    for k in range(len(edges_j)):
        other = max(other, abs(edges_j[k, 0] - edges_j[0, 0]), abs(edges_j[k, 1] - edges_j[0, 1]))
    tie = TIE * min(size, other)
    near, count = 1e-3 * tie, 0
    for k in range(len(edges_i)):
        if within(edges_j, edges_i[k, 0], edges_i[k, 1], tie):
            count = put_common(found, count, near, edges_i[k, 0], edges_i[k, 1], k, NONE)
    for k in range(len(edges_j)):
        if within(edges_i, edges_j[k, 0], edges_j[k, 1], tie):
            count = put_common(found, count, near, edges_j[k, 0], edges_j[k, 1], NONE, k)
    for k in range(len(edges_i)):
        ax, ay, bx, by = edges_i[k, 0], edges_i[k, 1], edges_i[k, 2], edges_i[k, 3]
        low_x, high_x, low_y, high_y = min(ax, bx), max(ax, bx), min(ay, by), max(ay, by)
        for m in range(len(edges_j)):
            px, py, qx, qy = edges_j[m, 0], edges_j[m, 1], edges_j[m, 2], edges_j[m, 3]
            if max(px, qx) < low_x or min(px, qx) > high_x:
                continue
            if max(py, qy) < low_y or min(py, qy) > high_y:
                continue
            ux, uy, ex, ey = bx - ax, by - ay, qx - px, qy - py
            turned = ux * ey - uy * ex
            if turned == 0.0:
                continue
            s = ((px - ax) * ey - (py - ay) * ex) / turned
            t = ((px - ax) * uy - (py - ay) * ux) / turned
            if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
                count = put_common(found, count, near, ax + s * ux, ay + s * uy, k, m)
    return hull(found, count, near) if count > 0 else 0


@jitable
def exterior_shares(found: F2, corners: F2) -> float:
    """Write the shares of the corners of a hull: exterior angles over a whole turn.

    Returns how wide it is: twice its area over its length round, of a strip its width.
    """
    count = len(corners)
    if count < 3:
        for k in range(count):
            corners[k, PART] = 1.0 / count
        return 0.0
    total, twice, around = 0.0, 0.0, 0.0
    for k in range(count):
        before, after = (k + count - 1) % count, (k + 1) % count
        ax, ay = found[k, X] - found[before, X], found[k, Y] - found[before, Y]
        bx, by = found[after, X] - found[k, X], found[after, Y] - found[k, Y]
        corners[k, PART] = abs(math.atan2(ax * by - ay * bx, ax * bx + ay * by))
        total, around = total + corners[k, PART], around + math.hypot(ax, ay)
        px, py = found[k, X] - found[0, X], found[k, Y] - found[0, Y]
        twice += px * by - py * bx
    for k in range(count):
        corners[k, PART] /= total
    return twice / around


@jitable
def lay_on_side(
    mesh_i: F1, side_i: int, mesh_j: F1, side_j: int, pose: F1, origin: V3, pieces: F1, peaks: F2
) -> None:
    """Write what two sides do that lie or lean on each other, in J's axes from `origin`.

    Both are seen along the mean n of their normals.
    """
    at_i, at_j = side_at(mesh_i, side_i), side_at(mesh_j, side_j)
    n_j, n_i = vector(mesh_j, at_j + NORMAL), turn(pose, vector(mesh_i, at_i + NORMAL))
    height_i = mesh_i[at_i + HEIGHT] + dot(n_i, sub(vector(pose), origin))
    height_j = mesh_j[at_j + HEIGHT] - dot(n_j, origin)
    n = sub(n_j, n_i)
    n = scale(1.0 / norm(n), n)
    x = any_tangent(n)
    y = cross(n, x)
    edges_i = np.empty((int(mesh_i[at_i + BORDER_COUNT]), 4))
    edges_j = np.empty((int(mesh_j[at_j + BORDER_COUNT]), 4))
    put_edges(mesh_i, side_i, pose, True, origin, x, y, edges_i)
    put_edges(mesh_j, side_j, pose, False, origin, x, y, edges_j)
    found = np.empty((4 * (len(edges_i) + len(edges_j)), COMMON))
    corners = np.empty((common_hull(edges_i, edges_j, found), CORNER))
    wide, deepest = exterior_shares(found, corners), 0.0
    for k in range(len(corners)):
        p = add(scale(found[k, X], x), scale(found[k, Y], y))
        below = (height_i - dot(n_i, p)) / dot(n_i, n)
        above = (height_j - dot(n_j, p)) / dot(n_j, n)
        g = n_j
        if found[k, EDGE_I] == NONE:
            g = scale(-1.0, n_i)
        elif found[k, EDGE_J] != NONE:
            u = turn(pose, edge_way(mesh_i, side_i, int(found[k, EDGE_I])))
            g = normal_of_edges(u, edge_way(mesh_j, side_j, int(found[k, EDGE_J])), n)
        deepest = max(deepest, above - below)
        # the slope of the depth along n
        g = scale(1.0 / max(dot(g, n), ASLANT), g)
        corners[k, DEPTH] = above - below
        p = add(p, scale(0.5 * (above + below), n))
        for c in range(3):
            corners[k, WHERE + c], corners[k, ALONG + c] = p[c], g[c]
    part = 0.0
    if deepest > 0.0:
        part = step(pieces[PEAK], 0.0, 0.0, REACHED * deepest, 1.0)
        part *= step(wide, NARROW * deepest, 0.0, WIDE * deepest, 1.0)
        part *= shallow(mesh_i, at_i, deepest) * shallow(mesh_j, at_j, deepest)
    cosine, steeper = -dot(n_i, n_j), scale(-part, cross(n_i, n_j))
    lean = sub(lean_of(n_i, n), lean_of(n_j, n))
    lies, by_lies = both_ways(mesh_i, at_i, mesh_j, at_j, AT_LEANING, cosine)
    holds, by_holds = both_ways(mesh_i, at_i, mesh_j, at_j, AT_LEAVING, cosine)
    push_aside(found, corners, edges_i, edges_j, x, y, LYING[0])
    turns = scale(by_lies, steeper)
    write_side(corners, part * lies, (lean, turns), LYING, pieces, peaks[0])
    push_aside(found, corners, edges_i, edges_j, x, y, LEANING[0])
    turns = scale(by_holds - by_lies, steeper)
    write_side(corners, part * (holds - lies), (lean, turns), LEANING, pieces, peaks[1])


@jitable
def both_ways(
    mesh_i: F1, at_i: int, mesh_j: F1, at_j: int, limits: int, cosine: float
) -> tuple[float, float]:
    """Return how far two sides are within their limits, see `sides.how_far`, and its slope."""
    (of_i, by_i), (of_j, by_j) = (
        how_far(mesh_i, at_i, limits, cosine),
        how_far(mesh_j, at_j, limits, cosine),
    )
    both, by_both = of_i * of_j, of_i * by_j + of_j * by_i
    if limits == AT_LEANING:
        return both, by_both
    # seen along the mean of normals that differ more, what they have in common is another thing
    part, by_part = (
        step(cosine, APART, 0.0, ALIKE, 1.0),
        step_derivative(cosine, APART, 0.0, ALIKE, 1.0, 1),
    )
    return part * both, part * by_both + by_part * both


@jitable
def push_aside(found: F2, corners: F2, edges_i: F2, edges_j: F2, x: V3, y: V3, power: int) -> None:
    """Write what corners are pushed by along x, y as shares change where I moves.

    With a_k the direction of the hull's edge from corner k on, sum c_k psi_k^p is the sum of
    a_k (psi_k^p - psi_(k+1)^p) over 2 pi, p the `power`. Corners of I move with it, those of J do
    not, and where an edge u of I crosses one e of J they move along e.
    """
    count, deepest = len(corners), 0.0
    for k in range(count):
        deepest = max(deepest, corners[k, DEPTH])
        for c in range(3):
            corners[k, ASIDE + c] = 0.0
    if count < 3 or not deepest > 0.0:
        return
    for k in range(count):
        after = (k + 1) % count
        ex, ey = found[after, X] - found[k, X], found[after, Y] - found[k, Y]
        here = max(0.0, corners[k, DEPTH]) / deepest
        there = max(0.0, corners[after, DEPTH]) / deepest
        fall = deepest * (here**power - there**power)
        part = fall / (2.0 * power * math.pi * (ex * ex + ey * ey))
        for end in range(2):
            at, sign = (k, 1.0) if end == 0 else (after, -1.0)
            fx, fy = -sign * part * ey, sign * part * ex
            if found[at, EDGE_I] == NONE:
                continue
            if found[at, EDGE_J] != NONE:
                i, j = int(found[at, EDGE_I]), int(found[at, EDGE_J])
                ux, uy = edges_i[i, 2] - edges_i[i, 0], edges_i[i, 3] - edges_i[i, 1]
                wx, wy = edges_j[j, 2] - edges_j[j, 0], edges_j[j, 3] - edges_j[j, 1]
                size = math.hypot(ux, uy) * math.hypot(wx, wy)
                sine = (ux * wy - uy * wx) / size
                over = (fx * wx + fy * wy) * sine / (sine * sine + ASLANT**4) / size
                fx, fy = -over * uy, over * ux
            for c in range(3):
                corners[at, ASIDE + c] += fx * x[c] + fy * y[c]


@jitable
def normal_of_edges(u: V3, e: V3, n: V3) -> V3:
    """Return the common normal of two edges that is along n; n where they are next to parallel."""
    across = scale(1.0 / (norm(u) * norm(e)), cross(u, e))
    size = norm(across) if dot(across, n) >= 0.0 else -norm(across)
    g = add(scale(size, across), scale(ASLANT * ASLANT, n))
    return scale(1.0 / norm(g), g)


@jitable
def facing_sides(mesh_i: F1, side_i: int, mesh_j: F1, side_j: int, pose: F1) -> float:
    """Return how far corners of two sides that look at each other hold."""
    at_i, at_j = side_at(mesh_i, side_i), side_at(mesh_j, side_j)
    n_j, n_i = vector(mesh_j, at_j + NORMAL), turn(pose, vector(mesh_i, at_i + NORMAL))
    return both_ways(mesh_i, at_i, mesh_j, at_j, AT_LEAVING, -dot(n_i, n_j))[0]


@jitable
def sides_between(mesh_i: F1, mesh_j: F1, pose: F1, origin: V3, nodes: F2, pairs: F2, on: I1) -> F2:
    """Return the pairs of sides that hold each other, each as two peaks: lying and leaning.

    `pairs` are the triangles of the `nodes`; `on` gets the number of each one's sides among these.
    """
    on[:] = -1
    if int(mesh_i[SIDES]) == 0 or int(mesh_j[SIDES]) == 0:
        return no_sides()
    names, count = np.empty((len(pairs), 2), np.int64), 0
    for k in range(len(pairs)):
        a, b = side_of(mesh_i, int(pairs[k, 0])), side_of(mesh_j, int(pairs[k, 1]))
        if a < 0 or b < 0:
            continue
        at = 0
        while at < count and (names[at, 0] != a or names[at, 1] != b):
            at += 1
        if at == count:
            if facing_sides(mesh_i, a, mesh_j, b, pose) == 0.0:
                continue
            names[at, 0], names[at, 1], count = a, b, count + 1
        on[k] = at
    if count == 0:
        return no_sides()
    peaks, pieces = np.zeros((2 * count, PEAK_NUMBERS)), np.zeros((count, PATCH_NUMBERS))
    for k in range(len(pairs)):
        if on[k] >= 0:
            add_patch(pieces[on[k]], nodes[k])
    for m in range(count):
        a, b = names[m]
        both = peaks[2 * m : 2 * m + 2]
        lay_on_side(mesh_i, a, mesh_j, b, pose, origin, pieces[m], both)
    return peaks
