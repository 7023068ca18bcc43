"""Whether a model makes sense as a whole: references, rings of markers, masses, contacts.

Every check adds its faults to one list, so that a user sees all of them at once.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from mbsim.errors import Fault
from mbsim.model.body_mass import BodyMassError, body_mass
from mbsim.model.contact_radius import by_materials, side_radius
from mbsim.model.elements import Contact, Graphic, Model, Source
from mbsim.model.frames import marker_frames, marker_loops
from mbsim.model.mechanism_checks import check_mechanism, wanted
from mbsim.model.mechanism_checks import tables as mechanism_tables
from mbsim.model.mesh import solid_fault
from mbsim.model.mesh_findings import crossing_findings, mesh_findings

_MOST_LISTED = 10
# the attribute that names the marker of a graphic, where it is not center_marker_id
_MARKER_ATTRIBUTE = {
    "BoxDefinedFromCorner": "corner_marker_id",
    "Plane": "rm_id",
    "TriaMesh": "rm_id",
}


@dataclass(frozen=True)
class Known:
    """What the reader knows beyond the model, so that one fault is not reported twice.

    `broken` holds (statement, id) of elements with faults of their own; `display_graphics`
    the type of graphics, by id, that exist and are only pictures.
    """

    broken: frozenset[tuple[str, int]] = frozenset()
    display_graphics: Mapping[int, str] = field(default_factory=dict)

    def exists(self, statement: str, id: int) -> bool:
        """Return whether the element is there but may be missing in the model."""
        return (statement, id) in self.broken


def check_model(model: Model, known: Known | None = None) -> tuple[list[Fault], list[str]]:
    """Return all faults of a model and its warnings.

    Parameters
    ----------
    model : Model
        The deck as read.
    known : Known, optional
        What the reader found already.

    Returns
    -------
    faults : list of Fault
        Empty where the model can be simulated.
    warnings : list of str
        What is allowed and looks wrong, each with file and line.
    """
    known = known or Known()
    faults = [
        *_references(model, known),
        *_loops(model),
        *_bodies(model, known),
        *_contacts(model),
        *check_mechanism(model, known.exists),
    ]
    return faults, list(_warnings(model))


def _fault(source: Source, element: str, message: str) -> Fault:
    return Fault(source.file, source.line, element, message)


def _listed(ids: Iterable[int]) -> str:
    """Return the first few ids, for a message that says what there is."""
    ids = list(ids)
    more = f" and {len(ids) - _MOST_LISTED} more" if len(ids) > _MOST_LISTED else ""
    return (", ".join(map(str, ids[:_MOST_LISTED])) or "none") + more


def _wanted(model: Model) -> Iterator[tuple[Source, str, str, int | None, str]]:
    """Yield every reference: where, from which element and attribute, to which id and statement."""
    for body in model.bodies.values():
        for name in ("cg_id", "im_id", "lprf_id", "vm_id", "wm_id"):
            id = getattr(body, name)
            yield body.source, f"Body_Rigid[{body.id}]", name, id, "Reference_Marker"
    for marker in model.markers.values():
        element = f"Reference_Marker[{marker.id}]"
        yield marker.source, element, "body_id", marker.body_id or None, "Body_Rigid"
        yield marker.source, element, "rm_id", marker.rm_id, "Reference_Marker"
    for graphic in model.graphics.values():
        element = f"Post_Graphic[{graphic.id}]"
        name = _MARKER_ATTRIBUTE.get(graphic.type, "center_marker_id")
        yield graphic.source, element, name, graphic.marker_id or None, "Reference_Marker"
    for contact in model.contacts.values():
        for name in ("i_graphics_id", "j_graphics_id"):
            for id in getattr(contact, name):
                yield contact.source, f"Force_Contact[{contact.id}]", name, id, "Post_Graphic"
    for request in model.requests.values():
        for name in ("i_marker_id", "j_marker_id", "ref_marker_id"):
            id = getattr(request, name) or None
            yield request.source, f"Post_Request[{request.id}]", name, id, "Reference_Marker"
    yield from wanted(model)


def _references(model: Model, known: Known) -> Iterator[Fault]:
    """Yield ids that lead nowhere, and body markers that sit on another body."""
    tables: dict[str, Mapping[int, object]] = {
        "Body_Rigid": model.bodies,
        "Reference_Marker": model.markers,
        "Post_Graphic": model.graphics,
        "Force_Contact": model.contacts,
        **mechanism_tables(model),
    }
    for source, element, name, id, target in _wanted(model):
        if id is None or known.exists(target, id):
            continue
        if id in tables[target]:
            floats = target == "Reference_Marker" and model.markers[id].floating
            if floats and name != "j_floating_marker_id":
                message = (
                    f'{name}="{id}": this marker floats: it has no place of its own, and only '
                )
                yield _fault(source, element, message + "j_floating_marker_id may be one")
            continue
        if target == "Post_Graphic" and id in known.display_graphics:
            type = known.display_graphics[id]
            message = f'{name}="{id}": type {type} is not built as a contact shape'
        else:
            message = f'{name}="{id}": no {target} has this id; there are {_listed(tables[target])}'
        yield _fault(source, element, message)

    for body in model.bodies.values():
        for name in ("cg_id", "im_id", "lprf_id"):
            marker = model.markers.get(getattr(body, name) or 0)
            if marker is None or marker.body_id not in model.bodies:
                continue
            if marker.body_id != body.id:
                message = f'{name}="{marker.id}": this marker is on body {marker.body_id}'
                element = f"Body_Rigid[{body.id}]"
                yield _fault(body.source, element, f"{message}, must be on the body itself")


def _loops(model: Model) -> Iterator[Fault]:
    """Yield rings of markers that are given relative to each other."""
    for ring in marker_loops(model):
        first = model.markers[ring[0]]
        shown = ring if len(ring) <= _MOST_LISTED else (*ring[: _MOST_LISTED - 1], "...", ring[-1])
        way = " -> ".join(map(str, shown))
        message = f"rm_id (or the body's lprf_id) leads back to itself: {way}"
        yield _fault(first.source, f"Reference_Marker[{first.id}]", message)


def _bodies(model: Model, known: Known) -> Iterator[Fault]:
    """Yield moving bodies whose mass properties are missing or impossible."""
    frames = marker_frames(model)
    # faults that are reported already would only be repeated in other words
    unsound = {id for statement, id in known.broken if statement == "Body_Rigid"}
    for marker in model.markers.values():
        if marker.id not in frames or known.exists("Reference_Marker", marker.id):
            unsound.add(marker.body_id)
    for body in model.bodies.values():
        ids = (body.cg_id, body.im_id, body.lprf_id)
        dangling = any(id is not None and id not in frames for id in ids)
        if body.is_ground or dangling or body.id in unsound:
            continue
        try:
            body_mass(model, frames, body)
        except BodyMassError as error:
            yield _fault(body.source, f"Body_Rigid[{body.id}]", str(error))


def _graphics(model: Model, contact: Contact, side: str) -> list[Graphic]:
    """Return the graphics of one side of a contact that are in the model."""
    ids = contact.i_graphics_id if side == "i" else contact.j_graphics_id
    return [model.graphics[id] for id in ids if id in model.graphics]


def _body_ids(model: Model, graphics: Iterable[Graphic]) -> set[int]:
    """Return the bodies that carry the graphics, as far as they are known."""
    markers = (model.markers.get(graphic.marker_id) for graphic in graphics)
    return {marker.body_id for marker in markers if marker is not None and marker.body_id}


def _contacts(model: Model) -> Iterator[Fault]:
    """Yield contacts of a body with itself, of planes with planes, and of what is no solid."""
    used: dict[int, Graphic] = {}
    for contact in model.contacts.values():
        element = f"Force_Contact[{contact.id}]"
        sides = {side: _graphics(model, contact, side) for side in "ij"}
        bodies = {side: _body_ids(model, graphics) for side, graphics in sides.items()}
        for side in "ij":
            used |= {graphic.id: graphic for graphic in sides[side]}
        if contact.with_itself and len(bodies["i"] | bodies["j"]) > 1:
            # a set in contact with itself; whose graphics share a body do not touch each other
            bodies["i"] = set()
        for body in sorted(bodies["i"] & bodies["j"]):
            message = f"i_graphics_id and j_graphics_id are both on body {body}"
            yield _fault(contact.source, element, f"{message}; must be on two bodies")
        planes = [next((g.id for g in sides[side] if g.shape == "PLANE"), None) for side in "ij"]
        if contact.with_itself:
            flat = [g.id for g in sides["i"] if g.shape == "PLANE"]
            planes = [flat[0], flat[1]] if len(flat) > 1 else [None]
        if None not in planes:
            message = f"graphics {planes[0]} and {planes[1]} are both planes; one must be a solid"
            yield _fault(contact.source, element, message)
        yield from _radii(model, contact)

    for graphic in used.values():
        element = f"Post_Graphic[{graphic.id}]"
        if not graphic.is_material_inside:
            message = 'is_material_inside="FALSE": cavities in a contact are not built yet'
            yield _fault(graphic.source, element, message)
        if graphic.vertices is not None and graphic.faces is not None:
            yield from _mesh_faults(graphic, element)


def _mesh_faults(graphic: Graphic, element: str) -> Iterator[Fault]:
    """Yield all that keeps a mesh from being a solid, each kind once."""
    if graphic.vertices is None or graphic.faces is None:
        return
    if not solid_fault(graphic.vertices, graphic.faces):
        return
    file = f'file="{graphic.mesh_file}": ' if graphic.mesh_file else ""
    found = mesh_findings(graphic.vertices, graphic.faces)
    for finding in (*found, *crossing_findings(graphic.vertices, graphic.faces)):
        yield _fault(graphic.source, element, f"{file}{finding}")
    yield _fault(
        graphic.source, element, f"{file}mbsim check --repair writes a mended copy if it can"
    )


def _radii(model: Model, contact: Contact) -> Iterator[Fault]:
    """Yield sides whose radius HERTZ needs and cannot know, and two flat sides."""
    ids = (*contact.i_graphics_id, *contact.j_graphics_id)
    if not by_materials(contact) or any(id not in model.graphics for id in ids):
        return
    element = f"Force_Contact[{contact.id}]"
    radii = {side: side_radius(contact, side, model.graphics) for side in "ij"}
    for side, radius in radii.items():
        if radius is None:
            message = f"{side}_radius: missing; must be a number > 0: HERTZ by elastic moduli takes"
            message += " it from graphics that are spheres of one radius, or planes and boxes"
            yield _fault(contact.source, element, message)
    if all(radius == math.inf for radius in radii.values()):
        message = "both sides are flat, HERTZ by elastic moduli needs a round one: give i_radius or"
        yield _fault(contact.source, element, f"{message} j_radius > 0, or stiffness")


def _warnings(model: Model) -> Iterator[str]:
    """Yield what is allowed and surely not meant."""
    ground = {body.id for body in model.bodies.values() if body.is_ground}
    if model.bodies and len(ground) == len(model.bodies):
        yield f"{model.file}: all bodies are ground: nothing can move"
    for contact in model.contacts.values():
        ids = [_body_ids(model, _graphics(model, contact, side)) for side in "ij"]
        if all(ids) and ids[0] | ids[1] <= ground:
            element = f"Force_Contact[{contact.id}]"
            message = "both sides are ground: the contact does nothing"
            yield str(_fault(contact.source, element, message))
