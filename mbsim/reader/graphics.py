"""Post_Graphic: the solids that contacts act on; other graphics are pictures only."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from mbsim.errors import ModelError
from mbsim.model import elements as el
from mbsim.model.hull import polyhedron_of
from mbsim.model.mesh import Faces, merge_vertices
from mbsim.model.mesh_file import load_mesh
from mbsim.reader import units
from mbsim.reader.keywords import ENDS_TYPES, FACETS, fold, nearest
from mbsim.reader.kinds import (
    FLAG,
    ID,
    NOT_NEGATIVE,
    POSITIVE,
    REAL,
    REAL_NO_EXPRESSION,
    TEXT,
    keyword,
)
from mbsim.reader.parse import Node
from mbsim.reader.statement import NAMED, Entry, Spec, Statement


@dataclass(frozen=True)
class Shape:
    """One built type: our shape, the attributes that may name its marker, sizes and extras.

    `offset` is the shape's centre in its marker's frame, as multiples of the sizes.
    """

    type: str
    shape: str
    markers: tuple[str, ...]
    sizes: tuple[str, ...] = ()
    extras: tuple[str, ...] = ()
    offset: tuple[tuple[float, ...], ...] = ()

    @cached_property
    def attributes(self) -> frozenset[str]:
        """Return the attributes that a graphic of this type may have."""
        return frozenset((*_COMMON, *self.markers, *self.sizes, *self.extras))


_LENGTHS = ("length_x", "length_y", "length_z")
_RADII = ("bottom_radius", "top_radius")
_BOUNDS = ("xmin", "xmax", "ymin", "ymax")
_HALF = ((0.5, 0.0, 0.0), (0.0, 0.5, 0.0), (0.0, 0.0, 0.5))
SHAPES = (
    Shape("Sphere", "SPHERE", ("center_marker_id",), ("radius",)),
    # the scales are taken as semi-axes
    Shape("Ellipsoid", "ELLIPSOID", ("center_marker_id",), ("x_scale", "y_scale", "z_scale")),
    Shape("BoxDefinedFromCorner", "BOX", ("corner_marker_id",), _LENGTHS, offset=_HALF),
    Shape("BoxDefinedFromCenter", "BOX", ("center_marker_id",), _LENGTHS),
    # the marker is the centre of the base circle; the axis is +z
    Shape(
        "Cylinder",
        "CYLINDER",
        ("center_marker_id",),
        ("radius", "length"),
        ("ends_type",),
        ((0.0, 0.0), (0.0, 0.0), (0.0, 0.5)),
    ),
    # bottom_radius at the marker, top_radius at z = length
    Shape(
        "Frustum",
        "FRUSTUM",
        ("center_marker_id",),
        ("bottom_radius", "top_radius", "length"),
        ("ends_type",),
        ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.5)),
    ),
    Shape("Plane", "PLANE", ("rm_id", "center_marker_id"), (), _BOUNDS),
    Shape("TriaMesh", "MESH", ("rm_id",), (), ("file", "length_unit", "facets", "crease_angle")),
)
_BY_TYPE = {fold(shape.type): shape for shape in SHAPES}

# documented, not contact shapes here: kept as pictures, refused where a contact names them
DISPLAY_TYPES = (
    "Parasolid SPDP Outline Arc Circle LineMesh ParamCurve ParamSurface DeformCurve "
    "DeformSurface Point UserGra"
).split()
_DISPLAY = {fold(name): name for name in DISPLAY_TYPES}


def _is_display(node: Node) -> bool:
    """Return whether the node is of a type that is only a picture."""
    type = node.find("type")
    return type is not None and fold(type.value) in _DISPLAY


def _build_display(entry: Entry) -> None:
    """Remember the id of a graphic that is only a picture."""
    found = entry.node.find("type")
    name = _DISPLAY[fold(found.value)] if found else ""
    try:
        id = ID.parse(found_id.value.strip()) if (found_id := entry.node.find("id")) else None
    except ValueError:
        id = None
    if id is None:
        entry.fault(f"id: must be {ID.allowed}")
    elif id in entry.draft.display_graphics:
        entry.fault(f'id="{id}": id already used; ids are unique per statement')
    else:
        entry.draft.display_graphics[id] = name
        entry.note(f"type {name} is not built as a contact shape and is a picture only")


def _build_graphic(entry: Entry) -> None:
    """Add a graphic of a built type."""
    if _is_display(entry.node):
        _build_display(entry)
        return
    shape = _BY_TYPE.get(fold(entry.get("type", "")))
    if shape is None:
        if entry.get("type") is not None:
            names = [known.type for known in SHAPES]
            close = nearest(entry.get("type"), (*names, *DISPLAY_TYPES))
            entry.fault(f"must be one of {', '.join(names)}{close}", "type")
        return
    _check_attributes(entry, shape)
    marker_id = _marker_id(entry, shape)
    size = tuple(entry.get(name, 1.0) for name in shape.sizes)
    offset = [sum(f * s for f, s in zip(row, size, strict=True)) for row in shape.offset]
    vertices, faces, file, convex = None, None, "", None
    if shape.shape == "MESH" and (mesh := _mesh(entry)) is not None:
        vertices, faces, file = mesh.vertices, mesh.faces, mesh.file
        convex = polyhedron_of(vertices, faces)
        finer = _smoothed(entry, mesh)
        if finer is not None:
            # a polyhedron is known by its corners: what is curved is measured as patches
            (vertices, faces), convex = finer, None

    graphic = el.Graphic(
        id=entry.get("id", 0),
        label=entry.get("label", ""),
        type=shape.type,
        shape=shape.shape,
        marker_id=marker_id,
        size=size,
        offset=(offset[0], offset[1], offset[2]) if offset else (0.0, 0.0, 0.0),
        vertices=vertices,
        faces=faces,
        mesh_file=file,
        hull=convex,
        is_material_inside=entry.get("is_material_inside", True),
        color=_color(entry),
        hidden=entry.get("hidden", False),
        bounds=_bounds(entry),
        source=entry.source,
    )
    entry.register("graphics", graphic, "display_graphics")


def _color(entry: Entry) -> tuple[int, int, int] | None:
    """Return red, green and blue of ``color="r:g:b"``, None with a note for another text."""
    text = entry.get("color", "")
    parts = [part.strip() for part in text.split(":")]
    if len(parts) == 3 and all(part.isascii() and part.isdigit() for part in parts):
        red, green, blue = (int(part) for part in parts)
        if max(red, green, blue) <= 255:
            return red, green, blue
    if text.strip():
        entry.note("pictures take r:g:b, each from 0 to 255; another colour is shown", "color")
    return None


def _bounds(entry: Entry) -> tuple[float, ...]:
    """Return the bounds of a plane's picture, nothing where the deck does not give all four."""
    if not all(entry.given(name) for name in _BOUNDS):
        return ()
    return tuple(float(entry.get(name, 0.0)) for name in _BOUNDS)


