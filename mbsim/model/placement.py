"""`place`: where every marker and moving body is at t = 0, with mass, inertia and velocity."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np

from mbsim.errors import DeckError, Fault
from mbsim.model.body_mass import BodyMassError, body_mass
from mbsim.model.elements import Array, Body, Graphic, Model
from mbsim.model.frames import GLOBAL, Frame, marker_frames, quaternion
from mbsim.model.names import element_name


@dataclass(frozen=True)
class MarkerPlace:
    """A marker at t = 0: origin `p` (3,) [L] and axes `R` (3, 3) as columns, both global.

    `p_B`, `R_B` are the same in the frame of its body: that of the body's cg marker, for
    ground the global frame. They stay as they are while the body moves.
    """

    id: int
    body_id: int
    p: Array
    R: Array
    p_B: Array
    R_B: Array


@dataclass(frozen=True)
class BodyPlace:
    """A moving body at t = 0.

    `p` (3,) [L], `R` (3, 3) and unit quaternion `q` (w, x, y, z) of its cg marker (without one, of
    the centre of its graphics), global;
    `mass` and `inertia` (3, 3) about the cg origin in cg axes, both times `mass_scale`,
    so that F = m a in the model's units; `v` [L/T] of the cg origin and `w` [1/T], global.
    `given` (n, 7): for each component of them that the deck gives its axis, three numbers for v
    and three for w, and its value.
    """

    id: int
    p: Array
    R: Array
    q: Array
    mass: float
    inertia: Array
    v: Array
    w: Array
    given: Array


@dataclass(frozen=True)
class Placement:
    """Markers and moving bodies by id, in the order of the deck, and the model's extent.

    `lower`, `upper` (3,) [L] bound all markers and graphics (of a plane only its marker);
    `L` is the diagonal of that box, 1 where all is in one point.
    """

    markers: dict[int, MarkerPlace]
    bodies: dict[int, BodyPlace]
    lower: Array
    upper: Array
    L: float


def place(model: Model) -> Placement:
    """Return the model's bodies and markers as they stand at t = 0.

    Parameters
    ----------
    model : Model
        A deck, as `read_model` returns it.

    Returns
    -------
    Placement
        In model units; masses are scaled by ``model.units.mass_scale``.

    Raises
    ------
    DeckError
        If a marker has no place (its parents form a ring or do not exist), or a moving body
        lacks or contradicts its mass properties.
        `read_model` has checked both; this is for models made or changed by hand.
    """
    frames = marker_frames(model)
    faults = [
        Fault(
            model.file,
            marker.source.line,
            element_name(model.file, "Reference_Marker", id),
            "has no place",
        )
        for id, marker in model.markers.items()
        if id not in frames
    ]
    if faults:
        raise DeckError(faults)
    bodies = {}
    for body in model.bodies.values():
        if body.is_ground:
            continue
        try:
            bodies[body.id] = _place_body(model, frames, body)
        except BodyMassError as error:
            name = element_name(model.file, "Body_Rigid", body.id)
            faults.append(Fault(model.file, body.source.line, name, str(error)))
    if faults:
        raise DeckError(faults)

    markers = {}
    for marker in model.markers.values():
        p, R = frames[marker.id]
        frame = _body_frame(bodies.get(marker.body_id))
        markers[marker.id] = MarkerPlace(
            marker.id, marker.body_id, p, R, frame.R.T @ (p - frame.p), frame.R.T @ R
        )
    lower, upper = bounding_box(model, frames)
    diagonal = float(np.linalg.norm(upper - lower))
    return Placement(markers, bodies, lower, upper, diagonal if diagonal > 0.0 else 1.0)


def _body_frame(body: BodyPlace | None) -> Frame:
    """Return the frame in which a body's markers are fixed; ground's is the global one."""
    return Frame(body.p, body.R) if body is not None else GLOBAL


def _place_body(model: Model, frames: Mapping[int, Frame], body: Body) -> BodyPlace:
    """Return one moving body; velocities are turned from vm_id and wm_id to the global frame."""
    mass, inertia, cg = body_mass(model, frames, body)
    scale = model.units.mass_scale
    axes_v = frames[body.vm_id].R if body.vm_id is not None else GLOBAL.R
    axes_w = frames[body.wm_id].R if body.wm_id is not None else GLOBAL.R
    return BodyPlace(
        id=body.id,
        p=cg.p,
        R=cg.R,
        q=quaternion(cg.R),
        mass=mass * scale,
        inertia=(inertia + inertia.T) * (0.5 * scale),
        v=axes_v @ np.array(body.v_ic),
        w=axes_w @ np.array(body.w_ic),
        given=np.array(
            [
                *((*axes_v[:, k], 0, 0, 0, body.v_ic[k]) for k in range(3) if body.v_given[k]),
                *((0, 0, 0, *axes_w[:, k], body.w_ic[k]) for k in range(3) if body.w_given[k]),
            ],
            dtype=np.float64,
        ).reshape(-1, 7),
    )


def bounding_box(model: Model, frames: Mapping[int, Frame]) -> tuple[Array, Array]:
    """Return the lower and upper corner (3,) of all markers and graphics, global [L].

    Parameters
    ----------
    model : Model
        The deck.
    frames : mapping of int to Frame
        Global frames of all markers.
    """
    boxes = [(frame.p, frame.p) for frame in frames.values()]
    boxes += _graphic_boxes(model, frames)
    if not boxes:
        return np.zeros(3), np.zeros(3)
    return (
        np.min([lower for lower, _ in boxes], axis=0),
        np.max([upper for _, upper in boxes], axis=0),
    )


def _graphic_boxes(model: Model, frames: Mapping[int, Frame]) -> Iterator[tuple[Array, Array]]:
    """Yield the global bounding box of every graphic that has an extent."""
    for graphic in model.graphics.values():
        frame = frames[graphic.marker_id]
        box = graphic_box(graphic, frame.p, frame.R)
        if box is not None:
            yield box


def graphic_box(graphic: Graphic, p: Array, R: Array) -> tuple[Array, Array] | None:
    """Return the global bounding box of a graphic whose marker is at p, R; None of a plane."""
    if graphic.vertices is not None:
        points = p + graphic.vertices @ R.T
        return points.min(axis=0), points.max(axis=0)
    if graphic.shape == "PLANE":
        return None
    centre = p + R @ np.array(graphic.offset)
    half = _half_extent(graphic, R)
    return centre - half, centre + half


def _half_extent(graphic: Graphic, R: Array) -> Array:
    """Return half the extent (3,) along the global axes of a shape turned by `R`."""
    if graphic.shape == "BOX":
        signs = np.array(list(product((-0.5, 0.5), repeat=3)))
        half: Array = np.abs((signs * graphic.size) @ R.T).max(axis=0)
        return half
    if graphic.shape == "CYLINDER":
        radius, length = graphic.size
        along = np.abs(R[:, 2])
        # a disc of normal n reaches r sqrt(1 - n_i^2) along axis i
        return radius * np.sqrt(np.maximum(0.0, 1.0 - along**2)) + 0.5 * length * along
    if graphic.shape == "FRUSTUM":
        # the cylinder around it
        bottom, top, length = graphic.size
        along = np.abs(R[:, 2])
        return max(bottom, top) * np.sqrt(np.maximum(0.0, 1.0 - along**2)) + 0.5 * length * along
    axes = np.array(graphic.size * 3 if graphic.shape == "SPHERE" else graphic.size)
    # support function of an ellipsoid: |diag(a) R' e_i|
    reach: Array = np.sqrt(((R * axes) ** 2).sum(axis=1))
    return reach
