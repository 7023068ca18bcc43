"""What follows from points that FCL found, which come without the shapes' motion between them."""

from __future__ import annotations

import math

from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1
from mbsim.core.jitable import jitable
from mbsim.core.rotation import dot, norm, sub, vector
from mbsim.dynamics.contact.forces import sides, velocity_at
from mbsim.geometry.catalog import AT_POINT, axis


@jitable
def bounding_gap(scene: Scene, pair: int) -> float:
    """Return a lower bound of two shapes' distance: ball of one to box or plane of the other."""
    pairs, graphics, work = scene.pairs, scene.graphics, scene.work
    best = -math.inf
    for side in range(2):
        g = pairs.graphic_i[pair] if side == 0 else pairs.graphic_j[pair]
        other = pairs.graphic_j[pair] if side == 0 else pairs.graphic_i[pair]
        frame, half = work.frames[other], graphics.half[other]
        d = sub(vector(work.frames[g]), vector(frame))
        if math.isinf(half[2]):
            best = max(best, dot(d, axis(frame, 2)) - graphics.radius[g])
            continue
        square = 0.0
        for k in range(3):
            out = max(0.0, abs(dot(d, axis(frame, k))) - half[k])
            square += out * out
        best = max(best, math.sqrt(square) - graphics.radius[g])
    return best


@jitable
def another_point(scene: Scene, y: F1, h: float, s: int) -> bool:
    """Return whether the point that FCL gives for slot s is too far to be the one before."""
    point, before = scene.work.points[s], scene.state.p[s]
    p = vector(point[AT_POINT:])
    gi, gj = sides(scene, s)
    graphics = scene.graphics
    speed = norm(velocity_at(scene, y, graphics.body[gi], p))
    speed += norm(velocity_at(scene, y, graphics.body[gj], p))
    size = min(graphics.radius[gi], graphics.radius[gj])
    # the point of touch may run ahead of both surfaces; a hundredth of the shape is near
    return norm(sub(p, vector(before))) > 2.0 * h * speed + 0.01 * size
