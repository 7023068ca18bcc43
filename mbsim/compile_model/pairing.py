"""Which graphics may touch, and what detects them: a closed form or FCL.

A contact tests every I graphic with every J graphic. Up to `MOST_LISTED` pairs are listed for
good; the pairs of a larger contact, a *large contact*, are too many to look at and are found as
they come near (`contact.broadphase`). A large contact whose I and J are the same graphics is a set
in contact with itself: each pair once, none on one body.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from mbsim.errors import DeckError, Fault
from mbsim.geometry.catalog import PAIRS, REGION_ROWS, REGIONS, RIGID_PAIRS, Pair
from mbsim.geometry.polyhedron import CUBE, HULL_SLOTS, MOST_EDGE_PAIRS, MOST_EDGES, hull_slots
from mbsim.model import hull
from mbsim.model.elements import Contact, Graphic, Model

#: Shapes with flat sides: FCL gives several points for two of them, one for all others.
_FLAT = {"BOX", "PLANE"}
FCL_SLOTS = 8
#: Shapes with round sides that are flat at their ends.
_ROUND_ENDED = {"CYLINDER", "FRUSTUM"}
_ROUND = {"CYLINDER", "FRUSTUM", "ELLIPSOID"}
#: Pairs of meshes of which one has more triangles are told to be costly.
MANY_TRIANGLES = 50_000
#: Points on which a round end rests in a closed form, and a face of a box on one.
_UNDER_AN_END, _UNDER_A_FACE = 3, 4
#: Contacts with more pairs than this are large contacts. Every pair listed for good costs some 5 ns
#: an evaluation: in a heap a large contact is cheaper from 30 pairs on, by a sixth at 300. But
#: steps end where its list does: bodies in free flight take twice as long at 300 pairs
#: (tests/bench/test_broadphase.py).
MOST_LISTED = 300


#: Shapes that have patches as triangles do.
AS_SURFACE = dict.fromkeys(("MESH", "BOX", "CYLINDER", "FRUSTUM", "ELLIPSOID"), "SURFACE")
#: What these are called where the depth of a contact is that of a field.
AS_FIELD = dict.fromkeys(AS_SURFACE, "FIELD")


@dataclass(frozen=True)
class Kind:
    """How two shapes of a contact are tested, in the order that their detector wants."""

    contact: int  # id
    shape_i: str
    shape_j: str
    swapped: bool
    closed_form: str  # name in PAIRS, or empty where FCL does it
    slots: int
    region: bool = False  # whether its points are summed up to one incident
    rigid: bool = False  # whether it has the points of rigid contact, in RIGID_PAIRS

    @property
    def form(self) -> Pair | None:
        """What gives its points, None where FCL does."""
        if not self.closed_form:
            return None
        return (RIGID_PAIRS if self.rigid else PAIRS)[self.closed_form]

    @property
    def has_area(self) -> bool:
        """Whether its incidents have an area."""
        return self.region or (self.form is not None and self.form.patches)

    @property
    def rims(self) -> bool:
        """Whether each three of its rows are of one rim."""
        return self.form is not None and not self.region and self.form.rims

    @property
    def moves(self) -> bool:
        """Whether its rows are no parts of a shape: incidents keep their slots by their places."""
        if not self.closed_form:
            return self.slots > 1
        return bool({"SURFACE", "FIELD"} & set(self.closed_form.split("-")))

    @property
    def step(self) -> int:
        """Return the rows from one incident to the next."""
        if self.region:
            return self.slots
        return REGION_ROWS if self.has_area else 1

    @property
    def regroups(self) -> bool:
        """Whether a contact that goes on may begin another slot, which is then no impact."""
        if self.region:
            return False
        if self.closed_form == "MESH-PLANE" and self.slots == hull.MOST_ROWS:
            # of a fine mesh the deepest corner has the force alone, and the next one takes it over
            return True
        return self.form is None or self.form.regroups

    @property
    def detector(self) -> str:
        """How `mbsim check` names it."""
        one = ", one region" if self.region else ""
        if self.has_area and not self.region:
            return "patches of triangles"
        if self.closed_form:
            return f"closed form {self.closed_form}{one}"
        shapes = {self.shape_i, self.shape_j}
        if self.slots > 1 or not shapes <= _FLAT | _ROUND_ENDED:
            return "FCL"
        points = f"{_UNDER_AN_END} or {_UNDER_A_FACE}" if "BOX" in shapes else f"{_UNDER_AN_END}"
        return (
            "FCL, one point: what rests on a flat end may tip, and is n^(1/exponent) times as deep "
            f"as on the n = {points} points of the closed form"
        )


class Detection(NamedTuple):
    """How a run tests its pairs: see `plan_pairs`."""

    detector: str
    rigid: bool


@dataclass(frozen=True)
class PairPlan:
    """One pair of graphics (ids), in the order of its kind."""

    kind: Kind
    graphic_i: int
    graphic_j: int


@dataclass(frozen=True)
class BroadphasePlan:
    """A contact of many graphics (ids), with its kinds by shape class of the contact's I and J."""

    contact: int
    i: tuple[int, ...]
    j: tuple[int, ...]
    same: bool
    kinds: dict[tuple[str, str], Kind]

    @property
    def pairs(self) -> int:
        """Return how many pairs there could be."""
        n = len(self.i)
        return n * (n - 1) // 2 if self.same else n * len(self.j)


