"""Groups of connected bodies, and the length and speed by which errors of each are judged.

Bodies belong together where a joint, another constraint, a force or a contact acts on both, or an
expression that acts on one looks at the other; through ground they do not. What a group knows of
length and speed comes from itself alone: not from markers and graphics that nothing acts at, nor
from bodies that nothing connects to it, nor from how long the run lasts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from mbsim.expressions import Expression
from mbsim.expressions.tree import references
from mbsim.forces.catalog import FORCES
from mbsim.model.elements import Model, Units
from mbsim.model.placement import Placement, graphic_box

#: Tables of a model whose elements act.
_ACTING = (
    *("joints", "primitives", "couplers", "motions", "general_constraints"),
    *("points_on_curves", "curves_on_curves", "points_on_surfaces"),
    *FORCES,
)
#: Where an expression's references lead, by their statement.
_TABLES = {
    "JOINT": "joints",
    "JPRIM": "primitives",
    "MOTION": "motions",
    "PTCV": "points_on_curves",
    "CVCV": "curves_on_curves",
    "PTSF": "points_on_surfaces",
    **{name: name for name in FORCES},
    "VARIABLE": "variables",
    "DIFF": "differentials",
    "SENSOR": "sensors",
}
#: Standard gravity [m/s^2]; without weight V is at least this part of what it would give.
GRAVITY, SLOWEST = 9.80665, 1e-2
#: What is so small beside the radius of gyration is one point.
POINT = 1e-3
#: Diagonal of the box around a solid sphere, over its radius of gyration as taken here.
OF_GYRATION = 2.0 * math.sqrt(3.0 / 0.6)


@dataclass(frozen=True)
class Groups:
    """What errors are judged by: see `arrays.model.Scales`, whose rows these are."""

    of_body: list[int]
    length: list[float]
    start: list[float]  # the fastest point of a body at the start
    speed: list[float]
    mass: list[float]
    of_contact: list[int]
    gyration: list[float]


@dataclass
class _Met:
    """What an element acts on and looks at, and elements that it names."""

    markers: set[int] = field(default_factory=set)  # whose places count
    bodies: set[int] = field(default_factory=set)
    named: list[Any] = field(default_factory=list)


class _Look:
    """Follows elements and their expressions to markers."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.known: dict[int, _Met] = {}

    def all_of(self, element: Any) -> _Met:
        """Return what an element has to do with, through all that it names."""
        met, seen, waiting = _Met(), {id(element)}, [element]
        while waiting:
            one = self._direct(waiting.pop())
            met.markers |= one.markers
            met.bodies |= one.bodies
            waiting += [other for other in one.named if id(other) not in seen]
            seen.update(map(id, one.named))
        return met

    def _direct(self, element: Any) -> _Met:
        """Return what an element names itself."""
        if id(element) in self.known:
            return self.known[id(element)]
        met = self.known[id(element)] = _Met()
        for one in fields(element):
            value = getattr(element, one.name)
            values = value if isinstance(value, tuple) else (value,)
            if one.name.endswith("marker_id"):
                # a floating one is wherever I is, and a reference marker gives axes alone
                places = one.name in ("i_marker_id", "j_marker_id")
                self._marker(value, met, places)
            elif one.name in ("joint_id", "joint_ids"):
                met.named += [self.model.joints[joint] for joint in values if joint is not None]
            for expression in values:
                if isinstance(expression, Expression):
                    self._expression(expression, met)
        return met

    def _marker(self, id: int | None, met: _Met, places: bool = True) -> None:
        if id in self.model.markers:
            met.bodies.add(self.model.markers[id].body_id)
            if places:
                met.markers.add(id)

    def _expression(self, expression: Expression, met: _Met) -> None:
        for reference in references(expression):
            if reference.statement == "MARKER":
                self._marker(reference.id, met)
            elif reference.statement == "CONTACT":
                met.bodies.update(*_touching(self.model, reference.id))
            elif reference.statement in _TABLES:
                table = self.model.table(_TABLES[reference.statement])
                met.named += [table[reference.id]] if reference.id in table else []


def _touching(model: Model, contact: int) -> tuple[set[int], set[int]]:
    """Return the bodies on either side of a contact."""
    one = model.contacts[contact]
    sides = (one.i_graphics_id, one.j_graphics_id)
    i, j = ({model.markers[model.graphics[g].marker_id].body_id for g in side} for side in sides)
    return i, j


def _elements(model: Model) -> Iterator[_Met]:
    """Yield what every element that acts has to do with."""
    look = _Look(model)
    for table in _ACTING:
        for element in model.table(table).values():
            yield look.all_of(element)


