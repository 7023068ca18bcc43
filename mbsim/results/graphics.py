"""What a picture of a run needs besides its motion: shapes, markers, and what is between bodies.

Tables are written once, with the first facts of a file. Poses are in the frame of the body: that
of its cg marker, of ground the global frame.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Sequence
from functools import cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from mbsim.model.elements import Array, Graphic, Model
from mbsim.results.elements import APPLIED, CONSTRAINTS, GROUPS, elements_of
from mbsim.results.forces import contact_bodies

if TYPE_CHECKING:
    from mbsim.model.placement import Placement

Table = np.ndarray[Any, Any]
#: No body: what is at several bodies, and markers and meshes that are not there.
NONE = -1
_POSE = [("body", "<i8"), ("position", "<f8", (3,)), ("quaternion", "<f8", (4,))]
#: Of `/graphics/shapes`; `color` is 65536 red + 256 green + blue, `mesh` a row of
#: `/graphics/meshes`, `size` and `bounds` those of `Graphic`, zeros behind them.
SHAPE = [
    ("id", "<i8"),
    *_POSE,
    ("shape", "S9"),
    ("size", "<f8", (3,)),
    ("bounds", "<f8", (4,)),
    ("color", "<i4"),
    ("hidden", "u1"),
    ("mesh", "<i4"),
]
MARKER = [("id", "<i8"), *_POSE]
#: Of `/connections`: what is between two bodies, at which markers; a contact has no markers.
CONNECTION = [
    ("group", "S20"),
    ("id", "<i8"),
    *((name, "<i8") for name in ("i_marker", "j_marker", "i_body", "j_body")),
]
#: Of `/graphics/meshes`: where vertices and faces of each begin, and how many there are.
MESH = [(name, "<i8") for name in ("vertex", "vertices", "face", "faces")]


def graphics_of(model: Model, placement: Placement) -> dict[str, Table]:
    """Return the tables by name."""
    found = {
        "markers": _with_labels(MARKER, list(_markers(model, placement)), model.markers),
        "connections": np.array(list(_connections(model)), dtype=CONNECTION),
    }
    meshes = _Meshes()
    rows = list(_shapes(model, placement, meshes))
    found["graphics/shapes"] = _with_labels(SHAPE, rows, model.graphics)
    return found | meshes.tables()


def graphics_later(model: Model, placement: Placement) -> dict[str, Callable[[], Table]]:
    """Return what makes the tables by name, all of them where one is asked for.

    Of results in memory hardly anybody looks at them.
    """
    made = cache(lambda: graphics_of(model, placement))
    names = ["markers", "connections", "graphics/shapes"]
    if any(_is_mesh(graphic) for graphic in model.graphics.values()):
        names += ["graphics/meshes", "graphics/vertices", "graphics/faces"]
    return {name: partial(_one_of, made, name) for name in names}


def _one_of(made: Callable[[], dict[str, Table]], name: str) -> Table:
    return made()[name]


def about_graphics(model: Model, placement: Placement) -> dict[str, float]:
    """Return the attributes of `/graphics`: gravity at first [L/T^2], and the deck's size [L]."""
    gravity = model.gravity
    if model.simulations and model.simulations[0].gravity is not None:
        gravity = model.simulations[0].gravity
    names = ("gravity_x", "gravity_y", "gravity_z")
    return {**dict(zip(names, map(float, gravity.g), strict=True)), "size": placement.L}


def _with_labels(fields: list[Any], rows: list[Any], elements: Any) -> Table:
    """Return a table of rows that begin with an id, with the deck's labels as UTF-8."""
    labels = [elements[row[0]].label.encode("utf-8", "backslashreplace") for row in rows]
    width = max(map(len, labels), default=0)
    if not width:
        return np.array(rows, dtype=fields)
    kept: list[Any] = [(*row, label) for row, label in zip(rows, labels, strict=True)]
    return np.array(kept, dtype=[*fields, ("label", f"S{width}")])


def _markers(model: Model, placement: Placement) -> Iterator[tuple[Any, ...]]:
    places = list(placement.markers.values())
    turns = quaternions(np.array([place.R_B for place in places]).reshape(-1, 3, 3))
    for place, q in zip(places, turns, strict=True):
        yield place.id, place.body_id, tuple(place.p_B), tuple(q)


