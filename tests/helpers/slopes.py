"""A cube that is a mesh on a slab that is one, on a slope below the angle of friction."""

from __future__ import annotations

import numpy as np
import trimesh

from helpers.decks import EARTH
from helpers.surfaces import mesh_graphic

ANGLE = np.deg2rad(10.0)
SAG = 9.81 * np.cos(ANGLE) * 1e-5
#: What is below 2 N/m of a face of 0.04 m^2 carries as a spring of 1e5 N/m.
DEPTHS = {
    "LARGEST": 'stiffness="1e5" damping="300"',
    "FIELD": 'stiffness="2.5e6" damping="7500" contact_depth="FIELD"',
}
FRICTIONS = {
    "COULOMB_ON": 'cff_type="COULOMB_ON" stiction_trans_vel="0.01" friction_trans_vel="0.02"',
    "STICTION": 'cff_type="STICTION"',
}


def slope(depth, friction):
    """Return a cube of 0.2 m and 1 kg that lies on a slab, as deep as it will; gravity aslant."""
    small, slab = trimesh.creation.box((0.2, 0.2, 0.2)), trimesh.creation.box((2.0, 2.0, 0.2))
    g = 9.81 * np.array([np.sin(ANGLE), -np.cos(ANGLE)])
    return (
        EARTH
        + mesh_graphic(100, 10, slab.vertices - [0.0, 0.0, 0.1], slab.faces)
        + '<Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="0.0066" inertia_yy="0.0066" '
        f'inertia_zz="0.0066"/><Reference_Marker id="20" body_id="2" pos_z="{0.1 - float(SAG)!r}"/>'
        + mesh_graphic(200, 20, small.vertices, small.faces)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'exponent="1" dmax="1e-5" {DEPTHS[depth]} {FRICTIONS[friction]} '
        'mu_static="0.3" mu_dynamic="0.3"/>'
        f'<Force_Gravity grav_x="{float(g[0])!r}" grav_z="{float(g[1])!r}"/>'
    )