def _check_attributes(entry: Entry, shape: Shape) -> None:
    """Refuse attributes of other types and missing sizes; note what has no effect."""
    for name in entry.those(entry.statement.attributes):
        if name not in shape.attributes:
            allowed = ", ".join((*shape.markers, *shape.sizes, *shape.extras))
            entry.fault(f"type {shape.type} has no such attribute; it has {allowed}", name)
    for name in shape.sizes:
        if not entry.given(name):
            allowed = (NOT_NEGATIVE if name in _RADII else POSITIVE).allowed
            entry.fault(f"{name}: missing; must be {allowed} for type {shape.type}")
    if shape.shape == "FRUSTUM" and all(entry.get(name, 1.0) == 0.0 for name in _RADII):
        entry.fault("must be > 0 where bottom_radius is 0: a line has no volume", "top_radius")
    for name in _BOUNDS if shape.shape == "PLANE" else ():
        if entry.given(name):
            entry.note("contact uses the whole plane, the half-space z <= 0", name)
    if entry.get("ends_type", "CLOSED") != "CLOSED":
        entry.note("contact takes the solid as closed at both ends", "ends_type")


def _marker_id(entry: Entry, shape: Shape) -> int:
    """Return the marker that carries the shape, 0 where the deck gives none or two."""
    given = entry.those(shape.markers)
    if len(given) == 1:
        return int(entry.get(given[0], 0))
    names = " or ".join(shape.markers)
    what = "missing" if not given else "give only one"
    entry.fault(f"{names}: {what}; type {shape.type} needs the id of its marker")
    return 0


