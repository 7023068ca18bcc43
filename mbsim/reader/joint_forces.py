"""Force_JointFriction, and Force_JointLimit (ours): what acts in a joint."""

from __future__ import annotations

from mbsim.model import elements as el
from mbsim.reader.contact import CFF_ALL, CFF_USES, FORCE_CONTACT, check_coulomb
from mbsim.reader.keywords import CFF_OF_JOINTS, CNF_OF_LIMITS, DIRECTIONS
from mbsim.reader.kinds import ID, NOT_NEGATIVE, POSITIVE, REAL, keyword
from mbsim.reader.normal_force import DEFAULT_SPEED, check_normal, note_unused
from mbsim.reader.statement import NAMED, Entry, Spec, Statement

#: Attributes of laws that stand here as they do in Force_Contact.
_COULOMB = ("mu_static", "mu_dynamic", "stiction_trans_vel", "friction_trans_vel")
_NORMAL = (
    *("stiffness", "exponent", "damping", "dmax", "penalty", "restitution_coef"),
    *("ref_velocity", "normal_trans_vel"),
)
#: Attributes of MotionSolve's own friction, with its stiction and its other ways to be pressed.
_NOT_BUILT = (
    *("friction_arm", "reaction_arm", "initial_overlap", "overlap_delta", "torque_preload"),
    *("force_preload", "max_stiction_deform", "bristle_stiffness", "damping_effects"),
    *("viscous_effects", "inactive", "effect", "inputs"),
)


def _of_contact(names: tuple[str, ...]) -> dict[str, Spec]:
    return {name: FORCE_CONTACT.attributes[name] for name in names}


def _build_friction(entry: Entry) -> None:
    """Add friction in a joint."""
    cff_type = entry.get("cff_type")
    if cff_type is None:
        return
    note_unused(entry, f"cff_type {cff_type}", CFF_ALL - CFF_USES[cff_type])
    if cff_type != "COULOMB_OFF":
        check_coulomb(entry, cff_type)
    friction = el.JointFriction(
        id=entry.get("id", 0),
        joint_id=entry.get("joint_id", 0),
        label=entry.get("label", ""),
        cff_type=cff_type,
        mu_static=entry.get("mu_static", 0.0),
        mu_dynamic=entry.get("mu_dynamic", 0.0),
        stiction_trans_vel=entry.get("stiction_trans_vel", DEFAULT_SPEED),
        friction_trans_vel=entry.get("friction_trans_vel", DEFAULT_SPEED),
        pin_radius=entry.get("pin_radius"),
        ball_radius=entry.get("ball_radius"),
        preload=entry.get("preload", 0.0),
        bending_reaction_arm=entry.get("bending_reaction_arm", 0.0),
        source=entry.source,
    )
    entry.register(entry.draft.joint_frictions, friction)


def _build_limit(entry: Entry) -> None:
    """Add a limit of a joint's displacement."""
    cnf_type, direction = entry.get("cnf_type"), entry.get("motion_type")
    if cnf_type is None or direction is None:
        return
    check_normal(entry, cnf_type)
    if cnf_type == "POISSON" and direction == "R" and not entry.given("normal_trans_vel"):
        entry.fault(
            "normal_trans_vel: missing; POISSON needs it with motion_type R, a number > 0 [rad/T]"
        )
    lower, upper = entry.get("lower"), entry.get("upper")
    if not entry.given("lower") and not entry.given("upper"):
        entry.fault("lower, upper: missing; at least one must be given, a number")
    if lower is not None and upper is not None and not lower < upper:
        entry.fault(f"must be greater than lower ({lower:g})", "upper")
    limit = el.JointLimit(
        id=entry.get("id", 0),
        joint_id=entry.get("joint_id", 0),
        direction=direction,
        label=entry.get("label", ""),
        lower=lower,
        upper=upper,
        cnf_type=cnf_type,
        stiffness=entry.get("stiffness", 0.0),
        exponent=entry.get("exponent", 1.5),
        damping=entry.get("damping", 0.0),
        dmax=entry.get("dmax"),
        penalty=entry.get("penalty", 0.1),
        restitution_coef=entry.get("restitution_coef"),
        ref_velocity=entry.get("ref_velocity"),
        normal_trans_vel=entry.get("normal_trans_vel", DEFAULT_SPEED),
        source=entry.source,
    )
    entry.register(entry.draft.joint_limits, limit)


_ON_JOINT = {
    **NAMED,
    "joint_id": Spec(ID, "joint in which it acts", required=True),
}

FORCE_JOINTFRICTION = Statement(
    "Force_JointFriction",
    {
        **_ON_JOINT,
        "cff_type": Spec(keyword(CFF_OF_JOINTS), "law of friction", required=True),
        **_of_contact(_COULOMB),
        "pin_radius": Spec(POSITIVE, "radius of the pin; REVOLUTE and CYLINDRICAL need it", "L"),
        "ball_radius": Spec(POSITIVE, "radius of the ball; SPHERICAL needs it", "L"),
        "preload": Spec(NOT_NEGATIVE, "presses beside the reaction", "F", "0"),
        "bending_reaction_arm": Spec(NOT_NEGATIVE, "arm of the torque that presses", "L", "0"),
        **{name: Spec(refused="is documented but not built yet") for name in _NOT_BUILT},
    },
    _build_friction,
    about="Coulomb friction in a joint, pressed by its reaction",
)
FORCE_JOINTLIMIT = Statement(
    "Force_JointLimit",
    {
        **_ON_JOINT,
        "motion_type": Spec(keyword(DIRECTIONS), "R turns, T slides", required=True),
        "lower": Spec(REAL, "least displacement; this, upper or both", "L or rad", "none"),
        "upper": Spec(REAL, "largest displacement", "L or rad", "none"),
        "cnf_type": Spec(keyword(CNF_OF_LIMITS), "law of the stop", required=True),
        **_of_contact(_NORMAL),
    },
    _build_limit,
    about="stops of a joint's displacement",
)
