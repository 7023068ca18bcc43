"""The way to FCL, and the only file that imports it.

Compiled code calls one C function with the number of pairs waiting; this fills their rows of
`Work.points` and returns 0, or `DETECTOR_FAILED` with the exception kept for the host.
FCL's objects are made at the first question: a scene that has a fallback but never needs it
does not import FCL.
"""

from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.core.codes import Code
from mbsim.geometry.catalog import AT_DEPTH, AT_NORMAL, AT_POINT, AT_WEIGHT, COUPLE
from mbsim.geometry.hull_overlap import Hull, Solid, hull_of, least_overlap, touching_point
from mbsim.geometry.mesh_contact import (
    against_convex,
    lowest_side,
    of_meshes,
    place,
    under_plane,
    under_sphere,
)
from mbsim.geometry.mesh_surface import Surface
from mbsim.geometry.support import CONVEX, ROUND, face_normal, round_normal, support
from mbsim.model.elements import Graphic

if TYPE_CHECKING:
    from mbsim.arrays.scene import Scene

#: Directions that FCL's iterative solver returns scatter by this much (the project's measurement
#: on ellipsoid pairs, given in its interface conventions).
NORMAL_NOISE = 2e-6
_MESH_CONTACTS = 100_000
#: Sides of the polyhedron around a frustum: 3e-4 of its radius too wide at the edges.
_SIDES = 128


def states_noise(shape_i: str, shape_j: str) -> float:
    """Return the scatter of normals for a pair of shapes: 0 where they are made exact."""
    if shape_i in ROUND and shape_j in ROUND:
        return 0.0
    iterative = {"ELLIPSOID", "CYLINDER", "FRUSTUM"}
    both = {shape_i, shape_j}
    return NORMAL_NOISE if both & iterative and "PLANE" not in both else 0.0


