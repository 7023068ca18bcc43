"""Patches in metres and in millimetres: one motion, to rounding."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from helpers.decks import EARTH, run_deck
from helpers.surfaces import angle, mesh_graphic

#: Metres, and kilograms, in the unit of length and of mass; force and time are N and s.
UNITS = {"METER KILOGRAM": (1.0, 1.0), "MILLIMETER MEGAGRAM": (1e3, 1e-3)}
#: What stiffness and damping are given over, as powers of a length.
DEPTHS = {"LARGEST": (1e5, 200.0, 1), "FIELD": (3e6, 6e3, 3)}


def thrown(depth, units):
    """Return an angle thrown flat onto a slab, which is a mesh too: it tilts as it rubs."""
    unit, mass = UNITS[units]
    stiffness, damping, power = DEPTHS[depth]
    length, kind = units.split()
    slab = trimesh.creation.box((2.0, 2.0, 0.2))
    vertices, faces = angle()
    inertia = [k * mass * unit**2 for k in (0.004, 0.004, 0.006)]
    return (
        f'<Param_Unit force_unit="NEWTON" mass_unit="{kind}" length_unit="{length}" '
        'time_unit="SECOND"/>'
        + EARTH
        + mesh_graphic(100, 10, unit * (slab.vertices - [0.0, 0.0, 0.1]), slab.faces)
        + f'<Body_Rigid id="2" cg_id="20" mass="{mass}" inertia_xx="{inertia[0]}" '
        f'inertia_yy="{inertia[1]}" inertia_zz="{inertia[2]}" v_ic_x="{0.5 * unit}" '
        f'v_ic_x_flag="TRUE"/><Reference_Marker id="20" body_id="2" pos_x="{0.1 * unit}" '
        f'pos_y="{0.2 * unit}" pos_z="{0.0505 * unit}"/>'
        + mesh_graphic(200, 20, unit * vertices, faces)
        + '<Force_Contact id="301" i_graphics_id="200" j_graphics_id="100" cnf_type="IMPACT" '
        f'stiffness="{stiffness / unit**power}" damping="{damping / unit**power}" exponent="1" '
        f'dmax="{1e-5 * unit}" contact_depth="{depth}" cff_type="COULOMB_ON" mu_static="0.3" '
        f'mu_dynamic="0.3" stiction_trans_vel="{0.01 * unit}" friction_trans_vel="{0.02 * unit}"/>'
        f'<Force_Gravity grav_z="{-9.81 * unit}"/>'
    )


@pytest.mark.parametrize("depth", DEPTHS)
@pytest.mark.parametrize("method", ["DOPRI5", "RADAU5", "VERLET"])
def test_units_change_nothing(depth, method, tmp_path):
    ends = []
    for units, (unit, _) in UNITS.items():
        run = run_deck(tmp_path, thrown(depth, units), 0.05, 0.05, integrator=method)
        position, turning = run["bodies/2/position"][-1], run["bodies/2/angular_velocity"][-1]
        ends.append(np.concatenate([position / unit, turning]))
        assert abs(turning).max() > 1e-3
    # steps follow the scale of length, which is found by rounding
    np.testing.assert_allclose(ends[1], ends[0], rtol=1e-6, atol=1e-7)
