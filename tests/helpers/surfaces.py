"""Meshes that need not be convex, packed, and their pairs called by name."""

from __future__ import annotations

import numpy as np

from helpers.pairs import entry, frame
from mbsim.geometry.catalog import AREA, GAIN, MOMENT_XX, PAIRS, POINT, REGION_ROWS, STIFF_XX
from mbsim.model.elements import Graphic
from mbsim.model.surface import pack
from mbsim.model.surface_layer import layer
from mbsim.model.tessellation import triangles_of


class Meshed:
    """A mesh with its packed surface; the layer where it is asked for."""

    def __init__(self, vertices, faces, layered=True):
        self.vertices, self.faces = np.asarray(vertices, dtype=float), np.asarray(faces)
        made = layer(self.vertices, self.faces) if layered else ()
        self.data = pack(self.vertices, self.faces, *made)
        self.size = np.array([0.0, 0.0, 0.0, self.data.ctypes.data])

    @property
    def corners(self):
        return self.vertices[self.faces]


def sphere(radius, halvings):
    """Return an icosphere whose vertices have the radius; 20 4^halvings triangles."""
    import mbsim.model.tessellation as made

    kept, made.HALVINGS = made.HALVINGS, halvings
    try:
        vertices, faces = triangles_of(Graphic(id=1, shape="SPHERE", size=(1.0,)))
    finally:
        made.HALVINGS = kept
    return radius * vertices / np.linalg.norm(vertices, axis=1)[:, None], faces


def box(*edges):
    return triangles_of(Graphic(id=1, shape="BOX", size=edges))


def torus(large, small, around, across):
    """Return a torus about z."""
    i, j = np.meshgrid(np.arange(around), np.arange(across), indexing="ij")
    u, v = 2 * np.pi * i / around, 2 * np.pi * j / across
    wide = large + small * np.cos(v)
    vertices = np.stack([wide * np.cos(u), wide * np.sin(u), small * np.sin(v)], axis=2)
    k = (i * across + j).ravel()
    right = (((i + 1) % around) * across + j).ravel()
    up = (i * across + (j + 1) % across).ravel()
    both = (((i + 1) % around) * across + (j + 1) % across).ravel()
    faces = np.vstack([np.column_stack([k, right, both]), np.column_stack([k, both, up])])
    return vertices.reshape(-1, 3), faces


def call(name, frame_i, size_i, frame_j, size_j):
    """Return all rows of a pair."""
    points = np.full((PAIRS[name].slots, POINT), np.nan)
    arrays = [np.ascontiguousarray(a, dtype=float) for a in (frame_i, size_i, frame_j, size_j)]
    entry(name)(*(a.ctypes.data for a in (*arrays, points)))
    return points


def incidents(points):
    """Return the touching incidents of patches and the rows of their numbers."""
    first, numbers = points[::REGION_ROWS], points[1::REGION_ROWS]
    down = first[:, 0] > 0.0
    return first[down], numbers[down]


def overlap_volume(points):
    """Return the volume and the area of patches on a plane."""
    _, numbers = incidents(points)
    # the stiffness of a bed against tilting is that of its moments over its mean depth
    mean = numbers[:, MOMENT_XX] / numbers[:, STIFF_XX]
    return float((numbers[:, AREA] * mean).sum()), float(numbers[:, AREA].sum())


def wrench(points, step=1, about=(0.0, 0.0, 0.0)):
    """Return force and torque on I of springs of stiffness 1."""
    touching = points[::step, 0] > 0.0
    down = points[::step][touching]
    gain = points[1::step, GAIN][touching] if step == REGION_ROWS else 1.0
    force = (down[:, 7] * gain * down[:, 0])[:, None] * down[:, 4:7]
    torque = np.cross(down[:, 1:4] - np.asarray(about), force)
    return np.concatenate([force.sum(axis=0), torque.sum(axis=0)])


PLANE = (frame(np.zeros(3), np.eye(3)), np.zeros(4))


def angle():
    """Return an L of 20 triangles, 0.2 m along both legs, 0.1 m thick and high; its cg at 0."""
    profile = 0.1 * np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]])
    ring = [np.column_stack([profile, np.full(6, z)]) for z in (0.0, 0.1)]
    k = np.arange(6)
    m = (k + 1) % 6
    end = np.array([[0, j, j + 1] for j in range(1, 5)])
    faces = np.vstack(
        [
            np.column_stack([k, m, m + 6]),
            np.column_stack([k, m + 6, k + 6]),
            end + 6,
            end[:, ::-1],
        ]
    )
    return np.vstack(ring) - [0.25 / 3, 0.25 / 3, 0.05], faces


def mesh_graphic(id, marker, vertices, faces):
    """Return a TriaMesh with its triangles in the deck."""
    nodes = " ".join(repr(float(x)) for x in np.ravel(vertices))
    rows = " ".join(str(int(k)) for k in np.ravel(faces))
    return (
        f'<Post_Graphic id="{id}" type="TriaMesh" rm_id="{marker}">'
        f"<Nodes>{nodes}</Nodes><Faces>{rows}</Faces></Post_Graphic>"
    )


GROUND = '<Post_Graphic id="100" type="Plane" rm_id="10"/>'


def angle_on_ground(height, contact, ground=GROUND):
    """Return the statements of an L of 1 kg above ground at z = 0."""
    return f"""
<Param_Unit force_unit="NEWTON" mass_unit="KILOGRAM" length_unit="METER" time_unit="SECOND"/>
<Body_Rigid id="1" isground="TRUE"/><Reference_Marker id="10" body_id="1"/>
<Reference_Marker id="11" body_id="1" pos_z="-0.1"/>
<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.004" inertia_yy="0.004" inertia_zz="0.006"/>
<Reference_Marker id="20" body_id="2" pos_z="{height}"/>
{ground}
{mesh_graphic(200, 20, *angle())}
<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" {contact}/>
<Force_Gravity grav_z="-9.81"/>"""


IMPACT = (
    'cnf_type="IMPACT" stiffness="1e6" exponent="1.5" damping="1e3" dmax="1e-4" '
    'cff_type="COULOMB_ON" mu_static="0.3" mu_dynamic="0.3" '
    'stiction_trans_vel="0.01" friction_trans_vel="0.02"'
)