@dataclass(frozen=True)
class Plans:
    """All pairs of a model: listed one by one, or as large contacts."""

    pairs: tuple[PairPlan, ...]
    broadphase: tuple[BroadphasePlan, ...]

    @property
    def kinds(self) -> list[Kind]:
        """Return every kind once, listed pairs' first."""
        listed = [plan.kind for plan in self.pairs]
        crowded = [kind for contact_set in self.broadphase for kind in contact_set.kinds.values()]
        return list(dict.fromkeys([*listed, *crowded]))


def _convex(*graphics: Graphic) -> bool:
    """Whether every mesh among the graphics is convex: the closed forms know no others."""
    return all(graphic.shape != "MESH" or graphic.hull is not None for graphic in graphics)


def _mesh_slots(i: Graphic, j: Graphic) -> int:
    """Return the rows of a pair with convex meshes, 0 where it is too large for a closed form."""
    if i.hull is None:
        assert j.hull is not None
        return 1 if i.shape != "SPHERE" or j.hull[hull.EDGES] <= MOST_EDGES else 0
    if j.shape == "PLANE":
        return int(i.hull[hull.ROWS])
    other = CUBE if j.hull is None else j.hull
    slots = hull_slots(i.hull, other)
    edges = i.hull[hull.EDGES] * other[hull.EDGES]
    return slots if slots <= HULL_SLOTS and edges <= MOST_EDGE_PAIRS else 0


def _patches(contact: int, i: Graphic, j: Graphic, named: dict[str, str]) -> Kind | None:
    """Return the pair of surfaces, `named` so, for graphics of which one is a mesh, else None.

    Of fields none needs to be a mesh.
    """
    shapes = {i.shape, j.shape}
    if named is AS_SURFACE and "MESH" not in shapes:
        return None
    for a, b, swapped in ((i, j, False), (j, i, True)):
        name = f"{named.get(a.shape, a.shape)}-{named.get(b.shape, b.shape)}"
        if name in PAIRS and set(name.split("-")) & set(named.values()):
            return Kind(contact, a.shape, b.shape, swapped, name, PAIRS[name].slots)
    return None


def _kind(contact: int, i: Graphic, j: Graphic, detector: str) -> Kind:
    """Return how graphics like these two are tested."""
    flat = i.shape in _FLAT and j.shape in _FLAT
    fcl_slots = FCL_SLOTS if flat else 1
    for a, b, swapped in ((i, j, False), (j, i, True)):
        name = f"{a.shape}-{b.shape}"
        if name in PAIRS and detector != "fcl" and _convex(a, b):
            if "MESH" in name:
                slots = _mesh_slots(a, b)
                if slots == 0:
                    break
                return Kind(contact, a.shape, b.shape, swapped, name, slots)
            return Kind(contact, a.shape, b.shape, swapped, name, PAIRS[name].slots)
    patches = _patches(contact, i, j, AS_SURFACE) if detector != "fcl" else None
    return patches or Kind(contact, i.shape, j.shape, False, "", fcl_slots)


def _as_rigid(kind: Kind) -> Kind:
    """Return a kind with the points that its rigid contact has, where those are others."""
    if kind.closed_form not in RIGID_PAIRS:
        return kind
    return replace(kind, slots=RIGID_PAIRS[kind.closed_form].slots, rigid=True)


def _kind_of(
    model: Model, contact: Contact, i: Graphic, j: Graphic, by: Detection, faults: list[Fault]
) -> Kind:
    """Return how graphics like these two are tested in a contact; say what it cannot have."""
    detector = by.detector
    if contact.contact_depth != "FIELD" or by.rigid:
        # rigid contact has no law that would ask how deep it is
        usual = _kind(contact.id, i, j, detector)
        found = _one_region(model, contact, i, j, usual, faults)
        return _as_rigid(found) if by.rigid else found
    kind = _patches(contact.id, i, j, AS_FIELD)
    if kind is not None and detector != "fcl":
        return kind
    why = "is measured without FCL; leave out --detector"
    if kind is None:
        why = f"has no field of depth ({i.shape} on {j.shape}); give what is round as a mesh"
    told = 'cnf_type="VOLUME"' if contact.cnf_type == "VOLUME" else 'contact_depth="FIELD"'
    where = f"Force_Contact[{contact.id}]"
    message = f"{told}: Post_Graphic[{i.id}] on Post_Graphic[{j.id}] {why}"
    faults.append(Fault(model.file, contact.source.line, where, message))
    return Kind(contact.id, i.shape, j.shape, False, "", FCL_SLOTS)


