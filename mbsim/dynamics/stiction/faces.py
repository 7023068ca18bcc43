"""The faces that rigid stiction holds along: where points of a pair are in a face of one shape.

Points of a flat face are half of their depths off it, each by its own, and a shape that rocks moves
them along it by how it turns times that. Held at these places it could rock only as they slip by
turns; in the face they move as one rigid shape there, whatever else it does.

The face is that of J, or of I where an edge or a corner of J presses on it: the one that the pair's
normal force is across. Where edges cross there is none, and each point is held across its own.
"""

from __future__ import annotations

import math

from mbsim.arrays.codes import HELD_AT_PLACES, HULL_SIDES, ON_PLANE
from mbsim.arrays.scene import Scene
from mbsim.core.arrays import F1, F2, V2, V3
from mbsim.core.jitable import jitable
from mbsim.core.memory import floats_at
from mbsim.core.rotation import add, cross, dot, norm, scale, sub, vector
from mbsim.dynamics.contact.forces import sides, velocity_at
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT, axis
from mbsim.geometry.mesh.merging import to_local
from mbsim.geometry.polyhedron import to_global
from mbsim.model.hull import AT_PLANES, FACES

#: A crossing of edges with less weight holds nothing: they are next to parallel, and where they
#: cross, and which way they push, is next to nothing of the shapes.
LEAST_HOLDING = 1e-3
#: Sine of the angle between a face's normal and the pair's up to which it is held along that face.
#: Limits are of the pair's normal: they are off by this part at most.
LEVEL = 0.01

#: A face: its graphic, -1 for none; its unit normal, the way of the contact's; a point of it.
Face = tuple[int, V3, V3]


@jitable
def has_face(scene: Scene, pair: int) -> bool:
    """Return whether what sticks of a pair may be held along a face."""
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
def side_along(scene: Scene, g: int, n: V3) -> tuple[float, V3, V3]:
    """Return (sine, n, point) of the flat side of graphic g that is most across n; n is a unit.

    Its own normal is given, outward. `sine` is that of the angle to n, 1 where it looks away.
    """
    frame, size = scene.work.frames[g], scene.graphics.size[g]
    p, local = vector(frame), to_local(frame, n)
    if scene.graphics.flat[g] == HULL_SIDES:
        hull = floats_at(size[0], size[1])
        at, best, found = int(hull[AT_PLANES]), -math.inf, 0
        for face in range(int(hull[FACES])):
            along = dot(vector(hull, at + 4 * face), local)
            if along > best:
                best, found = along, face
        out = to_global(frame, vector(hull, at + 4 * found))
        p = add(p, scale(hull[at + 4 * found + 3], out))
    else:
        which = 0
        for k in range(1, 3):
            if abs(local[k]) > abs(local[which]):
                which = k
        out = axis(frame, which)
        out = out if local[which] >= 0.0 else scale(-1.0, out)
        p = add(p, scale(size[which], out))
    return (norm(cross(out, n)) if dot(out, n) > 0.0 else 1.0), out, p


@jitable
def face_of(scene: Scene, pair: int, points: F2, at: int) -> Face:
    """Return the face that a pair is held along, of rows of points from `at` on.

    A corner behind an edge has the normal of edges in place of that of a face, off by the tilt of
    both faces: held along each in turn it would be driven over the edge and back. So J's face is
    kept as long as it is level with the pair's normal.
    """
    gi, gj = scene.pairs.graphic_i[pair], scene.pairs.graphic_j[pair]
    # as the pair's own J is below I, whatever the contact calls them
    way = -1.0 if scene.kinds.swapped[scene.pairs.kind[pair]] == 1 else 1.0
    if scene.kinds.moves[scene.pairs.kind[pair]] == ON_PLANE:
        frame = scene.work.frames[gj]
        return gj, scale(way, axis(frame, 2)), vector(frame)
    n = common_normal(scene, pair, points, at)
    if norm(n) == 0.0:
        # apart, as at a trial point: all rows have the direction of the gap
        n = vector(points[at, AT_NORMAL:])
    n = scale(way / norm(n), n)
    sine, out, p = side_along(scene, gj, n)
    if sine <= LEVEL:
        return gj, scale(way, out), p
    sine, out, p = side_along(scene, gi, scale(-1.0, n))
    if sine <= LEVEL:
        return gi, scale(-way, out), p
    return -1, n, p


@jitable
def onto(face: Face, p: V3) -> V3:
    """Return the point of a face that is nearest to p."""
    return sub(p, scale(dot(sub(p, face[2]), face[1]), face[1]))


@jitable
def slip_of(scene: Scene, y: F1, s: int) -> V2:
    """Return slip along x and y of slot s, in its face, at the point evaluated last."""
    gi, gj = sides(scene, s)
    point, pair = scene.work.points[s], scene.slots.pair[s]
    p, n, tx = vector(point[AT_POINT:]), vector(point[AT_NORMAL:]), vector(scene.work.t[s])
    if has_face(scene, pair):
        face = face_of(scene, pair, scene.work.points, scene.pairs.slot[pair])
        if face[0] >= 0:
            p, n = onto(face, p), face[1]
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