class _Mesh(NamedTuple):
    """A TriaMesh as its file or the deck has it, in the deck's unit of length."""

    vertices: el.Array  # (n, 3)
    faces: Faces  # (m, 3)
    file: str = ""
    normals: el.Array | None = None  # (m, 3, 3) see `MeshFile`


def _smoothed(entry: Entry, mesh: _Mesh) -> tuple[el.Array, Faces] | None:
    """Return vertices and faces of a mesh with smooth facets, None where it stays as it is."""
    facets = entry.get("facets")
    if facets == "FLAT" or (facets is None and mesh.normals is None):
        if entry.given("crease_angle"):
            entry.note('has no effect without facets="SMOOTH" or normals in file', "crease_angle")
        return None
    from mbsim.model.mesh import solid_fault
    from mbsim.model.smooth_facets import CREASE, smooth

    if solid_fault(mesh.vertices, mesh.faces):
        return None
    crease, told = entry.get("crease_angle", CREASE), mesh.normals if facets is None else None
    finer, cut = smooth(mesh.vertices, mesh.faces, crease, told=told)
    if len(cut) == len(mesh.faces):
        if facets is not None:
            entry.note("no edge is smooth: all bend by more than crease_angle", "facets")
        return None
    if facets is None:
        message = (
            'its normals say where it is smooth, so it is rounded there; facets="FLAT" does not'
        )
        entry.note(message, "file")
    return finer, cut


def _mesh(entry: Entry) -> _Mesh | None:
    """Return a TriaMesh from its file or its child elements, None with a fault."""
    children = {child.key: child for child in entry.node.children}
    if entry.given("file") == bool(children):
        both = "not both" if children else "one is needed"
        entry.fault(f'TriaMesh: file="..." or <Nodes> and <Faces>: {both}')
        return None
    if not children:
        path = entry.beside(entry.get("file", ""))
        try:
            vertices, faces, unit, normals = load_mesh(path)
        except ModelError as error:
            entry.fault(str(error), "file")
            return None
        scale = _scale(entry, unit)
        # an inch in metres is no round number: the factor is rounded once
        return _Mesh(vertices if scale == 1.0 else vertices * scale, faces, str(path), normals)

    if entry.given("length_unit"):
        entry.fault("is for a file; <Nodes> are in the deck's unit of length", "length_unit")

    if set(children) != {"nodes", "faces"} or len(entry.node.children) != 2:
        entry.fault("TriaMesh: needs one <Nodes> and one <Faces>")
        return None
    nodes = _numbers(entry, children["nodes"], "numbers")
    indices = _numbers(entry, children["faces"], "zero-based vertex indices")
    if nodes is None or indices is None:
        return None
    bad = (indices != np.floor(indices)) | (indices < 0) | (indices >= len(nodes))
    if bad.any():
        message = f"<Faces>: {indices[bad][0]:g} is no index of {len(nodes)} nodes (from 0)"
        entry.fault_at(children["faces"].line, message)
        return None
    return _Mesh(*merge_vertices(nodes, indices.astype(np.int64)))


def _scale(entry: Entry, unit: str) -> float:
    """Return the factor from a mesh file's numbers to the deck's unit of length.

    The attribute goes first, then the `unit` that the file's format tells, then the deck's.
    """
    ours = (entry.draft.units or el.Units()).length
    theirs = entry.get("length_unit") or unit or ours
    factor = units.LENGTH[theirs] / units.LENGTH[ours]
    if unit and unit != ours and not entry.given("length_unit"):
        entry.note(f"is in {unit} by its format, taken times {float(factor):g} to {ours}", "file")
    elif unit and theirs != unit:
        entry.note(f"goes before {unit}, which the file's format says", "length_unit")
    return float(factor)


