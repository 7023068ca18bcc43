"""The registry of closed-form pairs, and their contract.

A pair is a function ``points(frame_i, size_i, frame_j, size_j, points) -> count`` of plain
arrays:

* `frame` (12,): the shape's centre, then its rotation matrix by rows, global frame;
* `size` (4,): radius | semi-axes | half edge lengths | radius and half length | bottom radius, top
  radius, half length of a frustum | nothing | of a convex mesh the address and length of its
  polyhedron (`model.hull`); last the address of its surface as triangles (`model.surface`) where
  a pair needs that, then it is a SURFACE;
* `points` (slots, POINT), written by the pair: depth [L] (> 0 overlap, < 0 the distance of this
  candidate), contact point (midpoint of the two surface points), unit normal from J into I,
  its weight of the law's force (1 unless a manifold splits the force of one corner over
  several points, so that the sum does not jump when a corner passes over an edge), the couple
  on I for a unit of the law's energy where the weight turns with the shapes
  (`geometry.crossing`), else 0, and the couple on I for a unit of the law's force where the
  depth changes otherwise than by what moves at the point, else 0.

The elastic energy of a pair is the sum of weight E(depth) over its points: forces and couples are
its slopes. The first couple is -d(weight)/dw, the second one is -weight d(depth)/dw with the point
held, where w is a small turn of I against J.

It fills every one of its `slots` rows (with meshes: as many as their polyhedra need) and returns
their number. A slot's identity over time is its row (a corner of a box keeps its row).
The largest depth, where negative, is a lower bound of the distance of the two shapes. A pair that
does not know the depth of an overlap as deep as this one returns less the number.

A pair that meets in areas has also ``region(frame_i, size_i, frame_j, size_j, points) -> count,
area``, which writes the same rows and returns beside their number the area of contact, seen along
the normal; it is in a second registry. A third one has the motion bounds of pairs with meshes.
A fourth one has the points of pairs of which rigid contact has others than compliant contact.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple, TypeVar

from mbsim.core.arrays import F1, V3
from mbsim.core.jitable import jitable
from mbsim.core.registry import Registry
from mbsim.core.rotation import any_tangent, cross, scale

#: Numbers of a shape's size.
SIZE = 4
#: Numbers of one candidate: depth, point, normal, weight, couples of energy and of force.
POINT = 14
#: Where they begin.
AT_DEPTH, AT_POINT, AT_NORMAL, AT_WEIGHT, COUPLE, COUPLE_OF_FORCE = 0, 1, 4, 7, 8, 11
#: Rows before the points of a pair that is one incident (`geometry.region`): the incident, then
#: numbers of the region in place of a point: its area, and the moments xx, xy, yy [L^2] of the
#: points' part of the force about the incident, in `plane_axes`.
REGION_ROWS = 2
AREA, MOMENT_XX, MOMENT_XY, MOMENT_YY = 1, 2, 3, 7
#: A pair of patches has as many rows for each of them. The second one has also its gain (how much
#: deeper the patch gets as the bodies get nearer by 1 along its normal), and how its centre moves:
#: the force turns against a tilt (wx, wy) of I, in `plane_axes`, with gain times the law's force
#: times the matrix (yy, -xy; -xy, xx) of its stiffness [L] times that tilt; with its lean (lx, ly)
#: [1/L] a depth of 1 counts as the tilt (ly, -lx) does.
GAIN, STIFF_XX, STIFF_XY, STIFF_YY, LEAN_X, LEAN_Y = 4, 5, 6, 8, 9, 10


class Pair(NamedTuple):
    """A closed-form pair of shapes in this order, with its number of candidate points."""

    name: str
    points: Callable[..., int]
    slots: int
    #: Whether a contact that goes on may begin another row (a corner that passes over an edge).
    regroups: bool = False
    #: Whether its rows are patches: `REGION_ROWS` each, without points.
    patches: bool = False
    #: Whether each three of its rows are of one rim, whose first is the lowest.
    rims: bool = False


class Region(NamedTuple):
    """How a pair gives its points and the area of contact, and the weights of a flat face."""

    points: Callable[..., tuple[int, float]]
    whole: float


Kernel = TypeVar("Kernel", bound=Callable[..., Any])

PAIRS: Registry[Pair] = Registry("mbsim.geometry.pairs")
NEARS: Registry[Callable[..., int]] = Registry("mbsim.geometry.pairs")
REGIONS: Registry[Region] = Registry("mbsim.geometry.pairs")
#: Pairs whose rigid contact has other points than their compliant one.
RIGID_PAIRS: Registry[Pair] = Registry("mbsim.geometry.pairs")
MOTION_BOUNDS: Registry[Callable[..., int]] = Registry("mbsim.geometry.pairs")


def pair(
    shape_i: str,
    shape_j: str,
    slots: int,
    regroups: bool = False,
    patches: bool = False,
    rims: bool = False,
) -> Callable[[Kernel], Kernel]:
    """Register the decorated function as the closed form of I = shape_i on J = shape_j."""

    def register(points: Kernel) -> Kernel:
        name = f"{shape_i}-{shape_j}"
        PAIRS.put(name, Pair(name, jitable(points), slots, regroups, patches, rims))
        return points

    return register


def region(shape_i: str, shape_j: str, whole: float) -> Callable[[Kernel], Kernel]:
    """Register the decorated function as the closed form of a pair with its area."""

    def register(function: Kernel) -> Kernel:
        REGIONS.put(f"{shape_i}-{shape_j}", Region(jitable(function), whole))
        return function

    return register


def near_pair(shape_i: str, shape_j: str) -> Callable[[Kernel], Kernel]:
    """Register the decorated function as what gives the points of a pair that is apart too.

    Its rows are those of the pair's `points`; a row that is no point has weight 0. The others'
    depth, where negative, is the distance of two features that may meet, along their normal.
    """

    def register(points: Kernel) -> Kernel:
        NEARS.put(f"{shape_i}-{shape_j}", jitable(points))
        return points

    return register


def rigid_pair(shape_i: str, shape_j: str, slots: int) -> Callable[[Kernel], Kernel]:
    """Register the decorated function as the pair's points where contact is rigid.

    Rigid contact needs all points that hold a body, and no energy whose slope its forces are.
    """

    def register(points: Kernel) -> Kernel:
        name = f"{shape_i}-{shape_j}"
        RIGID_PAIRS.put(name, Pair(name, jitable(points), slots, regroups=True))
        return points

    return register


def motion_bound(shape_i: str, shape_j: str) -> Callable[[Kernel], Kernel]:
    """Register the decorated function as what tells how long a pair in touch passes no wall.

    ``bound(frame_i, size_i, frame_j, size_j, motion)`` is given a motion (`geometry.motion`)
    in the global frame, and writes the time over the one that is asked for.
    """

    def register(function: Kernel) -> Kernel:
        MOTION_BOUNDS.put(f"{shape_i}-{shape_j}", jitable(function))
        return function

    return register


@jitable
def put_point(row: F1, depth: float, p: V3, n: V3, weight: float = 1.0) -> None:
    """Write one candidate into a row of `points`."""
    row[AT_DEPTH] = depth
    row[AT_POINT], row[AT_POINT + 1], row[AT_POINT + 2] = p[0], p[1], p[2]
    row[AT_NORMAL], row[AT_NORMAL + 1], row[AT_NORMAL + 2] = n[0], n[1], n[2]
    row[AT_WEIGHT] = weight
    row[COUPLE] = row[COUPLE + 1] = row[COUPLE + 2] = 0.0
    row[COUPLE_OF_FORCE] = row[COUPLE_OF_FORCE + 1] = row[COUPLE_OF_FORCE + 2] = 0.0


@jitable
def put_couple(row: F1, couple: V3) -> None:
    """Give a candidate the couple on I for a unit of its energy."""
    row[COUPLE], row[COUPLE + 1], row[COUPLE + 2] = couple[0], couple[1], couple[2]


@jitable
def put_couple_of_force(row: F1, couple: V3) -> None:
    """Give a candidate the couple on I for a unit of its law's force."""
    for k in range(3):
        row[COUPLE_OF_FORCE + k] = couple[k]


@jitable
def plane_axes(n: V3) -> tuple[V3, V3]:
    """Return two unit vectors x, y square to n; the same for n and -n, and x * y is one of both."""
    k = 0
    for c in range(1, 3):
        if abs(n[c]) > abs(n[k]):
            k = c
    up = n if n[k] >= 0.0 else scale(-1.0, n)
    x = any_tangent(up)
    return x, cross(up, x)


@jitable
def axis(frame: F1, k: int) -> V3:
    """Return axis k (column k of the rotation) of a frame."""
    return (frame[3 + k], frame[6 + k], frame[9 + k])
