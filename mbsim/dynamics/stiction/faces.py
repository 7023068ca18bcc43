"""The faces that rigid stiction holds along: where points of a pair are in the face of its J.

Points of a flat face are half of their depths off it, each by its own, and a shape that rocks moves
them along it by how it turns times that. Held at these places it could rock only as they slip by
turns; in the face they move as one rigid shape there, whatever else it does.
"""

from __future__ import annotations

from mbsim.arrays.codes import HELD_AT_PLACES, ON_PLANE
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.contact.forces import sides, velocity_at
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT, axis

#: A crossing of edges with less weight holds nothing: they are next to parallel, and where they
#: cross, and which way they push, is next to nothing of the shapes.
LEAST_HOLDING = 1e-3


@jitable
def has_face(scene: Scene, pair: int) -> bool:
    """Return whether what sticks of a pair is held along a face."""
    moves = scene.kinds.moves[scene.pairs.kind[pair]]
    return moves == ON_PLANE or moves == HELD_AT_PLACES


@jitable
def common_normal(scene: Scene, pair: int, points: F2, at: int) -> V3:
    """Return the sum of the normals of a pair's points, of rows from `at` on, each by its weight.

    Of two edges that are next to parallel it has no say: their normal may be any that is across.
    """
    n = (0.0, 0.0, 0.0)
    for k in range(at, at + scene.kinds.slots[scene.pairs.kind[pair]]):
        if points[k, AT_DEPTH] > 0.0:
            n = add(n, scale(points[k, AT_WEIGHT], vector(points[k, AT_NORMAL:])))
    return n


@jitable
def face_of(scene: Scene, pair: int, points: F2, at: int) -> tuple[V3, float]:
    """Return the outward normal of J's face that a pair is held along, and its height over J.

    A corner behind an edge has the normal of edges in place of that of a face, off by the tilt of
    both faces: held along each in turn it would be driven over the edge and back.
    """
    g = scene.pairs.graphic_j[pair]
    frame, size = scene.work.frames[g], scene.graphics.size[g]
    if scene.kinds.moves[scene.pairs.kind[pair]] == ON_PLANE:
        return axis(frame, 2), 0.0
    n, best = common_normal(scene, pair, points, at), 0
    if norm(n) == 0.0:
        # apart, as at a trial point: all rows have the direction of the gap
        n = vector(points[at, AT_NORMAL:])
    if scene.kinds.swapped[scene.pairs.kind[pair]] == 1:
        n = scale(-1.0, n)
    for k in range(1, 3):
        if abs(dot(axis(frame, k), n)) > abs(dot(axis(frame, best), n)):
            best = k
    out = axis(frame, best)
    return (out if dot(out, n) >= 0.0 else scale(-1.0, out)), size[best]


@jitable
def above(scene: Scene, pair: int, p: V3, out: V3, height: float) -> float:
    """Return how far point p is outside of the face of a pair."""
    return dot(sub(p, vector(scene.work.frames[scene.pairs.graphic_j[pair]])), out) - height


@jitable
def as_normal(scene: Scene, pair: int, out: V3) -> V3:
    """Return the normal from the contact's J into its I, where `out` is that of a face."""
    return scale(-1.0, out) if scene.kinds.swapped[scene.pairs.kind[pair]] == 1 else out


@jitable
def slip_of(scene: Scene, y: F1, s: int) -> V2:
    """Return slip along x and y of slot s, in its face, at the point evaluated last."""
    gi, gj = sides(scene, s)
    point, pair = scene.work.points[s], scene.slots.pair[s]
    p, n, tx = vector(point[AT_POINT:]), vector(point[AT_NORMAL:]), vector(scene.work.t[s])
    if has_face(scene, pair):
        out, height = face_of(scene, pair, scene.work.points, scene.pairs.slot[pair])
        p, n = sub(p, scale(above(scene, pair, p, out, height), out)), as_normal(scene, pair, out)
        tx = sub(tx, scale(dot(tx, n), n))
        tx = scale(1.0 / max(norm(tx), 1e-3), tx)
    v = sub(
        velocity_at(scene, y, scene.graphics.body[gi], p),
        velocity_at(scene, y, scene.graphics.body[gj], p),
    )
    return dot(v, tx), dot(v, cross(n, tx))


@jitable
def holds_nothing(scene: Scene, s: int) -> bool:
    """Return whether slot s is a crossing of edges next to parallel, at what was evaluated last."""
    level = scene.kinds.moves[scene.pairs.kind[scene.slots.pair[s]]]
    return level == HELD_AT_PLACES and scene.work.points[s, AT_WEIGHT] < LEAST_HOLDING