def _numbers(entry: Entry, node: Node, what: str) -> el.Array | None:
    """Return the text of <Nodes> or <Faces> as rows of three, None with a fault."""
    words = node.text.replace(",", " ").split()
    message = ""
    values = np.zeros(0)
    if "_" in node.text:
        message = "'_' is not part of a number"
    else:
        try:
            values = np.array(words, dtype=np.float64)
        except ValueError as error:
            message = str(error)
    if not message and (len(values) == 0 or len(values) % 3):
        message = f"{len(values)} values; must be {what}, three to a row"
    if not message and not (np.abs(values) < 1e40).all():
        message = "values must be finite and below 1e40"
    if message:
        entry.fault_at(node.line, f"<{node.tag}>: {message}")
        return None
    return values.reshape(-1, 3)


_ABOUT_TYPE = "shape: Sphere, BoxDefinedFromCenter, Plane, ..."
_ABOUT_RADII = {
    "bottom_radius": "radius of a frustum at its marker",
    "top_radius": "radius of a frustum at z = length",
}
_COMMON = {
    "id": NAMED["id"],
    "type": Spec(TEXT, _ABOUT_TYPE, required=True),
    "label": NAMED["label"],
    "full_label": NAMED["full_label"],
    "color": Spec(TEXT, "colour in pictures, r:g:b, each from 0 to 255", "", "by its body"),
    "hidden": Spec(FLAG, "TRUE: pictures show it only when asked to", "", "FALSE"),
    "refinement_level": Spec(REAL, note="closed forms and meshes are used as they are"),
    "is_material_inside": Spec(FLAG, "FALSE (a cavity) is refused in a contact", "", "TRUE"),
}
POST_GRAPHIC = Statement(
    "Post_Graphic",
    {
        **_COMMON,
        "center_marker_id": Spec(ID, "marker at the centre; of Cylinder, Frustum at the base"),
        "corner_marker_id": Spec(ID, "marker at the corner of BoxDefinedFromCorner"),
        "rm_id": Spec(ID, "marker of a Plane (solid at z <= 0) or of a TriaMesh"),
        "radius": Spec(POSITIVE, "radius of a Sphere or Cylinder", "L"),
        "length": Spec(POSITIVE, "length along z of a Cylinder or Frustum", "L"),
        **{name: Spec(NOT_NEGATIVE, about, "L") for name, about in _ABOUT_RADII.items()},
        **{name: Spec(POSITIVE, f"edge of a box along {name[-1]}", "L") for name in _LENGTHS},
        **{
            f"{axis}_scale": Spec(POSITIVE, f"semi-axis of an Ellipsoid along {axis}", "L")
            for axis in "xyz"
        },
        **{
            name: Spec(REAL_NO_EXPRESSION, "bound of a Plane's picture; contact has none", "L")
            for name in _BOUNDS
        },
        "ends_type": Spec(keyword(ENDS_TYPES), "contact takes ends as closed", "", "CLOSED"),
        "file": Spec(
            TEXT, "a TriaMesh's STL, OBJ, OFF, PLY, GLB, glTF or 3MF, relative to the deck"
        ),
        # ours
        "length_unit": Spec(
            keyword(units.names(units.LENGTH)),
            "unit of the file's numbers",
            "",
            "the file's own, else the deck's",
        ),
        "facets": Spec(
            keyword(FACETS), "SMOOTH: rounded between sharp edges", "", "by the file's normals"
        ),
        "crease_angle": Spec(POSITIVE, "bend above which an edge is sharp", "deg", "30"),
    },
    _build_graphic,
    children=("Nodes", "Faces"),
    any_attribute=_is_display,
    about="a shape on a body: what contacts act on",
)
