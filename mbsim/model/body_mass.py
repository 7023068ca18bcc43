"""Mass and inertia of a body, as the deck gives them or from its graphics."""

from __future__ import annotations

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from mbsim.model import mass_properties
from mbsim.model.elements import Array, Body, Graphic, Model
from mbsim.model.frames import GLOBAL, Frame
from mbsim.model.mass_properties import MassProperties
from mbsim.model.mesh import solid_fault

_TRIANGLE = 1e-9  # relative slack of the triangle inequality
_CENTRE = 1e-6  # how far, in cube roots of the volume, the cg marker may lie off the centre


class BodyMassError(ValueError):
    """A body whose mass properties cannot be; the message names attribute and value."""


class BodyMass(NamedTuple):
    """`mass` and `inertia` (3, 3) about the origin of `cg` in its axes, in the deck's units.

    `cg` is the global frame of the cg marker; without one, of the centre of the graphics.
    """

    mass: float
    inertia: Array
    cg: Frame


def body_mass(model: Model, frames: Mapping[int, Frame], body: Body) -> BodyMass:
    """Return mass and inertia of a moving body, not scaled to the unit of force.

    Parameters
    ----------
    model : Model
        The deck.
    frames : mapping of int to Frame
        Global frames of all markers.
    body : Body
        A body that is not ground.

    Returns
    -------
    BodyMass
        Mass [mass] and inertia [mass L^2] about the cg marker's origin, in its axes.

    Raises
    ------
    BodyMassError
        If something needed is missing, or no rigid body has such an inertia.

    Notes
    -----
    A given mass goes before `density`. Inertia that is not given is that of the body's
    solid graphics, summed without regard to overlap and scaled to the mass; their centre
    must then be the cg marker's origin. A body of given `density` needs no cg marker: that is then
    at the centre of its graphics, along the axes of `lprf_id` (without it, the global ones).
    """
    solid: MassProperties | None = None
    if body.cg_id is not None:
        cg = frames[body.cg_id]
        if body.mass is None or body.inertia is None:
            solid = _solid(model, frames, body, cg)
    else:
        solid, cg = _own_centre(model, frames, body)

    mass = body.mass
    if mass is None:
        if body.density is None:
            raise BodyMassError("mass: missing; give mass, or density and solid graphics")
        if solid is None:
            raise BodyMassError(f"density={body.density:g}: the body has no solid graphics")
        mass = body.density * solid.volume
        if not mass > 0.0:
            raise BodyMassError(f"density={body.density:g}: the mass is {mass:g}, must be > 0")

    if body.inertia is not None:
        inertia = _given_inertia(body, mass, frames, cg)
    elif solid is not None:
        inertia = _solid_inertia(solid, mass)
    else:
        raise BodyMassError(
            "inertia_xx, inertia_yy, inertia_zz: missing, and the body has no solid graphics"
        )
    _check_inertia(inertia, body)
    return BodyMass(mass, inertia, cg)


def solids_of(model: Model, body: Body) -> list[Graphic]:
    """Return the body's graphics that have a volume."""
    return [
        graphic
        for graphic in model.graphics.values()
        if graphic.shape != "PLANE"
        and (marker := model.markers.get(graphic.marker_id)) is not None
        and marker.body_id == body.id
    ]


def _own_centre(
    model: Model, frames: Mapping[int, Frame], body: Body
) -> tuple[MassProperties, Frame]:
    """Return the solid of a body without a cg marker and the frame at its centre."""
    if body.density is None:
        raise BodyMassError(
            "cg_id: missing; a moving body needs the id of its cg marker, or density and "
            "solid graphics"
        )
    lprf = frames[body.lprf_id] if body.lprf_id is not None else GLOBAL
    # from a place on the body: far from the origin of all, sums would lose digits
    markers = (frames[graphic.marker_id] for graphic in solids_of(model, body))
    near = Frame(next((frame.p for frame in markers), lprf.p), lprf.R)
    solid = _solid(model, frames, body, near)
    if solid is None:
        raise BodyMassError(f"density={body.density:g}: the body has no solid graphics")
    if not solid.volume > 0.0:
        raise BodyMassError("cg_id: missing, and the graphics enclose no volume")
    centre = Frame(near.p + near.R @ solid.centre, near.R)
    return solid._replace(centre=np.zeros(3)), centre


