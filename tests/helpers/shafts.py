"""Two shafts beside each other, of which a torque drives one, as statements of a deck."""

from __future__ import annotations

#: To be filled: `held`, what relates their angles.
TWO_SHAFTS = """
  <Body_Rigid id="1" isground="TRUE"/>
  <Body_Rigid id="2" cg_id="20" mass="1" inertia_xx="1" inertia_yy="1" inertia_zz="1"/>
  <Body_Rigid id="3" cg_id="30" mass="1" inertia_xx="4" inertia_yy="4" inertia_zz="4"/>
  <Reference_Marker id="10" body_id="1"/>
  <Reference_Marker id="11" body_id="1" pos_x="1"/>
  <Reference_Marker id="20" body_id="2"/>
  <Reference_Marker id="30" body_id="3" pos_x="1"/>
  <Constraint_Joint id="1" type="REVOLUTE" i_marker_id="20" j_marker_id="10"/>
  <Constraint_Joint id="2" type="REVOLUTE" i_marker_id="30" j_marker_id="11"/>
  {held}
  <Force_Scalar_TwoBody id="1" type="Torque" i_marker_id="20" j_marker_id="10" expr="3"/>
"""
