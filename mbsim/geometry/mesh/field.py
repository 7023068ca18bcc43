"""From pieces of surface to contact points under `contact_depth="FIELD"`: one for each patch.

A patch is what hangs together. With U its potential and G, T the field's force and torque of
`record` (the slopes of U), its row is

    depth = 2 U / |G|      weight = |G| / depth      normal = G / |G|

at the centre of pressure, with the torque that G there leaves of T as its couple. A law F = k depth
then gives the force k G, the torque k T and the stored energy k U: elastic forces have a potential
whatever the patch's shape is, and nothing jumps where patches merge, for their sums do not.
"""

from __future__ import annotations

import math

import numpy as np

from mbsim.core.arrays import F1, F2, I1, I2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, norm, scale, sub, vector
from mbsim.geometry.catalog import (
    AREA,
    AT_DEPTH,
    GAIN,
    POINT,
    REGION_ROWS,
    axis,
    plane_axes,
    put_couple_of_force,
    put_point,
)
from mbsim.geometry.mesh.merging import (
    MEAN,
    MOMENTS,
    PEAK_NUMBERS,
    root_of,
    to_local,
    write_moments,
)
from mbsim.geometry.mesh.record import (
    AREA_VECTOR,
    BEYOND,
    MOMENT,
    PEAK,
    POTENTIAL,
    PRESSURE,
    PUSH,
    SPREAD,
    TWIST,
    add_patch,
)
from mbsim.geometry.polyhedron import to_global

#: Least depth of a patch as a part of its largest: where forces of its pieces cancel (a shaft in
#: its hole) or surfaces bend within a layer, 2 U / |G| is no depth.
LEAST_DEPTH = 0.05


@jitable
def join_connected(nodes: F2, partners: I2, above: I1) -> None:
    """Add up what hangs together in one node, where `above` ends for all of it."""
    count = len(above)
    for k in range(count):
        above[k] = k
    for k in range(count):
        for e in range(partners.shape[1]):
            other = partners[k, e]
            if other >= 0:
                a, b = root_of(above, k), root_of(above, other)
                above[max(a, b)] = min(a, b)
    for k in range(count):
        top = root_of(above, k)
        if top != k:
            add_patch(nodes[top], nodes[k])


@jitable
def centre_of(patch: F1) -> V3:
    """Return the centre of a patch's pressure, from the origin of its sums."""
    return scale(1.0 / patch[PRESSURE], vector(patch, MOMENT))


@jitable
def strongest_patches(nodes: F2, above: I1, most: int, kept: I1) -> int:
    """Write the nodes of the `most` patches of greatest pressure; return their number.

    What is left is added to the nearest of those.
    """
    count, many = len(above), 0
    while many < most:
        best = -1
        for k in range(count):
            if above[k] == k and nodes[k, PRESSURE] > 0.0:
                if best < 0 or nodes[k, PRESSURE] > nodes[best, PRESSURE]:
                    best = k
        if best < 0:
            return many
        kept[many], above[best] = best, -1
        many += 1
    for k in range(count):
        if above[k] != k or nodes[k, PRESSURE] <= 0.0:
            continue
        nearest, least = 0, math.inf
        for j in range(many):
            away = norm(sub(centre_of(nodes[kept[j]]), centre_of(nodes[k])))
            if away < least:
                nearest, least = j, away
        add_patch(nodes[kept[nearest]], nodes[k])
    return many


@jitable
def write_patch(patch: F1, frame: F1, origin: V3, points: F2) -> None:
    """Write a patch, measured in the axes of `frame` from `origin` (global), in its two rows."""
    push, size = vector(patch, PUSH), norm(vector(patch, PUSH))
    c = centre_of(patch)
    depth = max(2.0 * patch[POTENTIAL] / size, LEAST_DEPTH * patch[PEAK])
    if patch[BEYOND] > 0.0:
        # the potential of what is below the layer is not known
        depth = patch[PEAK]
    depth = min(depth, patch[PEAK])
    local = scale(1.0 / size, push)
    n = to_global(frame, local)
    put_point(points[0], depth, add(origin, to_global(frame, c)), n, size / depth)
    rest = sub(vector(patch, TWIST), cross(c, push))
    put_couple_of_force(points[0], scale(1.0 / depth, to_global(frame, rest)))
    numbers = points[1]
    for k in range(POINT):
        numbers[k] = -0.0 if k == AT_DEPTH else 0.0
    numbers[AREA], numbers[GAIN] = norm(vector(patch, AREA_VECTOR)), 1.0
    spread = np.zeros(PEAK_NUMBERS)
    spread[MEAN] = size / numbers[AREA] if numbers[AREA] > 0.0 else 0.0
    for k in range(6):
        spread[MOMENTS + k] = patch[SPREAD + k] / patch[PRESSURE]
    x, y = plane_axes(n)
    x, y = to_local(frame, x), to_local(frame, y)
    write_moments(spread, c, x, y, size / depth, numbers)


@jitable
def write_patches(nodes: F2, partners: I2, frame: F1, origin: V3, points: F2) -> int:
    """Write all patches as contact points; return their number. Other rows have depth 0."""
    most = len(points) // REGION_ROWS
    above, kept = np.empty(len(nodes), np.int64), np.empty(most, np.int64)
    join_connected(nodes, partners, above)
    for k in range(len(points)):
        put_point(points[k], -0.0, origin, axis(frame, 2))
    count, written = strongest_patches(nodes, above, most, kept), 0
    for k in range(count):
        patch = nodes[kept[k]]
        if norm(vector(patch, PUSH)) > 0.0:
            at = REGION_ROWS * written
            write_patch(patch, frame, origin, points[at : at + REGION_ROWS])
            written += 1
    return written
