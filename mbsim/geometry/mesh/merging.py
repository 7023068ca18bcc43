"""From pieces of surface to contact points: one for each depth that stands out.

The pieces of an overlap are nodes of a graph. A link joins two that share a segment, and has the
largest psi on it. Each node belongs to the peak that it leads up to. Where the pieces of two peaks
p >= q are linked at a saddle s (the largest there is between them), the lower one stands out by
u = (q - s)/q: it has the weight u, and the higher one, whose weight is 1, acts at

    u x_p + (1 - u) x_both

with x the centre of pressure of the one and of both. Peaks that do not stand out (the corners of a
flat face, the noise of a tessellation) have no weight, patches that do not touch have their own,
and nothing jumps where patches merge or one peak overtakes the other.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, I2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, norm, scale, sub, vector
from mbsim.geometry.catalog import axis, put_point
from mbsim.geometry.mesh.record import MOMENT, PEAK, PRESSURE, PUSH, add_patch
from mbsim.geometry.polyhedron import to_global

#: A link this near (as a part) to a node's own peak leads up.
LEADS = 1.0 - 1e-9
#: Rows of a pair: peaks beyond that count lose their own point to the higher one.
MOST_PEAKS = 12
#: Numbers of a peak that has a row: depth, weight, point (3), normal (3), its node.
PEAK_NUMBERS = 9
AT_NODE = 8
#: A peak that presses less than this part of the strongest one is none.
LEAST = 1e-9


@jitable
def root_of(above: I1, k: int) -> int:
    """Return where the way up from node k ends, and shorten it."""
    while above[k] != k:
        above[k] = above[above[k]]
        k = above[k]
    return k


@jitable
def lead_up(nodes: F2, links: F2, partners: I2, above: I1) -> None:
    """Find for each node the highest neighbour that it leads up to, itself for a peak."""
    for k in range(len(above)):
        best = k
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other < 0 or links[k, e] < LEADS * nodes[k, PEAK]:
                continue
            higher = nodes[other, PEAK] - nodes[best, PEAK]
            if higher > 0.0 or (higher == 0.0 and other > best):
                best = other
        above[k] = best


@jitable
def sort_down(values: F1, order: I1) -> None:
    """Sort the indices in `order` so that their values fall (Shell's sort)."""
    gap = len(order) // 2
    while gap > 0:
        for k in range(gap, len(order)):
            moving, j = order[k], k
            while j >= gap and values[order[j - gap]] < values[moving]:
                order[j] = order[j - gap]
                j -= gap
            order[j] = moving
        gap //= 2


@jitable
def saddles(above: I1, links: F2, partners: I2) -> tuple[F1, I2]:
    """Return the links between pieces of different peaks: their psi, and the two peaks."""
    count = 0
    for k in range(len(above)):
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other > k and root_of(above, k) != root_of(above, other):
                count += 1
    levels, ends = np.empty(count), np.empty((count, 2), np.int64)
    count = 0
    for k in range(len(above)):
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other > k and root_of(above, k) != root_of(above, other):
                levels[count] = links[k, e]
                ends[count, 0], ends[count, 1] = above[k], above[other]
                count += 1
    return levels, ends


@jitable
def centre(patch: F1) -> V3:
    """Return the centre of pressure of a patch from the origin of its sums."""
    over = 1.0 / patch[PRESSURE] if patch[PRESSURE] > 0.0 else 0.0
    return scale(over, vector(patch[MOMENT:]))


@jitable
def direction(patch: F1) -> V3:
    """Return the direction of the field's force on I; 0 where there is none."""
    push = vector(patch[PUSH:])
    size = norm(push)
    return scale(1.0 / size, push) if size > 0.0 else (0.0, 0.0, 0.0)


@jitable
def begin_peak(peak: F1, patch: F1) -> None:
    """Write a peak that stands alone."""
    x, n = centre(patch), direction(patch)
    peak[0], peak[1] = patch[PEAK], 1.0
    for k in range(3):
        peak[2 + k], peak[5 + k] = x[k], n[k]


@jitable
def join(high: F1, low: F1, whole: F1, saddle: float) -> None:
    """Let the lower peak stand out above the saddle only; `whole` is the patch of both."""
    u = max(0.0, 1.0 - saddle / low[0])
    low[1] = u
    x, n = centre(whole), direction(whole)
    for k in range(3):
        high[2 + k] = u * high[2 + k] + (1.0 - u) * x[k]
        high[5 + k] = u * high[5 + k] + (1.0 - u) * n[k]


@jitable
def merge(nodes: F2, links: F2, partners: I2, peaks: F2) -> int:
    """Fill `peaks` (as many rows as nodes) with the peaks that stand out; return their number.

    What belongs to a peak is added up in its node; links (n, e) [L] and partners (n, e) are the
    largest psi on a shared segment and the node beyond it, -1 for none.
    """
    count = len(nodes)
    above = np.empty(count, np.int64)
    lead_up(nodes, links, partners, above)
    levels, ends = saddles(above, links, partners)
    found = np.empty(count, np.int64)  # row in `peaks` of a node that is a peak
    tops = 0
    for k in range(count):
        top = root_of(above, k)
        if top == k:
            peaks[tops, AT_NODE] = k
            found[k] = tops
            tops += 1
        else:
            add_patch(nodes[top], nodes[k])
    for t in range(tops):
        begin_peak(peaks[t], nodes[int(peaks[t, AT_NODE])])
    order = np.arange(len(levels))
    sort_down(levels, order)
    for k in range(len(order)):
        a, b = root_of(above, ends[order[k], 0]), root_of(above, ends[order[k], 1])
        if a == b:
            continue
        if nodes[a, PEAK] < nodes[b, PEAK]:
            a, b = b, a
        add_patch(nodes[a], nodes[b])
        join(peaks[found[a]], peaks[found[b]], nodes[a], levels[order[k]])
        above[b] = a
    return tops


@jitable
def strongest(peaks: F2, count: int, most: int) -> int:
    """Move the `most` peaks of greatest weight times depth to the front; return their number.

    What those behind press is added to the nearest of those in front, at their common centre.
    """
    for k in range(count):
        # in no direction there is no force
        if norm(vector(peaks[k, 5:])) == 0.0:
            peaks[k, 1] = 0.0
    kept = 0
    while kept < min(most, count):
        best = kept
        for k in range(kept + 1, count):
            if peaks[k, 0] * peaks[k, 1] > peaks[best, 0] * peaks[best, 1]:
                best = k
        if peaks[best, 0] * peaks[best, 1] <= LEAST * peaks[0, 0]:
            break
        for c in range(PEAK_NUMBERS):
            peaks[kept, c], peaks[best, c] = peaks[best, c], peaks[kept, c]
        kept += 1
    for k in range(kept, count):
        if kept < most or peaks[k, 1] <= 0.0:
            continue
        nearest, least = 0, math.inf
        x = vector(peaks[k, 2:])
        for j in range(kept):
            away = norm(sub(vector(peaks[j, 2:]), x))
            if away < least:
                nearest, least = j, away
        add_weight(peaks[nearest], peaks[k])
    return kept


@jitable
def add_weight(kept: F1, lost: F1) -> None:
    """Add to a peak what another one presses, as of a linear law."""
    more = lost[1] * lost[0] / kept[0]
    part = more / (kept[1] + more)
    kept[1] += more
    for k in range(2, 8):
        kept[k] += part * (lost[k] - kept[k])


@jitable
def write_points(peaks: F2, count: int, frame: F1, origin: V3, points: F2) -> None:
    """Write peaks, measured in the axes of `frame` from `origin` (global), as contact points.

    The normal is the global direction of I from J. Rows without a peak have depth 0.
    """
    for k in range(len(points)):
        put_point(points[k], -0.0, origin, axis(frame, 2))
    for k in range(count):
        n = vector(peaks[k, 5:])
        n = to_global(frame, scale(1.0 / norm(n), n))
        p = add(origin, to_global(frame, vector(peaks[k, 2:])))
        put_point(points[k], peaks[k, 0], p, n, peaks[k, 1])