class _Sets:
    """Disjoint sets of bodies."""

    def __init__(self, bodies: Iterable[int]) -> None:
        self.parent = {body: body for body in bodies}

    def root(self, body: int) -> int:
        while self.parent[body] != body:
            self.parent[body] = self.parent[self.parent[body]]
            body = self.parent[body]
        return body

    def join(self, bodies: Iterable[int]) -> None:
        first, *others = sorted({self.root(body) for body in bodies if body in self.parent}) or [0]
        for other in others:
            self.parent[other] = first


def natural_speed(units: Units, length: float) -> float:
    """Return sqrt(g L) of standard gravity, in the model's units."""
    return math.sqrt(GRAVITY * units.time_s**2 / units.length_m * length)


def speeds_of(model: Model, groups: Groups) -> list[float]:
    """Return V of each group [L/T]: of its start or weight; of standard gravity without both."""
    g = float(np.linalg.norm(model.gravity.g))
    found = []
    for start, length in zip(groups.start, groups.length, strict=True):
        speed = max(start, math.sqrt(g * length))
        found.append(speed if speed > 0.0 else natural_speed(model.units, length))
    return found


def find_groups(model: Model, placement: Placement) -> Groups:
    """Return the groups of moving bodies, in the order of their first bodies.

    L is the diagonal of the box around the bodies' cg markers, the markers at which something
    acts and the graphics that may touch, all that ground lends to the group among them. Where all
    that is one point beside the largest radius of gyration, the box is around a solid sphere that
    has it. V is the fastest point of a body at the start, at least `SLOWEST` sqrt(g L) of standard
    gravity; the model's own weight is added where errors are judged, for it may change.
    """
    bodies = placement.bodies
    sets = _Sets(bodies)
    mets = list(_elements(model))
    for met in mets:
        sets.join(met.bodies)
    boxes: dict[int, list[tuple[Any, Any]]] = {body: [] for body in bodies}

    def add(who: Iterable[int], box: tuple[Any, Any]) -> None:
        for body in who:
            if body in boxes:
                boxes[body].append(box)

    for met in mets:
        for id in met.markers:
            placed = placement.markers[id]
            add([placed.body_id] if placed.body_id in bodies else met.bodies, (placed.p, placed.p))
    # of two sets that touch within and a third one, a graphic stands on many sides
    around: dict[int, tuple[Any, Any]] = {}
    contacts = []
    for id, contact in model.contacts.items():
        i, j = _touching(model, id)
        moving = [side & bodies.keys() for side in (i, j)]
        contacts.append(moving[0] | moving[1])
        if all(moving):
            sets.join(moving[0] | moving[1])
        for side, other in ((0, 1), (1, 0)):
            for g in (contact.i_graphics_id, contact.j_graphics_id)[side]:
                graphic = model.graphics[g]
                placed = placement.markers[graphic.marker_id]
                if g not in around:
                    around[g] = graphic_box(graphic, placed.p, placed.R) or (placed.p, placed.p)
                add([placed.body_id] if placed.body_id in bodies else moving[other], around[g])
    row: dict[int, int] = {}
    of_body = [row.setdefault(sets.root(body), len(row)) for body in bodies]
    if not row:
        length = [placement.L]
        least = [SLOWEST * natural_speed(model.units, length[0])]
        return Groups([], length, [0.0], least, [1.0], [0] * len(contacts), [])
    count = len(row)
    gyration, start, mass = [], [0.0] * count, [0.0] * count
    extents: list[list[tuple[Any, Any]]] = [[] for _ in range(count)]
    radius = [0.0] * count
    for g, body in zip(of_body, bodies.values(), strict=True):
        gyration.append(math.sqrt(float(np.trace(body.inertia)) / (2.0 * body.mass)))
        fastest = float(np.linalg.norm(body.v) + np.linalg.norm(body.w) * gyration[-1])
        start[g], mass[g] = max(start[g], fastest), max(mass[g], body.mass)
        radius[g] = max(radius[g], gyration[-1])
        extents[g] += [(body.p, body.p), *boxes[body.id]]
    length = []
    for g, found in enumerate(extents):
        lower = np.min([low for low, _ in found], axis=0)
        upper = np.max([high for _, high in found], axis=0)
        diagonal = float(np.linalg.norm(upper - lower))
        extended = diagonal > POINT * radius[g]
        length.append(diagonal if extended else OF_GYRATION * radius[g])
    slowest = [SLOWEST * natural_speed(model.units, size) for size in length]
    speed = [max(v, least) for v, least in zip(start, slowest, strict=True)]
    group = dict(zip(bodies, of_body, strict=True))
    # of several groups that a contact serves the one with the heaviest body
    of_contact = [
        max((group[body] for body in sorted(touched)), key=lambda g: mass[g], default=0)
        for touched in contacts
    ]
    return Groups(of_body, length, start, speed, mass, of_contact, gyration)
