"""What a contact's settings mean, said before a run: depth, impacts, creep and the step.

All of it follows from the deck alone, by the laws' own formulas. Loads are weights: that of a free
body and of those that stand above it. Bodies with joints are left out, as joints may carry them.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from mbsim.laws.catalog import FRICTION_LAWS, NORMAL_LAWS, FrictionInput, NormalLaw
from mbsim.laws.constants import friction_parameters, normal_constants
from mbsim.laws.impact_test import impact_of, resting_depth
from mbsim.model.contact_radius import with_radii
from mbsim.model.elements import Array, Contact, Graphic, Model, Units
from mbsim.model.placement import BodyPlace, MarkerPlace, Placement, graphic_box, place
from mbsim.reader.units import symbol

#: A depth is worth a word beyond this part of the smaller shape's least width.
DEEP = 0.01
#: A damper that fades in over dmax has little effect at rest below this part of it.
SHALLOW = 0.1
#: An explicit method of order 5 is stable up to about this much over the fastest rate.
STABLE = 3.3
#: Steps of a run from which on an explicit method is not worth its while.
MANY_STEPS = 1e5
#: Pairs of a contact that are looked at for its loads and speeds.
MOST_PAIRS = 4_000_000
#: Cosine of a plane's normal to the vertical up to which it is a wall, that carries nothing.
UPRIGHT = 1e-6
#: Overlap at the start, over a width, that is none but rounding.
TOUCHING = 1e-6
#: Tangent of an incline below which a plane is level.
LEVEL = 1e-9
#: Cosine of a cylinder's axis to a plane's normal from which on it stands on its end.
STANDING = 0.99
_OF_REVOLUTION = ("CYLINDER", "FRUSTUM")
_ONE_POINT = ("SPHERE", "ELLIPSOID")


class _Meeting(NamedTuple):
    """A pair of a contact at which it is looked at."""

    load: float = 0.0  # normal force at rest [F]
    slope: float = 0.0  # tangent of the incline, nan where that is not known
    speed: float = 0.0  # closing speed when it first touches [L/T]
    mass: float = 0.0  # effective mass of a central impact [M such that F = m a]
    points: int = 1  # how many points may carry it
    width: float = math.inf  # least width of the smaller shape [L]


def advice(model: Model) -> Iterator[tuple[str, str]]:
    """Yield contacts and what their settings mean, in the deck's units, which are named."""
    if not model.contacts:
        return
    scene = _Weights(model)
    for contact in model.contacts.values():
        name = f"Force_Contact[{contact.id}]"
        law = NORMAL_LAWS[contact.cnf_type] if contact.cnf_type in NORMAL_LAWS else None
        if law is None or contact.contact_depth == "FIELD":
            continue  # what a user's function or an area does is not known ahead
        constants = tuple(normal_constants(law, with_radii(contact, model.graphics)).tolist())
        meetings = list(scene.meetings(contact))
        for text in (
            *_at_rest(contact, law, constants, meetings, model),
            *_impacts(law, constants, meetings, model.units),
            *_creep(contact, meetings, model.units),
        ):
            yield name, text


def _at_rest(
    contact: Contact,
    law: NormalLaw,
    constants: tuple[float, ...],
    meetings: list[_Meeting],
    model: Model,
) -> Iterator[str]:
    """Yield the depth under the largest load, and the step that follows from it."""
    heavy = max(meetings, key=lambda each: each.load, default=_Meeting())
    if heavy.load <= 0.0:
        return
    size = heavy.width if math.isfinite(heavy.width) else 1e3
    depth = resting_depth(law, constants, heavy.load, 1e3 * size)
    force, length = symbol(model.units.force), symbol(model.units.length)
    text = f"at rest under {heavy.load:.4g} {force} of weight it is {depth:.3g} {length} deep"
    if heavy.points > 1:
        spread = resting_depth(law, constants, heavy.load / heavy.points, 1e3 * size)
        text += f" on one point, {spread:.3g} {length} on {heavy.points}"
        depth = spread
    if depth > DEEP * heavy.width:
        wide = f"{heavy.width:.3g} {length}"
        text += f": more than {DEEP:.0%} of a width of {wide}; raise its stiffness"
    yield text
    if contact.cnf_type == "IMPACT" and contact.dmax is not None and contact.damping > 0.0:
        if depth < SHALLOW * contact.dmax:
            yield (
                f"its damper hardly acts at rest, where it is less than {SHALLOW:.0%} of dmax "
                f"deep; lower dmax to {depth:.2g} {length}"
            )
    if math.isfinite(depth) and heavy.mass > 0.0:
        yield from _step(law, constants, heavy, depth, model)


