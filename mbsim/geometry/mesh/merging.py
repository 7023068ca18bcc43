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

import numpy as np

from mbsim.core.arrays import F1, F2, I1, I2, V3
from mbsim.core.jitable import jitable, uncounted
from mbsim.core.rotation import add, dot, norm, scale, vector
from mbsim.geometry.catalog import (
    AREA,
    AT_DEPTH,
    LEAN_X,
    LEAN_Y,
    MOMENT_XX,
    MOMENT_XY,
    MOMENT_YY,
    POINT,
    REGION_ROWS,
    STIFF_XX,
    STIFF_XY,
    STIFF_YY,
    axis,
    plane_axes,
    put_couple,
    put_couple_of_force,
    put_point,
)
from mbsim.geometry.catalog import GAIN as GAIN_OF
from mbsim.geometry.mesh.record import (
    AREA_VECTOR,
    MOMENT,
    PEAK,
    PRESSURE,
    PUSH,
    SPREAD,
    add_patch,
)
from mbsim.geometry.polyhedron import to_global

#: A link this near (as a part) to a node's own peak leads up.
LEADS = 1.0 - 1e-9
#: Incidents of a pair: what peaks beyond that count press, the nearest of those does.
MOST_PEAKS = 8
#: Numbers of a peak: depth, weight, then point (3), direction (3), area, mean depth and the moments
#: of the pressure over itself (xx, yy, zz, xy, yz, zx; about the origin of sums); its node; then
#: what `catalog` has of a lying side (`sides`): gain, stiffness against tilting (6, as moments are,
#: for a unit of the law's force and of the gain) and lean (3), the couple for a unit of force (3),
#: and how its weight changes as I turns (3).
PEAK_NUMBERS = 33
PLACE, NORMAL, SURFACE, MEAN, MOMENTS, AT_NODE = 2, 5, 8, 9, 10, 16
GAIN, STIFF, LEAN, COUPLE, TURNS = 17, 18, 24, 27, 30
#: A peak that presses less than this part of the strongest one is none.
LEAST = 1e-9
#: A peak's integral of psi is at least this part of its depth times the square of how far it stands
#: out. Of a needle's tip, a thousand times as long as thick, it is 1e-6.
ROOM = 1e-10


@jitable
def root_of(above: I1, k: int) -> int:
    """Return where the way up from node k ends, and shorten it."""
    while above[k] != k:
        above[k] = above[above[k]]
        k = above[k]
    return k


@jitable
def lead_up(nodes: F2, links: F2, partners: I2, above: I1) -> None:
    """Find for each node where it leads up to, itself for a peak.

    Pieces whose peaks are one point, or one flat side, are one: together they lead to the highest
    neighbour that any of them has there. So rounding does not tell to which peak they belong.
    """
    count = len(above)
    for k in range(count):
        above[k] = k
    for k in range(count):
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other >= 0 and links[k, e] >= LEADS * max(nodes[k, PEAK], nodes[other, PEAK]):
                a, b = root_of(above, k), root_of(above, other)
                above[max(a, b)] = min(a, b)
    top, best = np.zeros(count), np.full(count, -1)
    for k in range(count):
        r = root_of(above, k)
        top[r] = max(top[r], nodes[k, PEAK])
    for k in range(count):
        r = root_of(above, k)
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other < 0 or links[k, e] < LEADS * nodes[k, PEAK]:
                continue
            high = top[root_of(above, other)]
            if high > top[r] and (best[r] < 0 or high > top[best[r]]):
                best[r] = root_of(above, other)
    for r in range(count):
        if best[r] >= 0:
            above[r] = best[r]


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


@uncounted
def told_here(partners: I2, k: int, other: int) -> bool:
    """Return whether the link of node k to another one is taken from k's row: once of both."""
    if other > k:
        return True
    for e in range(partners.shape[1]):
        if partners[other, e] == k:
            return False
    return True


