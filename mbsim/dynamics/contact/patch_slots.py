"""Which incident of a pair is which, where rows are no parts of a shape."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, sub, vector
from mbsim.geometry.catalog import AT_DEPTH, AT_POINT


@jitable
def exchange(scene: Scene, a: int, b: int, step: int) -> None:
    """Exchange the rows of two incidents."""
    points = scene.work.points
    for r in range(step):
        for c in range(points.shape[1]):
            points[a + r, c], points[b + r, c] = points[b + r, c], points[a + r, c]


@jitable
def keep_slots(scene: Scene, pair: int) -> None:
    """Give incidents the slots of the committed ones that are nearest to them, nearest pair first.

    It follows from the trial point and the committed state alone. An incident without a committed
    one gets a slot that has none.
    """
    pairs, state, work = scene.pairs, scene.state, scene.work
    if pairs.touches[pair] == 0:
        return
    kind, first = pairs.kind[pair], pairs.slot[pair]
    step, last = scene.kinds.step[kind], first + scene.kinds.slots[kind]
    left = pairs.touches[pair]
    settled = 0  # bits of slots that have their incident
    while left > 0:
        slot, incident, least = -1, -1, math.inf
        for s in range(first, last, step):
            if state.touching[s] == 0 or settled >> ((s - first) // step) & 1:
                continue
            for k in range(first, last, step):
                if work.points[k, AT_DEPTH] <= 0.0 or settled >> ((k - first) // step) & 1:
                    continue
                way = sub(vector(work.points[k, AT_POINT:]), vector(state.p[s]))
                if dot(way, way) < least:
                    slot, incident, least = s, k, dot(way, way)
        if slot < 0:
            return
        if slot != incident:
            exchange(scene, slot, incident, step)
        settled |= 1 << ((slot - first) // step)
        left -= 1