def _region_fault(model: Model, contact: Contact, i: Graphic, j: Graphic, why: str) -> Fault:
    """Return the fault of a pair whose area is asked for and not known."""
    return Fault(
        model.file,
        contact.source.line,
        f"Force_Contact[{contact.id}]",
        f'contact_points="REGION": Post_Graphic[{i.id}] on Post_Graphic[{j.id}] '
        f"({i.shape} on {j.shape}) {why}",
    )


def _one_region(
    model: Model, contact: Contact, i: Graphic, j: Graphic, kind: Kind, faults: list[Fault]
) -> Kind:
    """Return a kind as the contact wants it: as it is, or one incident with an area.

    A pair of shapes that touch in one point only is one incident without area as it is.
    """
    if contact.contact_points != "REGION" or kind.has_area:
        return kind
    if kind.closed_form in REGIONS:
        return replace(kind, slots=kind.slots + REGION_ROWS, region=True)
    if not kind.closed_form:
        why = "is found by FCL, which gives no area"
    elif PAIRS[kind.closed_form].slots > 1:
        why = "has no closed form of its area"
    elif contact.needs_area:
        why = f"touches in a point, so cff_type={contact.cff_type} needs patch_radius"
    else:
        return kind
    if "needs" not in why:
        why += '; give contact_points="POINTS"'
    faults.append(_region_fault(model, contact, i, j, why))
    return kind


def shape_class(graphic: Graphic) -> str:
    """Return what graphics have in common that are tested in the same way."""
    if graphic.vertices is None:
        return graphic.shape
    return f"{graphic.shape} {hashlib.sha256(graphic.vertices.tobytes()).hexdigest()[:12]}"


def _two_planes(model: Model, contact: Contact, i: int, j: int) -> Fault:
    """Return the fault of a plane against a plane."""
    return Fault(
        model.file,
        contact.source.line,
        f"Force_Contact[{contact.id}]",
        f"Post_Graphic[{i}] and Post_Graphic[{j}] are both planes; "
        "give one of them a body of finite size",
    )


def _contact_set(
    model: Model, contact: Contact, same: bool, by: Detection
) -> tuple[BroadphasePlan, list[Fault]]:
    """Return a contact of many graphics, and what is wrong with it."""
    kinds: dict[tuple[str, str], Kind] = {}
    faults = []
    i_ids, j_ids = contact.i_graphics_id, contact.j_graphics_id
    first: list[dict[str, int]] = [{}, {}]
    for side, ids in zip(first, (i_ids, j_ids), strict=True):
        for id in ids:
            side.setdefault(shape_class(model.graphics[id]), id)
    for shape_i, i in first[0].items():
        for shape_j, j in first[1].items():
            if shape_i == shape_j == "PLANE":
                if same and sum(model.graphics[id].shape == "PLANE" for id in i_ids) == 1:
                    continue
                faults.append(_two_planes(model, contact, i, j))
            elif (shape_j, shape_i) not in kinds or not same:
                a, b = model.graphics[i], model.graphics[j]
                kinds[shape_i, shape_j] = _kind_of(model, contact, a, b, by, faults)
    return BroadphasePlan(contact.id, i_ids, j_ids, same, kinds), faults


def plan_pairs(model: Model, detector: str = "auto", rigid: bool = False) -> Plans:
    """Return every I graphic with every J graphic of every contact.

    Parameters
    ----------
    model : Model
    detector : {"auto", "fcl"}
        "fcl" sends all pairs through FCL.
    rigid : bool
        Whether the method that runs it has rigid contact: pairs then have its points.

    Raises
    ------
    DeckError
        If two shapes cannot be tested against each other (two planes), or have no area that is
        known where the contact asks for it.
    """
    by = Detection(detector, rigid)
    pairs, broadphase, faults = [], [], []
    for contact in model.contacts.values():
        i_ids, j_ids = contact.i_graphics_id, contact.j_graphics_id
        same = contact.with_itself
        many = len(i_ids) * (len(i_ids) - 1) // 2 if same else len(i_ids) * len(j_ids)
        if many > MOST_LISTED:
            contact_set, wrong = _contact_set(model, contact, same, by)
            broadphase.append(contact_set)
            faults += wrong
            continue
        for first, i in enumerate(i_ids):
            for j in j_ids[first + 1 :] if same else j_ids:
                a, b = model.graphics[i], model.graphics[j]
                if (
                    same
                    and model.markers[a.marker_id].body_id == model.markers[b.marker_id].body_id
                ):
                    continue
                if a.shape == b.shape == "PLANE":
                    faults.append(_two_planes(model, contact, i, j))
                    continue
                kind = _kind_of(model, contact, a, b, by, faults)
                pairs.append(PairPlan(kind, j, i) if kind.swapped else PairPlan(kind, i, j))
    if faults:
        raise DeckError(faults)
    return Plans(tuple(pairs), tuple(broadphase))