@jitable
def saddles(above: I1, links: F2, partners: I2) -> tuple[F1, I2]:
    """Return the links between pieces of different peaks: their psi, and the two peaks."""
    count = 0
    for k in range(len(above)):
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other < 0 or root_of(above, k) == root_of(above, other):
                continue
            if told_here(partners, k, other):
                count += 1
    levels, ends = np.empty(count), np.empty((count, 2), np.int64)
    count = 0
    for k in range(len(above)):
        for e in range(links.shape[1]):
            other = partners[k, e]
            if other < 0 or root_of(above, k) == root_of(above, other):
                continue
            if told_here(partners, k, other):
                levels[count] = links[k, e]
                ends[count, 0], ends[count, 1] = above[k], above[other]
                count += 1
    return levels, ends


@jitable
def blend(peak: F1, patch: F1, part: float) -> None:
    """Let what a peak has but depth and weight be a part of what it is and the rest of a patch."""
    push = vector(patch, PUSH)
    size, pressure = norm(push), patch[PRESSURE]
    rest = 1.0 - part
    by_push = rest / size if size > 0.0 else 0.0
    by_pressure = rest / pressure if pressure > 0.0 else 0.0
    for k in range(PLACE, AT_NODE):
        peak[k] *= part
    for k in range(3):
        peak[PLACE + k] += by_pressure * patch[MOMENT + k]
        peak[NORMAL + k] += by_push * push[k]
    for k in range(6):
        peak[MOMENTS + k] += by_pressure * patch[SPREAD + k]
    area = norm(vector(patch, AREA_VECTOR))
    peak[SURFACE] += rest * area
    peak[MEAN] += rest * size / area if area > 0.0 else 0.0


@uncounted
def begin_peak(peak: F1, patch: F1) -> None:
    """Write a peak that stands alone."""
    for k in range(PLACE, AT_NODE):
        peak[k] = 0.0
    for k in range(GAIN, PEAK_NUMBERS):
        peak[k] = 0.0
    peak[0], peak[1], peak[GAIN] = patch[PEAK], 1.0, 1.0
    blend(peak, patch, 0.0)


@uncounted
def join(high: F1, low: F1, whole: F1, saddle: float) -> None:
    """Let the lower peak stand out above the saddle only; `whole` is the patch of both."""
    u = max(0.0, 1.0 - saddle / low[0])
    low[1] = u
    blend(high, whole, u)


@jitable
def merge(nodes: F2, links: F2, partners: I2, on: I1, sides: F2, peaks: F2) -> int:
    """Fill `peaks` (as many rows as nodes) with the peaks that stand out; return their number.

    What belongs to a peak is added up in its node; links (n, e) [L] and partners (n, e) are the
    largest psi on a shared segment and the node beyond it, -1 for none. `on` says on which of the
    `sides` that hold a node is, -1 for none: a peak there has what stands out of the side. Each
    side has two rows.
    """
    count = len(nodes)
    above = np.empty(count, np.int64)
    lead_up(nodes, links, partners, above)
    levels, ends = saddles(above, links, partners)
    found = np.empty(count, np.int64)  # row in `peaks` of a node that is a peak
    tops, held = 0, np.zeros(count)
    hold_down(nodes, above, on, held)
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
        if on[b] >= 0:
            # what stands out of a side that holds has the weight of a lower peak that does
            part = held[b] * min(1.0, levels[order[k]] / peaks[found[a], 0])
            if part > held[a]:
                on[a], held[a] = on[b], part
        above[b] = a
    for t in range(tops):
        # psi falls by no more than the way: what stands out of a corner of both meshes, where
        # rounding alone makes a piece that has no neighbours, has no room around it
        out = peaks[t, 1] * peaks[t, 0]
        if nodes[int(peaks[t, AT_NODE]), PRESSURE] < ROOM * out * out * peaks[t, 0]:
            peaks[t, 1] = 0.0
        node = int(peaks[t, AT_NODE])
        if on[node] >= 0:
            leave_rest(peaks[t], sides[2 * on[node] : 2 * on[node] + 2], held[node])
    return tops