class FclDetector:
    """FCL behind an address, for the pairs of one scene.

    Parameters
    ----------
    scene : Scene
    graphics : list of Graphic
        Row by row as in ``scene.graphics``.
    """

    def __init__(self, scene: Scene, graphics: list[Graphic]) -> None:
        self._scene = scene
        self._graphics = graphics
        self._size = scene.graphics.size[:, :3]
        self._objects: dict[tuple[int, int], Any] = {}
        self._surfaces: dict[int, Surface] = {}
        self._hulls: dict[int, Hull] = {}
        self._fcl: Any = None
        self.failure: BaseException | None = None
        self._callback = ctypes.CFUNCTYPE(ctypes.c_int64, ctypes.c_int64)(self._answer)
        self.address = int(ctypes.cast(self._callback, ctypes.c_void_p).value or 0)

    def _answer(self, count: int) -> int:
        """Detect the first `count` pairs of ``work.fcl``."""
        try:
            if self._fcl is None:
                import fcl

                self._fcl = fcl
            for pair in self._scene.work.fcl[:count].tolist():
                self._detect(pair)
        except BaseException as error:  # nothing may cross a C callback
            self.failure = error
            return Code.DETECTOR_FAILED
        return 0

    def _geometry(self, g: int, flat_partner: float) -> Any:
        """Return FCL's geometry of graphic g; a plane under a flat shape is a box that size."""
        fcl, graphic, size = self._fcl, self._graphics[g], self._size[g]
        if graphic.shape == "SPHERE":
            return fcl.Sphere(size[0])
        if graphic.shape == "ELLIPSOID":
            return fcl.Ellipsoid(*size)
        if graphic.shape == "BOX":
            return fcl.Box(*(2.0 * size))
        if graphic.shape == "CYLINDER":
            return fcl.Cylinder(size[0], 2.0 * size[1])
        if graphic.shape == "FRUSTUM":
            return self._prism(*size)
        if graphic.shape == "PLANE":
            if flat_partner > 0.0:
                return fcl.Box(8.0 * flat_partner, 8.0 * flat_partner, 8.0 * flat_partner)
            return fcl.Halfspace(np.array([0.0, 0.0, 1.0]), 0.0)
        mesh = fcl.BVHModel()
        assert graphic.vertices is not None
        assert graphic.faces is not None
        mesh.beginModel(len(graphic.vertices), len(graphic.faces))
        mesh.addSubModel(graphic.vertices, graphic.faces)
        mesh.endModel()
        return mesh

    def _prism(self, bottom: float, top: float, half: float) -> Any:
        """Return a frustum, which FCL does not have, as a polyhedron around it.

        Its depth is made exact afterwards; touch is seen too early by at most r (1/cos(pi/n) - 1).
        """
        n = _SIDES
        angle = 2.0 * np.pi * np.arange(n) / n
        ring = np.column_stack([np.cos(angle), np.sin(angle)]) / np.cos(np.pi / n)
        ends = [
            np.column_stack([r * ring, np.full(n, z)]) for r, z in ((bottom, -half), (top, half))
        ]
        vertices = np.vstack([*ends, [[0.0, 0.0, -half], [0.0, 0.0, half]]])
        k = np.arange(n)
        m = (k + 1) % n
        faces = np.vstack([
            np.column_stack([k, m, n + m]), np.column_stack([k, n + m, n + k]),
            np.column_stack([np.full(n, 2 * n), m, k]),
            np.column_stack([np.full(n, 2 * n + 1), n + k, n + m]),
        ])  # fmt: skip
        rows = np.column_stack([np.full(len(faces), 3), faces]).ravel()
        return self._fcl.Convex(vertices, len(faces), rows)

    def _object(self, pair: int, g: int, other: int) -> tuple[Any, float]:
        """Return the collision object of one side, and the size of its stand-in box or 0."""
        flat = 0.0
        if self._graphics[g].shape == "PLANE" and self._graphics[other].shape == "BOX":
            flat = float(self._scene.graphics.radius[other])
        # a stand-in belongs to its pair, everything else is shared by all pairs of the graphic
        key = (g, pair if flat else -1)
        if key not in self._objects:
            self._objects[key] = self._fcl.CollisionObject(self._geometry(g, flat))
        return self._objects[key], flat

    def _frame(self, g: int) -> tuple[np.ndarray[Any, Any], np.ndarray[Any, Any]]:
        """Return centre and axes of graphic g at the trial point."""
        frame = self._scene.work.frames[g]
        return frame[:3], frame[3:].reshape(3, 3)

    def _detect(self, pair: int) -> None:
        """Fill the candidate rows of one pair."""
        scene, fcl = self._scene, self._fcl
        i, j = int(scene.pairs.graphic_i[pair]), int(scene.pairs.graphic_j[pair])
        objects = []
        for g, other in ((i, j), (j, i)):
            body, flat = self._object(pair, g, other)
            p, R = self._frame(g)
            if flat:
                # keep the stand-in right below what lies on it, its face in the plane
                n, above = R[:, 2], self._frame(other)[0]
                p = above - n * (n @ (above - p) + 4.0 * flat)
            body.setTransform(fcl.Transform(R, p))
            objects.append(body)
        kind = scene.pairs.kind[pair]
        first = int(scene.pairs.slot[pair])
        last = first + int(scene.kinds.slots[kind])
        meshes = "MESH" in (self._graphics[i].shape, self._graphics[j].shape)
        if meshes and self._put_hull(i, j, scene.work.points[first]):
            return
        most = _MESH_CONTACTS if meshes else last - first
        request = fcl.CollisionRequest(num_max_contacts=most, enable_contact=True)
        result = fcl.CollisionResult()
        if "PLANE" not in (self._graphics[i].shape, self._graphics[j].shape) or not meshes:
            fcl.collide(objects[0], objects[1], request, result)
        if meshes:
            self._put_mesh(i, j, result.contacts, scene.work.points[first])
            return
        # FCL's normal points from its first object to its second
        found = [
            (c.penetration_depth, np.array(c.pos), -np.array(c.normal)) for c in result.contacts
        ]
        found.sort(key=lambda contact: -contact[0])
        points = scene.work.points
        points[first:last, 0] = -0.0
        sign = -1.0 if scene.kinds.swapped[kind] else 1.0
        for slot, (depth, p, n) in enumerate(found[: last - first], first):
            if last - first == 1:
                n = self._sharpen(i, j, n)
                depth, p = self._refine(i, j, depth, p, n)
            points[slot, AT_DEPTH] = depth
            points[slot, AT_POINT:AT_NORMAL] = p
            points[slot, AT_NORMAL:AT_WEIGHT] = sign * n
            points[slot, AT_WEIGHT], points[slot, COUPLE:] = 1.0, 0.0

    def _surface(self, g: int) -> Surface:
        """Return the mesh of graphic g with its normals and neighbours."""
        if g not in self._surfaces:
            graphic = self._graphics[g]
            assert graphic.vertices is not None
            assert graphic.faces is not None
            convex = graphic.hull is not None
            self._surfaces[g] = Surface(graphic.vertices, graphic.faces, convex)
        return self._surfaces[g]

    def _put_hull(self, i: int, j: int, row: Any) -> bool:
        """Fill the row of a convex mesh on a round solid; False where the pair is another one."""
        turned = self._graphics[j].shape != "MESH"
        mesh, other = (i, j) if turned else (j, i)
        shape = self._graphics[other].shape
        if shape not in ("CYLINDER", "FRUSTUM", "ELLIPSOID") or self._graphics[mesh].hull is None:
            return False
        if mesh not in self._hulls:
            surface = self._surface(mesh)
            self._hulls[mesh] = hull_of(
                surface.vertices, surface.faces, surface.normals, surface.beside
            )
        hull = self._hulls[mesh]
        (p, R), (p_o, R_o) = self._frame(mesh), self._frame(other)
        size = self._size[other]
        solid = Solid(shape, size, R.T @ (p_o - p), R.T @ R_o)
        depth, n = least_overlap(hull, solid)
        row[AT_DEPTH], row[AT_WEIGHT], row[COUPLE:] = max(depth, -0.0), 1.0, 0.0
        if depth > 0.0:
            row[AT_POINT:AT_NORMAL] = p + R @ touching_point(solid, depth, n)
            row[AT_NORMAL:AT_WEIGHT] = -(R @ n) if turned else R @ n
        return True

    def _put_mesh(self, i: int, j: int, contacts: list[Any], row: Any) -> None:
        """Fill the row of a pair with a mesh from the triangles in contact."""
        row[AT_DEPTH] = -0.0
        shapes = (self._graphics[i].shape, self._graphics[j].shape)
        if not contacts and "PLANE" not in shapes:
            return
        # everything is measured in the axes of the mesh, of J's if both are meshes
        turned = self._graphics[j].shape != "MESH"
        mesh, other = (i, j) if turned else (j, i)
        p, R = self._frame(mesh)
        if self._graphics[other].shape == "MESH":
            depth, at, n = self._on_mesh(i, j, contacts)
        else:
            depth, at, n = self._on_other(mesh, other, contacts)
        row[AT_DEPTH] = depth if depth > 0.0 else -0.0
        row[AT_POINT:AT_NORMAL] = p + R @ at
        row[AT_NORMAL:AT_WEIGHT] = -(R @ n) if turned else R @ n
        row[AT_WEIGHT], row[COUPLE:] = 1.0, 0.0

    def _on_mesh(self, i: int, j: int, contacts: list[Any]) -> tuple[float, Any, Any]:
        """Return (depth, point, normal) of two meshes in J's axes."""
        (p_i, R_i), (p_j, R_j) = self._frame(i), self._frame(j)
        frame = (R_j.T @ (p_i - p_j), R_j.T @ R_i)
        pairs = np.array([(c.b1, c.b2) for c in contacts])
        return of_meshes(self._surface(i), self._surface(j), frame, pairs)

    def _on_other(self, mesh: int, other: int, contacts: list[Any]) -> tuple[float, Any, Any]:
        """Return (depth, point, normal out of the mesh) of a mesh and a shape, in its axes."""
        surface, shape = self._surface(mesh), self._graphics[other].shape
        size = self._size[other]
        (p, R), (p_o, R_o) = self._frame(mesh), self._frame(other)
        centre, axes = R.T @ (p_o - p), R.T @ R_o
        if shape == "PLANE":
            up = axes[:, 2]
            depth, low = under_plane(surface, up, float(up @ centre))
            return depth, low + 0.5 * depth * up, -up
        # FCL gives the triangle first, wherever the mesh stands
        touched = np.array([c.b1 for c in contacts])
        if shape == "SPHERE":
            return under_sphere(surface, touched, centre, float(size[0]))
        normals = np.array([c.normal for c in contacts]) @ R
        own = np.empty((0, 3))
        if shape == "BOX":
            own = np.vstack([axes.T, -axes.T])
        elif shape in ("CYLINDER", "FRUSTUM"):
            own = np.vstack([axes[:, 2], -axes[:, 2]])
        return against_convex(
            surface, touched, normals, lambda d: support(shape, size, centre, axes, d), own
        )

    def _sharpen(self, i: int, j: int, n: Any) -> Any:
        """Return the normal made exact where a shape is round and the other round or a box."""
        shape_i, shape_j = self._graphics[i].shape, self._graphics[j].shape
        size, frame_i, frame_j = self._size, self._frame(i), self._frame(j)
        if shape_i in ROUND and shape_j in ROUND:
            return round_normal(shape_i, size[i], frame_i, shape_j, size[j], frame_j, n)
        if shape_i in ROUND and shape_j == "BOX":
            face = face_normal(
                size[j], frame_j, lambda d: support(shape_i, size[i], *frame_i, -d), n
            )
            return n if face is None else face
        if shape_j in ROUND and shape_i == "BOX":
            face = face_normal(
                size[i], frame_i, lambda d: support(shape_j, size[j], *frame_j, -d), -n
            )
            return n if face is None else -face
        if shape_i in CONVEX and shape_j in CONVEX:
            return self._nearest_flat(i, j, n)
        return n

    def _nearest_flat(self, i: int, j: int, n: Any) -> Any:
        """Return a flat side's normal near n where the shapes overlap no more along it, else n."""
        best, least = n, self._overlap(i, j, n)
        for g in (i, j):
            R = self._frame(g)[1]
            own = {"BOX": R.T, "CYLINDER": R.T[2:], "FRUSTUM": R.T[2:]}
            for axis in own.get(self._graphics[g].shape, R.T[:0]):
                along = float(axis @ n)
                if abs(along) < 0.9:
                    continue
                flat = axis * np.sign(along)
                depth = self._overlap(i, j, flat)
                if depth <= least * (1.0 + 1e-9):
                    best, least = flat, depth
        return best

    def _overlap(self, i: int, j: int, n: Any) -> float:
        """Return how far convex shapes overlap along n."""
        size = self._size
        low = support(self._graphics[i].shape, size[i], *self._frame(i), -n)
        high = support(self._graphics[j].shape, size[j], *self._frame(j), n)
        return float(n @ (high - low))

    def _refine(self, i: int, j: int, depth: float, p: Any, n: Any) -> tuple[float, Any]:
        """Return depth and midpoint made exact along n from the shapes' support points."""
        shape_i, shape_j = self._graphics[i].shape, self._graphics[j].shape
        size = self._size

        def far(g: int, d: Any) -> Any:
            return support(self._graphics[g].shape, size[g], *self._frame(g), d)

        if shape_i in CONVEX:
            low = far(i, -n)
        elif shape_i == "PLANE":
            low = self._frame(i)[0]
        else:
            return depth, p
        if shape_j in CONVEX:
            high = far(j, n)
        elif shape_j == "PLANE":
            high = self._frame(j)[0]
        else:
            return depth, p
        exact = float(n @ (high - low))
        if shape_i in ROUND:
            return exact, low + 0.5 * exact * n
        if shape_j in ROUND:
            return exact, high - 0.5 * exact * n
        # FCL may choose any point of what is down, however it is tilted
        lowest = lowest_side(lambda d: far(i, d), n, exact) if shape_i in CONVEX else None
        highest = lowest_side(lambda d: far(j, d), -n, exact) if shape_j in CONVEX else None
        if lowest is None or highest is None:
            side = highest if lowest is None else lowest
            assert side is not None
            p = place(side, side, n)
            return exact, p + n * (0.5 * float(n @ (high + low)) - float(n @ p))
        return exact, place(highest, lowest, n)
