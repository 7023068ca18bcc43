"""Volume, centre and inertia of solids of unit density: closed forms and exact polyhedra."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from mbsim.model.elements import Array, Graphic


class MassProperties(NamedTuple):
    """Of a solid of unit density, in some frame G.

    `volume` [L^3]; `centre` (3,) [L], in G; `inertia` (3, 3) [L^5] about the centre, axes of G.
    """

    volume: float
    centre: Array
    inertia: Array


def sphere(radius: float) -> MassProperties:
    """Return the properties of a ball [L] about its centre: I = 2/5 m r^2."""
    return ellipsoid(radius, radius, radius)


def ellipsoid(a: float, b: float, c: float) -> MassProperties:
    """Return the properties of an ellipsoid of semi-axes a, b, c [L]: I_x = m (b^2 + c^2)/5."""
    volume = 4.0 / 3.0 * math.pi * a * b * c
    moments = np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    return MassProperties(volume, np.zeros(3), np.diag(volume / 5.0 * moments))


def box(x: float, y: float, z: float) -> MassProperties:
    """Return the properties of a box of edges x, y, z [L]: I_x = m (y^2 + z^2)/12."""
    volume = x * y * z
    moments = np.array([y * y + z * z, x * x + z * z, x * x + y * y])
    return MassProperties(volume, np.zeros(3), np.diag(volume / 12.0 * moments))


def cylinder(radius: float, length: float) -> MassProperties:
    """Return the properties of a cylinder [L] along z about its centre.

    I_z = m r^2/2, I_x = I_y = m (3 r^2 + l^2)/12.
    """
    volume = math.pi * radius**2 * length
    across = (3.0 * radius**2 + length**2) / 12.0
    return MassProperties(
        volume, np.zeros(3), np.diag(volume * np.array([across, across, radius**2 / 2.0]))
    )


def frustum(bottom: float, top: float, length: float) -> MassProperties:
    """Return the properties of a cone cut off [L] along z, about the middle of its axis.

    With r(z) from `bottom` to `top` over the length, s = z/length from 0 to 1:
    V = pi l <r^2>, z_c = l <s r^2>/<r^2>, I_z = pi l <r^4>/2 and
    I_x = I_z/2 + pi l^3 <s^2 r^2> - V z_c^2, <> the mean over s.
    """
    a, b = bottom, top
    r2 = (a * a + a * b + b * b) / 3.0
    s1 = (a * a + 2.0 * a * b + 3.0 * b * b) / 12.0
    s2 = (a * a + 3.0 * a * b + 6.0 * b * b) / 30.0
    r4 = (a**4 + a**3 * b + a * a * b * b + a * b**3 + b**4) / 5.0
    volume = math.pi * length * r2
    z = length * s1 / r2
    axial = 0.5 * math.pi * length * r4
    across = 0.5 * axial + math.pi * length**3 * s2 - volume * z * z
    centre = np.array([0.0, 0.0, z - 0.5 * length])
    return MassProperties(volume, centre, np.diag([across, across, axial]))


def polyhedron(vertices: Array, faces: npt.NDArray[np.int64]) -> MassProperties:
    """Return the properties of the solid inside a closed mesh, exact up to rounding.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Vertex indices, counter-clockwise seen from outside.

    Returns
    -------
    MassProperties
        In the frame of the vertices; a negative volume means faces turned inside out.

    Notes
    -----
    Each face spans a tetrahedron (0, a, b, c) of signed volume V = a.(b x c)/6 with
    integral x dV = V s/4 and integral x x' dV = V (s s' + a a' + b b' + c c')/20,
    s = a + b + c. The origin is moved into the mesh first, which keeps rounding small.

    References
    ----------
    F. Tonon, "Explicit exact formulas for the 3-D tetrahedron inertia tensor in terms of
    its vertex coordinates", Journal of Mathematics and Statistics 1(1), 2005.
    """
    origin = vertices.mean(axis=0)
    corners = vertices[faces] - origin
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    volumes = np.einsum("ij,ij->i", a, np.cross(b, c)) / 6.0
    volume = float(volumes.sum())
    if volume == 0.0:
        return MassProperties(0.0, origin, np.zeros((3, 3)))

    s = a + b + c
    offset = volumes @ s / (4.0 * volume)
    second = sum(np.einsum("i,ij,ik->jk", volumes, w, w) for w in (s, a, b, c)) / 20.0
    # about the centre: integral x x' loses V c c'; then I = tr(C) 1 - C
    second = second - volume * np.outer(offset, offset)
    inertia = np.trace(second) * np.eye(3) - second
    return MassProperties(volume, origin + offset, inertia)


def of_graphic(graphic: Graphic) -> MassProperties:
    """Return the properties of a solid graphic, in the frame of its marker.

    Raises
    ------
    ValueError
        If the graphic is a plane, which bounds no volume.
    """
    if graphic.shape == "MESH":
        if graphic.vertices is None or graphic.faces is None:
            raise ValueError("a mesh without vertices has no volume")
        return polyhedron(graphic.vertices, graphic.faces)
    if graphic.shape == "SPHERE":
        local = sphere(*graphic.size)
    elif graphic.shape == "ELLIPSOID":
        local = ellipsoid(*graphic.size)
    elif graphic.shape == "BOX":
        local = box(*graphic.size)
    elif graphic.shape == "CYLINDER":
        local = cylinder(*graphic.size)
    elif graphic.shape == "FRUSTUM":
        local = frustum(*graphic.size)
    else:
        raise ValueError(f"a {graphic.type} has no volume")
    return local._replace(centre=local.centre + np.array(graphic.offset))


def moved(properties: MassProperties, p: Array, R: Array) -> MassProperties:
    """Return the properties in frame F, where G has origin `p` (3,) and axes `R` (3, 3)."""
    return MassProperties(
        properties.volume,
        p + R @ properties.centre,
        R @ properties.inertia @ R.T,
    )


def combined(parts: Iterable[MassProperties]) -> MassProperties:
    """Return the properties of several solids in one frame; overlaps count twice."""
    parts = list(parts)
    volume = sum(part.volume for part in parts)
    if volume == 0.0:
        return MassProperties(0.0, np.zeros(3), np.zeros((3, 3)))
    centre = sum((part.volume / volume * part.centre for part in parts), np.zeros(3))
    inertia = sum(
        (part.inertia + steiner(part.volume, part.centre - centre) for part in parts),
        np.zeros((3, 3)),
    )
    return MassProperties(volume, centre, inertia)


def steiner(mass: float, d: Array) -> Array:
    """Return m (d.d 1 - d d'), shape (3, 3): what a shift by `d` (3,) from the centre adds."""
    return mass * (float(d @ d) * np.eye(3) - np.outer(d, d))
