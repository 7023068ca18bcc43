"""Blocks that move along x, before a spring."""

from __future__ import annotations

#: Marker 10 at the origin and 11 a unit before it.
GROUND = """
<Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="11" body_id="1" pos_x="-1"/>"""


def body(id, mass, x=0.0, v=0.0, w=0.0):
    """Return a body with its cg marker 10 times its id."""
    given = f'v_ic_x="{v!r}" v_ic_x_flag="TRUE" w_ic_x="{w!r}" w_ic_x_flag="TRUE"'
    return f"""
<Body_Rigid id="{id}" cg_id="{id}0" mass="{mass!r}" inertia_xx="0.1" inertia_yy="0.1"
  inertia_zz="0.1" {given}/>
<Reference_Marker id="{id}0" body_id="{id}" pos_x="{x!r}"/>"""


def spring(k):
    """Return a spring of body 2 that is relaxed at x = 0."""
    return f"""
<Force_SpringDamper id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="11"
  stiffness="{k!r}" length="1"/>"""