def _step(
    law: NormalLaw, constants: tuple[float, ...], heavy: _Meeting, depth: float, model: Model
) -> Iterator[str]:
    """Yield how long steps of an explicit method may be at rest, where that makes many."""
    small = 1e-4 * depth
    above, below = (law.law(d, 0.0, *constants)[1] for d in (depth + small, depth - small))
    k = heavy.points * (above - below) / (2.0 * small) / heavy.mass
    rate = 1e-3 * depth * math.sqrt(max(k, 0.0))
    closing, leaving = (law.law(depth, v, *constants)[0] for v in (rate, -rate))
    c = heavy.points * (closing - leaving) / (2.0 * rate) / heavy.mass if rate > 0.0 else 0.0
    fastest = float(np.abs(np.roots([1.0, c, k])).max())
    span = sum(each.end_time - each.start_time for each in model.simulations)
    if fastest > 0.0 and span * fastest / STABLE > MANY_STEPS:
        yield (
            f"costly by explicit methods: stable steps at rest are {STABLE / fastest:.2g} "
            f"{symbol(model.units.time)} long, {span * fastest / STABLE:.2g} of them; "
            "AUTO, GALPHA and RADAU5 take longer ones"
        )


def _impacts(
    law: NormalLaw, constants: tuple[float, ...], meetings: list[_Meeting], units: Units
) -> Iterator[str]:
    """Yield what the fastest first touch does; masses are said in the deck's unit."""
    fast = max(meetings, key=lambda each: each.speed, default=_Meeting())
    if fast.speed <= 0.0 or fast.mass <= 0.0:
        return
    hit = impact_of(law, constants, fast.speed, fast.mass)
    length, time = symbol(units.length), symbol(units.time)
    text = (
        f"it is met at {fast.speed:.3g} {length}/{time} by a mass of "
        f"{fast.mass / units.mass_scale:.3g} {symbol(units.mass)}: {hit.depth:.3g} {length} deep, "
        f"{hit.time:.3g} {time} long, rebound {hit.rebound:.3g} of the speed"
    )
    if hit.depth > DEEP * fast.width:
        wide = f"{fast.width:.3g} {length}"
        text += f"; more than {DEEP:.0%} of a width of {wide}: raise its stiffness"
    yield text


def _creep(contact: Contact, meetings: list[_Meeting], units: Units) -> Iterator[str]:
    """Yield how fast smoothed friction creeps down the incline that it could hold."""
    law = FRICTION_LAWS[contact.cff_type] if contact.cff_type in FRICTION_LAWS else None
    if law is None or law.memory or law.of_area or contact.asks_user:
        return
    steep = max(
        (each for each in meetings if each.load > 0.0 and each.slope > LEVEL),
        key=lambda each: each.slope,
        default=None,
    )
    if steep is None:
        return
    par = friction_parameters(law, contact).tolist()

    def mu(speed: float) -> float:
        zero = (0.0, 0.0, 0.0)
        inputs = FrictionInput(
            *(0.0, 0.0, zero, (speed, 0.0, 0.0), (0.0, 0.0), 1.0, 0.0, 0.0, zero, zero),
            *(0.0, 0.0, 0.0, 0.0, math.nan, 0.0, math.nan, math.nan, math.nan),
        )
        return -float(law.force(inputs, *par)[0])

    usual = max(getattr(contact, "friction_trans_vel", 0.0), contact.stiction_trans_vel, 1e-12)
    speeds = usual * np.geomspace(1e-6, 10.0, 1401)
    found = np.array([mu(speed) for speed in speeds])
    degrees = math.degrees(math.atan(steep.slope))
    if not found.max() > steep.slope:
        yield f"slides down its incline of {degrees:.3g} degrees: mu is {found.max():.3g} at most"
        return
    low, high = 0.0, float(speeds[int(np.argmax(found > steep.slope))])
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if mu(middle) < steep.slope else (low, middle)
    yield (
        f"creeps at {high:.4g} {symbol(units.length)}/{symbol(units.time)} down its incline of "
        f'{degrees:.3g} degrees; cff_type="STICTION" holds'
    )