def why_costly(model: Model, plan: PairPlan) -> str:
    """Return why a pair of listed graphics is costly to detect, an empty string if it is not."""
    reasons = []
    for mesh in (model.graphics[plan.graphic_i], model.graphics[plan.graphic_j]):
        if mesh.faces is None:
            continue
        edges = 0 if mesh.hull is None else int(mesh.hull[hull.EDGES])
        if plan.kind.closed_form in ("SURFACE-SURFACE", "FIELD-FIELD"):
            if len(mesh.faces) > MANY_TRIANGLES:
                why = "of which each gets a layer before the run"
                reasons.append(f"Post_Graphic[{mesh.id}] has {len(mesh.faces)} triangles, {why}")
        elif plan.kind.shape_i in _ROUND and edges > MOST_EDGES:
            why = "which are all looked at in touch"
            reasons.append(f"Post_Graphic[{mesh.id}] has {edges} edges, {why}")
    return " and ".join(reasons)


def half_width(graphic: Graphic) -> float:
    """Return half of the least width of a shape; inf for a plane.

    A convex mesh is measured along the normals of its faces, another one along its axes.
    """
    if graphic.vertices is None:
        return min(half_extent(graphic))
    ways = np.eye(3)
    if graphic.hull is not None:
        first, count = int(graphic.hull[hull.AT_PLANES]), int(graphic.hull[hull.FACES])
        ways = graphic.hull[first : first + 4 * count].reshape(count, 4)[:, :3]
    return 0.5 * float(np.ptp(graphic.vertices @ ways.T, axis=0).min())


def half_extent(graphic: Graphic) -> tuple[float, float, float]:
    """Return the half edges of the box, in the shape's axes, that holds the shape."""
    size = graphic.size
    if graphic.shape == "SPHERE":
        return (size[0], size[0], size[0])
    if graphic.shape == "ELLIPSOID":
        return (size[0], size[1], size[2])
    if graphic.shape == "BOX":
        return (0.5 * size[0], 0.5 * size[1], 0.5 * size[2])
    if graphic.shape == "CYLINDER":
        return (size[0], size[0], 0.5 * size[1])
    if graphic.shape == "FRUSTUM":
        widest = max(size[0], size[1])
        return (widest, widest, 0.5 * size[2])
    if graphic.shape == "PLANE":
        return (math.inf, math.inf, math.inf)
    assert graphic.vertices is not None
    x, y, z = abs(graphic.vertices).max(axis=0)
    return (float(x), float(y), float(z))


def radius(graphic: Graphic) -> float:
    """Return the radius of the ball around the shape's centre that holds it."""
    if graphic.shape == "SPHERE":
        return graphic.size[0]
    if graphic.shape == "ELLIPSOID":
        return max(graphic.size)
    if graphic.shape == "CYLINDER":
        return math.hypot(graphic.size[0], 0.5 * graphic.size[1])
    if graphic.shape == "FRUSTUM":
        return math.hypot(max(graphic.size[:2]), 0.5 * graphic.size[2])
    if graphic.shape == "MESH":
        assert graphic.vertices is not None
        return float((graphic.vertices**2).sum(axis=1).max() ** 0.5)
    return math.sqrt(sum(half * half for half in half_extent(graphic)))


def kernel_size(graphic: Graphic) -> tuple[float, float, float]:
    """Return the three numbers that the closed forms take (see `geometry.catalog`)."""
    if graphic.shape == "CYLINDER":
        return (graphic.size[0], 0.5 * graphic.size[1], 0.0)
    if graphic.shape == "FRUSTUM":
        return (graphic.size[0], graphic.size[1], 0.5 * graphic.size[2])
    if graphic.shape == "SPHERE":
        return (graphic.size[0], 0.0, 0.0)
    if graphic.hull is not None:
        # the model keeps the polyhedron for as long as the scene lives
        return (float(graphic.hull.ctypes.data), float(len(graphic.hull)), 0.0)
    if graphic.shape in ("PLANE", "MESH"):
        return (0.0, 0.0, 0.0)
    return half_extent(graphic)