@jitable
def hold_down(nodes: F2, above: I1, on: I1, held: F1) -> None:
    """Find for each peak the side that holds there, and how high that is as a part of the peak."""
    highest = np.zeros(len(above))
    for k in range(len(above)):
        top = root_of(above, k)
        highest[top] = max(highest[top], nodes[k, PEAK])
    side = np.full(len(above), -1)
    for k in range(len(above)):
        top = root_of(above, k)
        if on[k] >= 0 and nodes[k, PEAK] > held[top] * highest[top]:
            side[top], held[top] = on[k], nodes[k, PEAK] / highest[top]
    on[:] = side


@jitable
def leave_rest(peak: F1, side: F2, part: float) -> None:
    """Leave a peak what the side that holds there does not have, and what turns it over to that.

    `part` is how much of the peak is the side's, which has a row as it lies and one as it leans.
    """
    left = 1.0 - part * (side[0, 1] + side[1, 1])
    for k in range(2):
        for c in range(3):
            peak[TURNS + c] -= part * peak[1] * side[k, TURNS + c]
        side[k, SURFACE] += part * side[k, 1] * peak[SURFACE]
    peak[SURFACE] *= left
    peak[1] *= left


@jitable
def presses(peak: F1) -> float:
    """Return what a peak presses as of a linear law: weight times gain times depth."""
    return peak[0] * peak[1] * peak[GAIN]


@jitable
def strongest(peaks: F2, count: int, most: int) -> int:
    """Move the peaks that press most to the front; return how many there are then, at most `most`.

    Where there are more than most - 1, the last one stands for what is left.
    """
    for k in range(count):
        # in no direction there is no force
        if norm(vector(peaks[k, NORMAL:])) == 0.0:
            peaks[k, 1] = 0.0
    kept = 0
    while kept < min(most, count):
        best = kept
        for k in range(kept + 1, count):
            if presses(peaks[k]) > presses(peaks[best]):
                best = k
        if presses(peaks[best]) <= LEAST * peaks[0, 0]:
            break
        exchange_peaks(peaks, kept, best)
        kept += 1
    if kept == most:
        gather_rest(peaks, count, most - 1)
        # of as strong ones it takes all, and a point without force is none
        exchange_peaks(peaks, 0, most - 1)
        for k in range(most - 1, 0, -1):
            if presses(peaks[k]) <= LEAST * presses(peaks[0]):
                kept -= 1
                exchange_peaks(peaks, k, kept)
    return kept


@jitable
def exchange_peaks(peaks: F2, a: int, b: int) -> None:
    """Exchange two peaks."""
    for c in range(PEAK_NUMBERS):
        peaks[a, c], peaks[b, c] = peaks[b, c], peaks[a, c]


@jitable
def gather_rest(peaks: F2, count: int, own: int) -> None:
    """Let the peak behind the first `own` stand for itself, those behind, and a part of the first.

    With s_k what peak k presses and s that of the first one behind, it takes min(s_k, s) of each:
    nothing jumps where one overtakes another or a further one begins. It presses with the sum of
    their forces at the centre of these.
    """
    level, total = presses(peaks[own]), 0.0
    rest, force = np.zeros(PEAK_NUMBERS), (0.0, 0.0, 0.0)
    for k in range(count):
        strength = presses(peaks[k])
        if strength <= 0.0:
            continue
        taken = min(strength, level)
        n = vector(peaks[k, NORMAL:])
        force = add(force, scale(taken / norm(n), n))
        total += taken
        part = taken / strength
        rest[0] += taken * peaks[k, 0]
        for c in range(PLACE, NORMAL):
            rest[c] += taken * peaks[k, c]
        rest[MEAN] += taken * (peaks[k, MEAN] if peaks[k, MEAN] > 0.0 else peaks[k, 0])
        for c in range(MOMENTS, AT_NODE):
            rest[c] += taken * peaks[k, c]
        rest[SURFACE] += part * peaks[k, SURFACE]
        peaks[k, 1] *= 1.0 - part
        peaks[k, SURFACE] *= 1.0 - part
        for c in range(3):
            rest[TURNS + c] += part * peaks[k, TURNS + c]
            rest[COUPLE + c] += part * peaks[k, COUPLE + c]
            peaks[k, TURNS + c] *= 1.0 - part
            peaks[k, COUPLE + c] *= 1.0 - part
    for c in range(AT_NODE):
        if c != SURFACE:
            rest[c] /= total
    size = norm(force)
    rest[1], rest[GAIN] = size / rest[0], 1.0
    for c in range(PEAK_NUMBERS):
        if c != AT_NODE:
            peaks[own, c] = rest[c]
    if size > 0.0:
        peaks[own, NORMAL], peaks[own, NORMAL + 1], peaks[own, NORMAL + 2] = force