def _shapes(model: Model, placement: Placement, meshes: _Meshes) -> Iterator[tuple[Any, ...]]:
    graphics = list(model.graphics.values())
    places = [placement.markers[graphic.marker_id] for graphic in graphics]
    turns = quaternions(np.array([place.R_B for place in places]).reshape(-1, 3, 3))
    for graphic, place, q in zip(graphics, places, turns, strict=True):
        centre = place.p_B + place.R_B @ np.array(graphic.offset)
        color = NONE
        if graphic.color is not None:
            red, green, blue = graphic.color
            color = (red << 16) + (green << 8) + blue
        yield (
            graphic.id,
            place.body_id,
            tuple(centre),
            tuple(q),
            graphic.shape.encode(),
            _padded(graphic.size, 3),
            _padded(graphic.bounds, 4),
            color,
            graphic.hidden,
            meshes.row_of(graphic),
        )


def _padded(values: Sequence[float], width: int) -> tuple[float, ...]:
    return (*values, *[0.0] * (width - len(values)))


def _connections(model: Model) -> Iterator[tuple[Any, ...]]:
    """Yield group, id, markers and bodies of everything between two of them."""
    for statement in (*CONSTRAINTS, *APPLIED):
        for id, element in elements_of(model, statement).items():
            i, j = (getattr(element, f"{side}_marker_id", 0) for side in "ij")
            joint = model.joints.get(getattr(element, "joint_id", None) or 0)
            if joint is not None and not i:
                i, j = joint.i_marker_id, joint.j_marker_id
            if i not in model.markers:
                continue  # couplers and general constraints are between no markers
            j = j if j in model.markers else NONE
            bodies = (model.markers[m].body_id if m != NONE else NONE for m in (i, j))
            yield GROUPS[statement].path.encode(), id, i, j, *bodies
    for contact in model.contacts.values():
        one = (b.pop() if len(b) == 1 else NONE for b in contact_bodies(model, contact))
        yield b"contacts", contact.id, NONE, NONE, *one


def _is_mesh(graphic: Graphic) -> bool:
    return graphic.vertices is not None and graphic.faces is not None


class _Meshes:
    """Vertices and faces of all meshes, each once however many graphics have it."""

    def __init__(self) -> None:
        self._rows: dict[bytes, int] = {}
        self._vertices: list[Table] = []
        self._faces: list[Table] = []

    def row_of(self, graphic: Graphic) -> int:
        """Return the row of a graphic's mesh, NONE of other shapes."""
        if graphic.vertices is None or graphic.faces is None:
            return NONE
        # what is drawn has no use for more digits
        vertices = graphic.vertices.astype("<f4")
        faces = graphic.faces.astype("<u4")
        key = hashlib.sha256(vertices.tobytes() + b"/" + faces.tobytes()).digest()
        if key not in self._rows:
            self._rows[key] = len(self._vertices)
            self._vertices.append(vertices)
            self._faces.append(faces)
        return self._rows[key]

    def tables(self) -> dict[str, Table]:
        """Return vertices (n, 3), faces (m, 3) that count within their mesh, where each begins."""
        if not self._vertices:
            return {}
        counts = [(len(v), len(f)) for v, f in zip(self._vertices, self._faces, strict=True)]
        first = np.cumsum([(0, 0), *counts], axis=0)
        rows = [
            (vertex, vertices, face, faces)
            for (vertex, face), (vertices, faces) in zip(first.tolist(), counts, strict=False)
        ]
        return {
            "graphics/meshes": np.array(rows, dtype=MESH),
            "graphics/vertices": np.concatenate(self._vertices),
            "graphics/faces": np.concatenate(self._faces),
        }


def quaternions(R: Array) -> Array:
    """Return the unit quaternions (n, 4), w first and not negative, of rotation matrices (n, 3, 3).

    The eigenvector of the largest eigenvalue of the symmetric 4 x 4 matrix B, for which
    q'B q = tr(R' R(q)), is the rotation (I. Y. Bar-Itzhack, J. Guidance 23(6), 2000).
    """
    trace = np.trace(R, axis1=1, axis2=2)
    B = np.zeros((len(R), 4, 4))
    B[:, 0, 0] = trace
    skew = (R[:, 2, 1] - R[:, 1, 2], R[:, 0, 2] - R[:, 2, 0], R[:, 1, 0] - R[:, 0, 1])
    for k, value in enumerate(skew):
        B[:, 0, 1 + k] = B[:, 1 + k, 0] = value
    B[:, 1:, 1:] = R + R.transpose(0, 2, 1) - trace[:, None, None] * np.eye(3)
    _, vectors = np.linalg.eigh(B)
    q: Array = vectors[:, :, -1]
    # that of no rotation is exact
    q[np.abs(R - np.eye(3)).max(axis=(1, 2), initial=0.0) == 0.0] = (1.0, 0.0, 0.0, 0.0)
    return np.where(q[:, :1] < 0.0, -q, q) + 0.0
