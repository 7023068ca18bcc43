"""Joints, motions, couplers, forces, variables and requests of XML decks, good and bad."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import pytest

from helpers.minimal_deck import added, deck, read
from mbsim.errors import DeckError, ModelError
from mbsim.expressions.tree import Call, Number
from mbsim.joints.catalog import JOINTS
from mbsim.run.settings import settle
from mbsim.run.simulation import simulate

ADDED_LINE = 14  # of the last statement of <Model> in the minimal deck
ON = 'i_marker_id="20" j_marker_id="10"'
REVOLUTE = f'<Constraint_Joint id="1" type="REVOLUTE" {ON}/>'


@pytest.mark.parametrize("type", sorted(JOINTS))
def test_every_joint(tmp_path: Path, type: str) -> None:
    needs = {name: 0.5 for name in JOINTS[type].needs}
    extra = " ".join(f'{name}="{value}"' for name, value in needs.items())
    spelled = type.replace("_", "").capitalize()
    model = read(
        tmp_path, added(f'<Constraint_Joint id="7" label="j" type="{spelled}" {ON} {extra}/>')
    )
    joint = model.joints[7]
    assert (joint.type, joint.label, joint.is_primitive) == (type, "j", False)
    assert (joint.i_marker_id, joint.j_marker_id) == (20, 10)
    assert all(getattr(joint, name) == value for name, value in needs.items())
    assert joint.source.line == ADDED_LINE


def test_distance_has_a_length(tmp_path: Path) -> None:
    text = added(f'<Constraint_Joint id="1" type="DISTANCE" {ON} length="2" is_virtual="FALSE"/>')
    assert read(tmp_path, text).joints[1].length == 2.0


@pytest.mark.parametrize("type", ["ATPOINT", "INLINE", "INPLANE", "PARALLEL_AXES"])
def test_primitives_have_ids_of_their_own(tmp_path: Path, type: str) -> None:
    model = read(tmp_path, added(f'{REVOLUTE}<Constraint_Jprim id="1" type="{type}" {ON}/>'))
    assert model.joints[1].type == "REVOLUTE"
    assert model.primitives[1].type == ("SPHERICAL" if type == "ATPOINT" else type)
    assert model.primitives[1].is_primitive


@pytest.mark.parametrize(
    ("attributes", "expected"),
    [
        ('val_type="D" ic_disp="3"', ("D", None, None)),
        ('val_type="V" ic_disp="3" ic_vel="4"', ("V", 3.0, None)),
        ('val_type="a" ic_disp="3" ic_vel="4"', ("A", 3.0, 4.0)),
    ],
)
def test_motion(tmp_path: Path, attributes: str, expected: tuple[object, ...]) -> None:
    # before its joint: its markers and its only direction are the joint's
    text = f'<Motion_Joint id="3" joint_id="1" type="EXPRESSION" expr="2*TIME" {attributes}/>'
    model = read(tmp_path, added(text + REVOLUTE))
    motion = model.motions[3]
    assert (motion.val_type, motion.ic_disp, motion.ic_vel) == expected
    assert (motion.direction, motion.i_marker_id, motion.j_marker_id) == ("R", 20, 10)
    assert isinstance(motion.expr.root, Call)
    unused = {"D": 1, "V": 1, "A": 0}[motion.val_type]
    assert sum("Motion_Joint ic_" in note for note in model.notes) == unused


def test_two_motions_of_a_cylindrical_joint(tmp_path: Path) -> None:
    motions = "".join(
        f'<Motion_Joint id="{k}" joint_id="1" motion_type="{d}" val_type="D" expr="1"/>'
        for k, d in enumerate("RT", start=1)
    )
    model = read(tmp_path, added(f'<Constraint_Joint id="1" type="CYLINDRICAL" {ON}/>{motions}'))
    assert [motion.direction for motion in model.motions.values()] == ["R", "T"]


def test_coupler_forces_and_variables(tmp_path: Path) -> None:
    model = read(
        tmp_path,
        added(
            REVOLUTE
            + f'<Constraint_Joint id="2" type="TRANSLATIONAL" {ON}/>'
            + '<Constraint_Coupler id="1" joint_ids="1 2" motion_types="r, T" scales="1 -2.5"/>'
            + f'<Force_SpringDamper id="4" type="Translational" {ON} stiffness="3" damping="2"'
            + ' length="0.5" preload="-1"/>'
            + f'<Force_Scalar_TwoBody id="5" type="Force" {ON} expr="-3*DM(20,10)"/>'
            + f'<Force_Scalar_TwoBody id="6" type="TorqueOnly" {ON} expr="1" action_only="TRUE"/>'
            + '<Reference_Variable id="8" type="EXPRESSION" expr="VARVAL(9)"/>'
            + '<Reference_Variable id="9" expr="DX(20)"/>'
            + '<Constraint_General id="2" expr="DM(20,10)-2"/>'
        ),
    )
    coupler = model.couplers[1]
    assert (coupler.joint_ids, coupler.motion_types) == ((1, 2), ("R", "T"))
    assert coupler.scales == (1.0, -2.5)
    spring = model.table("SPRINGDAMPER")[4]
    assert (spring.type, spring.stiffness, spring.damping) == ("TRANSLATIONAL", 3.0, 2.0)
    assert (spring.length, spring.preload) == (0.5, -1.0)
    assert [force.type for force in model.scalar_forces.values()] == ["TRANSLATIONAL", "ROTATIONAL"]
    assert [force.action_only for force in model.scalar_forces.values()] == [False, True]
    assert model.variables[9].expr.root == Call("DX", (Number(20.0),), 1)
    assert model.general_constraints[2].expr.text == "DM(20,10)-2"


def test_requests(tmp_path: Path) -> None:
    model = read(
        tmp_path,
        added(
            REVOLUTE
            + f'<Post_Request id="1" type="FORCE" {ON} ref_marker_id="20"/>'
            + '<Post_Request id="2" type="ELEMENTAL_FORCE" elem_type="Joint" elem_id="1"/>'
            + '<Post_Request id="3" type="ELEMENTAL_FORCE" elem_type="FORCE_CONTACT"'
            + ' elem_id="301" jflag="TRUE" ref_marker_id="20"/>'
            + '<Post_Request id="4" type="EXPRESSION" expr1="TIME" expr8="VX(20)+JOINT(1,0,2,0)"/>'
            + '<Post_Request id="5" type="VELOCITY" i_marker_id="20"/>'
        ),
    )
    assert [request.type for request in model.requests.values()] == [
        "MARKER_FORCE",
        "ELEMENTAL_FORCE",
        "ELEMENTAL_FORCE",
        "EXPRESSION",
        "MARKER_VELOCITY",
    ]
    two, three, four = (model.requests[id] for id in (2, 3, 4))
    assert (two.elem_type, two.elem_id, two.jflag) == ("JOINT", 1, False)
    assert (three.elem_type, three.elem_id, three.jflag) == ("CONTACT", 301, True)
    assert [expr is not None for expr in four.exprs] == [True] + [False] * 6 + [True]


def test_assembly(tmp_path: Path) -> None:
    old = 'analysis_type="Transient" end_time="3" print_interval="0.01"'
    alone = read(tmp_path, deck((old, 'analysis_type="Assembly"')))
    (stage,) = settle(alone).stages
    assert (stage.simulation.start_time, stage.simulation.end_time) == (0.0, 0.0)
    with pytest.raises(ModelError, match="only assembles"):
        settle(alone, end_time=1.0)
    both = read(tmp_path, deck(("<Simulate", '<Simulate analysis_type="Assembly"/><Simulate')))
    assert [s.analysis_type for s in both.simulations] == ["ASSEMBLY", "TRANSIENT"]
    # a transient run begins with an assembly of its own
    assert [s.simulation.end_time for s in settle(both).stages] == [3.0]


JOINT = 'Constraint_Joint id="1" type='
MOTION = f'{REVOLUTE}<Motion_Joint id="1" joint_id="1"'
SLIDER = f'<Constraint_Joint id="2" type="TRANSLATIONAL" {ON}/>'
COUPLED = REVOLUTE + SLIDER + '<Constraint_Coupler id="1" joint_ids='
PIN_FRICTION = '<Force_JointFriction id="1" joint_id="1" cff_type="COULOMB_DYNAMICONLY"'
STOPS = '<Force_JointLimit id="1" joint_id="1" cnf_type="IMPACT" stiffness="100"'
BAD = {
    "no such joint": (f'<{JOINT}"HINGE" {ON}/>', ("Constraint_Joint[1]", '"HINGE"', "REVOLUTE")),
    "no pitch": (f'<{JOINT}"SCREW" {ON}/>', ("pitch: missing", "a number")),
    "no diameter": (f'<{JOINT}"RACK_PINION" {ON}/>', ("pitch_diameter: missing", "> 0")),
    "strange pitch": (f'<{JOINT}"FIXED" {ON} pitch="1"/>', ('pitch="1"', "SCREW; this is FIXED")),
    "strange length": (f'<{JOINT}"FIXED" {ON} length="1"/>', ('length="1"', "DISTANCE")),
    "no length": (f'<{JOINT}"DISTANCE" {ON} length="0"/>', ('length="0"', "> 0")),
    "virtual": (f'<{JOINT}"FIXED" {ON} is_virtual="TRUE"/>', ("is_virtual", "not built yet")),
    "no J": (f'<{JOINT}"FIXED" i_marker_id="20"/>', ("j_marker_id: missing",)),
    "unknown J": (
        f'<{JOINT}"FIXED" i_marker_id="20" j_marker_id="9"/>',
        ('j_marker_id="9"', "no Reference_Marker has this id; there are 10, 20"),
    ),
    "one body": (
        f'<{JOINT}"FIXED" i_marker_id="20" j_marker_id="20"/>',
        ("Constraint_Joint[1]", "both on body 2", "two bodies"),
    ),
    "spring on one body": (
        '<Force_SpringDamper id="1" type="ROTATIONAL" i_marker_id="20" j_marker_id="20"'
        ' stiffness="1"/>',
        ("Force_SpringDamper[1]", "both on body 2"),
    ),
    "two grounds": (
        '<Body_Rigid id="3" isground="TRUE"/><Reference_Marker id="30" body_id="3"/>'
        f'<{JOINT}"FIXED" i_marker_id="30" j_marker_id="10"/>',
        ("Constraint_Joint[1]", "both on ground"),
    ),
    "id twice": (REVOLUTE + REVOLUTE, ("Constraint_Joint[1]", "already used on line 14")),
    "primitive": (f'<Constraint_Jprim id="1" type="FIXED" {ON}/>', ('type="FIXED"', "INLINE")),
    "no joint": (
        '<Motion_Joint id="1" joint_id="5" val_type="D" expr="1"/>',
        ('joint_id="5"', "no Constraint_Joint has this id; there are none"),
    ),
    "no value type": (f'{MOTION} expr="1"/>', ("Motion_Joint[1]", "val_type: missing")),
    "no expr": (f'{MOTION} val_type="D"/>', ("Motion_Joint[1]", "expr: missing")),
    "slides": (
        f'{MOTION} motion_type="T" val_type="D" expr="1"/>',
        ('motion_type="T"', "joint 1 is REVOLUTE", "may be R"),
    ),
    "which": (
        f'<{JOINT}"CYLINDRICAL" {ON}/><Motion_Joint id="1" joint_id="1" val_type="D" expr="1"/>',
        ("motion_type", "joint 1 is CYLINDRICAL", "R or T"),
    ),
    "motion of a ball": (
        f'<{JOINT}"SPHERICAL" {ON}/>'
        '<Motion_Joint id="1" joint_id="1" motion_type="R" val_type="D" expr="1"/>',
        ("joint 1 is SPHERICAL, which takes no motion",),
    ),
    "twice": (
        f'{MOTION} val_type="D" expr="1"/>'
        '<Motion_Joint id="2" joint_id="1" val_type="V" expr="1"/>',
        ("Motion_Joint[2]", "motion 1 gives the same direction of the same joint 1"),
    ),
    "of the state": (
        f'{MOTION} val_type="V" expr="WZ(20)"/>',
        ("Motion_Joint[1]", "uses WZ", "the velocity must be", "TIME and displacements"),
    ),
    "user motion": (
        f'{MOTION} val_type="D" type="USERSUB"/>',
        ("usrsub_param_string: missing",),
    ),
    "user function": (
        f'{MOTION} val_type="D" expr="1" usrsub_param_string="USER()"/>',
        ('expr="1"', "is given by a user subroutine"),
    ),
    "no expression": (
        f'{MOTION} val_type="D" expr="2*(TIME"/>',
        ('expr="2*(TIME"', "is no expression", "column"),
    ),
    "one joint": (f'{COUPLED}"1" motion_types="R" scales="1"/>', ('joint_ids="1"', "2 or 3")),
    "joint twice": (f'{COUPLED}"1 1" motion_types="R R" scales="1 2"/>', ("names id 1 twice",)),
    "few types": (
        f'{COUPLED}"1 2" motion_types="R" scales="1 2"/>',
        ('motion_types="R"', "one value for each of the 2 joints"),
    ),
    "bad type": (f'{COUPLED}"1 2" motion_types="R Q" scales="1 2"/>', ("Q: must be R or T",)),
    "scale 0": (f'{COUPLED}"1 2" motion_types="R T" scales="1 0"/>', ('scales="1 0"', "0")),
    "joint that is not": (
        f'{COUPLED}"1 3" motion_types="R R" scales="1 2"/>',
        ('joint_ids="3"', "no Constraint_Joint has this id"),
    ),
    "does not slide": (
        f'{COUPLED}"1 2" motion_types="T T" scales="1 2"/>',
        ("Constraint_Coupler[1]", "joint 1 is REVOLUTE", "slide along", "R"),
    ),
    "stiffness": (
        f'<Force_SpringDamper id="1" type="ROTATIONAL" {ON} stiffness="-1"/>',
        ('stiffness="-1"', ">= 0"),
    ),
    "negative length": (
        f'<Force_SpringDamper id="1" type="TRANSLATIONAL" {ON} stiffness="1" length="-1"/>',
        ('length="-1"', ">= 0"),
    ),
    "force without expr": (
        f'<Force_Scalar_TwoBody id="1" type="Force" {ON}/>',
        ("Force_Scalar_TwoBody[1]", "expr: missing"),
    ),
    "unknown marker": (
        f'<Force_Scalar_TwoBody id="1" type="Force" {ON} expr="DM(20,99)"/>',
        ("Force_Scalar_TwoBody[1]", 'expr="99"', "no Reference_Marker has this id"),
    ),
    "unknown variable": (
        '<Reference_Variable id="1" expr="VARVAL(2)"/>',
        ("Reference_Variable[1]", "no Reference_Variable has this id"),
    ),
    "circle": (
        '<Reference_Variable id="1" expr="VARVAL(2)"/><Reference_Variable id="2" '
        'expr="1+VARVAL(3)"/><Reference_Variable id="3" expr="VARVAL(2)"/>',
        ("Reference_Variable[2]", "2 -> 3 -> 2"),
    ),
    "friction of a plane": (
        f'<{JOINT}"PLANAR" {ON}/>{PIN_FRICTION} mu_dynamic="0.1"/>',
        ("Force_JointFriction[1]", 'joint_id="1"', "PLANAR", "REVOLUTE, TRANSLATIONAL"),
    ),
    "friction of no joint": (
        f'{PIN_FRICTION} mu_dynamic="0.1"/>',
        ("Force_JointFriction[1]", 'joint_id="1"', "no Constraint_Joint has this id"),
    ),
    "friction without a pin": (
        f'{REVOLUTE}{PIN_FRICTION} mu_dynamic="0.1"/>',
        ("Force_JointFriction[1]", "pin_radius: missing", "number > 0"),
    ),
    "pin of a ball": (
        f'<{JOINT}"SPHERICAL" {ON}/>{PIN_FRICTION} ball_radius="1" pin_radius="2"/>',
        ('pin_radius="2"', "belongs to REVOLUTE or CYLINDRICAL"),
    ),
    "arm of a ball": (
        f'<{JOINT}"SPHERICAL" {ON}/>{PIN_FRICTION} ball_radius="1" bending_reaction_arm="2"/>',
        ('bending_reaction_arm="2"', "bears no torque"),
    ),
    "pulling preload": (
        f'{REVOLUTE}{PIN_FRICTION} pin_radius="1" preload="-2"/>',
        ('preload="-2"', "number >= 0"),
    ),
    "collar": (
        f'{REVOLUTE}{PIN_FRICTION} pin_radius="1" reaction_arm="2"/>',
        ('reaction_arm="2"', "is REVOLUTE; belongs to TRANSLATIONAL"),
    ),
    "overlap": (
        f'{REVOLUTE}{PIN_FRICTION} pin_radius="1" initial_overlap="2"/>',
        ('initial_overlap="2"', "documented but not built yet"),
    ),
    "friction twice": (
        f'{REVOLUTE}{PIN_FRICTION} pin_radius="1"/>{PIN_FRICTION} pin_radius="1"/>'.replace(
            'Friction id="1" j', 'Friction id="2" j', 1
        ),
        ("friction 2 is in joint 1 already",),
    ),
    "user friction": (
        f'{REVOLUTE}{PIN_FRICTION} pin_radius="1"/>'.replace("COULOMB_DYNAMICONLY", "USERCFF"),
        ('cff_type="USERCFF"', "COULOMB_ON"),
    ),
    "limit of what does not slide": (
        f'{REVOLUTE}{STOPS} motion_type="T" upper="1"/>',
        ('motion_type="T"', "joint 1 is REVOLUTE", "may be R"),
    ),
    "limit without bounds": (
        f'{REVOLUTE}{STOPS} motion_type="R"/>',
        ("Force_JointLimit[1]", "lower, upper: missing"),
    ),
    "empty range": (
        f'{REVOLUTE}{STOPS} motion_type="R" lower="2" upper="1"/>',
        ('upper="1"', "greater than lower (2)"),
    ),
    "limit by Hertz": (
        f'{REVOLUTE}{STOPS} motion_type="R" upper="1"/>'.replace("IMPACT", "HERTZ"),
        ('cnf_type="HERTZ"', "HUNT_CROSSLEY, IMPACT, POISSON"),
    ),
    "limit without speed": (
        f'{REVOLUTE}{STOPS} motion_type="R" upper="1" penalty="9"/>'.replace("IMPACT", "POISSON"),
        ("normal_trans_vel: missing", "rad/T"),
    ),
    "what force": (
        '<Post_Request id="1" type="ELEMENTAL_FORCE" elem_id="1"/>',
        ("Post_Request[1]", "elem_type: missing", "JOINT"),
    ),
    "force of nothing": (
        '<Post_Request id="1" type="ELEMENTAL_FORCE" elem_type="MOTION" elem_id="4"/>',
        ('elem_id="4"', "no Motion_Joint has this id"),
    ),
    "nothing asked": ('<Post_Request id="1" type="EXPRESSION"/>', ("expr1 ... expr8: missing",)),
    "other type": (
        '<Post_Request id="1" type="EXPRESSION" expr1="1" i_marker_id="20"/>',
        ('i_marker_id="20"', "another type of request than EXPRESSION"),
    ),
    "no such function": (
        '<Post_Request id="1" type="EXPRESSION" expr2="FOO(3)"/>',
        ('expr2="FOO(3)"', "no function FOO"),
    ),
}


@pytest.mark.parametrize("name", sorted(BAD))
def test_names_the_fault(tmp_path: Path, name: str) -> None:
    statements, parts = BAD[name]
    with pytest.raises(DeckError) as caught:
        read(tmp_path, added(statements))
    (line,) = [str(fault) for fault in caught.value.faults]
    assert line.startswith(f"{tmp_path / 'deck.xml'}:{ADDED_LINE}: ")
    assert all(part in line for part in parts), line


def test_friction_and_limits_of_joints(tmp_path: Path) -> None:
    text = (
        f'{REVOLUTE}<Force_JointFriction id="4" label="f" joint_id="1" cff_type="ON" '
        'mu_static="0.3" mu_dynamic="0.2" stiction_trans_vel="0.01" friction_trans_vel="0.02" '
        'pin_radius="0.05" preload="3" bending_reaction_arm="0.2"/>'
        '<Force_JointLimit id="5" label="l" joint_id="1" motion_type="Rotation" lower="-1.5" '
        'cnf_type="HUNT_CROSSLEY" stiffness="100" exponent="1" damping="0.5"/>'
    )
    model = read(tmp_path, added(text))
    friction, limit = model.joint_frictions[4], model.joint_limits[5]
    assert (friction.joint_id, friction.label, friction.cff_type) == (1, "f", "COULOMB_ON")
    assert (friction.mu_static, friction.mu_dynamic) == (0.3, 0.2)
    assert (friction.stiction_trans_vel, friction.friction_trans_vel) == (0.01, 0.02)
    assert (friction.pin_radius, friction.ball_radius) == (0.05, None)
    assert (friction.preload, friction.bending_reaction_arm) == (3.0, 0.2)
    assert (limit.joint_id, limit.label, limit.direction) == (1, "l", "R")
    assert (limit.lower, limit.upper) == (-1.5, None)
    assert (limit.cnf_type, limit.stiffness) == ("HUNT_CROSSLEY", 100.0)
    assert (limit.exponent, limit.damping) == (1.0, 0.5)
    for left in (0, 1):
        one = replace(model, **{("joint_frictions", "joint_limits")[left]: {}})
        name = ("Force_JointLimit", "Force_JointFriction")[left]
        with pytest.raises(ModelError, match=rf"{name}\[.\]: integrator VERLET"):
            settle(one, None, None, "VERLET", None)


def test_attributes_of_another_law_are_noted(tmp_path: Path) -> None:
    model = read(
        tmp_path,
        added(
            f'{REVOLUTE}{PIN_FRICTION} pin_radius="1" mu_dynamic="0.1" mu_static="0.2" '
            f'friction_trans_vel="1"/>{STOPS} motion_type="R" upper="1" penalty="3"/>'
        ),
    )
    notes = "\n".join(model.notes)
    assert "Force_JointFriction mu_static: has no effect with cff_type" in notes
    assert "Force_JointLimit penalty: has no effect with cnf_type IMPACT" in notes


def test_spring_that_does_nothing(tmp_path: Path) -> None:
    model = read(tmp_path, added(f'<Force_SpringDamper id="1" type="ROTATIONAL" {ON}/>'))
    (warning,) = model.warnings
    assert "Force_SpringDamper[1]" in warning
    assert "does nothing" in warning


def test_angles_of_expressions_may_be_degrees(tmp_path: Path) -> None:
    model = read(tmp_path, added(f'{MOTION} val_type="D" expr="180D"/>'))
    assert model.motions[1].expr is not None
    assert model.motions[1].expr.root == Number(math.pi)


def test_verlet_refuses_joints(tmp_path: Path) -> None:
    model = read(tmp_path, added(REVOLUTE))
    with pytest.raises(
        ModelError, match=r"Constraint_Joint\[1\]: integrator VERLET is for free bodies.*joints"
    ):
        simulate(model, end_time=0.1, integrator="VERLET")


PLANAR = '<Reference_2DCluster id="1" planar_type="{}">{}</Reference_2DCluster>{}'
NAMED = "<Subsystem_Planar> 1 </Subsystem_Planar>"


def test_bodies_of_a_cluster_are_held_in_its_plane(tmp_path: Path) -> None:
    model = read(tmp_path, added(REVOLUTE + PLANAR.format("YZ", 2, NAMED)))
    held = model.joints[2]
    assert held.type == "PLANAR"
    assert [model.markers[id].body_id for id in (held.i_marker_id, held.j_marker_id)] == [2, 1]
    assert list(read(tmp_path, added(PLANAR.format("YZ", 2, ""))).joints) == []


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PLANAR.format("UV", 2, NAMED), 'planar_type="UV": must be one of XY, YZ, ZX'),
        (PLANAR.format("XY", 9, NAMED), r"Reference_2DCluster\[1\]: there is no body 9"),
        (PLANAR.format("XY", 1, NAMED), "body 1 is ground, which does not move"),
        (NAMED, "Subsystem_Planar: there is no Reference_2DCluster 1"),
        (
            '<Reference_2DCluster id="1" planar_type="XY" num_body="2">2</Reference_2DCluster>',
            'num_body="2": must be the number of ids in the list, 1',
        ),
    ],
)
def test_clusters_that_do_not_fit(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(DeckError, match=said):
        read(tmp_path, added(text))