@uncounted
def along_both(peak: F1, at: int, x: V3, y: V3) -> float:
    """Return x.M y of a symmetric matrix (xx, yy, zz, xy, yz, zx) of a peak."""
    m = vector(peak, at)
    xy, yz, zx = peak[at + 3], peak[at + 4], peak[at + 5]
    total = m[0] * x[0] * y[0] + m[1] * x[1] * y[1] + m[2] * x[2] * y[2]
    total += xy * (x[0] * y[1] + x[1] * y[0]) + yz * (x[1] * y[2] + x[2] * y[1])
    return total + zx * (x[2] * y[0] + x[0] * y[2])


@uncounted
def moment(peak: F1, p: V3, x: V3, y: V3) -> float:
    """Return the mean of (r.x) (r.y) over a peak's pressure, r from its centre p."""
    return along_both(peak, MOMENTS, x, y) - dot(p, x) * dot(p, y)


@jitable
def write_moments(peak: F1, p: V3, x: V3, y: V3, weight: float, numbers: F1) -> None:
    """Write moments and stiffness against tilting of a peak (axes x, y) that acts at p.

    Depth over a bed that tilts grows by tilt times lever, so its centre of pressure moves by the
    tilt times the moments over the mean depth.
    """
    xx, xy, yy = moment(peak, p, x, x), moment(peak, p, x, y), moment(peak, p, y, y)
    numbers[MOMENT_XX], numbers[MOMENT_XY], numbers[MOMENT_YY] = (
        weight * xx,
        weight * xy,
        weight * yy,
    )
    if peak[MEAN] > 0.0:
        over = weight / peak[MEAN]
        numbers[STIFF_XX], numbers[STIFF_XY], numbers[STIFF_YY] = over * xx, over * xy, over * yy
    else:
        numbers[STIFF_XX] = weight * along_both(peak, STIFF, x, x)
        numbers[STIFF_XY] = weight * along_both(peak, STIFF, x, y)
        numbers[STIFF_YY] = weight * along_both(peak, STIFF, y, y)


@jitable
def to_local(frame: F1, d: V3) -> V3:
    """Return a vector of global axes in a frame's axes."""
    return (dot(d, axis(frame, 0)), dot(d, axis(frame, 1)), dot(d, axis(frame, 2)))


@jitable
def write_points(peaks: F2, count: int, frame: F1, origin: V3, points: F2) -> None:
    """Write peaks, measured in the axes of `frame` from `origin` (global), as contact points.

    The normal is the global direction of I from J. Rows without a peak have depth 0.
    """
    for k in range(len(points)):
        put_point(points[k], -0.0, origin, axis(frame, 2))
    for k in range(count):
        peak, row, numbers = peaks[k], points[REGION_ROWS * k], points[REGION_ROWS * k + 1]
        n = vector(peak, NORMAL)
        n = to_global(frame, scale(1.0 / norm(n), n))
        p = vector(peak, PLACE)
        put_point(row, peak[0], add(origin, to_global(frame, p)), n, peak[1])
        put_couple(row, to_global(frame, scale(-1.0, vector(peak, TURNS))))
        put_couple_of_force(row, to_global(frame, vector(peak, COUPLE)))
        for c in range(POINT):
            numbers[c] = -0.0 if c == AT_DEPTH else 0.0
        numbers[AREA], numbers[GAIN_OF] = peak[SURFACE], peak[GAIN]
        x, y = plane_axes(n)
        x, y = to_local(frame, x), to_local(frame, y)
        write_moments(peak, p, x, y, peak[1], numbers)
        numbers[LEAN_X], numbers[LEAN_Y] = dot(vector(peak, LEAN), x), dot(vector(peak, LEAN), y)