class _Weights:
    """Bodies at the start, what each carries, and how pairs of shapes meet."""

    def __init__(self, model: Model) -> None:
        self.model, self.at = model, place(model)
        self.g = np.array(model.gravity.g)
        self.size = float(np.linalg.norm(self.g))
        self.up = -self.g / self.size if self.size > 0.0 else np.zeros(3)
        self.joined = _joined(model, self.at)
        sides = [(c.i_graphics_id, c.j_graphics_id) for c in model.contacts.values()]
        touching = {id for both in sides for side in both for id in side}
        #: How many shapes that contacts name each body has.
        self.shapes = Counter(self._body(id) for id in touching)
        self.on_others: set[int] = set()
        self.carried = self._columns() if self.size > 0.0 else {}

    def _columns(self) -> dict[int, float]:
        """Return the weight of each free body and of those that stand on it, by its id.

        One stands on another where it is higher, a contact may be between them, and they overlap
        as seen from above.
        """
        free = [id for id in self.at.bodies if id not in self.joined]
        radius = dict.fromkeys(free, 0.0)
        sets: dict[int, set[int]] = {id: set() for id in free}
        for contact in self.model.contacts.values():
            for side in (contact.i_graphics_id, contact.j_graphics_id):
                for id in side:
                    body = self._body(id)
                    if body in radius:
                        sets[body].add(contact.id)
                        radius[body] = max(radius[body], _half_width(self.model.graphics[id]))
        order = sorted(free, key=lambda id: -float(self.at.bodies[id].p @ self.up))
        above = np.zeros((len(order), len(order)), dtype=bool)
        p = np.array([self.at.bodies[id].p for id in order]).reshape(-1, 3)
        flat = p - np.outer(p @ self.up, self.up)
        r = np.array([radius[id] for id in order])
        weights = np.array([self.at.bodies[id].mass for id in order]) * self.size
        for k, id in enumerate(order):
            over = np.linalg.norm(flat[:k] - flat[k], axis=1) < (r[:k] + r[k])
            for other in np.flatnonzero(over):
                if not above[k, other] and sets[id] & sets[order[int(other)]]:
                    above[k] |= above[other]
                    above[k, other] = True
        self.on_others = {order[int(k)] for k in np.flatnonzero(above.any(axis=0))}
        carried = weights + above @ weights
        return dict(zip(order, carried.tolist(), strict=True))

    def _body(self, graphic: int) -> int:
        return self.at.markers[self.model.graphics[graphic].marker_id].body_id

    def meetings(self, contact: Contact) -> Iterator[_Meeting]:
        """Yield how the pairs of a contact meet."""
        if len(contact.i_graphics_id) * len(contact.j_graphics_id) > MOST_PAIRS:
            return
        for i in contact.i_graphics_id:
            for j in contact.j_graphics_id:
                if self._body(i) != self._body(j) and not (contact.with_itself and i > j):
                    yield self._meeting(contact, i, j)

    def _meeting(self, contact: Contact, i: int, j: int) -> _Meeting:
        """Return how graphics i and j meet; a plane is put second."""
        shapes = [self.model.graphics[id] for id in (i, j)]
        if shapes[0].shape == "PLANE":
            i, j, shapes = j, i, shapes[::-1]
        bodies = [self.at.bodies.get(self._body(id)) for id in (i, j)]
        inverse = sum(1.0 / body.mass for body in bodies if body is not None)
        if not inverse:
            return _Meeting()
        widths = [2.0 * _half_width(s) for s in shapes if s.shape != "PLANE"]
        one = any(s.shape in _ONE_POINT for s in shapes) or contact.contact_points == "REGION"
        normal, gap = self._gap(shapes)
        meeting = _Meeting(
            mass=1.0 / inverse, points=1 if one else 4, width=min(widths, default=math.inf)
        )
        if normal is None:
            return meeting._replace(load=self._load(bodies), slope=math.nan)
        cosine, load = float(normal @ self.up), self._load(bodies)
        if shapes[1].shape != "PLANE":
            meeting = meeting._replace(load=load, slope=math.nan)
        elif cosine > UPRIGHT:
            slope = math.sqrt(max(0.0, 1.0 - cosine * cosine)) / cosine
            if slope > LEVEL and self._is_wedged(i, normal):
                load, slope = 0.0, math.nan  # each of several planes carries what is not known
            elif self._rolls(shapes[0], normal):
                slope = math.nan
            meeting = meeting._replace(load=load * cosine, slope=slope)
        size = meeting.width if math.isfinite(meeting.width) else 0.0
        return meeting._replace(
            speed=self._speed(bodies, normal, gap if abs(gap) > TOUCHING * size else 0.0)
        )

    def _rolls(self, shape: Graphic, normal: Array) -> bool:
        """Return whether a shape, the only one of its body, rolls on a plane rather than slides."""
        if self.shapes[self.at.markers[shape.marker_id].body_id] > 1:
            return False  # a wheel, a foot: what the others do is not known
        if shape.shape in _OF_REVOLUTION:
            return abs(float(self.at.markers[shape.marker_id].R[:, 2] @ normal)) < STANDING
        return shape.shape in _ONE_POINT

    def _is_wedged(self, graphic: int, normal: Array) -> bool:
        """Return whether the body of a graphic touches a plane of another normal at the start."""
        body, graphics = self._body(graphic), self.model.graphics
        for contact in self.model.contacts.values():
            sides = contact.i_graphics_id, contact.j_graphics_id
            for own, others in (sides, sides[::-1]):
                planes = [graphics[j] for j in others if graphics[j].shape == "PLANE"]
                for shape in [graphics[i] for i in own if planes and self._body(i) == body]:
                    for plane in planes:
                        other, gap = self._gap([shape, plane])
                        near = gap <= TOUCHING * 2.0 * _half_width(shape)
                        if other is not None and near and float(other @ normal) < 1.0 - LEVEL:
                            return True
        return False

    def _load(self, bodies: list[BodyPlace | None]) -> float:
        """Return what the upper one of two bodies brings down on the lower one."""
        known = [b for b in bodies if b is not None]
        if any(b.id not in self.carried for b in known):
            return 0.0
        loads = [self.carried[b.id] for b in sorted(known, key=lambda b: -float(b.p @ self.up))]
        # of two that do not stand on each other neither carries the other's load
        return loads[0] if len(loads) == 1 or loads[1] > loads[0] else 0.0

    def _gap(self, shapes: list[Graphic]) -> tuple[Array | None, float]:
        """Return the normal from J into I and the distance along it, where that is simple."""
        a, b = (self.at.markers[shape.marker_id] for shape in shapes)
        if shapes[1].shape == "PLANE":
            least = graphic_box(shapes[0], b.R.T @ (a.p - b.p), b.R.T @ a.R)
            return (b.R[:, 2], float(least[0][2])) if least is not None else (None, 0.0)
        if shapes[0].shape == shapes[1].shape == "SPHERE":
            between = a.p - b.p
            distance = float(np.linalg.norm(between))
            if distance > 0.0:
                return between / distance, distance - shapes[0].size[0] - shapes[1].size[0]
        return None, 0.0

    def _speed(self, bodies: list[BodyPlace | None], normal: Array, gap: float) -> float:
        """Return the closing speed at touch, of free bodies that do not turn; else 0."""
        i, j = bodies
        if any(b is not None and b.id in self.joined for b in bodies) or gap < 0.0:
            return 0.0
        if i is not None and j is None and i.id in self.on_others:
            return 0.0  # there is another body between
        vi, vj = (b.v if b is not None else np.zeros(3) for b in (i, j))
        ai, aj = (self.g if b is not None else np.zeros(3) for b in (i, j))
        v, a = float((vj - vi) @ normal), float((aj - ai) @ normal)
        square = v * v + 2.0 * a * max(gap, 0.0)
        if square <= 0.0 or v + math.sqrt(square) <= 0.0:
            return 0.0
        return math.sqrt(square)


def _joined(model: Model, at: Placement) -> set[int]:
    """Return the bodies on which a joint, a motion or a force between markers acts."""
    found = set()

    def body(marker: MarkerPlace | None) -> None:
        if marker is not None:
            found.add(marker.body_id)

    tables: list[Mapping[int, Any]] = [
        *(model.joints, model.primitives, model.motions, model.vector_forces),
        *(model.scalar_forces, model.force_elements),
    ]
    tables += model.marker_forces.values()
    for table in tables:
        for element in table.values():
            for name in ("i_marker_id", "j_marker_id"):
                body(at.markers.get(getattr(element, name, None) or 0))
    return found


def _half_width(graphic: Graphic) -> float:
    """Return half of the least width of a shape; that of a plane is 0."""
    from mbsim.compile_model.pairing import half_width

    width = half_width(graphic)
    return float(width) if math.isfinite(width) else 0.0
