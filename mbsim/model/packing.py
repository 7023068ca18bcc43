"""A closed mesh as a packed surface, with all that contact asks of it."""

from __future__ import annotations

from mbsim.model.elements import Array
from mbsim.model.flat_parts import fewer_triangles
from mbsim.model.mesh import Faces
from mbsim.model.surface import pack


def pack_mesh(vertices: Array, faces: Faces, layered: bool) -> Array:
    """Return a closed mesh as a packed surface (`model.surface`), with a layer or without.

    Parameters
    ----------
    vertices : ndarray, shape (n, 3)
        Positions [L].
    faces : ndarray of int, shape (m, 3)
        Triangles, counter-clockwise seen from outside.
    layered : bool
        Whether other surfaces are to touch it: planes and spheres need no layer.
    """
    vertices, faces = fewer_triangles(vertices, faces)
    if not layered:
        return pack(vertices, faces)
    from mbsim.model.surface_layer import layer

    return pack(vertices, faces, *layer(vertices, faces))
