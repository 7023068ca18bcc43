"""Force_JointFriction: a friction law in a joint, pressed by the joint's own reaction.

Its formula is no function of displacements: reactions press it and follow from it. What it slides
by and how both are settled is in `dynamics.forces.joint_friction`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mbsim.arrays.codes import BALL_FRICTION, SCREW_FRICTION, SLIDE_FRICTION, TURN_FRICTION
from mbsim.forces.catalog import Given, OfReactions, Parameter, Reading, force

_FORMS = {
    "TRANSLATIONAL": SLIDE_FRICTION,
    "REVOLUTE": TURN_FRICTION,
    "CYLINDRICAL": SCREW_FRICTION,
    "SPHERICAL": BALL_FRICTION,
}

#: Attributes of MotionSolve's own friction, with its stiction and its other ways to be pressed.
_NOT_BUILT = (
    *("initial_overlap", "overlap_delta", "torque_preload"),
    *("force_preload", "max_stiction_deform", "bristle_stiffness", "damping_effects"),
    *("viscous_effects", "inactive", "effect", "inputs"),
)


def _radius(name: str, about: str) -> Parameter:
    return Parameter(name, positive=True, optional=True, about=about, unit="L")


_COULOMB = ("mu_static", "mu_dynamic", "stiction_trans_vel", "friction_trans_vel")
_ATTRIBUTES = (
    Parameter("joint_id", None, kind="id", about="joint in which it acts"),
    Parameter("cff_type", None, kind="friction of joints", about="law of friction"),
    *(Parameter(name, kind="of contacts") for name in _COULOMB),
    _radius("pin_radius", "radius of the pin; REVOLUTE and CYLINDRICAL need it"),
    _radius("ball_radius", "radius of the ball; SPHERICAL needs it"),
    Parameter("preload", about="presses beside the reaction", unit="F"),
    Parameter("bending_reaction_arm", about="arm of the torque that presses", unit="L"),
    Parameter("friction_arm", about="arm at which the axial force rubs, REVOLUTE", unit="L"),
    Parameter("reaction_arm", about="arm of the torque about z, TRANSLATIONAL", unit="L"),
)


def _read(given: Given, values: dict[str, Any]) -> Mapping[str, Any] | None:
    if "cff_type" not in values:
        return None
    given.check_law("cff_type")
    return values


force(
    "JOINTFRICTION",
    "Force_JointFriction",
    "joint_frictions",
    form=OfReactions(_FORMS, law="cff_type"),
    title="joint friction",
    table="joint_frictions",
    reading=Reading(_ATTRIBUTES, _read),
    changes="mu_static mu_dynamic stiction_trans_vel friction_trans_vel pin_radius ball_radius "
    "preload bending_reaction_arm friction_arm reaction_arm",
    refused=dict.fromkeys(_NOT_BUILT, "is documented but not built yet"),
    about="Coulomb friction in a joint, pressed by its reaction",
)