def _solid(
    model: Model, frames: Mapping[int, Frame], body: Body, cg: Frame
) -> MassProperties | None:
    """Return the properties of all solid graphics of the body in cg axes, None without any."""
    parts = []
    for graphic in solids_of(model, body):
        name = f"Post_Graphic[{graphic.id}]"
        if not graphic.is_material_inside:
            raise BodyMassError(f"{name} is a cavity; give mass and inertia of the body")
        if graphic.shape == "MESH" and graphic.vertices is None:
            raise BodyMassError(f"no mass or inertia from {name}: its mesh is not read")
        if graphic.vertices is not None and graphic.faces is not None:
            fault = solid_fault(graphic.vertices, graphic.faces)
            if fault:
                raise BodyMassError(f"no mass or inertia from {name}: {fault}")
        marker = frames[graphic.marker_id]
        p, R = cg.R.T @ (marker.p - cg.p), cg.R.T @ marker.R
        parts.append(mass_properties.moved(mass_properties.of_graphic(graphic), p, R))
    return mass_properties.combined(parts) if parts else None


def _solid_inertia(solid: MassProperties, mass: float) -> Array:
    """Return the solid's inertia scaled to `mass`; its centre must be the cg origin."""
    if not solid.volume > 0.0:
        raise BodyMassError("the graphics enclose no volume; give inertia_xx ... of the body")
    if np.linalg.norm(solid.centre) > _CENTRE * solid.volume ** (1.0 / 3.0):
        x, y, z = solid.centre
        raise BodyMassError(
            f"the centre of its graphics is at ({x:.12g}, {y:.12g}, {z:.12g}) of the cg marker, "
            "must be at its origin where inertia comes from graphics"
        )
    # inertia by volume first: mass by volume alone can be too large for a double
    return solid.inertia / solid.volume * mass


def _given_inertia(body: Body, mass: float, frames: Mapping[int, Frame], cg: Frame) -> Array:
    """Return the deck's inertia, moved from the IM marker to the cg and turned to its axes."""
    xx, yy, zz, xy, yz, xz = body.inertia or (0.0,) * 6
    # the deck gives integrals of xy dm, which stand in the tensor with a minus
    tensor = np.array([[xx, -xy, -xz], [-xy, yy, -yz], [-xz, -yz, zz]]) + 0.0
    if body.im_id is None or body.im_id == body.cg_id:
        return tensor
    im = frames[body.im_id]
    R = cg.R.T @ im.R
    # Steiner: about the centre it is smallest
    moved: Array = R @ tensor @ R.T - mass_properties.steiner(mass, cg.R.T @ (im.p - cg.p))
    return moved


def _check_inertia(inertia: Array, body: Body) -> None:
    """Refuse what no rigid body has: moments <= 0, or one larger than the other two together."""
    low, middle, high = _principal_moments(inertia)
    if low > 0.0 and high <= (low + middle) * (1.0 + _TRIANGLE):
        return
    moments = f"principal moments about the cg {low:.9g}, {middle:.9g}, {high:.9g}"
    given = ""
    if body.inertia is not None:
        names = ("xx", "yy", "zz", "xy", "yz", "xz")
        pairs = zip(names, body.inertia, strict=True)
        # moments are told always, products where there are some
        told = (f"inertia_{name}={value:g}" for name, value in pairs if value or name[0] == name[1])
        given = " ".join(told) + ": "
    if not low > 0.0:
        raise BodyMassError(f"{given}{moments}; all must be > 0")
    raise BodyMassError(f"{given}{moments}; none may be larger than the sum of the others")


def _principal_moments(inertia: Array) -> list[float]:
    """Return the principal moments in ascending order."""
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = inertia.tolist()
    if not (xy or xz or yz or yx or zx or zy):
        return sorted((xx, yy, zz))
    moments: list[float] = np.linalg.eigvalsh((inertia + inertia.T) / 2.0).tolist()
    return moments
