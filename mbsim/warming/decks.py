"""Small decks of what the models in `models/` have not: each asks for code that no other does."""

from __future__ import annotations

_HEAD = """<MotionSolve><Model><Body_Rigid id="1" isground="TRUE"/>
<Reference_Marker id="10" body_id="1"/><Reference_Marker id="11" body_id="1" pos_x="-1"/>
<Force_Gravity grav_x="0.3" grav_z="-9.81"/>"""
_TAIL = """</Model><Command>
<Simulate analysis_type="Transient" end_time="1" print_interval="0.1"/></Command></MotionSolve>"""


def _body(id: int, x: float = 0.0, z: float = 1.0) -> str:
    """Return a body that moves, with a sphere around it."""
    return f"""<Body_Rigid id="{id}" cg_id="{id}0" mass="1" inertia_xx="0.1" inertia_yy="0.1"
 inertia_zz="0.1" v_ic_x="0.5" v_ic_x_flag="TRUE"/>
<Reference_Marker id="{id}0" body_id="{id}" pos_x="{x}" pos_z="{z}"/>
<Post_Graphic id="{id}00" type="Sphere" center_marker_id="{id}0" radius="0.1"/>"""


def _broadphase() -> str:
    """Return a set of spheres in contact with itself, too many to list its pairs for good."""
    count = 26
    ids = " ".join(f"{id}00" for id in range(2, 2 + count))
    return "".join(_body(2 + k, 0.3 * k) for k in range(count)) + (
        f'<Force_Contact id="1" num_i_graphics="{count}" i_graphics_id="{ids}" '
        f'num_j_graphics="{count}" j_graphics_id="{ids}" cnf_type="IMPACT" stiffness="1e4" '
        'exponent="1.5" damping="5" dmax="1e-3"/>'
    )


_SENSORS = "".join(
    f'<Sensor_Event id="{id}" type="EXPRESSION" expr="TIME" compare="GE" value="0.5" '
    f'zero_crossing="{located}"/>'
    for id, located in ((1, "TRUE"), (2, "FALSE"))
)
_STATE = '<Control_Diff id="1" type="EXPRESSION" expr="-2*DIF(1)" ic="1" is_implicit="FALSE"/>'
_SLIDER = '<Constraint_Joint id="1" type="TRANSLATIONAL" i_marker_id="20" j_marker_id="10"/>'
_JOINT_FRICTION = (
    '<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_DYNAMICONLY" mu_dynamic="0.3" '
    'friction_trans_vel="0.01"/>'
)
_LATE = (
    '<Force_Scalar_TwoBody id="1" type="Force" i_marker_id="20" j_marker_id="11" '
    'expr="-0.3*ABS(JOINT(1, 0, 2, 0))*TANH(VZ(20))" action_only="TRUE"/>'
)


def _dry(more: str) -> str:
    """Return a Force_DryFriction."""
    return (
        '<Force_DryFriction id="7" type="TX" i_marker_id="20" j_marker_id="10" '
        f'friction="2" {more}/>'
    )


#: What a deck is of -> its text.
DECKS = {
    name: f"{_HEAD}{model}{_TAIL}"
    for name, model in {
        "sensors": _body(2) + _SENSORS,
        "states": _body(2) + _STATE,
        "joint friction": _body(2) + _SLIDER + _JOINT_FRICTION,
        "forces of reactions": _body(2) + _SLIDER + _LATE,
        "dry friction": _body(2) + _dry('dx="0.01"'),
        "rigid dry friction": _body(2) + _dry(""),
        "broadphase": _broadphase(),
    }.items()
}
