"""Force_JointFriction: a friction law in a joint, pressed by the joint's own reaction.

Its formula is no function of displacements: reactions press it and follow from it. What it slides
by and how both are settled is in `dynamics.forces.joint_friction`.
"""

from __future__ import annotations

from mbsim.arrays.codes import BALL_FRICTION, SCREW_FRICTION, SLIDE_FRICTION, TURN_FRICTION
from mbsim.forces.catalog import OfReactions, force

_FORMS = {
    "TRANSLATIONAL": SLIDE_FRICTION,
    "REVOLUTE": TURN_FRICTION,
    "CYLINDRICAL": SCREW_FRICTION,
    "SPHERICAL": BALL_FRICTION,
}

force(
    "JOINTFRICTION",
    "Force_JointFriction",
    "joint_frictions",
    form=OfReactions(_FORMS, law="cff_type"),
    title="joint friction",
    table="joint_frictions",
    changes="mu_static mu_dynamic stiction_trans_vel friction_trans_vel pin_radius ball_radius "
    "preload bending_reaction_arm",
)
